//! Counts of visible rays and of what they brought → probability of every region, for one cell.
//!
//! A region's probability is in proportion to its energy, to a power of the visibility V̂ = hits / trials,
//! and to the response: the mean over the rays that hit of BRDF · cosine, weighed by the light's colours.
//! The response is the product with the BRDF that Tsai et al. (2008) take at every hit, as the mean over
//! the surfaces of a cell and the directions they are seen from; the cell of a flat wall has nearly one of
//! each.
//!
//! Where a cell has seen little, it leans on what its surroundings have seen: a fine cell on its
//! coarse cell, that on all cells of its face, those on the rate of the whole scene and on a cosine. A
//! fine cell that differs from its coarse cell does so over whole parts of the sky, so what the coarse
//! cell says is first scaled by what the cell found in the angular parent of the region.

use glam::Vec3;

use super::partition::{Partition, Region};
use crate::gpu::constants::GUIDE_COUNT_WORDS;

/// Weight of the prior, in rays.
const PRIOR: f64 = 4.0;
/// Weight of the prior of the response, in rays that hit.
const RESPONSE_PRIOR: f64 = 16.0;
/// Largest factor by which a parent region raises the prior.
const LARGEST_RATIO: f64 = 8.0;
/// Exponent of the visibility in the probability of a region. Least variance asks for ½ where the response is
/// one number and the visibility of a cell is the same chance everywhere in it, and for 1 where hits of
/// a cell that see a region see all of it.
const VISIBILITY_EXPONENT: f64 = 0.8;
/// Least of that power.
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
    /// Whether the response is learned; else it is the cosine toward the normal of the face.
    pub learned_response: bool,
}

impl Default for EstimateOptions {
    fn default() -> Self {
        Self { hierarchy: true, learned_share: true, learned_response: true }
    }
}

/// What is believed of one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// V̂, the share of rays that reach the environment.
    pub visibility: f64,
    /// Mean response of those, in units of 1 / [`GUIDE_RESPONSE_UNITS`](crate::gpu::constants::GUIDE_RESPONSE_UNITS).
    pub response: f64,
}

/// Estimates of every region.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates(pub Vec<Estimate>);

/// Trials, hits and sum of the responses of the hits, as they lie on the device and in files.
pub type CountWords = [u32; GUIDE_COUNT_WORDS as usize];

/// A ray, as it is counted: regions that are split anew share what was counted.
pub const PARTS_PER_RAY: u64 = 16;

/// What was counted of one region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Rays that reached the environment, [`PARTS_PER_RAY`] for each.
    pub hits: u64,
    /// Rays traced, and directions that brought nothing, [`PARTS_PER_RAY`] for each.
    pub trials: u64,
    /// Sum of the responses of the rays that hit.
    pub response: u64,
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

    fn mean_response(self, prior: f64, weight: f64) -> f64 {
        (self.response as f64 + weight * prior) / (self.hits_in_rays() + weight)
    }

    /// Adds another count.
    pub fn add(&mut self, other: Self) {
        self.hits += other.hits;
        self.trials += other.trials;
        self.response += other.response;
    }

    /// Adds `share` of another count.
    pub fn add_share(&mut self, other: Self, share: f64) {
        self.hits += (other.hits as f64 * share).round() as u64;
        self.trials += (other.trials as f64 * share).round() as u64;
        self.response += (other.response as f64 * share).round() as u64;
    }
}

/// What was found, by what was expected; 1 where that is little.
#[derive(Clone, Copy, Debug, Default)]
struct Ratio {
    found: f64,
    expected: f64,
}

impl Ratio {
    fn add(&mut self, found: f64, expected: f64) {
        self.found += found;
        self.expected += expected;
    }

    /// Leaning on `prior` as if `weight` had been expected already.
    fn value(self, prior: f64, weight: f64) -> f64 {
        (self.found + weight * prior) / (self.expected + weight)
    }
}

impl Estimates {
    /// Of all cells of the face whose normal is `normal`, against the whole scene.
    pub fn of_face(counts: &[Count], scene: Count, normal: Vec3, partition: &Partition) -> Self {
        let rate = (scene.hits_in_rays() + 1.0) / (scene.trials_in_rays() + 2.0);
        let response = scene.mean_response(1.0, f64::MIN_POSITIVE);
        let prior = Self(
            partition
                .regions
                .iter()
                .map(|region| Estimate {
                    visibility: rate,
                    response: response * facing(normal, region),
                })
                .collect(),
        );
        prior.updated(counts, 2.0)
    }

    /// Of a coarse cell, against its face.
    pub fn of_coarse(counts: &[Count], face: &Self) -> Self {
        face.updated(counts, PRIOR)
    }

    /// With what was counted, where `self` is worth `weight` rays; its responses are scaled by what was
    /// found in all regions together.
    fn updated(&self, counts: &[Count], weight: f64) -> Self {
        let scale = self.response_ratio(counts);
        let update = |(count, prior): (&Count, &Estimate)| Estimate {
            visibility: count.rate(prior.visibility, weight),
            response: count.mean_response(prior.response * scale, RESPONSE_PRIOR),
        };
        Self(counts.iter().zip(&self.0).map(update).collect())
    }

    /// Responses found in all regions together by those expected here.
    fn response_ratio(&self, counts: &[Count]) -> f64 {
        let mut ratio = Ratio::default();
        for (count, prior) in counts.iter().zip(&self.0) {
            ratio.add(count.response as f64, count.hits_in_rays() * prior.response);
        }
        ratio.value(1.0, self.mean_response())
    }

    fn mean_response(&self) -> f64 {
        self.0.iter().map(|estimate| estimate.response).sum::<f64>() / self.0.len().max(1) as f64
    }

    /// Of a fine cell, against its coarse cell, region by region and parent by parent.
    pub fn of_fine(counts: &[Count], coarse: &Self, partition: &Partition) -> Self {
        let mut visible = vec![Ratio::default(); partition.parent_count];
        let mut responses = vec![Ratio::default(); partition.parent_count];
        for ((count, prior), region) in counts.iter().zip(&coarse.0).zip(&partition.regions) {
            visible[region.parent]
                .add(count.hits_in_rays(), count.trials_in_rays() * prior.visibility);
            responses[region.parent]
                .add(count.response as f64, count.hits_in_rays() * prior.response);
        }
        let scale = coarse.response_ratio(counts);
        let weight = RESPONSE_PRIOR * coarse.mean_response();
        let scales: Vec<[f64; 2]> = visible
            .iter()
            .zip(&responses)
            .map(|(visible, response)| {
                [visible.value(1.0, 1.0).min(LARGEST_RATIO), response.value(scale, weight)]
            })
            .collect();
        let fine = |((count, prior), region): ((&Count, &Estimate), &Region)| {
            let [visible, response] = scales[region.parent];
            Estimate {
                visibility: count.rate((prior.visibility * visible).min(1.0), PRIOR),
                response: count.mean_response(prior.response * response, RESPONSE_PRIOR),
            }
        };
        Self(counts.iter().zip(&coarse.0).zip(&partition.regions).map(fine).collect())
    }

    /// The entries of the device for a cell whose surfaces point along `normal`: cumulative
    /// probabilities of the regions with, for each, its probability divided by its share of the
    /// energy and the visibility that weights candidates. See [`decode_entry`].
    pub fn entries(
        &self,
        normal: Vec3,
        partition: &Partition,
        options: &EstimateOptions,
    ) -> Vec<[u32; 2]> {
        let guided = |(estimate, region): (&Estimate, &Region)| {
            let response =
                if options.learned_response { estimate.response } else { facing(normal, region) };
            region.share * response * estimate.visibility.powf(VISIBILITY_EXPONENT).max(FLOOR)
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
        for (((part, start), estimate), region) in
            parts.iter().zip(starts).zip(&self.0).zip(&partition.regions)
        {
            let probability = f64::from(*part) / f64::from(REGION_SCALE);
            let ratio = if region.share > 0.0 { (probability / region.share) as f32 } else { 0.0 };
            let octaves = -(estimate.visibility as f32).clamp(1e-5, 1.0).log2();
            let level = (octaves * per_octave).round().min(steps) as u32;
            // What follows the last region that can be drawn is never looked at.
            let word = before.min(REGION_SCALE - 1) | start << 16 | level << 26;
            entries.push([ratio.to_bits(), word]);
            before += part;
        }
        entries
    }
}

/// Cosine between the normal of a face and the mean direction of a region, raised for the surfaces that do
/// not point along that normal.
fn facing(normal: Vec3, region: &Region) -> f64 {
    ((normal.as_dvec3().dot(region.direction) + 0.25) / 1.25).max(0.03)
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
