//! Weighted expectation maximization for mixtures of von Mises-Fisher lobes. \[Banerjee et al. 2005\].
//!
//! Takes target points and lobes, and improves the lobes. Each step lowers the Kullback-Leibler
//! divergence from the target to the mixture. Sums run over fixed chunks in a fixed order, so the
//! number of threads does not affect a fit.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{
    component::{Component, bandwidth_from_shortfall, kernel_integral},
    points::{Point, PointSet},
};

/// Points per chunk, the unit of parallel work; keeps 32-bit sums short.
const CHUNK: usize = 128;
/// Lanes of the inner loops; lobes are padded to a multiple of it.
const LANES: usize = 8;
/// Chunks per group; fixed, to fix the order of sums.
const GROUP: usize = 8;
/// Stands for the logarithm of 0.
const NOTHING: f32 = -1e30;

/// One number for each of eight lobes, the operand of a vector instruction.
type Lanes = [f32; LANES];

/// Eight lobes in single precision. The last block is padded with lobes that own no points.
#[derive(Clone, Copy)]
struct Block {
    x: Lanes,
    y: Lanes,
    z: Lanes,
    bandwidth: Lanes,
    log_scale: Lanes,
}

fn pack(components: &[Component]) -> Vec<Block> {
    let log_scale = |c: &Component| {
        if c.share > 0.0 { (c.share / kernel_integral(c.bandwidth)).ln() as f32 } else { NOTHING }
    };
    let block = |group: &[Component]| {
        let lanes = |value: &dyn Fn(&Component) -> f32, padding: f32| {
            std::array::from_fn(|lane| group.get(lane).map_or(padding, value))
        };
        Block {
            x: lanes(&|c| c.axis.x as f32, 0.0),
            y: lanes(&|c| c.axis.y as f32, 0.0),
            z: lanes(&|c| c.axis.z as f32, 1.0),
            bandwidth: lanes(&|c| c.bandwidth as f32, 0.0),
            log_scale: lanes(&log_scale, NOTHING),
        }
    };
    components.chunks(LANES).map(block).collect()
}

/// Fills `row` with each lobe's responsibility for a point. Returns the logarithm of the mixture's
/// density there.
fn responsibilities(blocks: &[Block], point: Point, row: &mut [Lanes]) -> f32 {
    let Point { mean, slack } = point;
    let mut largest = [f32::MIN; LANES];
    for (block, values) in blocks.iter().zip(row.iter_mut()) {
        for k in 0..LANES {
            let (dx, dy, dz) = (mean.x - block.x[k], mean.y - block.y[k], mean.z - block.z[k]);
            let distance = 0.5 * (dx * dx + dy * dy + dz * dz) + slack;
            let value = block.log_scale[k] - block.bandwidth[k] * distance;
            values[k] = value;
            largest[k] = if value > largest[k] { value } else { largest[k] };
        }
    }
    let largest = largest.into_iter().fold(f32::MIN, f32::max);
    let mut sums = [0.0_f32; LANES];
    for values in row.iter_mut() {
        for k in 0..LANES {
            let value = fast_exp(values[k] - largest);
            values[k] = value;
            sums[k] += value;
        }
    }
    let sum: f32 = sums.iter().sum();
    let scale = 1.0 / sum;
    for values in row.iter_mut() {
        for value in values {
            *value *= scale;
        }
    }
    largest + sum.ln()
}

/// Computes `exp(x)` for −40 ≤ x ≤ 80 with a relative error of a few 1e-7, in a form that compilers
/// vectorize: 2ⁿ from the exponent bits, the rest from a polynomial. Above 80 it stays at e⁸⁰, below −40 at
/// e⁻⁴⁰: negligible, yet products with it avoid denormal numbers, which are a hundred times slower.
#[inline]
pub(crate) fn fast_exp(x: f32) -> f32 {
    /// 1.5·2²³: adding it rounds to an integer in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let x = if x < -40.0 { -40.0 } else { x };
    let x = if x > 80.0 { 80.0 } else { x };
    let power = x * std::f32::consts::LOG2_E;
    let rounded = power + ROUND;
    let f = (power - (rounded - ROUND)) * std::f32::consts::LN_2;
    let polynomial = 1.0
        + f * (1.0
            + f * (0.5
                + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0))))));
    f32::from_bits(polynomial.to_bits().wrapping_add(rounded.to_bits() << 23))
}

/// Sums `WIDTH` numbers per lobe, and the divergence, over the points. Calls `accumulate` for each
/// point and block of lobes with the lobes' responsibilities (times the point's weight), the x, y
/// and z distances to the point, the point's excess and the sums to add to.
fn sum_over_points<const WIDTH: usize>(
    points: &PointSet,
    components: &[Component],
    accumulate: impl Fn(&Lanes, [&Lanes; 3], f32, &mut [Lanes; WIDTH]) + Sync,
) -> (Vec<[f64; WIDTH]>, f64) {
    let blocks = pack(components);
    let sum_group = |group: usize| {
        let mut totals = vec![[0.0_f64; WIDTH]; components.len()];
        let mut divergence = 0.0;
        let mut sums = vec![[[0.0_f32; LANES]; WIDTH]; blocks.len()];
        let mut row = vec![[0.0_f32; LANES]; blocks.len()];
        let end = ((group + 1) * GROUP * CHUNK).min(points.len());
        for start in (group * GROUP * CHUNK..end).step_by(CHUNK) {
            sums.fill([[0.0; LANES]; WIDTH]);
            for index in start..(start + CHUNK).min(end) {
                let point = points.places[index];
                let log_density = responsibilities(&blocks, point, &mut row);
                let excess = points.log_density[index] - log_density;
                let weight = points.weight[index];
                divergence += f64::from(weight) * f64::from(excess);
                for ((block, values), sums) in blocks.iter().zip(&row).zip(&mut sums) {
                    let mut share = [0.0; LANES];
                    let (mut dx, mut dy, mut dz) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
                    for k in 0..LANES {
                        share[k] = weight * values[k];
                        dx[k] = point.mean.x - block.x[k];
                        dy[k] = point.mean.y - block.y[k];
                        dz[k] = point.mean.z - block.z[k];
                    }
                    accumulate(&share, [&dx, &dy, &dz], excess, sums);
                }
            }
            for (k, total) in totals.iter_mut().enumerate() {
                for (total, lanes) in total.iter_mut().zip(&sums[k / LANES]) {
                    *total += f64::from(lanes[k % LANES]);
                }
            }
        }
        (totals, divergence)
    };
    let groups: Vec<_> =
        (0..points.len().div_ceil(GROUP * CHUNK)).into_par_iter().map(sum_group).collect();
    let mut totals = vec![[0.0_f64; WIDTH]; components.len()];
    let mut divergence = 0.0;
    for (partial, value) in groups {
        divergence += value;
        for (total, row) in totals.iter_mut().zip(partial) {
            for (total, value) in total.iter_mut().zip(row) {
                *total += value;
            }
        }
    }
    (totals, divergence)
}

/// Performs one step: computes the lobes' responsibilities for the points, then each lobe's axis,
/// bandwidth and share from its points. A lobe that has lost every point keeps axis and bandwidth
/// with share 0. Returns the divergence (nats) *before* the step.
pub fn step(points: &PointSet, components: &mut [Component]) -> f64 {
    let (sums, divergence) =
        sum_over_points::<4>(points, components, |share, [dx, dy, dz], _, sums| {
            let [shares, drift_x, drift_y, drift_z] = sums;
            for k in 0..LANES {
                shares[k] += share[k];
                drift_x[k] += share[k] * dx[k];
                drift_y[k] += share[k] * dy[k];
                drift_z[k] += share[k] * dz[k];
            }
        });
    let total: f64 = sums.iter().map(|sums| sums[0]).sum();
    for (component, [share, drift_x, drift_y, drift_z]) in components.iter_mut().zip(sums) {
        component.share = share / total;
        if share < 1e-12 {
            component.share = 0.0;
            continue;
        }
        // Express the mean direction as the old axis (as the sums saw it) plus a drift, so that 1 −
        // |mean| keeps its digits.
        let axis = component.axis.as_vec3().as_dvec3();
        let drift = DVec3::new(drift_x, drift_y, drift_z) / share;
        let mean = axis + drift;
        let length = mean.length();
        let defect = (1.0 - axis.length_squared()) - 2.0 * axis.dot(drift) - drift.length_squared();
        if length > 1e-6 {
            component.axis = mean / length;
        }
        component.bandwidth = bandwidth_from_shortfall(defect / (1.0 + length));
    }
    divergence
}

/// Performs one step that changes only the shares.
pub(crate) fn reweigh(points: &PointSet, components: &mut [Component]) {
    let (sums, _) = sum_over_points::<1>(points, components, |share, _, _, sums| {
        for k in 0..LANES {
            sums[0][k] += share[k];
        }
    });
    let total: f64 = sums.iter().map(|sums| sums[0]).sum();
    for (component, [share]) in components.iter_mut().zip(sums) {
        component.share = share / total;
    }
}

/// Performs at most `steps` steps, until one lowers the divergence by less than `tolerance`.
/// Returns the divergence before the last step.
pub(crate) fn maximize(
    points: &PointSet,
    components: &mut [Component],
    steps: usize,
    tolerance: f64,
) -> f64 {
    let mut last = f64::INFINITY;
    for _ in 0..steps {
        let divergence = step(points, components);
        if last - divergence < tolerance {
            return divergence;
        }
        last = divergence;
    }
    last
}

/// Statistics of a lobe that decide which lobes to split, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Holding {
    /// The lobe's contribution to the divergence, nats: `Σ γ w ln(p/q)`.
    pub divergence: f64,
    /// Covariance of the points about the axis, weighted by responsibility.
    pub covariance: DMat3,
}

/// Computes divergence and covariance per lobe.
pub(crate) fn holdings(points: &PointSet, components: &[Component]) -> Vec<Holding> {
    let (sums, _) =
        sum_over_points::<8>(points, components, |share, [dx, dy, dz], excess, sums| {
            for k in 0..LANES {
                sums[0][k] += share[k];
                sums[1][k] += share[k] * excess;
                sums[2][k] += share[k] * dx[k] * dx[k];
                sums[3][k] += share[k] * dy[k] * dy[k];
                sums[4][k] += share[k] * dz[k] * dz[k];
                sums[5][k] += share[k] * dx[k] * dy[k];
                sums[6][k] += share[k] * dx[k] * dz[k];
                sums[7][k] += share[k] * dy[k] * dz[k];
            }
        });
    let holding = |[share, divergence, xx, yy, zz, xy, xz, yz]: [f64; 8]| {
        let columns = DMat3::from_cols(
            DVec3::new(xx, xy, xz),
            DVec3::new(xy, yy, yz),
            DVec3::new(xz, yz, zz),
        );
        Holding { divergence, covariance: columns * (1.0 / share.max(1e-30)) }
    };
    sums.into_iter().map(holding).collect()
}

#[cfg(test)]
mod tests {
    use super::fast_exp;

    #[test]
    fn fast_exponential_is_exact_to_single_precision() {
        for i in 0..4000 {
            let x = -0.01 * i as f32;
            let exact = f64::from(x).exp();
            let error = (f64::from(fast_exp(x)) / exact - 1.0).abs();
            // Allow for rounding the argument to a multiple of ln 2.
            assert!(error < 4e-7 + 1e-7 * f64::from(-x), "{x}: {error}");
        }
        assert!(fast_exp(-1e30) < 5e-18);
    }
}
