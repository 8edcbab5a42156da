//! Error figures of a fit, over every cell of the target.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    component::{Component, kernel_integral, lobe_energy},
    config,
    expectation::fast_exp,
    grid::{Grid, STEEP_PARTS},
    hemisphere::HemisphereTarget,
};
use crate::{math::colour::luminance, srbf::Lobe};

/// Error figures of a fit. The target has density p and values L, the fit has density f and values
/// F; densities are per steradian and integrate to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitErrors {
    /// `‖L − F‖ / ‖L‖` over the sphere (all colour channels together).
    pub relative_l2: f64,
    /// `∫p²/q dω − 1` for `q = 0.9·f + 0.1·uniform`: variance of an estimator that samples q.
    pub chi_squared: f64,
    /// Kullback-Leibler divergence `∫p ln(p/f) dω`, nats.
    pub kullback_leibler: f64,
    /// `∫F dω / ∫L dω`, luminance.
    pub energy_captured: f64,
}

impl FitErrors {
    /// Computes the figures from integrals of (L − F)², L², p²/q, p ln(p/f) and F, and `energy`, that of L.
    fn from_sums(sums: [f64; 5], energy: f64) -> Self {
        let [difference, square, second_moment, divergence, fitted] = sums;
        Self {
            relative_l2: (difference / square).sqrt(),
            chi_squared: second_moment - 1.0,
            kullback_leibler: divergence,
            energy_captured: fitted / energy,
        }
    }
}

/// Side of a block, in cells. Each block is compared only with the lobes that matter in it.
const BLOCK: usize = 16;
/// Difference in exponent from the largest beyond which a lobe does not matter in a block.
const CULL: f64 = 18.0;

/// Lobe with its colour: `component` gives the luminance density, `colour` the value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColouredComponent {
    /// Shape and share of the sampling density.
    pub component: Component,
    /// Value at the axis per colour channel.
    pub colour: DVec3,
}

/// The lobes that matter in a block.
#[derive(Default)]
struct Selection {
    /// Axis, bandwidth, logarithm of the density at the axis, and value at the axis.
    lobes: Vec<[f32; 8]>,
    /// Logarithm of each lobe's contribution to the density at a point.
    exponents: Vec<f32>,
}

impl Selection {
    /// Selects the lobes whose contribution to density or value is not negligible within `radius`
    /// radians of `centre`.
    fn choose(&mut self, lobes: &[ColouredComponent], centre: DVec3, radius: f64) {
        struct Bounds {
            log_scale: f64,
            log_value: f64,
            near: f64,
            far: f64,
        }
        let bounds = |lobe: &ColouredComponent| {
            let c = &lobe.component;
            let angle = c.axis.cross(centre).length().atan2(c.axis.dot(centre));
            let exponent = |angle: f64| -2.0 * c.bandwidth * (0.5 * angle).sin().powi(2);
            Bounds {
                log_scale: (c.share / kernel_integral(c.bandwidth)).max(1e-300).ln(),
                log_value: (lobe.colour.max_element() + 1e-300).ln(),
                near: exponent((angle - radius).max(0.0)),
                far: exponent((angle + radius).min(PI)),
            }
        };
        let bounds: Vec<Bounds> = lobes.iter().map(bounds).collect();
        let density_floor = bounds.iter().map(|b| b.log_scale + b.far).fold(f64::MIN, f64::max);
        let value_floor = bounds.iter().map(|b| b.log_value + b.far).fold(f64::MIN, f64::max);
        self.lobes.clear();
        for (lobe, b) in lobes.iter().zip(&bounds) {
            if b.log_scale + b.near < density_floor - CULL
                && b.log_value + b.near < value_floor - CULL
            {
                continue;
            }
            let [x, y, z] = lobe.component.axis.as_vec3().to_array();
            let [red, green, blue] = lobe.colour.as_vec3().to_array();
            let bandwidth = lobe.component.bandwidth as f32;
            self.lobes.push([x, y, z, bandwidth, b.log_scale as f32, red, green, blue]);
        }
        self.exponents.resize(self.lobes.len(), 0.0);
    }

    /// Returns the logarithm of the density, and the value.
    fn evaluate(&mut self, direction: Vec3) -> (f64, Vec3) {
        let (mut largest, mut value) = (f32::MIN, Vec3::ZERO);
        for (lobe, slot) in self.lobes.iter().zip(&mut self.exponents) {
            let &[x, y, z, bandwidth, log_scale, red, green, blue] = lobe;
            let d = direction - Vec3::new(x, y, z);
            let exponent = -0.5 * bandwidth * d.dot(d);
            value += fast_exp(exponent) * Vec3::new(red, green, blue);
            *slot = exponent + log_scale;
            largest = largest.max(*slot);
        }
        let sum: f32 = self.exponents.iter().map(|exponent| fast_exp(exponent - largest)).sum();
        (f64::from(largest) + f64::from(sum).ln(), value)
    }
}

/// Error figures of a fit of a map whose luminance has the integral `energy`.
pub(crate) fn judge_environment(
    grid: &Grid,
    energy: f64,
    lobes: &[ColouredComponent],
) -> FitErrors {
    let (columns, rows) = (grid.width.div_ceil(BLOCK), grid.height.div_ceil(BLOCK));
    let share: f64 = lobes.iter().map(|lobe| lobe.component.share).sum();
    let blocks: Vec<[f64; 5]> = (0..columns * rows)
        .into_par_iter()
        .map_init(Selection::default, |selection, block| {
            let (x0, y0) = (block % columns * BLOCK, block / columns * BLOCK);
            let (x1, y1) = ((x0 + BLOCK).min(grid.width), (y0 + BLOCK).min(grid.height));
            let centre = grid.direction(0.5 * (x0 + x1) as f64, 0.5 * (y0 + y1) as f64);
            // Half a block's diagonal, measured along meridian and parallel.
            let radius = PI * BLOCK as f64 * 1.5 / grid.height.min(grid.width / 2).max(1) as f64;
            selection.choose(lobes, centre, radius);
            let mut sums = [0.0; 5];
            for (x, y) in (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y))) {
                let parts = if grid.is_steep(x, y) { STEEP_PARTS } else { 1 };
                let solid_angle = grid.cell_solid_angle(y) / (parts * parts) as f64;
                for part in 0..parts * parts {
                    let inside = |part: usize| (part as f64 + 0.5) / parts as f64;
                    let column = x as f64 + inside(part % parts);
                    let row = y as f64 + inside(part / parts);
                    let direction = grid.direction(column, row).as_vec3();
                    let (log_density, value) = selection.evaluate(direction);
                    let log_density = log_density - share.ln();
                    let radiance = grid.lookup(column, row);
                    let p = f64::from(luminance(radiance)) / energy;
                    let q = (1.0 - config::DEFENSIVE_SHARE) * log_density.exp()
                        + config::DEFENSIVE_SHARE / (4.0 * PI);
                    let difference = (radiance - value).as_dvec3();
                    sums[0] += solid_angle * difference.length_squared();
                    sums[1] += solid_angle * radiance.as_dvec3().length_squared();
                    sums[2] += solid_angle * p * p / q;
                    if p > 0.0 {
                        sums[3] += solid_angle * p * (p.ln() - log_density);
                    }
                    sums[4] += solid_angle * f64::from(luminance(value));
                }
            }
            sums
        })
        .collect();
    let mut sums = [0.0; 5];
    for block in blocks {
        for (sum, value) in sums.iter_mut().zip(block) {
            *sum += value;
        }
    }
    FitErrors::from_sums(sums, energy)
}

/// Error figures of a fit of BRDF × cosine for one view. The uniform part of q covers the
/// hemisphere; energy of lobes below the horizon is lost to f, to the energy of F and to q.
pub(crate) fn judge_hemisphere(target: &HemisphereTarget, lobes: &[Lobe]) -> FitErrors {
    let energy = target.energy();
    let lobe_sum: f64 = lobes.iter().map(lobe_energy).sum();
    if energy <= 0.0 || lobe_sum <= 0.0 {
        return FitErrors::default();
    }
    let components: Vec<Component> =
        lobes.iter().map(|lobe| Component::from_lobe(lobe, 1.0)).collect();
    let mut sums = [0.0; 5];
    for sample in &target.samples {
        let kernel = |c: &Component| {
            let d = sample.direction - c.axis;
            c.share / kernel_integral(c.bandwidth) * (-0.5 * c.bandwidth * d.length_squared()).exp()
        };
        let value: f64 = components.iter().map(kernel).sum();
        let (f, p) = (value / lobe_sum, sample.value / energy);
        let q = (1.0 - config::DEFENSIVE_SHARE) * f + config::DEFENSIVE_SHARE / (2.0 * PI);
        sums[0] += sample.solid_angle * (sample.value - value).powi(2);
        sums[1] += sample.solid_angle * sample.value.powi(2);
        sums[2] += sample.solid_angle * p * p / q;
        if p > 0.0 {
            sums[3] += sample.solid_angle * p * (p / f.max(1e-300)).ln();
        }
        sums[4] += sample.solid_angle * value;
    }
    FitErrors::from_sums(sums, energy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::hemisphere::sample_hemisphere;

    /// Half of the density of a flat lobe lies below the horizon, where a flat target has none.
    #[test]
    fn figures_over_the_hemisphere_are_those_of_a_flat_lobe() {
        let target = sample_hemisphere(&|_| 1.0, DVec3::Z);
        let lobe = Lobe { axis: Vec3::Z, bandwidth: 0.0, amplitude: 1.0 };
        let errors = judge_hemisphere(&target, &[lobe]);
        let q = 0.5 * (1.0 - config::DEFENSIVE_SHARE) + config::DEFENSIVE_SHARE;
        for (found, expected) in [
            (errors.relative_l2, 0.0),
            (errors.chi_squared, 1.0 / q - 1.0),
            (errors.kullback_leibler, 2_f64.ln()),
            (errors.energy_captured, 1.0),
        ] {
            assert!((found - expected).abs() < 1e-6, "{found} instead of {expected}");
        }
    }
}
