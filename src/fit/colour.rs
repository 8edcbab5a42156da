//! Colour amplitudes of lobes of given shapes, by the objective of the fit.
//!
//! Under the divergence, expectation maximization with fixed shapes finds each channel's shares: no
//! channel loses energy, and a sun spoils nothing. Under the squared error, amplitudes a ≥ 0
//! minimize `∫(L − Σ a_l G_l)² dω`: closest to the map where it is bright, at the cost of the
//! surroundings of a sun. The Gram matrix `∫G_iG_j` has a closed form (\[Wu & Shih 2009\] Eq. 7),
//! so lobes narrower than a patch still count; only `∫L·G_i` is summed over patches.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    component::{Component, convolution, kernel_integral},
    config,
    expectation::reweigh,
    grid::ColouredPatch,
    points::{PointSet, blurred},
};

/// Most coordinate updates per fit; bounds the time of large fits.
const MAX_UPDATES: usize = 400_000_000;
const MAX_SWEEPS: usize = 400;
/// Largest change in a sweep, relative to the largest amplitude, at which sweeps end.
const TOLERANCE: f64 = 1e-5;

/// Finds amplitudes per lobe and channel that lower each channel's divergence.
pub(crate) fn divergence_colours(
    patches: &[ColouredPatch],
    components: &[Component],
) -> Vec<DVec3> {
    let channel = |index: usize| -> Vec<f64> {
        let points =
            PointSet::weighted(patches.iter().map(|patch| (&patch.patch, patch.colour[index])));
        if points.is_empty() {
            return vec![0.0; components.len()];
        }
        let mut weighted = components.to_vec();
        for _ in 0..config::COLOUR_STEPS {
            reweigh(&points, &mut weighted);
        }
        weighted.iter().map(|c| points.energy * c.share / kernel_integral(c.bandwidth)).collect()
    };
    let [red, green, blue] = [0, 1, 2].map(channel);
    (0..components.len()).map(|k| DVec3::new(red[k], green[k], blue[k])).collect()
}

/// Finds the amplitudes per lobe and channel of the smallest squared error, from the guess `start`.
pub(crate) fn least_squares_colours(
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
                let (direction, variance) = patch.patch.spread()?;
                let (bandwidth, factor) = blurred(component.bandwidth, variance);
                let exponent = bandwidth * (direction.dot(component.axis) - 1.0);
                Some(patch.colour * factor * exponent.exp())
            };
            patches.iter().filter_map(kernel).sum()
        })
        .collect();
    let mut amplitudes = start.to_vec();
    // Residual of the target: ∫(L − F)·G_i.
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
