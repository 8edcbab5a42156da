//! Counts of visible rays and of what they brought → probability of every region, for one cell.
//!
//! A region's probability is in proportion to its energy, to a power of the visibility V̂ = hits / trials,
//! and to the response: the mean over the rays that hit of BRDF · cosine, weighed by the light's colours.
//! The response is the product with the BRDF that Tsai et al. (2008) take at every hit, as the mean over
//! the surfaces of a cell and the directions they are seen from; the cell of a flat wall has nearly one of
//! each.
//!
//! Where a cell has seen little, it leans on what its surroundings have seen: the part of a refined cell
//! on that, a fine cell on its coarse cell, that on all cells of its face, those on the rate of the whole
//! scene and on a cosine. A cell that differs from what it is a part of does so over whole parts of the sky,
//! so what that says is first scaled by what the cell found in the angular parent of the region.

use glam::Vec3;

use crate::sampler::guided::{
    key::{FACE_COUNT, face_normal},
    partition::{PARENT_COUNT, Partition, Region},
};
use crate::shader::constants::GUIDE_COUNT_WORDS;

/// Weight of the prior, in rays.
const PRIOR: f32 = 4.0;
/// Weight of the prior of the response, in rays that hit.
const RESPONSE_PRIOR: f32 = 8.0;
/// Largest factor by which a parent region raises the prior.
const LARGEST_RATIO: f32 = 8.0;
/// Exponent of the visibility in the probability of a region. Least variance asks for ½ where the response is
/// one number and the visibility of a cell is the same chance everywhere in it, and for 1 where hits of
/// a cell that see a region see all of it.
const VISIBILITY_EXPONENT: f32 = 0.75;
/// Least visibility that is told from none.
const LEAST_VISIBILITY: f32 = 1e-5;
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

/// What is believed of one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// V̂, the share of rays that reach the environment.
    pub visibility: f32,
    /// Mean response of those, in units of 1 / [`GUIDE_RESPONSE_UNITS`](crate::shader::constants::GUIDE_RESPONSE_UNITS).
    pub response: f32,
}

/// Trials, hits and sum of the responses of the hits, as they lie on the device and in files.
pub type CountWords = [u32; GUIDE_COUNT_WORDS as usize];

/// A ray, as it is counted: regions that are split anew share what was counted.
pub const PARTS_PER_RAY: u32 = 16;

/// No word of a [`Count`] is larger, whatever a file says and however regions are merged.
pub const LARGEST_WORD: u32 = 1 << 30;

/// What was counted of one region in one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Rays that reached the environment, [`PARTS_PER_RAY`] for each.
    pub hits: u32,
    /// Rays traced, and directions that brought nothing, [`PARTS_PER_RAY`] for each.
    pub trials: u32,
    /// Sum of the responses of the rays that hit.
    pub response: u32,
}

impl Count {
    /// Rays that reached the environment; of regions that were split anew, a share.
    pub fn hits_in_rays(self) -> f64 {
        f64::from(self.hits) / f64::from(PARTS_PER_RAY)
    }

    /// Rays traced; of regions that were split anew, a share.
    pub fn trials_in_rays(self) -> f64 {
        f64::from(self.trials) / f64::from(PARTS_PER_RAY)
    }

    /// Adds `share` of another count, to the nearest whole part.
    pub fn add_share(&mut self, other: Self, share: f64) {
        let sum = |count: u32, other: u32| {
            (count + (f64::from(other) * share + 0.5) as u32).min(LARGEST_WORD)
        };
        self.hits = sum(self.hits, other.hits);
        self.trials = sum(self.trials, other.trials);
        self.response = sum(self.response, other.response);
    }
}

/// What was counted of one region in one or more cells, in rays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    hits: f32,
    trials: f32,
    response: f32,
}

impl From<&Count> for Tally {
    fn from(count: &Count) -> Self {
        let rays = 1.0 / PARTS_PER_RAY as f32;
        // Counts are below 2³¹, and signed integers become floats more quickly.
        let float = |count: u32| count as i32 as f32;
        Self {
            hits: float(count.hits) * rays,
            trials: float(count.trials) * rays,
            response: float(count.response),
        }
    }
}

impl From<&Tally> for Tally {
    fn from(tally: &Tally) -> Self {
        *tally
    }
}

impl Tally {
    /// Adds another.
    pub fn add(&mut self, other: Self) {
        self.hits += other.hits;
        self.trials += other.trials;
        self.response += other.response;
    }

    fn rate(self, prior: f32, weight: f32) -> f32 {
        (self.hits + weight * prior) / (self.trials + weight)
    }

    fn mean_response(self, prior: f32, weight: f32) -> f32 {
        (self.response + weight * prior) / (self.hits + weight)
    }
}

/// What was found, by what was expected; 1 where that is little.
#[derive(Clone, Copy, Debug, Default)]
struct Ratio {
    found: f32,
    expected: f32,
}

impl Ratio {
    fn add(&mut self, found: f32, expected: f32) {
        self.found += found;
        self.expected += expected;
    }

    /// Leaning on `prior` as if `weight` had been expected already.
    fn value(self, prior: f32, weight: f32) -> f32 {
        (self.found + weight * prior) / (self.expected + weight)
    }
}

/// What estimates look up: the regions, and powers of V̂.
pub struct Lookup {
    /// Share of the energy of every region.
    shares: Vec<f64>,
    /// Parent of every region.
    parents: Vec<u8>,
    /// [`facing`] for every face and region.
    facing: Vec<Vec<f32>>,
    /// What a part of [`REGION_SCALE`] is of a region's share of the energy.
    inverse_shares: Vec<f32>,
    /// V̂ raised to [`VISIBILITY_EXPONENT`] and its level, by the upper bits of V̂ from
    /// [`LEAST_VISIBILITY`] on.
    powers: Vec<(f32, u32)>,
}

/// The bits of V̂ that its power and level are looked up by: 64 steps per octave.
fn power_index(visibility: f32) -> usize {
    let bits = |value: f32| (value.to_bits() >> 17) as usize;
    bits(visibility.clamp(LEAST_VISIBILITY, 1.0)) - bits(LEAST_VISIBILITY)
}

impl Lookup {
    /// For the regions of `partition`.
    pub fn new(partition: &Partition) -> Self {
        let facing_of = |face| {
            let normal = face_normal(face);
            partition.regions.iter().map(|region| facing(normal, region) as f32).collect()
        };
        let inverse = |region: &Region| {
            let inverse = 1.0 / (f64::from(REGION_SCALE) * region.share);
            if region.share > 0.0 { (inverse as f32).min(f32::MAX) } else { 0.0 }
        };
        let least = LEAST_VISIBILITY.to_bits() >> 17;
        let steps = (VISIBILITY_LEVELS - 1) as f32;
        let power = |index: u32| {
            // The middle of the step; the last is 1.
            let middle = f32::from_bits((least + index) << 17 | 1 << 16).min(1.0);
            let octaves = -middle.log2();
            let level = (octaves * (TARGET_EXPONENT / TARGET_RANGE * steps)).round().min(steps);
            ((-VISIBILITY_EXPONENT * octaves).exp2(), level as u32)
        };
        Self {
            shares: partition.regions.iter().map(|region| region.share).collect(),
            parents: partition.regions.iter().map(|region| region.parent as u8).collect(),
            facing: (0..FACE_COUNT).map(facing_of).collect(),
            inverse_shares: partition.regions.iter().map(inverse).collect(),
            powers: (0..=power_index(1.0) as u32).map(power).collect(),
        }
    }
}

/// Estimates of every region.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    regions: Vec<Estimate>,
    mean_response: f32,
}

impl Estimates {
    fn new(regions: Vec<Estimate>) -> Self {
        let sum: f32 = regions.iter().map(|estimate| estimate.response).sum();
        Self { mean_response: sum / regions.len().max(1) as f32, regions }
    }

    /// True for the default, which estimates no region.
    pub fn is_empty(&self) -> bool {
        self.regions.is_empty()
    }

    /// Of all cells of a face, against the whole `scene`.
    pub fn of_face(face: usize, tallies: &[Tally], scene: Tally, lookup: &Lookup) -> Self {
        let rate = (scene.hits + 1.0) / (scene.trials + 2.0);
        let response = scene.mean_response(1.0, f32::MIN_POSITIVE);
        let prior = |facing: &f32| Estimate { visibility: rate, response: response * facing };
        Self::new(lookup.facing[face].iter().map(prior).collect()).updated(tallies, 2.0)
    }

    /// Of a coarse cell, against its face.
    pub fn of_coarse(tallies: &[Tally], face: &Self) -> Self {
        face.updated(tallies, PRIOR)
    }

    /// With what was counted, where `self` is worth `weight` rays; its responses are scaled by what was
    /// found in all regions together.
    fn updated(&self, tallies: &[Tally], weight: f32) -> Self {
        let mut ratio = Ratio::default();
        for (tally, prior) in tallies.iter().zip(&self.regions) {
            ratio.add(tally.response, tally.hits * prior.response);
        }
        let scale = ratio.value(1.0, self.mean_response);
        let update = |(tally, prior): (&Tally, &Estimate)| Estimate {
            visibility: tally.rate(prior.visibility, weight),
            response: tally.mean_response(prior.response * scale, RESPONSE_PRIOR),
        };
        Self::new(tallies.iter().zip(&self.regions).map(update).collect())
    }

    /// Of a cell, against the cell that it is a part of, region by region and parent by parent.
    pub fn of_part<'a, T>(counted: &'a [T], whole: &Self, lookup: &Lookup) -> Self
    where
        Tally: From<&'a T>,
    {
        let mut visible = [Ratio::default(); PARENT_COUNT];
        let mut responses = [Ratio::default(); PARENT_COUNT];
        for ((counted, prior), parent) in counted.iter().zip(&whole.regions).zip(&lookup.parents) {
            let tally = Tally::from(counted);
            let parent = usize::from(*parent);
            visible[parent].add(tally.hits, tally.trials * prior.visibility);
            responses[parent].add(tally.response, tally.hits * prior.response);
        }
        let mut all = Ratio::default();
        for response in &responses {
            all.add(response.found, response.expected);
        }
        let scale = all.value(1.0, whole.mean_response);
        let weight = RESPONSE_PRIOR * whole.mean_response;
        let mut scales = [[0.0; 2]; PARENT_COUNT];
        for ((scales, visible), response) in scales.iter_mut().zip(&visible).zip(&responses) {
            *scales = [visible.value(1.0, 1.0).min(LARGEST_RATIO), response.value(scale, weight)];
        }
        let estimate = |((counted, prior), parent): ((&'a T, &Estimate), &u8)| {
            let [visible, response] = scales[usize::from(*parent)];
            let tally = Tally::from(counted);
            Estimate {
                visibility: tally.rate((prior.visibility * visible).min(1.0), PRIOR),
                response: tally.mean_response(prior.response * response, RESPONSE_PRIOR),
            }
        };
        let counted = counted.iter().zip(&whole.regions).zip(&lookup.parents);
        Self::new(counted.map(estimate).collect())
    }

    /// Light of the environment that surfaces of the cell reflect, as the sum over regions of share of
    /// energy · V̂ · response.
    pub fn reflected(&self, lookup: &Lookup) -> f32 {
        let reflected = |(estimate, share): (&Estimate, &f64)| {
            *share as f32 * estimate.visibility * estimate.response
        };
        self.regions.iter().zip(&lookup.shares).map(reflected).sum()
    }

    /// Writes the entries of the device for a cell: cumulative probabilities of the regions
    /// with, for each, its probability divided by its share of the energy and the visibility that weights
    /// candidates. See [`decode_entry`].
    pub fn write_entries(&self, lookup: &Lookup, scratch: &mut Scratch, entries: &mut [[u32; 2]]) {
        let Scratch { weights, levels, parts, starts } = scratch;
        weights.clear();
        levels.clear();
        weights.extend(self.regions.iter().zip(&lookup.shares).map(|(estimate, share)| {
            let (power, level) = lookup.powers[power_index(estimate.visibility)];
            levels.push(level);
            share * f64::from(estimate.response * power)
        }));
        let scale = (1.0 - DEFENSIVE_SHARE) / weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        for (weight, share) in weights.iter_mut().zip(&lookup.shares) {
            *weight = scale * *weight + DEFENSIVE_SHARE * share;
        }
        whole_parts(weights, parts);
        interval_starts(parts, starts);
        let mut before = 0;
        for ((((entry, part), inverse), level), start) in
            entries.iter_mut().zip(parts).zip(&lookup.inverse_shares).zip(levels).zip(starts)
        {
            // What follows the last region that can be drawn is never looked at.
            let word = before.min(REGION_SCALE - 1) | *start << 16 | *level << 26;
            *entry = [(*part as i32 as f32 * inverse).to_bits(), word];
            before += *part;
        }
    }
}

/// Memory for the steps from estimates to entries, used again for the next cell.
#[derive(Default)]
pub struct Scratch {
    weights: Vec<f64>,
    levels: Vec<u32>,
    parts: Vec<u32>,
    starts: Vec<u32>,
}

/// Cosine between the normal of a face and the mean direction of a region, raised for the surfaces that do
/// not point along that normal.
fn facing(normal: Vec3, region: &Region) -> f64 {
    ((normal.as_dvec3().dot(region.direction) + 0.25) / 1.25).max(0.03)
}

/// Whole numbers in proportion to `weights` that sum to [`REGION_SCALE`], at least 1 where there is
/// any weight: what is drawn, however seldom, keeps the sampler unbiased. All 0 if the weights are.
fn whole_parts(weights: &[f64], parts: &mut Vec<u32>) {
    parts.clear();
    let sum: f64 = weights.iter().sum();
    if sum <= 0.0 || sum.is_subnormal() {
        parts.resize(weights.len(), 0);
        return;
    }
    let scale = f64::from(REGION_SCALE - weights.len() as u32) / sum;
    let part = |weight: &f64| (weight * scale) as i32 as u32 + u32::from(*weight > 0.0);
    parts.extend(weights.iter().map(part));
    // What rounding down leaves over goes to the largest.
    let total: u32 = parts.iter().sum();
    if let Some(largest) = parts.iter_mut().max_by_key(|part| **part) {
        *largest += REGION_SCALE.saturating_sub(total);
    }
}

/// For each of as many equal intervals of random numbers as there are regions, a region that begins at
/// or before its start and after which no other does that begins a whole part earlier; for the first,
/// where that is the first one, the last region that can be drawn.
fn interval_starts(parts: &[u32], starts: &mut Vec<u32>) {
    let count = parts.len() as u32;
    starts.clear();
    // One more, for what follows the last region that can be drawn.
    starts.resize(parts.len() + 1, 0);
    let (mut before, mut last) = (0, 0);
    for (region, part) in (0..).zip(parts) {
        // The first interval that starts where the region begins or later.
        starts[(before * count).div_ceil(REGION_SCALE) as usize] = region;
        last = if *part > 0 { region } else { last };
        before += part;
    }
    starts.pop();
    let mut latest = 0;
    for start in starts.iter_mut() {
        latest = latest.max(*start);
        *start = latest;
    }
    if let Some(first) = starts.first_mut() {
        *first = last;
    }
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
            let mut parts = Vec::new();
            whole_parts(&weights, &mut parts);
            assert_eq!(parts.iter().sum::<u32>(), REGION_SCALE);
            for (weight, part) in weights.iter().zip(&parts) {
                assert_eq!(*weight > 0.0, *part > 0, "{weight} {part}");
            }
        }
        let mut parts = vec![7];
        whole_parts(&[0.0; 3], &mut parts);
        assert_eq!(parts, [0; 3]);
    }

    #[test]
    fn intervals_start_where_a_search_from_the_first_region_would_arrive() {
        let (mut parts, mut starts) = (Vec::new(), Vec::new());
        whole_parts(&[0.0, 0.1, 0.0, 7.0, 1e-9, 2.0, 0.5, 0.0, 0.0], &mut parts);
        interval_starts(&parts, &mut starts);
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
