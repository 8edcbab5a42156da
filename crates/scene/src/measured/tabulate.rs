//! Tables of a measured material besides the grid: the sampling table, the directional albedo, and
//! the limit that keeps the grid from reflecting more light than it receives.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec3, vec3};
use rayon::prelude::*;

use crate::{
    math::{colour::luminance, write_cumulative},
    measured::{layout::*, lookup},
};

/// Sampling table of one bin of outgoing elevation.
pub(super) struct SamplingRow {
    /// Probability of the cosine lobe.
    pub cosine_share: f32,
    /// Cumulative probabilities of the cells, the last one exactly 1.
    pub cumulative: Vec<f32>,
    /// Density of each cell, per steradian of half vectors.
    pub density: Vec<f32>,
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
    /// Candidate shares of the cosine lobe; the one of least variance is used. None is 0, since the
    /// tabulated density may vanish where the BRDF does not.
    const COSINE_SHARES: [f64; 7] = [0.05, 0.1, 0.15, 0.25, 0.4, 0.6, 0.8];
    /// Points per cell and dimension: outgoing elevation, θ_h, φ_h.
    const POINTS: u32 = 3;

    /// Tabulates BRDF × cosine of an elevation bin over half vectors, from the grid in `words`.
    pub(super) fn new(words: &[u32], elevation: u32) -> Self {
        let cells: Vec<Vec<QuadraturePoint>> = (0..MEASURED_SAMPLING_CELLS)
            .map(|cell| Self::quadrature(words, elevation, cell))
            .collect();
        let solid_angle = |cell: u32| {
            let (lower, upper) = Self::edges(cell);
            // Count both signs of φ_h.
            2.0 * (upper - lower) * std::f64::consts::PI / f64::from(MEASURED_AZIMUTH_BINS)
        };
        let masses: Vec<f64> = cells
            .iter()
            .zip(0..)
            .map(|(points, cell)| {
                let sum: f64 = points.iter().map(|point| point.value * point.jacobian).sum();
                sum / points.len() as f64 * solid_angle(cell)
            })
            .collect();
        let mut cumulative = vec![0.0; masses.len()];
        if write_cumulative(masses.iter().copied(), &mut cumulative) <= 0.0 {
            // The material is black: any density serves.
            let solid_angles = (0..MEASURED_SAMPLING_CELLS).map(solid_angle);
            write_cumulative(solid_angles, &mut cumulative);
        }
        // Derive the density from the rounded probabilities, to match the samples exactly.
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
                let angles = lookup::half_difference_angles(outgoing, incident);
                value = luminance(lookup::measured_value(words, 0, angles)) * incident.z;
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

/// ∫ BRDF·cosθ_i dω_i from 1024 samples of the material's own density, at the points of an additive
/// lattice of irrational steps. Accurate to about 1%, for images only.
pub(super) fn directional_albedo(words: &[u32], cosine: f32) -> Vec3 {
    const SAMPLES: u32 = 1024;
    let cosine = cosine.max(0.5 / BRDF_COSINE_INTERVALS as f32 / 8.0);
    let outgoing = vec3((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    // Step by the three-dimensional golden ratio: powers of the inverted root of x⁴ = x + 1.
    let step = [0.819_172_513_396_164_4_f64, 0.671_043_606_703_789_2, 0.549_700_477_901_970_5];
    let mut sum = Vec3::ZERO;
    for index in 0..SAMPLES {
        let coordinate =
            |dimension: usize| (0.5 + f64::from(index) * step[dimension]).fract().min(0.999_999);
        let u = vec3(coordinate(0) as f32, coordinate(1) as f32, coordinate(2) as f32);
        let incident = lookup::measured_sample(words, 0, outgoing, u);
        if incident.z > 0.0 {
            let angles = lookup::half_difference_angles(outgoing, incident);
            let pdf = lookup::measured_pdf(words, 0, outgoing, incident, angles.x);
            if pdf > 0.0 {
                sum += lookup::measured_value(words, 0, angles) * (incident.z / pdf);
            }
        }
    }
    (sum / SAMPLES as f32).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Bins of the polar angle for balancing energy.
const POLAR_BINS: usize = 90;
/// Bound on the albedo of limited materials; the rest to 1 covers the error of the quadrature.
const LARGEST_ALBEDO: f32 = 0.97;
/// Points over the azimuth between two directions, 0…π.
const AZIMUTH_POINTS: usize = 90;

/// Factors by polar angle, applied for both directions, that keep a BRDF from reflecting more light
/// than it receives.
pub(super) struct EnergyLimit {
    /// Largest directional albedo of any channel before scaling.
    pub largest_albedo: f32,
    /// Factor at the centre of each polar bin.
    factors: Vec<f32>,
}

impl EnergyLimit {
    /// Measures the albedo of the grid in `words` at every polar angle. If one exceeds 1, finds
    /// s(θ) ≤ 1 such that s(θ_o)·∫ f·s(θ_i)·cosθ_i dω_i stays below 1 everywhere; the product form
    /// keeps the BRDF reciprocal. `None` if none exceeds 1.
    pub(super) fn new(words: &[u32]) -> Option<Self> {
        let theta = |bin: usize| (bin as f32 + 0.5) / POLAR_BINS as f32 * FRAC_PI_2;
        // ∫ f dφ · cosθ_i sinθ_i dθ_i by bins of outgoing and incident polar angle.
        let transport: Vec<Vec<Vec3>> = (0..POLAR_BINS)
            .into_par_iter()
            .map(|outgoing_bin| {
                let (sine, cosine) = theta(outgoing_bin).sin_cos();
                let outgoing = vec3(sine, 0.0, cosine);
                let ring = |incident_bin: usize| -> Vec3 {
                    let (sine, cosine) = theta(incident_bin).sin_cos();
                    let sum: Vec3 = (0..AZIMUTH_POINTS)
                        .map(|point| {
                            // Sample more densely around the mirror direction, φ = π.
                            let x = (point as f32 + 0.5) / AZIMUTH_POINTS as f32;
                            let phi = PI * (1.0 - x * x);
                            let incident = vec3(sine * phi.cos(), sine * phi.sin(), cosine);
                            let angles = lookup::half_difference_angles(outgoing, incident);
                            lookup::measured_value(words, 0, angles) * (2.0 * x)
                        })
                        .sum();
                    sum * (2.0 * PI / AZIMUTH_POINTS as f32 * cosine * sine * FRAC_PI_2
                        / POLAR_BINS as f32)
                };
                (0..POLAR_BINS).map(ring).collect()
            })
            .collect();
        let albedo = |factors: &[f32], bin: usize| -> f32 {
            let sum: Vec3 =
                transport[bin].iter().zip(factors).map(|(ring, factor)| *ring * *factor).sum();
            sum.max_element() * factors[bin]
        };
        let mut factors = vec![1.0; POLAR_BINS];
        let largest =
            |factors: &[f32]| (0..POLAR_BINS).map(|bin| albedo(factors, bin)).fold(0.0, f32::max);
        let largest_albedo = largest(&factors);
        if largest_albedo <= 1.0 {
            return None;
        }
        // The square root damps the step, since the factors of both directions move at once.
        for _ in 0..200 {
            let steps: Vec<f32> = (0..POLAR_BINS)
                .map(|bin| (albedo(&factors, bin) / LARGEST_ALBEDO).max(1.0).sqrt().recip())
                .collect();
            factors.iter_mut().zip(&steps).for_each(|(factor, step)| *factor *= step);
            if steps.iter().all(|step| *step > 0.9999) {
                break;
            }
        }
        Some(Self { largest_albedo, factors })
    }

    /// s(θ) of a direction above the surface, linear between bin centres.
    pub(super) fn factor(&self, direction_local: Vec3) -> f32 {
        let theta = direction_local.truncate().length().atan2(direction_local.z);
        let last = POLAR_BINS - 1;
        let position = (theta / FRAC_PI_2 * POLAR_BINS as f32 - 0.5).clamp(0.0, last as f32);
        let bin = (position as usize).min(last - 1);
        let fraction = position - bin as f32;
        self.factors[bin] * (1.0 - fraction) + self.factors[bin + 1] * fraction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bin for each degree, with its number as factor.
    #[test]
    fn factors_hold_in_the_middle_of_their_bins() {
        let factors = (0..POLAR_BINS).map(|bin| bin as f32).collect();
        let limit = EnergyLimit { largest_albedo: 2.0, factors };
        for (angle_deg, expected) in [(0.2_f32, 0.0), (10.5, 10.0), (11.0, 10.5), (89.9, 89.0)] {
            let (sine, cosine) = angle_deg.to_radians().sin_cos();
            let found = limit.factor(vec3(sine, 0.0, cosine));
            assert!((found - expected).abs() < 1e-3, "{angle_deg}°: {found}");
        }
    }
}
