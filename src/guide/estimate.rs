//! Counts of visible rays → probability of every region, for one cell.
//!
//! Where a cell has seen little, it leans on what its surroundings have seen: a fine cell on its
//! coarse cell, that on all cells of its face, those on the rate of the whole scene. A fine cell
//! that differs from its coarse cell does so over whole parts of the sky, so the coarse cell's rate
//! is first scaled by what the cell found in the angular parent of the region.

use glam::Vec3;

use super::partition::{Partition, Region};

/// Weight of the prior, in rays.
const PRIOR: f64 = 4.0;
/// Largest factor by which a parent region raises the prior.
const LARGEST_RATIO: f64 = 8.0;
/// Least estimate of visibility.
const FLOOR: f64 = 1e-4;
/// Share of the regions' probability that does not look at what was learned.
const DEFENSIVE_SHARE: f64 = 0.05;

/// Probabilities of regions are multiples of one over this.
const REGION_SCALE: u32 = 1 << 16;
/// Levels of the estimate of visibility that candidates are weighted with.
pub const VISIBILITY_LEVELS: u32 = 64;
/// Exponent of the visibility in the weight of a candidate.
const TARGET_EXPONENT: f32 = 0.7;
/// Binary orders of magnitude that the levels cover.
const TARGET_RANGE: f32 = 10.5;

/// What experiments turn off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EstimateOptions {
    /// Whether cells lean on coarser ones; else on the rate of the whole scene.
    pub hierarchy: bool,
    /// Whether the share of rays from the BRDF is learned; else it goes by the material.
    pub learned_share: bool,
}

impl Default for EstimateOptions {
    fn default() -> Self {
        Self { hierarchy: true, learned_share: true }
    }
}

/// Estimates of visibility of every region.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates(pub Vec<f64>);

/// A ray, as it is counted: regions that are split anew share what was counted.
pub const PARTS_PER_RAY: u64 = 16;

/// Hits and trials per region, [`PARTS_PER_RAY`] for each ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Rays that reached the environment.
    pub hits: u64,
    /// Rays traced, and directions that brought nothing.
    pub trials: u64,
}

impl Count {
    /// Rays that reached the environment; of regions that were split anew, a share.
    pub fn hits_in_rays(self) -> f64 {
        self.hits as f64 / PARTS_PER_RAY as f64
    }

    /// Rays traced; of regions that were split anew, a share.
    pub fn trials_in_rays(self) -> f64 {
        self.trials as f64 / PARTS_PER_RAY as f64
    }

    fn rate(self, prior: f64, weight: f64) -> f64 {
        (self.hits_in_rays() + weight * prior) / (self.trials_in_rays() + weight)
    }

    /// Adds `share` of another count.
    pub fn add_share(&mut self, other: Self, share: f64) {
        self.hits += (other.hits as f64 * share).round() as u64;
        self.trials += (other.trials as f64 * share).round() as u64;
    }
}

impl Estimates {
    /// Of all cells of one face, against the rate of the whole scene.
    pub fn of_face(counts: &[Count], scene: Count) -> Self {
        let rate = (scene.hits_in_rays() + 1.0) / (scene.trials_in_rays() + 2.0);
        Self(counts.iter().map(|count| count.rate(rate, 2.0)).collect())
    }

    /// Of a coarse cell, against its face.
    pub fn of_coarse(counts: &[Count], face: &Self) -> Self {
        let rates = counts.iter().zip(&face.0).map(|(count, prior)| count.rate(*prior, PRIOR));
        Self(rates.collect())
    }

    /// Of a fine cell, against its coarse cell, region by region and parent by parent.
    pub fn of_fine(counts: &[Count], coarse: &Self, partition: &Partition) -> Self {
        let mut found = vec![0.0; partition.parent_count];
        let mut expected = vec![0.0; partition.parent_count];
        for ((count, prior), region) in counts.iter().zip(&coarse.0).zip(&partition.regions) {
            found[region.parent] += count.hits_in_rays();
            expected[region.parent] += count.trials_in_rays() * prior;
        }
        let rates = counts.iter().zip(&coarse.0).zip(&partition.regions);
        Self(
            rates
                .map(|((count, prior), region)| {
                    let ratio = (found[region.parent] + 1.0) / (expected[region.parent] + 1.0);
                    count.rate((prior * ratio.clamp(0.0, LARGEST_RATIO)).min(1.0), PRIOR)
                })
                .collect(),
        )
    }

    /// The entries of the device for a cell whose surfaces point along `normal`: cumulative
    /// probabilities of the regions with, for each, its probability divided by its share of the
    /// energy and the visibility that weights candidates. See [`decode_entry`].
    pub fn entries(&self, normal: Vec3, partition: &Partition) -> Vec<[u32; 2]> {
        let normal = normal.as_dvec3();
        let guided = |(visibility, region): (&f64, &Region)| {
            let facing = ((normal.dot(region.direction) + 0.25) / 1.25).max(0.03);
            region.share * facing * visibility.max(FLOOR)
        };
        let mut weights: Vec<f64> = self.0.iter().zip(&partition.regions).map(guided).collect();
        let sum = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        for (weight, region) in weights.iter_mut().zip(&partition.regions) {
            *weight = (1.0 - DEFENSIVE_SHARE) * *weight / sum + DEFENSIVE_SHARE * region.share;
        }
        let parts = whole_parts(&weights);
        let steps = (VISIBILITY_LEVELS - 1) as f32;
        let per_octave = TARGET_EXPONENT / TARGET_RANGE * steps;
        let starts = interval_starts(&parts);
        let mut before = 0;
        let mut entries = Vec::with_capacity(weights.len());
        for (((part, start), visibility), region) in
            parts.iter().zip(starts).zip(&self.0).zip(&partition.regions)
        {
            let probability = f64::from(*part) / f64::from(REGION_SCALE);
            let ratio = if region.share > 0.0 { (probability / region.share) as f32 } else { 0.0 };
            let octaves = -(*visibility as f32).clamp(1e-5, 1.0).log2();
            let level = (octaves * per_octave).round().min(steps) as u32;
            // What follows the last region that can be drawn is never looked at.
            let word = before.min(REGION_SCALE - 1) | start << 16 | level << 26;
            entries.push([ratio.to_bits(), word]);
            before += part;
        }
        entries
    }
}

/// Whole numbers in proportion to `weights` that sum to [`REGION_SCALE`], at least 1 where there is
/// any weight: what is drawn, however seldom, keeps the sampler unbiased. All 0 if the weights are.
fn whole_parts(weights: &[f64]) -> Vec<u32> {
    let sum: f64 = weights.iter().sum();
    if sum <= 0.0 || sum.is_subnormal() {
        return vec![0; weights.len()];
    }
    let scale = f64::from(REGION_SCALE - weights.len() as u32) / sum;
    let part = |weight: f64| if weight > 0.0 { 1 + (weight * scale) as u32 } else { 0 };
    let mut parts: Vec<u32> = weights.iter().map(|&weight| part(weight)).collect();
    // What rounding down leaves over goes to the largest.
    let total: u32 = parts.iter().sum();
    if let Some(largest) = parts.iter_mut().max_by_key(|part| **part) {
        *largest += REGION_SCALE.saturating_sub(total);
    }
    parts
}

/// For each of as many equal intervals as there are regions, the last region that begins at or before
/// its start; for the first, where that is the first one, the last region that can be drawn.
fn interval_starts(parts: &[u32]) -> Vec<u32> {
    let count = parts.len() as u64;
    let mut starts = Vec::with_capacity(parts.len());
    let (mut region, mut end) = (0, parts.first().copied().unwrap_or(0));
    for interval in 0..count {
        // The least 32 bits that fall into the interval, and their upper half.
        let least = ((interval << 32).div_ceil(count) >> 16) as u32;
        while end <= least && region + 1 < parts.len() {
            region += 1;
            end += parts[region];
        }
        starts.push(region as u32);
    }
    if let (Some(first), Some(last)) = (starts.first_mut(), parts.iter().rposition(|&p| p > 0)) {
        *first = last as u32;
    }
    starts
}

/// Ratio of probability to share, cumulative probability of the regions before in 65,536ths, first
/// region of the interval (of the first one, the last region) and weight of visibility of an entry; twin of what `glsl/include/guide.glsl` reads.
pub fn decode_entry(entry: [u32; 2]) -> (f32, u32, u32, f32) {
    let level = (entry[1] >> 26) as f32;
    let range = TARGET_RANGE;
    let weight = (-level * (range / (VISIBILITY_LEVELS - 1) as f32)).exp2();
    (f32::from_bits(entry[0]), entry[1] & 0xffff, entry[1] >> 16 & 0x3ff, weight)
}

/// V̂, the estimate of visibility that an entry was made from, in steps of its levels.
pub fn decode_visibility(entry: [u32; 2]) -> f64 {
    f64::from(decode_entry(entry).3.powf(1.0 / TARGET_EXPONENT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_fill_the_scale_and_leave_out_nothing_that_has_weight() {
        for weights in [vec![0.0, 1e-12, 3.0, 0.0, 1.0, 0.0], vec![1.0; 1024], vec![0.0, 5.0]] {
            let parts = whole_parts(&weights);
            assert_eq!(parts.iter().sum::<u32>(), REGION_SCALE);
            for (weight, part) in weights.iter().zip(&parts) {
                assert_eq!(*weight > 0.0, *part > 0, "{weight} {part}");
            }
        }
        assert_eq!(whole_parts(&[0.0; 3]), [0; 3]);
    }

    #[test]
    fn intervals_start_where_a_search_from_the_first_region_would_arrive() {
        let parts = whole_parts(&[0.0, 0.1, 0.0, 7.0, 1e-9, 2.0, 0.5, 0.0, 0.0]);
        let starts = interval_starts(&parts);
        assert_eq!(starts[0], 6, "the last region that can be drawn");
        let count = parts.len() as u64;
        for bits in (0..=u32::MAX).step_by(99_991) {
            let mut end = 0;
            let wanted = parts.iter().position(|part| {
                end += part;
                bits >> 16 < end
            });
            let interval = ((u64::from(bits) * count) >> 32) as usize;
            let low = if interval == 0 { 0 } else { starts[interval] };
            let high = starts[(interval + 1) % parts.len()];
            let wanted = wanted.map_or(u32::MAX, |region| region as u32);
            assert!((low..=high).contains(&wanted), "{bits}: {wanted} not in {low} to {high}");
        }
    }
}
