//! Cornell / pbrt-v2 `.brdf` text: scattered isotropic samples with spectra → [`MeasuredTable`].
//!
//! The format: `#` starts a comment; numbers separated by white space. The count N of wavelengths,
//! N wavelengths in nm, then records of θ_i φ_i θ_o φ_o (radians) and N values in 1/sr.
//!
//! The samples are interpolated as in pbrt-v2 (Pharr & Humphreys, Physically Based Rendering,
//! second edition, section 8.6.2) and the result is baked on the half/difference grid.

use std::{f32::consts::PI, fs, path::Path};

use glam::{DVec3, Vec3, vec3};
use rayon::prelude::*;

use crate::{
    brdf::{
        spectrum,
        table::{CELL_COUNT, MeasuredTable, bin_directions},
    },
    error::{Error, Result},
    gpu::constants::*,
};

/// Largest count of wavelengths that is believed.
const LARGEST_WAVELENGTH_COUNT: f64 = 10_000.0;
/// Squared radius of the first search.
const FIRST_SQUARED_RADIUS: f32 = 0.001;
/// Beyond this squared radius the search stops widening.
const LARGEST_SQUARED_RADIUS: f32 = 1.5;
/// Fewest samples to average, unless the search has reached its end.
const FEWEST_SAMPLES: usize = 3;
/// Decay of the weights exp(−100·d²).
const WEIGHT_DECAY: f32 = 100.0;

/// One measured pair of directions in the interpolation's coordinates.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// (sinθ_i·sinθ_o, |Δφ|/π, cosθ_i·cosθ_o): the same for the two directions interchanged.
    point: Vec3,
    /// Linear sRGB in 1/sr; channels may be negative for saturated colours.
    value: Vec3,
}

/// A number of the file with its place.
struct Number {
    value: f64,
    line: usize,
    column: usize,
}

/// Reads a `.brdf` file and bakes it on the half/difference grid.
///
/// Records with values that are not finite or with a direction below the surface are left out and
/// counted in the table's warnings.
pub fn load(path: &Path) -> Result<MeasuredTable> {
    let bytes = fs::read(path).map_err(|source| Error::io(path, "read", source))?;
    let text = String::from_utf8(bytes).map_err(|error| {
        Error::format(
            path,
            format!(
                "expected the text of a .brdf file, found bytes that are not UTF-8 at byte {}; MERL \
                 files end in .binary",
                error.utf8_error().valid_up_to()
            ),
        )
    })?;
    let (samples, left_out) = parse(path, &text)?;
    if samples.is_empty() {
        return Err(Error::format(
            path,
            "no usable record: all are below the surface or not finite",
        ));
    }
    let samples = SampleSet::new(samples);
    let mut table = MeasuredTable::from_cells(bake(&samples))
        .map_err(|message| Error::format(path, message))?;
    if left_out > 0 {
        table.warnings.push(format!(
            "{left_out} records that are not finite or below the surface were left out"
        ));
    }
    Ok(table)
}

/// The samples interpolated at the centres of the grid's bins. The coordinates of the interpolation
/// are the same at φ_d and π − φ_d, so that half of the grid is enough.
fn bake(samples: &SampleSet) -> Vec<Vec3> {
    const THETA_DIFFERENCE: usize = MEASURED_THETA_DIFFERENCE_BINS as usize;
    const PHI_DIFFERENCE: usize = MEASURED_PHI_DIFFERENCE_BINS as usize;
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

/// The samples of a file, and how many records were left out.
fn parse(path: &Path, text: &str) -> Result<(Vec<Sample>, usize)> {
    let numbers = numbers(path, text)?;
    let error = |place: &Number, message: String| Error::Parse {
        path: path.to_path_buf(),
        line: place.line,
        column: place.column,
        message,
    };
    let Some((first, rest)) = numbers.split_first() else {
        return Err(Error::format(path, "empty: expected the count of wavelengths"));
    };
    if !(first.value >= 1.0
        && first.value <= LARGEST_WAVELENGTH_COUNT
        && first.value.fract() == 0.0)
    {
        let message = format!(
            "expected the count of wavelengths, an integer of 1 to {LARGEST_WAVELENGTH_COUNT}, \
             found {}",
            first.value
        );
        return Err(error(first, message));
    }
    let count = first.value as usize;
    if rest.len() < count {
        return Err(Error::format(
            path,
            format!("truncated: expected {count} wavelengths, found {}", rest.len()),
        ));
    }
    let (wavelengths, records) = rest.split_at(count);
    for pair in wavelengths.windows(2) {
        if !(pair[0].value < pair[1].value) {
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

/// The numbers of the text without its comments.
fn numbers(path: &Path, text: &str) -> Result<Vec<Number>> {
    let mut numbers = Vec::new();
    for (line_index, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default();
        for word in content.split_whitespace() {
            let place = word.as_ptr() as usize - line.as_ptr() as usize;
            let column = line[..place].chars().count() + 1;
            let value = word.parse().map_err(|_| {
                let shown: String = word.chars().take(40).collect();
                Error::Parse {
                    path: path.to_path_buf(),
                    line: line_index + 1,
                    column,
                    message: format!("expected a number, found {shown:?}"),
                }
            })?;
            numbers.push(Number { value, line: line_index + 1, column });
        }
    }
    Ok(numbers)
}

/// Unit vector of polar angle θ and azimuth φ, radians.
fn direction(theta: f64, phi: f64) -> Vec3 {
    DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()).as_vec3()
}

/// (sinθ_i·sinθ_o, |Δφ|/π, cosθ_i·cosθ_o) of two directions.
fn mapped_point(outgoing: Vec3, incident: Vec3) -> Vec3 {
    let (a, b) = (outgoing.truncate(), incident.truncate());
    let sines = a.length() * b.length();
    let azimuth = if sines > 0.0 { a.perp_dot(b).abs().atan2(a.dot(b)) } else { 0.0 };
    vec3(sines, azimuth / PI, outgoing.z * incident.z)
}

/// Samples in the order of their azimuth, so that a search looks at a slab only.
struct SampleSet {
    samples: Vec<Sample>,
}

impl SampleSet {
    fn new(mut samples: Vec<Sample>) -> Self {
        samples.sort_by(|a, b| a.point.y.total_cmp(&b.point.y));
        Self { samples }
    }

    /// Mean of the samples near a point with weights exp(−100·d²), the squared radius doubling
    /// from 0.001 until three samples are found or it exceeds 1.5; negative channels become 0. NaN
    /// where nothing was found.
    fn interpolate(&self, point: Vec3) -> Vec3 {
        let mut squared_radius = FIRST_SQUARED_RADIUS;
        loop {
            let radius = squared_radius.sqrt();
            let first = self.samples.partition_point(|sample| sample.point.y < point.y - radius);
            let (mut found, mut sum, mut weight_sum) = (0, Vec3::ZERO, 0.0);
            for sample in &self.samples[first..] {
                if sample.point.y > point.y + radius {
                    break;
                }
                let squared_distance = sample.point.distance_squared(point);
                if squared_distance < squared_radius {
                    let weight = (-WEIGHT_DECAY * squared_distance).exp();
                    found += 1;
                    sum += weight * sample.value;
                    weight_sum += weight;
                }
            }
            if found >= FEWEST_SAMPLES || squared_radius > LARGEST_SQUARED_RADIUS {
                return if weight_sum > 0.0 {
                    (sum / weight_sum).max(Vec3::ZERO)
                } else {
                    Vec3::NAN
                };
            }
            squared_radius *= 2.0;
        }
    }
}
