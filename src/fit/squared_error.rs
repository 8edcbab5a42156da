//! Squared error of a mixture and its gradient: the objective of the fits of \[Tsai et al. 2008\].
//!
//! `J = ∫(L − F)² / ∫L²` with `F = Σ a_l G_l`. `∫F²` has a closed form, `∫L·F` is summed over
//! patches, `∫L²` is given. A lobe has five unknowns: axis (of any length), logarithm of the
//! bandwidth, and amplitude relative to its start.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    component::{
        Component, MAX_BANDWIDTH, MIN_BANDWIDTH, convolution, kernel_integral, mean_shortfall,
    },
    config,
    points::{Patch, blurred},
    solver::{self, Bounds},
};

/// Unknowns per lobe.
const UNKNOWNS: usize = 5;

/// Objective over all lobes.
pub(crate) struct SquaredError {
    /// Energies, mean directions and variances of the patches that hold energy.
    patches: Vec<(f64, DVec3, f64)>,
    /// `∫L²`.
    square: f64,
    /// Initial amplitudes; unknowns are relative to them.
    scales: Vec<f64>,
}

#[derive(Clone, Copy)]
struct Scaled {
    shape: Component,
    amplitude: f64,
}

impl SquaredError {
    /// Returns the objective for a target whose square has the integral `square`, and the unknowns
    /// of `components` (shares of the energy of `patches`).
    pub(crate) fn new(
        patches: &[Patch],
        square: f64,
        components: &[Component],
    ) -> (Self, Vec<f64>) {
        let energy: f64 = patches.iter().map(|patch| patch.energy).sum();
        let mut unknowns = Vec::with_capacity(UNKNOWNS * components.len());
        let mut scales = Vec::with_capacity(components.len());
        for component in components {
            let share = component.share.max(1e-6 / components.len() as f64);
            scales.push(energy * share / kernel_integral(component.bandwidth));
            unknowns.extend(component.axis.to_array());
            unknowns.extend([component.bandwidth.ln(), 1.0]);
        }
        let patches = patches
            .iter()
            .filter_map(|patch| {
                let (direction, variance) = patch.spread()?;
                Some((patch.energy, direction, variance))
            })
            .collect();
        (Self { patches, square, scales }, unknowns)
    }

    pub(crate) fn bounds(&self) -> Vec<Bounds> {
        let free = (f64::NEG_INFINITY, f64::INFINITY);
        let one =
            [free, free, free, (MIN_BANDWIDTH.ln(), MAX_BANDWIDTH.ln()), (0.0, f64::INFINITY)];
        one.repeat(self.scales.len())
    }

    fn lobes(&self, unknowns: &[f64]) -> Vec<Scaled> {
        let lobe = |(values, scale): (&[f64], &f64)| Scaled {
            shape: Component {
                axis: DVec3::new(values[0], values[1], values[2]).normalize_or(DVec3::Y),
                bandwidth: values[3].exp(),
                share: 0.0,
            },
            amplitude: values[4] * scale,
        };
        unknowns.chunks_exact(UNKNOWNS).zip(&self.scales).map(lobe).collect()
    }

    /// Returns the lobes of the unknowns, with shares of their own sum, and their energy.
    pub(crate) fn components(&self, unknowns: &[f64]) -> (Vec<Component>, f64) {
        let lobes = self.lobes(unknowns);
        let energy_of = |lobe: &Scaled| lobe.amplitude * kernel_integral(lobe.shape.bandwidth);
        let energy: f64 = lobes.iter().map(energy_of).sum();
        let component = |lobe: &Scaled| Component {
            share: if energy > 0.0 { energy_of(lobe) / energy } else { 0.0 },
            ..lobe.shape
        };
        (lobes.iter().map(component).collect(), energy)
    }

    pub(crate) fn evaluate(&self, unknowns: &[f64]) -> (f64, Vec<f64>) {
        let lobes = self.lobes(unknowns);
        let row = |index: usize| {
            let Scaled { shape: a, amplitude } = lobes[index];
            // d/da, d/dξ and d/dλ of Σ_j a_j ∫G_iG_j − ∫L·G_i
            let (mut value, mut by_axis, mut by_bandwidth) = (0.0, DVec3::ZERO, 0.0);
            for b in &lobes {
                let overlap = b.amplitude * convolution(&a, &b.shape);
                if overlap == 0.0 {
                    continue;
                }
                let u = a.bandwidth * a.axis + b.shape.bandwidth * b.shape.axis;
                let length = u.length().max(1e-12);
                let slope = 1.0 - mean_shortfall(length);
                value += overlap;
                by_axis += overlap * slope * a.bandwidth / length * u;
                // slope·ξ·u/|u| and 1 nearly cancel for narrow lobes; 64 bits suffice.
                by_bandwidth += overlap * (slope * a.axis.dot(u) / length - 1.0);
            }
            let quadratic = amplitude * value;
            let mut linear = 0.0;
            for (energy, direction, variance) in &self.patches {
                let (bandwidth, factor) = blurred(a.bandwidth, *variance);
                let cosine = direction.dot(a.axis) - 1.0;
                if bandwidth * cosine < -40.0 {
                    continue;
                }
                let kernel = energy * factor * (bandwidth * cosine).exp();
                linear += kernel;
                by_axis -= kernel * bandwidth * *direction;
                by_bandwidth -= kernel * (cosine * factor * factor - variance * factor);
            }
            let scale = 2.0 / self.square;
            // The unknown axis is normalized, so only the tangential part counts.
            let raw = &unknowns[UNKNOWNS * index..];
            let stretch = DVec3::new(raw[0], raw[1], raw[2]).length().max(1e-12);
            let tangential = (by_axis - by_axis.dot(a.axis) * a.axis) / stretch;
            let [x, y, z] = (scale * amplitude * tangential).to_array();
            let gradient = [
                x,
                y,
                z,
                scale * amplitude * by_bandwidth * a.bandwidth,
                scale * (value - linear) * self.scales[index],
            ];
            ((quadratic - 2.0 * amplitude * linear) / self.square, gradient)
        };
        let rows: Vec<(f64, [f64; UNKNOWNS])> = (0..lobes.len()).into_par_iter().map(row).collect();
        let value = 1.0 + rows.iter().map(|row| row.0).sum::<f64>();
        (value, rows.into_iter().flat_map(|row| row.1).collect())
    }
}

/// Lowers the squared error of `components` by L-BFGS. Takes shares of the energy of `patches` and
/// returns shares of the returned energy. `square` is the integral of the target's square;
/// `progress` receives the share of the steps that are done.
pub(crate) fn minimize_squared_error(
    patches: &[Patch],
    square: f64,
    components: &[Component],
    progress: &mut dyn FnMut(f64),
) -> (Vec<Component>, f64) {
    let (objective, mut unknowns) = SquaredError::new(patches, square, components);
    solver::minimize(
        |unknowns| objective.evaluate(unknowns),
        &objective.bounds(),
        &mut unknowns,
        config::L2_STEPS,
        config::L2_TOLERANCE,
        &mut |step| progress(step as f64 / config::L2_STEPS as f64),
    );
    objective.components(&unknowns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradient_matches_differences() {
        let patch = |x: f64, y: f64, z: f64, energy: f64| {
            let mean = DVec3::new(x, y, z).normalize() * 0.999;
            Patch { energy, moment: energy * mean, solid_angle: 0.1 }
        };
        let patches =
            [patch(0.2, 0.9, 0.1, 2.0), patch(-0.5, 0.1, 0.8, 1.0), patch(0.3, -0.7, -0.2, 0.5)];
        let component = |x: f64, y: f64, z: f64, bandwidth: f64| Component {
            axis: DVec3::new(x, y, z).normalize(),
            bandwidth,
            share: 0.4,
        };
        let components = [component(0.1, 1.0, 0.2, 5.0), component(-0.3, 0.2, 0.9, 0.7)];
        let (objective, mut unknowns) = SquaredError::new(&patches, 3.0, &components);
        unknowns[4] = 0.6;
        unknowns[5] *= 1.3;
        let (_, gradient) = objective.evaluate(&unknowns);
        for index in 0..unknowns.len() {
            let mut moved = unknowns.clone();
            moved[index] += 1e-5;
            let above = objective.evaluate(&moved).0;
            moved[index] -= 2e-5;
            let difference = (above - objective.evaluate(&moved).0) / 2e-5;
            assert!((difference - gradient[index]).abs() < 1e-8, "unknown {index}");
        }
    }
}
