//! Separable part of a measured BRDF: g(θ_o)·g(θ_i) per channel, nowhere above the BRDF.
//!
//! The light that such a part reflects looks the same from all directions but for a factor, so that
//! the pixels of a cohort can share it (`glsl/include/base.glsl`). g is made as large as it can be by
//! coordinate ascent, directions next to the normal first, since most light is there.

use std::f32::consts::PI;

use glam::{Vec3, vec3};
use rayon::prelude::*;

use crate::measured::{layout::*, lookup};

/// Intervals between the nodes of g.
const INTERVALS: usize = BRDF_COSINE_INTERVALS as usize;
/// Points on each side of an interval at which the BRDF is looked up, its ends included.
const POINTS: usize = 2 * INTERVALS + 1;
/// Points over the azimuth between the directions, 0…π.
const AZIMUTHS: usize = 24;
/// Share of the least value found that g may use up: the BRDF is lower still between the points.
const MARGIN: f32 = 0.97;
/// Rounds of relaxation and of ascent; they settle after a few.
const ROUNDS: usize = 16;

/// Values of g at the nodes of the cosine 0…1, square root of 1/sr, for the grid in `words`.
pub(super) fn separable_base(words: &[u32]) -> Vec<Vec3> {
    let least = least_values(words);
    let channels: Vec<Vec<f32>> = (0..3)
        .map(|channel| {
            let bound = |a: usize, b: usize| MARGIN * least[a.max(b)][a.min(b)][channel];
            nodes_below(&largest_factors(bound))
        })
        .collect();
    (0..=INTERVALS)
        .map(|node| vec3(channels[0][node], channels[1][node], channels[2][node]))
        .collect()
}

/// Least value of the BRDF over each pair of intervals of the cosines, the later one first.
fn least_values(words: &[u32]) -> Vec<Vec<Vec3>> {
    let direction = |point: usize, phi: f32| {
        // At the horizon itself angles are undefined.
        let cosine = (point as f32 / (POINTS - 1) as f32).max(1e-3);
        let sine = (1.0 - cosine * cosine).sqrt();
        vec3(sine * phi.cos(), sine * phi.sin(), cosine)
    };
    let at_points: Vec<Vec<Vec3>> = (0..POINTS)
        .into_par_iter()
        .map(|first| {
            let outgoing = direction(first, 0.0);
            let least = |second: usize| {
                (0..AZIMUTHS)
                    .map(|index| {
                        let phi = index as f32 / (AZIMUTHS - 1) as f32 * PI;
                        let incident = direction(second, phi);
                        let angles = lookup::half_difference_angles(outgoing, incident);
                        lookup::measured_value(words, 0, angles)
                    })
                    .fold(Vec3::INFINITY, Vec3::min)
            };
            (0..=first).map(least).collect()
        })
        .collect();
    let pair = |a: usize, b: usize| at_points[a.max(b)][a.min(b)];
    (0..INTERVALS)
        .map(|a| {
            let of_pair = |b: usize| {
                (2 * a..=2 * a + 2)
                    .flat_map(|first| (2 * b..=2 * b + 2).map(move |second| (first, second)))
                    .map(|(first, second)| pair(first, second))
                    .fold(Vec3::INFINITY, Vec3::min)
            };
            (0..=a).map(of_pair).collect()
        })
        .collect()
}

/// Factors h of the intervals with h_a·h_b at most `bound(a, b)` for all pairs: lowers those that
/// break a bound, the one nearer the horizon more, then raises each as far as the others let it.
fn largest_factors(bound: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    let mut factors: Vec<f32> = (0..INTERVALS).map(|a| bound(a, a).sqrt()).collect();
    for _ in 0..ROUNDS {
        for a in (0..INTERVALS).rev() {
            for b in 0..a {
                let excess = factors[a] * factors[b] / bound(a, b);
                if excess > 1.0 {
                    let share = (b as f32 + 0.5) / ((a + b) as f32 + 1.0);
                    factors[a] /= if excess.is_finite() { excess.powf(share) } else { 1.0 };
                    factors[b] /= excess.powf(1.0 - share);
                }
            }
        }
    }
    for _ in 0..ROUNDS {
        for a in (0..INTERVALS).rev() {
            let others = (0..INTERVALS)
                .filter(|b| *b != a && factors[*b] > 0.0)
                .map(|b| bound(a, b) / factors[b])
                .fold(f32::INFINITY, f32::min);
            factors[a] = bound(a, a).sqrt().min(others);
        }
    }
    factors
}

/// Values at the nodes such that the lines between them stay below the factors of the intervals.
fn nodes_below(factors: &[f32]) -> Vec<f32> {
    (0..=factors.len())
        .map(|node| {
            let before = node.checked_sub(1).map_or(f32::INFINITY, |interval| factors[interval]);
            before.min(factors.get(node).copied().unwrap_or(f32::INFINITY))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::{measured::MeasuredTable, measured::lookup::cosine_table};

    fn base(words: &[u32], cosine: f32) -> Vec3 {
        let channel = |channel| cosine_table(words, MEASURED_BASE_OFFSET + channel, 3, cosine);
        vec3(channel(0), channel(1), channel(2))
    }

    /// Directions of an additive lattice of irrational steps over the hemisphere, uniform in cosine.
    fn direction(index: u32, steps: [f64; 2]) -> Vec3 {
        let part = |step: f64| (0.5 + f64::from(index) * step).fract() as f32;
        let (cosine, phi) = (part(steps[0]), 2.0 * PI * part(steps[1]));
        let sine = (1.0 - cosine * cosine).sqrt();
        vec3(sine * phi.cos(), sine * phi.sin(), cosine)
    }

    #[test]
    fn the_base_is_below_the_brdf_and_close_to_it_where_that_is_diffuse() {
        // A lobe on a diffuse base that is darker near the horizon.
        let value = |outgoing: Vec3, incident: Vec3| {
            let half_vector = (outgoing + incident).normalize();
            let base = vec3(0.2, 0.1, 0.0) * outgoing.z.powf(0.3) * incident.z.powf(0.3);
            base + 2.0 * half_vector.z.powi(400)
        };
        let table = MeasuredTable::tabulate(value).unwrap();
        let mut shares = Vec::new();
        for index in 0..20_000 {
            let outgoing = direction(index, [0.819_172_5, 0.671_043_6]);
            let incident = direction(index, [0.549_700_5, 0.350_284_7]);
            let measured = table.evaluate(outgoing, incident);
            let base = base(table.words(), outgoing.z) * base(table.words(), incident.z);
            assert!(base.cmple(measured).all(), "{outgoing} {incident}: {base} over {measured}");
            let diffuse = 0.2 * outgoing.z.powf(0.3) * incident.z.powf(0.3);
            shares.push(f64::from(base.x / diffuse));
        }
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        assert!(mean > 0.85, "the base holds {mean} of the diffuse part");
    }
}
