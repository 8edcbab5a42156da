//! Measured BRDFs on the half/difference grid of the MERL files: cells in any order of validity →
//! the words that `measured_value`, `measured_pdf` and `measured_sample` of `brdf.glsl` read.
//!
//! Layout of the words: directional albedo, cosine shares, cumulative probabilities and densities
//! of the sampling table, grid cells of two words; the offsets are `MEASURED_…_OFFSET` of
//! [`constants`](crate::gpu::constants).

use std::{
    f32::consts::{FRAC_PI_2, PI},
    fmt, fs,
    io::Read,
    path::Path,
};

use glam::{Vec3, vec3};
use half::f16;
use rayon::prelude::*;

use crate::{
    brdf::{cornell, merl, twin},
    error::{Error, Result},
    gpu::constants::*,
};

/// Bins of θ_h as an index.
const THETA_HALF: usize = MEASURED_THETA_HALF_BINS as usize;
/// Bins of θ_d as an index.
const THETA_DIFFERENCE: usize = MEASURED_THETA_DIFFERENCE_BINS as usize;
/// Bins of φ_d as an index.
const PHI_DIFFERENCE: usize = MEASURED_PHI_DIFFERENCE_BINS as usize;
/// Cells of the grid.
pub const CELL_COUNT: usize = THETA_HALF * THETA_DIFFERENCE * PHI_DIFFERENCE;

/// Weights of linear Rec.709 in luminance.
pub const LUMINANCE: Vec3 = vec3(0.2126, 0.7152, 0.0722);

/// Isotropic measured BRDF on a grid of θ_h × θ_d × φ_d with its sampling table.
#[derive(Clone, PartialEq)]
pub struct MeasuredTable {
    words: Vec<u32>,
    /// Cells without a measured value, which took that of a neighbour. About a quarter of the grid
    /// has a direction below the surface and is counted here.
    pub invalid_cell_count: usize,
    /// What was repaired while reading, for the log.
    pub warnings: Vec<String>,
}

impl fmt::Debug for MeasuredTable {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("MeasuredTable")
            .field("words", &self.words.len())
            .field("invalid_cell_count", &self.invalid_cell_count)
            .field("warnings", &self.warnings)
            .finish()
    }
}

/// Directions (outgoing, incident) of the centre of a bin, in the local frame, with the half vector
/// in the plane y = 0. The centre in θ_h is that of the square-root spacing, where the interpolation
/// takes the cell's value unmixed.
pub fn bin_directions(theta_half: usize, theta_difference: usize, phi: usize) -> (Vec3, Vec3) {
    let root = (theta_half as f32 + 0.5) / THETA_HALF as f32;
    let theta_half = root * root * FRAC_PI_2;
    let theta_difference = (theta_difference as f32 + 0.5) / THETA_DIFFERENCE as f32 * FRAC_PI_2;
    let phi = (phi as f32 + 0.5) / PHI_DIFFERENCE as f32 * PI;
    let (sine_half, cosine_half) = theta_half.sin_cos();
    let (sine, cosine) = theta_difference.sin_cos();
    let incident = vec3(sine * phi.cos(), sine * phi.sin(), cosine);
    let outgoing = vec3(-incident.x, -incident.y, cosine);
    let local_from_half = |d: Vec3| {
        vec3(cosine_half * d.x + sine_half * d.z, d.y, cosine_half * d.z - sine_half * d.x)
    };
    (local_from_half(outgoing), local_from_half(incident))
}

/// Index of a cell: φ_d fastest, θ_h slowest, as in the files.
pub fn cell_index(theta_half: usize, theta_difference: usize, phi: usize) -> usize {
    phi + PHI_DIFFERENCE * (theta_difference + THETA_DIFFERENCE * theta_half)
}

/// Whether a cell holds a measurement: finite and not negative.
fn is_valid(cell: Vec3) -> bool {
    cell.is_finite() && cell.min_element() >= 0.0
}

impl MeasuredTable {
    /// Reads a measured BRDF: MERL `.binary` where the name or the first 12 bytes say so, else the
    /// text format of Cornell and pbrt-v2.
    pub fn load(path: &Path) -> Result<Self> {
        let mut head = [0; merl::HEADER_BYTES];
        let read = fs::File::open(path)
            .and_then(|file| file.take(head.len() as u64).read(&mut head))
            .map_err(|source| Error::io(path, "read", source))?;
        let is_merl = path.extension().is_some_and(|extension| extension == "binary")
            || (read == head.len() && merl::dimensions(head) == merl::EXPECTED_DIMENSIONS);
        if is_merl { merl::load(path) } else { cornell::load(path) }
    }

    /// The table of a function of (outgoing, incident) directions in 1/sr, taken at the centres of
    /// the bins that have both directions above the surface.
    pub fn tabulate(value: impl Fn(Vec3, Vec3) -> Vec3 + Sync) -> Result<Self, String> {
        let mut cells = vec![Vec3::NAN; CELL_COUNT];
        cells.par_chunks_mut(PHI_DIFFERENCE).enumerate().for_each(|(row, cells)| {
            for (phi, cell) in cells.iter_mut().enumerate() {
                let (outgoing, incident) =
                    bin_directions(row / THETA_DIFFERENCE, row % THETA_DIFFERENCE, phi);
                if outgoing.z > 0.0 && incident.z > 0.0 {
                    *cell = value(outgoing, incident);
                }
            }
        });
        Self::from_cells(cells)
    }

    /// The table of `CELL_COUNT` cells in 1/sr in the order of [`cell_index`]; a cell with a
    /// negative or non-finite component is invalid and takes the value of the nearest valid one, so
    /// that interpolation needs no case of its own. Fails where no cell is valid.
    ///
    /// The bins at θ_h = 0 and θ_d = 0, of which 0.01° and 1° are the widths, are replaced by their
    /// mean over φ_d: the angle means nothing at a pole, and a value that turns with it there would
    /// make the BRDF discontinuous.
    pub fn from_cells(mut cells: Vec<Vec3>) -> Result<Self, String> {
        assert_eq!(cells.len(), CELL_COUNT, "a measured table has 90·90·180 cells");
        let invalid_cell_count = cells.par_iter().filter(|cell| !is_valid(**cell)).count();
        if invalid_cell_count == CELL_COUNT {
            return Err(format!("none of the {CELL_COUNT} cells is valid"));
        }
        average_poles(&mut cells);
        fill_invalid(&mut cells);

        let largest = f16::MAX.to_f32();
        let clamped = cells.par_iter().filter(|cell| cell.max_element() > largest).count();
        let mut warnings = Vec::new();
        if clamped > 0 {
            warnings.push(format!("{clamped} cells above {largest}/sr were clamped to that"));
        }
        let mut words = vec![0; MEASURED_GRID_OFFSET as usize + 2 * CELL_COUNT];
        let grid = &mut words[MEASURED_GRID_OFFSET as usize..];
        grid.par_chunks_exact_mut(2).zip(&cells).for_each(|(words, cell)| {
            let half = |value: f32| u32::from(f16::from_f32(value.min(largest)).to_bits());
            words[0] = half(cell.x) | half(cell.y) << 16;
            words[1] = half(cell.z);
        });
        drop(cells);

        let rows: Vec<SamplingRow> = (0..MEASURED_ELEVATION_BINS)
            .into_par_iter()
            .map(|elevation| SamplingRow::new(&words, elevation))
            .collect();
        for (elevation, row) in rows.iter().enumerate() {
            words[MEASURED_COSINE_SHARE_OFFSET as usize + elevation] = row.cosine_share.to_bits();
            let first = elevation * MEASURED_SAMPLING_CELLS as usize;
            for (offset, values) in [
                (MEASURED_CUMULATIVE_OFFSET, &row.cumulative),
                (MEASURED_DENSITY_OFFSET, &row.density),
            ] {
                let target = &mut words[offset as usize + first..][..values.len()];
                for (word, value) in target.iter_mut().zip(values) {
                    *word = value.to_bits();
                }
            }
        }
        let albedo: Vec<Vec3> = (0..BRDF_COSINE_NODES)
            .into_par_iter()
            .map(|node| directional_albedo(&words, node as f32 / BRDF_COSINE_INTERVALS as f32))
            .collect();
        for (word, value) in words.iter_mut().zip(albedo.iter().flat_map(Vec3::to_array)) {
            *word = value.to_bits();
        }
        Ok(Self { words, invalid_cell_count, warnings })
    }

    /// The words the shader reads, `MEASURED_GRID_OFFSET` + 2 per cell.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Value in 1/sr, without the cosine; 0 unless both directions are above the surface.
    pub fn evaluate(&self, outgoing_local: Vec3, incident_local: Vec3) -> Vec3 {
        if outgoing_local.z <= 0.0 || incident_local.z <= 0.0 {
            return Vec3::ZERO;
        }
        let angles = twin::half_difference_angles(outgoing_local, incident_local);
        twin::measured_value(&self.words, 0, angles)
    }
}

/// Makes the bins at the poles θ_h = 0 and θ_d = 0 constant over φ_d, the mean of the valid ones.
fn average_poles(cells: &mut [Vec3]) {
    let rows = (0..THETA_DIFFERENCE)
        .map(|theta_difference| cell_index(0, theta_difference, 0))
        .chain((1..THETA_HALF).map(|theta_half| cell_index(theta_half, 0, 0)));
    for first in rows {
        let row = &mut cells[first..first + PHI_DIFFERENCE];
        let valid: Vec<Vec3> = row.iter().copied().filter(|cell| is_valid(*cell)).collect();
        if !valid.is_empty() {
            row.fill(valid.iter().sum::<Vec3>() / valid.len() as f32);
        }
    }
}

/// Gives every invalid cell the value of a valid one: the nearest in θ_d, toward smaller angles
/// first since the horizon lies at larger ones; where a column has none, the nearest in φ_d; where
/// a slice has none, the nearest in θ_h.
fn fill_invalid(cells: &mut [Vec3]) {
    let slice = THETA_DIFFERENCE * PHI_DIFFERENCE;
    cells.par_chunks_mut(slice).for_each(|cells| {
        for phi in 0..PHI_DIFFERENCE {
            fill_line(cells, phi, PHI_DIFFERENCE, THETA_DIFFERENCE);
        }
        for theta_difference in 0..THETA_DIFFERENCE {
            fill_line(cells, theta_difference * PHI_DIFFERENCE, 1, PHI_DIFFERENCE);
        }
    });
    for first in 0..slice {
        fill_line(cells, first, slice, THETA_HALF);
    }
}

/// Fills the invalid cells of one line of the grid from the valid one before, else the one after.
fn fill_line(cells: &mut [Vec3], first: usize, stride: usize, count: usize) {
    let index = |position: usize| first + position * stride;
    let Some(start) = (0..count).find(|&position| is_valid(cells[index(position)])) else {
        return;
    };
    let mut latest = cells[index(start)];
    for position in 0..count {
        if position > start && is_valid(cells[index(position)]) {
            latest = cells[index(position)];
        } else {
            cells[index(position)] = latest;
        }
    }
}

/// Sampling table of one bin of outgoing elevation.
struct SamplingRow {
    /// Probability of the cosine lobe.
    cosine_share: f32,
    /// Cumulative probabilities of the cells, the last one exactly 1.
    cumulative: Vec<f32>,
    /// Density of each cell, per steradian of half vectors.
    density: Vec<f32>,
}

/// One point of the quadrature over half vectors.
struct QuadraturePoint {
    /// Luminance of BRDF × cosine, 1/sr.
    value: f64,
    /// cosθ_i / π.
    cosine_pdf: f64,
    /// dω_i/dω_h = 4 ω_o·h.
    jacobian: f64,
}

impl SamplingRow {
    /// Shares of the cosine lobe among which the one of least variance is taken. None is 0, since
    /// the tabulated density may vanish where the BRDF does not.
    const COSINE_SHARES: [f64; 7] = [0.05, 0.1, 0.15, 0.25, 0.4, 0.6, 0.8];
    /// Points per cell and dimension: outgoing elevation, θ_h, φ_h.
    const POINTS: u32 = 3;

    fn new(words: &[u32], elevation: u32) -> Self {
        let cells: Vec<Vec<QuadraturePoint>> = (0..MEASURED_SAMPLING_CELLS)
            .map(|cell| Self::quadrature(words, elevation, cell))
            .collect();
        let solid_angle = |cell: u32| {
            let (lower, upper) = Self::edges(cell);
            // Both signs of φ_h.
            2.0 * (upper - lower) * std::f64::consts::PI / f64::from(MEASURED_AZIMUTH_BINS)
        };
        let mut masses: Vec<f64> = cells
            .iter()
            .zip(0..)
            .map(|(points, cell)| {
                let sum: f64 = points.iter().map(|point| point.value * point.jacobian).sum();
                sum / points.len() as f64 * solid_angle(cell)
            })
            .collect();
        let mut total: f64 = masses.iter().sum();
        if total <= 0.0 {
            // A black material: any density serves.
            masses = (0..MEASURED_SAMPLING_CELLS).map(solid_angle).collect();
            total = masses.iter().sum();
        }
        let mut sum = 0.0;
        let mut cumulative: Vec<f32> = masses
            .iter()
            .map(|mass| {
                sum += mass;
                (sum / total) as f32
            })
            .collect();
        // Rounding must leave no probability behind the last cell that has any.
        if let Some(last) = masses.iter().rposition(|mass| *mass > 0.0) {
            cumulative[last..].fill(1.0);
        }
        // The density is that of the rounded probabilities: exactly what is sampled.
        let mut before = 0.0;
        let density: Vec<f32> = cumulative
            .iter()
            .zip(0..)
            .map(|(&upper, cell)| {
                let mass = f64::from(upper) - before;
                before = f64::from(upper);
                (mass / solid_angle(cell)) as f32
            })
            .collect();

        let second_moment = |share: f64| -> f64 {
            let cell_moment = |points: &[QuadraturePoint], density: f32| -> f64 {
                let moments = points.iter().filter(|point| point.value > 0.0).map(|point| {
                    let pdf = share * point.cosine_pdf
                        + (1.0 - share) * f64::from(density) / point.jacobian;
                    point.value * point.value / pdf * point.jacobian
                });
                moments.sum::<f64>() / points.len() as f64
            };
            cells
                .iter()
                .zip(&density)
                .zip(0..)
                .map(|((points, &density), cell)| cell_moment(points, density) * solid_angle(cell))
                .sum()
        };
        let cosine_share = Self::COSINE_SHARES
            .into_iter()
            .map(|share| (second_moment(share), share))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(0.5, |(_, share)| share) as f32;
        Self { cosine_share, cumulative, density }
    }

    /// Lower and upper 1 − cosθ_h of a cell.
    fn edges(cell: u32) -> (f64, f64) {
        let edge = |polar: u32| {
            let root = f64::from(polar) / f64::from(MEASURED_POLAR_BINS);
            let sine = (0.25 * std::f64::consts::PI * root * root).sin();
            2.0 * sine * sine
        };
        let polar = cell / MEASURED_AZIMUTH_BINS;
        (edge(polar), edge(polar + 1))
    }

    fn quadrature(words: &[u32], elevation: u32, cell: u32) -> Vec<QuadraturePoint> {
        let (lower, upper) = Self::edges(cell);
        let middle = |index: u32| (f64::from(index) + 0.5) / f64::from(Self::POINTS);
        let mut points = Vec::with_capacity(Self::POINTS.pow(3) as usize);
        for index in 0..Self::POINTS.pow(3) {
            let theta = (f64::from(elevation) + middle(index % Self::POINTS))
                / f64::from(MEASURED_ELEVATION_BINS)
                * std::f64::consts::FRAC_PI_2;
            let below_pole = lower + (upper - lower) * middle(index / Self::POINTS % Self::POINTS);
            let azimuth = f64::from(cell % MEASURED_AZIMUTH_BINS)
                + middle(index / Self::POINTS / Self::POINTS);
            let phi = azimuth * std::f64::consts::PI / f64::from(MEASURED_AZIMUTH_BINS);
            let outgoing = vec3(theta.sin() as f32, 0.0, theta.cos() as f32);
            let sine = (below_pole * (2.0 - below_pole)).sqrt();
            let half_vector = vec3(
                (sine * phi.cos()) as f32,
                (sine * phi.sin()) as f32,
                (1.0 - below_pole) as f32,
            );
            let cosine_difference = outgoing.dot(half_vector);
            let incident = 2.0 * cosine_difference * half_vector - outgoing;
            let mut value = 0.0;
            if cosine_difference > 0.0 && incident.z > 0.0 {
                let angles = twin::half_difference_angles(outgoing, incident);
                value = twin::measured_value(words, 0, angles).dot(LUMINANCE) * incident.z;
            }
            points.push(QuadraturePoint {
                value: f64::from(value),
                cosine_pdf: f64::from(incident.z / PI),
                jacobian: f64::from(4.0 * cosine_difference),
            });
        }
        points
    }
}

/// ∫ BRDF·cosθ_i dω_i by 1024 samples of the material's own density at the points of an additive
/// lattice of irrational steps; within about 1%, for images only.
fn directional_albedo(words: &[u32], cosine: f32) -> Vec3 {
    const SAMPLES: u32 = 1024;
    let cosine = cosine.max(0.5 / BRDF_COSINE_INTERVALS as f32 / 8.0);
    let outgoing = vec3((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    // Steps of the three-dimensional golden ratio: powers of the root of x⁴ = x + 1, inverted.
    let step = [0.819_172_513_396_164_4_f64, 0.671_043_606_703_789_2, 0.549_700_477_901_970_5];
    let mut sum = Vec3::ZERO;
    for index in 0..SAMPLES {
        let coordinate =
            |dimension: usize| (0.5 + f64::from(index) * step[dimension]).fract().min(0.999_999);
        let u = vec3(coordinate(0) as f32, coordinate(1) as f32, coordinate(2) as f32);
        let incident = twin::measured_sample(words, 0, outgoing, u);
        if incident.z > 0.0 {
            let angles = twin::half_difference_angles(outgoing, incident);
            let pdf = twin::measured_pdf(words, 0, outgoing, incident, angles.x);
            if pdf > 0.0 {
                sum += twin::measured_value(words, 0, angles) * (incident.z / pdf);
            }
        }
    }
    (sum / SAMPLES as f32).clamp(Vec3::ZERO, Vec3::ONE)
}
