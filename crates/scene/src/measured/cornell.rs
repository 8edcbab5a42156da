//! Cornell / pbrt-v2 `.brdf` text: scattered isotropic samples with spectra → [`MeasuredTable`].
//!
//! Format: numbers separated by white space; `#` starts a comment. A count N of wavelengths, N
//! wavelengths in nm, then records of θ_i φ_i θ_o φ_o (radians) and N values in 1/sr.
//!
//! A mean with weights that decay with distance interpolates the samples, as in pbrt-v2 (\[Pharr &
//! Humphreys 2010\], section 8.6.2); the result is baked on the half/difference grid.
//!
//! Deviation: pbrt-v2 measures distances between points (sinθ_i·sinθ_o, |Δφ|/π, cosθ_i·cosθ_o).
//! These put a pair near the mirror direction as close to pairs along the plane of incidence as to
//! other mirror pairs. The single sample in the highlight of a coated paint then shows as a row of
//! bright patches, one in eight directions, the one at 80° makes grazing light come back fivefold,
//! and the value jumps at normal incidence, where Δφ is undefined. The points used here,
//! (2·√(θ_h/90°), θ_d/90°, ½|cosθ_i − cosθ_o|), are continuous in the directions, symmetric in the
//! two, fine in the highlight, and coarse along it, where the BRDF changes slowly.

use std::{f32::consts::FRAC_PI_2, path::Path};

use glam::{DVec3, Vec3, vec3};
use rayon::prelude::*;

use crate::{
    error::{Error, Result},
    files,
    measured::{
        lookup,
        table::{CELL_COUNT, MeasuredTable, PHI_DIFFERENCE, THETA_DIFFERENCE, bin_directions},
    },
    spectrum,
};

/// Largest plausible count of wavelengths.
const LARGEST_WAVELENGTH_COUNT: f64 = 10_000.0;
/// Smallest squared radius of the mean.
const LEAST_SQUARED_RADIUS: f32 = 0.001;
/// Squared radius of the first search for the nearest samples.
const FIRST_SQUARED_SEARCH: f32 = 0.008;
/// Squared radius beyond which the search stops widening: no two points are farther apart.
const LARGEST_SQUARED_SEARCH: f32 = 6.0;
/// Least number of samples in a mean.
const NEAREST_SAMPLES: usize = 4;
/// Squared radius of the mean, relative to the squared distance of the farthest of these samples.
const RADIUS_MARGIN: f32 = 1.5;
/// Decay of the weights exp(−100·d²).
const WEIGHT_DECAY: f32 = 100.0;

/// One measured pair of directions in the interpolation's coordinates.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// Coordinates of the pair: see [`mapped_point`].
    point: Vec3,
    /// Linear sRGB in 1/sr; channels may be negative for saturated colours.
    value: Vec3,
}

/// Number in the file, with its place.
struct Number {
    value: f64,
    line: usize,
    column: usize,
}

/// Reads a `.brdf` file and bakes it on the half/difference grid.
///
/// Omits records with values that are not finite or with a direction below the surface, and counts
/// them in the table's warnings.
pub fn load(path: &Path) -> Result<MeasuredTable> {
    let (samples, left_out) = read(path)?;
    let mut table = MeasuredTable::from_cells(bake(&samples))
        .map_err(|message| Error::format(path, message))?;
    if left_out > 0 {
        table.warnings.push(format!(
            "{left_out} records that are not finite or below the surface were left out"
        ));
    }
    Ok(table)
}

/// Reads the samples of a `.brdf` file, and the number of records that were left out.
pub fn read(path: &Path) -> Result<(SampleSet, usize)> {
    let text = String::from_utf8(files::read(path)?).map_err(|error| {
        let byte = error.utf8_error().valid_up_to();
        let message = format!(
            "expected the text of a .brdf file, found bytes that are not UTF-8 at byte {byte}; MERL files \
             end in .binary"
        );
        Error::format(path, message)
    })?;
    let (samples, left_out) = parse(path, &text)?;
    if samples.is_empty() {
        let message = "no usable record: all are below the surface or not finite";
        return Err(Error::format(path, message));
    }
    Ok((SampleSet::new(samples), left_out))
}

/// Interpolates the samples at the bin centres of the grid. The coordinates of the interpolation
/// agree at φ_d and π − φ_d, so half of the grid suffices.
fn bake(samples: &SampleSet) -> Vec<Vec3> {
    let mut cells = vec![Vec3::NAN; CELL_COUNT];
    cells.par_chunks_mut(PHI_DIFFERENCE).enumerate().for_each(|(row, cells)| {
        for phi in 0..PHI_DIFFERENCE / 2 {
            let (outgoing, incident) =
                bin_directions(row / THETA_DIFFERENCE, row % THETA_DIFFERENCE, phi);
            if outgoing.z > 0.0 && incident.z > 0.0 {
                let value = samples.interpolate(mapped_point(outgoing, incident));
                cells[phi] = value;
                cells[PHI_DIFFERENCE - 1 - phi] = value;
            }
        }
    });
    cells
}

/// Returns the samples of a file and the number of omitted records.
fn parse(path: &Path, text: &str) -> Result<(Vec<Sample>, usize)> {
    let numbers = numbers(path, text)?;
    let error =
        |place: &Number, message: String| Error::parse(path, place.line, place.column, message);
    let Some((first, rest)) = numbers.split_first() else {
        return Err(Error::format(path, "empty: expected the count of wavelengths"));
    };
    if !((1.0..=LARGEST_WAVELENGTH_COUNT).contains(&first.value) && first.value.fract() == 0.0) {
        let message = format!(
            "expected the count of wavelengths, an integer of 1 to {LARGEST_WAVELENGTH_COUNT}, \
             found {}",
            first.value
        );
        return Err(error(first, message));
    }
    let count = first.value as usize;
    if rest.len() < count {
        let message = format!("truncated: expected {count} wavelengths, found {}", rest.len());
        return Err(Error::format(path, message));
    }
    let (wavelengths, records) = rest.split_at(count);
    for pair in wavelengths.windows(2) {
        let increases = pair[0].value < pair[1].value;
        if !increases {
            let message = format!(
                "expected increasing wavelengths, found {} after {}",
                pair[1].value, pair[0].value
            );
            return Err(error(&pair[1], message));
        }
    }
    let length = 4 + count;
    if records.is_empty() || !records.len().is_multiple_of(length) {
        let message = format!(
            "expected records of {length} numbers (4 angles and {count} values), found {} numbers: \
             {} records and {} left over",
            records.len(),
            records.len() / length,
            records.len() % length
        );
        return Err(error(numbers.last().unwrap_or(first), message));
    }
    let wavelengths: Vec<f64> = wavelengths.iter().map(|number| number.value).collect();
    let weights = spectrum::srgb_weights(&wavelengths).ok_or_else(|| {
        error(&rest[0], "expected wavelengths in nm, of which some are visible".to_string())
    })?;

    let mut samples = Vec::with_capacity(records.len() / length);
    for record in records.chunks_exact(length) {
        let angle = |index: usize| record[index].value;
        let colour: DVec3 =
            record[4..].iter().zip(&weights).map(|(number, weight)| *weight * number.value).sum();
        let (incident, outgoing) = (direction(angle(0), angle(1)), direction(angle(2), angle(3)));
        let point = mapped_point(outgoing, incident);
        if point.is_finite() && incident.z > 0.0 && outgoing.z > 0.0 && colour.is_finite() {
            samples.push(Sample { point, value: colour.as_vec3() });
        }
    }
    let left_out = records.len() / length - samples.len();
    Ok((samples, left_out))
}

/// Numbers of the text without its comments.
fn numbers(path: &Path, text: &str) -> Result<Vec<Number>> {
    let mut numbers = Vec::new();
    for (line_index, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default();
        for word in content.split_whitespace() {
            let place = word.as_ptr() as usize - line.as_ptr() as usize;
            let column = line[..place].chars().count() + 1;
            let line = line_index + 1;
            let value = word.parse().map_err(|_| {
                let shown: String = word.chars().take(40).collect();
                Error::parse(path, line, column, format!("expected a number, found {shown:?}"))
            })?;
            numbers.push(Number { value, line, column });
        }
    }
    Ok(numbers)
}

/// Unit vector of polar angle θ and azimuth φ, radians.
fn direction(theta: f64, phi: f64) -> Vec3 {
    DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()).as_vec3()
}

/// (2·√(θ_h/90°), θ_d/90°, ½|cosθ_i − cosθ_o|) of two directions.
fn mapped_point(outgoing: Vec3, incident: Vec3) -> Vec3 {
    let angles = lookup::half_difference_angles(outgoing, incident);
    vec3(
        2.0 * (angles.x / FRAC_PI_2).sqrt(),
        angles.y / FRAC_PI_2,
        0.5 * (incident.z - outgoing.z).abs(),
    )
}

/// Measured samples, sorted by their first coordinate, so that a search visits only a slab.
pub struct SampleSet {
    samples: Vec<Sample>,
}

impl SampleSet {
    fn new(mut samples: Vec<Sample>) -> Self {
        samples.sort_by(|a, b| a.point.x.total_cmp(&b.point.x));
        Self { samples }
    }

    /// Mean of the samples near a point, with negative channels set to 0.
    ///
    /// Weights are exp(−100·d²)·(1 − d²/r²)² within a radius r that includes the four nearest
    /// samples. Deviation: pbrt-v2 starts at r² = 0.001, doubles it until it finds more than two
    /// samples and has no second factor, so the mean jumps where a sample enters or the radius
    /// changes. Here both are continuous in the point.
    fn interpolate(&self, point: Vec3) -> Vec3 {
        let nearest = self.nearest(point);
        let farthest = nearest.iter().copied().filter(|d| d.is_finite()).fold(0.0, f32::max);
        let squared_radius = (RADIUS_MARGIN * farthest).max(LEAST_SQUARED_RADIUS);
        let (mut sum, mut weight_sum) = (Vec3::ZERO, 0.0);
        for sample in self.slab(point, squared_radius.sqrt()) {
            let squared_distance = sample.point.distance_squared(point);
            if squared_distance < squared_radius {
                let window = 1.0 - squared_distance / squared_radius;
                // Measure from the nearest sample, so that no weight underflows far from all samples.
                let decay = (-WEIGHT_DECAY * (squared_distance - nearest[0])).exp();
                let weight = decay * window * window;
                sum += weight * sample.value;
                weight_sum += weight;
            }
        }
        (sum / weight_sum).max(Vec3::ZERO)
    }

    /// Squared distances of the nearest samples, ascending; infinite for missing samples.
    fn nearest(&self, point: Vec3) -> [f32; NEAREST_SAMPLES] {
        let mut searched = FIRST_SQUARED_SEARCH;
        loop {
            let mut nearest = [f32::INFINITY; NEAREST_SAMPLES];
            for sample in self.slab(point, searched.sqrt()) {
                let squared_distance = sample.point.distance_squared(point);
                let place = nearest.partition_point(|other| *other < squared_distance);
                if place < NEAREST_SAMPLES {
                    nearest[place..].rotate_right(1);
                    nearest[place] = squared_distance;
                }
            }
            if nearest[NEAREST_SAMPLES - 1] <= searched || searched > LARGEST_SQUARED_SEARCH {
                return nearest;
            }
            searched *= 2.0;
        }
    }

    /// Samples whose first coordinate differs by at most `radius` from that of the point.
    fn slab(&self, point: Vec3, radius: f32) -> impl Iterator<Item = &Sample> {
        let first = self.samples.partition_point(|sample| sample.point.x < point.x - radius);
        self.samples[first..].iter().take_while(move |sample| sample.point.x <= point.x + radius)
    }
}
