//! Measured BRDFs on the half/difference grid of MERL: cells, some without a value → the words that
//! `measured_value`, `measured_pdf` and `measured_sample` of `brdf.glsl` read.
//!
//! Layout of the words: directional albedo, cosine shares, cumulative probabilities and densities
//! of the sampling table, grid cells of two words, as many words of each factor by turn; offsets are
//! `MEASURED_…_OFFSET` of [`layout`](super::layout).

use std::{
    f32::consts::{FRAC_PI_2, PI},
    fmt,
};

use glam::{Quat, Vec3, vec3};
use half::f16;
use rayon::prelude::*;

use crate::measured::{
    layout::*,
    lookup,
    tabulate::{EnergyLimit, SamplingRow, directional_albedo},
};

/// Bins of θ_h, θ_d and φ_d as indices.
const THETA_HALF: usize = MEASURED_THETA_HALF_BINS as usize;
pub(super) const THETA_DIFFERENCE: usize = MEASURED_THETA_DIFFERENCE_BINS as usize;
pub(super) const PHI_DIFFERENCE: usize = MEASURED_PHI_DIFFERENCE_BINS as usize;
/// Turns about the normal over which an anisotropic BRDF is averaged. An odd count visits twice as many where
/// half a turn changes nothing.
const MEAN_TURNS: u32 = 17;
/// Bins of φ_h, θ_d and φ_d of its factors.
const TURN_COUNTS: [usize; 3] = [
    MEASURED_TURN_BINS as usize,
    MEASURED_TURN_THETA_DIFFERENCE_BINS as usize,
    MEASURED_TURN_PHI_DIFFERENCE_BINS as usize,
];
/// Cells of the grid.
pub const CELL_COUNT: usize = THETA_HALF * THETA_DIFFERENCE * PHI_DIFFERENCE;

/// Parts of an RGL file that the table has no place for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RglTraits {
    /// The file has spectra; the table holds their linear sRGB under D65.
    pub is_spectral: bool,
}

/// Measured BRDF on a grid of θ_h × θ_d × φ_d, with its sampling table: of an anisotropic one the mean over
/// all turns about the normal, and its factors by turn.
#[derive(Clone, PartialEq)]
pub struct MeasuredTable {
    words: Vec<u32>,
    /// Cells without a measurement, filled from a neighbour. They include about a quarter of the
    /// grid, where a direction is below the surface.
    pub invalid_cell_count: usize,
    /// Repairs made while reading, for the log.
    pub warnings: Vec<String>,
    /// Describes the file if it is one of RGL.
    pub rgl: Option<RglTraits>,
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

/// Directions (outgoing, incident) of a bin's centre in the local frame, with the half vector in
/// the plane y = 0. The centre in θ_h follows the square-root spacing, so that interpolation there
/// returns the cell's value unmixed.
pub fn bin_directions(theta_half: usize, theta_difference: usize, phi: usize) -> (Vec3, Vec3) {
    centre_directions(theta_half, [theta_difference, phi], [THETA_DIFFERENCE, PHI_DIFFERENCE])
}

/// As [`bin_directions`], for other counts of bins of θ_d and φ_d.
fn centre_directions(theta_half: usize, bins: [usize; 2], counts: [usize; 2]) -> (Vec3, Vec3) {
    let root = (theta_half as f32 + 0.5) / THETA_HALF as f32;
    let theta_half = root * root * FRAC_PI_2;
    let centre = |axis: usize| (bins[axis] as f32 + 0.5) / counts[axis] as f32;
    let (theta_difference, phi) = (centre(0) * FRAC_PI_2, centre(1) * PI);
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

/// True if a cell holds a measurement: finite and not negative.
fn is_valid(cell: Vec3) -> bool {
    cell.is_finite() && cell.min_element() >= 0.0
}

impl MeasuredTable {
    /// Tabulates a function of (outgoing, incident) directions in 1/sr from its values at the centres of the
    /// bins with both directions above the surface.
    ///
    /// Lines between nodes of second difference d have d/12 too much on the mean, by which a narrow lobe
    /// would reflect 1% too much: along θ_h each node takes it off.
    pub fn tabulate(value: impl Fn(Vec3, Vec3) -> Vec3 + Sync) -> Result<Self, String> {
        let mut values = vec![Vec3::NAN; CELL_COUNT];
        for_each_cell(&mut values, |cell, outgoing, incident| {
            if outgoing.z > 0.0 && incident.z > 0.0 {
                *cell = value(outgoing, incident);
            }
        });
        let cell = |index: usize| values.get(index).copied().unwrap_or(Vec3::NAN);
        let next = cell_index(1, 0, 0);
        let corrected = (0..CELL_COUNT).into_par_iter().map(|index| {
            let own = values[index];
            let second = cell(index.wrapping_sub(next)) + cell(index + next) - 2.0 * own;
            if second.is_finite() { (own - second / 12.0).max(Vec3::ZERO) } else { own }
        });
        Self::from_cells(corrected.collect())
    }

    /// As [`Self::tabulate`], for a function that depends on the turn about the normal, with the tangent
    /// along x. The factors of a bin have the mean 1 over all turns.
    pub fn tabulate_turns(value: impl Fn(Vec3, Vec3) -> Vec3 + Sync) -> Result<Self, String> {
        let turned = |angle: f32, outgoing: Vec3, incident: Vec3| {
            let turn = Quat::from_rotation_z(angle);
            value(turn * outgoing, turn * incident)
        };
        let mut table = Self::tabulate(|outgoing, incident| {
            let angles = (0..MEAN_TURNS).map(|turn| 2.0 * PI * turn as f32 / MEAN_TURNS as f32);
            let sum: Vec3 = angles.map(|angle| turned(angle, outgoing, incident)).sum();
            sum / MEAN_TURNS as f32
        })?;
        let [turns, differences, phis] = TURN_COUNTS;
        let slice = turns * phis;
        let mut factors = vec![Vec3::NAN; THETA_HALF * differences * slice];
        factors.par_chunks_mut(slice).enumerate().for_each(|(row, factors)| {
            for phi in 0..phis {
                let bins = [row % differences, phi];
                let (outgoing, incident) =
                    centre_directions(row / differences, bins, [differences, phis]);
                if outgoing.z <= 0.0 || incident.z <= 0.0 {
                    continue;
                }
                let values: Vec<Vec3> = (0..turns)
                    .map(|turn| 2.0 * PI * (turn as f32 + 0.5) / turns as f32 - PI)
                    .map(|angle| turned(angle, outgoing, incident))
                    .collect();
                let mean = values.iter().sum::<Vec3>() / turns as f32;
                for (turn, value) in values.iter().enumerate() {
                    factors[turn * phis + phi] = value / mean;
                }
            }
        });
        // Where a direction is below the surface, as at the last θ_d or else θ_h before.
        factors.par_chunks_mut(differences * slice).for_each(|factors| {
            (0..slice).for_each(|first| fill_line(factors, first, slice, differences));
        });
        for first in 0..differences * slice {
            fill_line(&mut factors, first, differences * slice, THETA_HALF);
        }
        table.words.resize(MEASURED_TURN_OFFSET as usize + 2 * factors.len(), 0);
        pack(&factors, &mut table.words[MEASURED_TURN_OFFSET as usize..]);
        Ok(table)
    }

    /// True if the table is anisotropic: materials of it are turned as the tangents of meshes.
    pub fn has_turns(&self) -> bool {
        self.words.len() > MEASURED_TURN_OFFSET as usize
    }

    /// Builds the table from `CELL_COUNT` cells in 1/sr in the order of [`cell_index`]. A cell with
    /// a negative or non-finite component is invalid and takes the value of the nearest valid one,
    /// so that interpolation needs no special case. Fails if no cell is valid.
    ///
    /// Extrapolated measurements may have a directional albedo above 1 at grazing angles. Such a
    /// table is scaled by a product of factors of the two polar angles until none exceeds 1.
    ///
    /// The bins at θ_h = 0 and θ_d = 0, which are 0.01° and 1° wide, take their mean over φ_d: the
    /// angle is undefined at a pole, and a value that varied with it would make the BRDF discontinuous.
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
        let grid = MEASURED_GRID_OFFSET as usize;
        let mut words = vec![0; grid + 2 * CELL_COUNT];
        pack(&cells, &mut words[grid..]);
        if let Some(limit) = EnergyLimit::new(&words) {
            // Cells below the surface, read only as neighbours, take the factor of the horizon.
            for_each_cell(&mut cells, |cell, outgoing, incident| {
                *cell *= limit.factor(outgoing) * limit.factor(incident);
            });
            average_poles(&mut cells);
            pack(&cells, &mut words[grid..]);
            warnings.push(format!(
                "reflected up to {:.2} times the light it receives and was scaled down to 1",
                limit.largest_albedo
            ));
        }
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
                target.copy_from_slice(bytemuck::cast_slice(values));
            }
        }
        let albedo: Vec<Vec3> = (0..BRDF_COSINE_NODES)
            .into_par_iter()
            .map(|node| directional_albedo(&words, node as f32 / BRDF_COSINE_INTERVALS as f32))
            .collect();
        words[..3 * albedo.len()].copy_from_slice(bytemuck::cast_slice(&albedo));
        Ok(Self { words, invalid_cell_count, warnings, rgl: None })
    }

    /// Words for the shader: `MEASURED_GRID_OFFSET`, then 2 per cell.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Share of light from a uniform white hemisphere reflected toward a direction of this cosine with
    /// the normal.
    pub fn albedo(&self, cosine: f32) -> Vec3 {
        Vec3::from_array(
            [0, 1, 2].map(|channel| lookup::cosine_table(&self.words, channel, 3, cosine)),
        )
    }

    /// Value in 1/sr, without the cosine, the mean over all turns about the normal; 0 unless both directions
    /// are above the surface.
    pub fn evaluate(&self, outgoing_local: Vec3, incident_local: Vec3) -> Vec3 {
        if outgoing_local.z <= 0.0 || incident_local.z <= 0.0 {
            return Vec3::ZERO;
        }
        let angles = lookup::half_difference_angles(outgoing_local, incident_local);
        lookup::measured_value(&self.words, 0, angles)
    }
}

/// Replaces the bins at the poles θ_h = 0 and θ_d = 0 by the mean of the valid ones over φ_d.
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

/// Gives every invalid cell the value of a valid one: the nearest in θ_d, smaller angles first
/// since the horizon lies at larger ones; in a column without any, the nearest in φ_d; in a slice
/// without any, the nearest in θ_h.
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

/// Fills the invalid cells of a line of the grid from the previous valid one, else from the next.
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

/// Packs the cells as halves into words of a grid.
fn pack(cells: &[Vec3], words: &mut [u32]) {
    words.par_chunks_exact_mut(2).zip(cells).for_each(|(words, cell)| {
        let half = |value: f32| {
            u32::from(f16::from_f32(value.clamp(MEASURED_LEAST_VALUE, f16::MAX.to_f32())).to_bits())
        };
        words[0] = half(cell.x) | half(cell.y) << 16;
        words[1] = half(cell.z);
    });
}

/// Calls `change` with every cell and the directions (outgoing, incident) of its bin's centre.
fn for_each_cell(cells: &mut [Vec3], change: impl Fn(&mut Vec3, Vec3, Vec3) + Sync) {
    cells.par_chunks_mut(PHI_DIFFERENCE).enumerate().for_each(|(row, cells)| {
        for (phi, cell) in cells.iter_mut().enumerate() {
            let (outgoing, incident) =
                bin_directions(row / THETA_DIFFERENCE, row % THETA_DIFFERENCE, phi);
            change(cell, outgoing, incident);
        }
    });
}
