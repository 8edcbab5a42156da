//! Points → mixture of any size: k-means++ for the first lobes, then splits.
//!
//! Growth splits the lobes with the most divergence, a quarter of the mixture at a time, with a few
//! steps of expectation maximization between. A mixture of 2n lobes thus starts where that of n
//! lobes ended and cannot be worse.

use glam::{DMat3, DVec3};

use super::{
    component::{Component, MAX_BANDWIDTH, MIN_BANDWIDTH, bandwidth_from_shortfall},
    config,
    expectation::{holdings, maximize},
    points::PointSet,
};

/// Reproducible numbers in [0, 1): splitmix64 \[Steele et al. 2014\], seeded alike for every fit.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Index of the first entry at which the running sum of `weights` exceeds `target`.
fn choose(weights: &[f64], target: f64) -> usize {
    let mut sum = 0.0;
    let mut last = 0;
    for (index, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
        sum += weight;
        last = index;
        if sum > target {
            break;
        }
    }
    last
}

/// Places at most `count` lobes, at most one per point, with probability proportional to a point's
/// energy and squared distance to the lobes so far. \[Arthur & Vassilvitskii 2007\].
fn k_means_plus_plus(points: &PointSet, count: usize, seed: u64) -> Vec<Component> {
    let mut random = Random(seed);
    let mut distances = vec![1.0_f64; points.len()];
    let mut axes: Vec<DVec3> = Vec::new();
    while axes.len() < count {
        let weights: Vec<f64> =
            distances.iter().zip(&points.weight).map(|(d, w)| d * f64::from(*w)).collect();
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            break;
        }
        let chosen = choose(&weights, random.uniform() * total);
        let axis = points.mean(chosen).normalize_or(DVec3::Y);
        for (index, distance) in distances.iter_mut().enumerate() {
            *distance = distance.min(1.0 - points.mean(index).dot(axis));
        }
        distances[chosen] = 0.0;
        axes.push(axis);
    }
    let nearest = |index: usize| {
        let mean = points.mean(index);
        let nearer = |a: &usize, b: &usize| mean.dot(axes[*a]).total_cmp(&mean.dot(axes[*b]));
        (0..axes.len()).max_by(nearer).unwrap_or(0)
    };
    let mut energies = vec![0.0_f64; axes.len()];
    let mut moments = vec![DVec3::ZERO; axes.len()];
    for index in 0..points.len() {
        let cluster = nearest(index);
        energies[cluster] += f64::from(points.weight[index]);
        moments[cluster] += f64::from(points.weight[index]) * points.mean(index);
    }
    let component = |k: usize| {
        let mean = moments[k] / energies[k].max(1e-30);
        Component {
            axis: mean.normalize_or(axes[k]),
            bandwidth: bandwidth_from_shortfall(1.0 - mean.length()),
            share: energies[k],
        }
    };
    (0..axes.len()).map(component).collect()
}

/// Eigenvalues of a covariance in the plane across `axis`: the larger, its eigenvector, the smaller.
fn principal(covariance: DMat3, axis: DVec3) -> (f64, DVec3, f64) {
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    let a = tangent.dot(covariance * tangent);
    let b = tangent.dot(covariance * bitangent);
    let c = bitangent.dot(covariance * bitangent);
    let middle = 0.5 * (a + c);
    let radius = (0.25 * (a - c) * (a - c) + b * b).sqrt();
    let angle = 0.5 * (2.0 * b).atan2(a - c);
    (middle + radius, angle.cos() * tangent + angle.sin() * bitangent, (middle - radius).max(0.0))
}

/// Splits the `count` lobes with the most divergence along their longest extent. Appends the second halves.
fn split(points: &PointSet, components: &mut Vec<Component>, count: usize) {
    let held = holdings(points, components);
    let mut order: Vec<usize> = (0..components.len()).collect();
    order.sort_by(|a, b| held[*b].divergence.total_cmp(&held[*a].divergence).then(a.cmp(b)));
    order.retain(|k| components[*k].share > 0.0);
    for &parent in order.iter().take(count) {
        let Component { axis, share, bandwidth } = components[parent];
        let (long, direction, short) = principal(held[parent].covariance, axis);
        let offset = (config::SPLIT_OFFSET * long.sqrt()).clamp(1e-4, 1.0);
        // Average the variance left along the split with that across it.
        let rest = long * (1.0 - config::SPLIT_OFFSET * config::SPLIT_OFFSET).max(0.0);
        let variance = 0.5 * (rest + short);
        let bandwidth = (1.0 / variance.max(1e-9)).max(bandwidth);
        let bandwidth = bandwidth.clamp(MIN_BANDWIDTH, MAX_BANDWIDTH);
        let child = |sign: f64| Component {
            axis: (axis + sign * offset * direction).normalize(),
            bandwidth,
            share: 0.5 * share,
        };
        components[parent] = child(1.0);
        components.push(child(-1.0));
    }
}

/// Returns the best of several starts. One start may place two lobes together and none elsewhere,
/// which expectation maximization does not undo.
fn start(points: &PointSet, count: usize) -> Vec<Component> {
    let attempt = |attempt: u64| {
        let mut components = k_means_plus_plus(points, count, config::SEED + attempt);
        let steps = config::START_STEPS;
        let divergence = maximize(points, &mut components, steps, config::GROWTH_TOLERANCE);
        (divergence, components)
    };
    (0..config::STARTS)
        .map(attempt)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, components)| components)
        .unwrap_or_default()
}

/// Grows a mixture of `count` lobes, or of as many as there are points. `progress` receives the
/// share of the work that is done.
pub(crate) fn grow(
    points: &PointSet,
    count: usize,
    progress: &mut dyn FnMut(f64),
) -> Vec<Component> {
    let count = count.min(points.len());
    let mut components = start(points, count.min(config::FIRST_LOBES));
    while components.len() < count {
        let size = components.len();
        let next = (size + size.div_ceil(4)).min(count);
        split(points, &mut components, next - size);
        let grown = components.len();
        maximize(points, &mut components, config::GROWTH_STEPS, config::GROWTH_TOLERANCE);
        progress(0.5 * grown as f64 / count as f64);
        if grown == size {
            break;
        }
    }
    for round in 0..config::FINAL_ROUNDS {
        maximize(points, &mut components, config::FINAL_STEPS, config::FINAL_TOLERANCE);
        progress(0.5 + 0.5 * (round + 1) as f64 / config::FINAL_ROUNDS as f64);
    }
    components.retain(|component| component.share > 0.0);
    components
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_split_along_their_longest_axis() {
        // Variances 4 and 1 along two directions of the tangent plane, and 9 along the axis itself.
        for turn in [0.0_f64, 0.4, 1.3, 2.0, 3.0] {
            let (long, across) = (DVec3::new(turn.cos(), turn.sin(), 0.0), DVec3::Z);
            let short = across.cross(long);
            let outer = |v: DVec3| DMat3::from_cols(v.x * v, v.y * v, v.z * v);
            let covariance = outer(long) * 4.0 + outer(short) + outer(across) * 9.0;
            let (largest, direction, smallest) = principal(covariance, across);
            assert!((largest - 4.0).abs() < 1e-12 && (smallest - 1.0).abs() < 1e-12);
            assert!((direction.dot(long).abs() - 1.0).abs() < 1e-12, "{direction} for {long}");
        }
    }
}
