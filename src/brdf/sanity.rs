//! Physical plausibility of a measured BRDF: how much it reflects, and whether it is reciprocal.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{DVec3, Vec3, vec3};
use rayon::prelude::*;

use crate::scene::measured::{MeasuredTable, layout::MEASURED_LEAST_VALUE};

/// Elevations of the reported albedo, degrees from the normal.
pub(crate) const ELEVATIONS_DEG: [f32; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];

/// Angle between the directions tried in pairs, degrees.
const STEP_DEG: usize = 15;

/// Quadrature steps over the elevation and azimuth of the incident direction: a quarter and half a
/// degree, finer than measured highlights.
const QUADRATURE_STEPS: [usize; 2] = [360, 720];

/// Figures on the plausibility of a measured BRDF.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub(crate) struct Sanity {
    /// Reflected share of light from a uniform hemisphere, linear Rec.709, at each of
    /// [`ELEVATIONS_DEG`]: ∫ value · cosine dω by the midpoint rule. Unlike the albedo used for
    /// rendering, it is not clamped.
    pub albedo: Vec<[f32; 3]>,
    /// Largest of these.
    pub largest_albedo: f32,
    /// Largest value among the pairs of directions tried, 1/sr.
    pub largest_value: f32,
    /// Largest change when the directions of a pair are interchanged, relative to the value.
    pub largest_reciprocity_error: f32,
}

impl Sanity {
    pub(crate) fn of(table: &MeasuredTable) -> Self {
        let albedo: Vec<[f32; 3]> =
            ELEVATIONS_DEG.iter().map(|&elevation_deg| albedo(table, elevation_deg)).collect();
        let (largest_value, largest_reciprocity_error) = try_pairs(table);
        Self {
            largest_albedo: albedo.as_flattened().iter().copied().fold(0.0, f32::max),
            albedo,
            largest_value,
            largest_reciprocity_error,
        }
    }

    /// Warnings for a user who renders with it.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.largest_albedo > 1.0 {
            warnings.push(format!(
                "reflects more light than it receives: albedo {:.3}",
                self.largest_albedo
            ));
        }
        if self.largest_reciprocity_error > 0.01 {
            warnings.push(format!(
                "not reciprocal: interchanged directions differ by {:.1}%",
                100.0 * self.largest_reciprocity_error
            ));
        }
        if self.largest_value < 2.0 * MEASURED_LEAST_VALUE {
            warnings.push("black at every pair of directions tried".to_owned());
        }
        warnings
    }
}

/// Unit vector at polar angle `elevation` from the normal and at `azimuth`, radians.
fn direction(elevation: f32, azimuth: f32) -> Vec3 {
    let ((sine, cosine), (sine_azimuth, cosine_azimuth)) = (elevation.sin_cos(), azimuth.sin_cos());
    vec3(sine * cosine_azimuth, sine * sine_azimuth, cosine)
}

/// ∫ value · cosine dω over the incident hemisphere.
fn albedo(table: &MeasuredTable, elevation_deg: f32) -> [f32; 3] {
    let outgoing = direction(elevation_deg.to_radians(), 0.0);
    let [rings, sectors] = QUADRATURE_STEPS;
    let (ring_width, sector_width) = (FRAC_PI_2 / rings as f32, TAU / sectors as f32);
    let ring = |index: usize| {
        let elevation = (index as f32 + 0.5) * ring_width;
        let sum: DVec3 = (0..sectors)
            .map(|sector| direction(elevation, (sector as f32 + 0.5) * sector_width))
            .map(|incident| table.evaluate(outgoing, incident).as_dvec3())
            .sum();
        sum * f64::from(elevation.sin() * elevation.cos())
    };
    // Collect in order, so that the sum does not depend on the threads.
    let sums: Vec<DVec3> = (0..rings).into_par_iter().map(ring).collect();
    let total: DVec3 = sums.into_iter().sum();
    (total * f64::from(ring_width * sector_width)).as_vec3().to_array()
}

/// Largest value and largest relative reciprocity error over pairs of directions.
fn try_pairs(table: &MeasuredTable) -> (f32, f32) {
    let radians = |degrees: usize| (degrees as f32).to_radians();
    let (mut largest, mut error) = (0.0_f32, 0.0_f32);
    for outgoing_deg in (0..90).step_by(STEP_DEG) {
        for incident_deg in (0..90).step_by(STEP_DEG) {
            for azimuth_deg in (0..=180).step_by(STEP_DEG) {
                let outgoing = direction(radians(outgoing_deg), 0.0);
                let incident = direction(radians(incident_deg), radians(azimuth_deg));
                let value = table.evaluate(outgoing, incident);
                let interchanged = table.evaluate(incident, outgoing);
                largest = largest.max(value.max_element());
                let scale = value.max_element().max(interchanged.max_element());
                if scale > 0.0 {
                    error = error.max((value - interchanged).abs().max_element() / scale);
                }
            }
        }
    }
    (largest, error)
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use std::f32::consts::PI;

    use super::*;

    #[test]
    fn a_white_lambertian_table_is_sane_and_one_twice_as_bright_is_scaled_down() {
        let sanity = |value: f32| {
            let table = MeasuredTable::tabulate(|_, _| Vec3::splat(value)).unwrap();
            Sanity::of(&table)
        };
        let white = sanity(0.9 / PI);
        for albedo in white.albedo.as_flattened() {
            assert!((albedo - 0.9).abs() < 0.01, "{albedo}");
        }
        assert!((white.largest_value - 0.9 / PI).abs() < 1e-3);
        assert!(white.largest_reciprocity_error < 1e-3);
        assert_eq!(white.warnings(), [""; 0]);
        let bright = MeasuredTable::tabulate(|_, _| Vec3::splat(2.0 / PI)).unwrap();
        assert!(bright.warnings[0].contains("2.00 times the light"), "{:?}", bright.warnings);
        let limited = Sanity::of(&bright);
        assert_eq!(limited.warnings(), [""; 0]);
        assert!((limited.largest_albedo - 0.97).abs() < 0.02, "{}", limited.largest_albedo);
        assert!(sanity(0.0).warnings()[0].contains("black"));
    }
}
