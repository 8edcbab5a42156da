//! Colour amplitudes of lobes whose shapes are given: non-negative least squares per channel.
//!
//! Minimizes `∫(L − Σ a_l G_l)² dω` over a ≥ 0. The Gram matrix `∫G_iG_j` is in closed form
//! (\[Wu & Shih 2009\] Eq. 7), so that lobes narrower than a patch are not mistaken for nothing; only
//! `∫L·G_i` is summed over patches.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    component::{Component, convolution},
    grid::ColouredPatch,
};

/// Coordinate updates per fit at most; bounds the time of large fits.
const MAX_UPDATES: usize = 400_000_000;
/// Sweeps at most.
const MAX_SWEEPS: usize = 400;
/// Largest change of a sweep, relative to the largest amplitude, at which it ends.
const TOLERANCE: f64 = 1e-5;

/// Amplitudes per lobe and channel. `start` holds the first guess.
pub fn colour_amplitudes(
    patches: &[ColouredPatch],
    components: &[Component],
    start: &[DVec3],
) -> Vec<DVec3> {
    let count = components.len();
    let gram: Vec<Vec<f64>> = components
        .par_iter()
        .map(|a| components.iter().map(|b| convolution(a, b)).collect())
        .collect();
    let target: Vec<DVec3> = components
        .par_iter()
        .map(|component| {
            let kernel = |patch: &ColouredPatch| {
                if patch.patch.energy <= 0.0 {
                    return DVec3::ZERO;
                }
                let mean = patch.patch.moment / patch.patch.energy;
                patch.colour * (component.bandwidth * (mean.dot(component.axis) - 1.0)).exp()
            };
            patches.iter().map(kernel).sum()
        })
        .collect();
    let mut amplitudes = start.to_vec();
    // What is left of the target: ∫(L − F)·G_i.
    let mut residual: Vec<DVec3> = (0..count)
        .map(|i| target[i] - (0..count).map(|j| gram[i][j] * amplitudes[j]).sum::<DVec3>())
        .collect();
    let sweeps = (MAX_UPDATES / (count * count).max(1)).clamp(1, MAX_SWEEPS);
    for _ in 0..sweeps {
        let mut largest_change = 0.0_f64;
        for i in 0..count {
            let next = (amplitudes[i] + residual[i] / gram[i][i]).max(DVec3::ZERO);
            let change = next - amplitudes[i];
            if change == DVec3::ZERO {
                continue;
            }
            amplitudes[i] = next;
            for (residual, value) in residual.iter_mut().zip(&gram[i]) {
                *residual -= *value * change;
            }
            largest_change = largest_change.max(change.abs().max_element());
        }
        let largest = amplitudes.iter().map(|a| a.max_element()).fold(0.0, f64::max);
        if largest_change < TOLERANCE * largest {
            break;
        }
    }
    amplitudes
}
