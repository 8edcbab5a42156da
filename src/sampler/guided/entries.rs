//! Estimates of one cell → entries, the probabilities of its regions as shaders read them.
//!
//! The probability of a region is proportional to energy · response · V̂^¾, mixed with a small
//! share that follows the energy alone.

use crate::{
    sampler::{guided::estimate::Estimates, regions::Partition},
    shader::rooms::guided::GUIDE_VISIBILITY_LEVELS,
};

/// Exponent of the visibility in the probability of a region. Variance is least with ½ where the
/// response is constant and the visibility of a cell is the same chance everywhere in it, and with
/// 1 where hits of a cell that sees a region see all of it.
const VISIBILITY_EXPONENT: f32 = 0.75;
/// Visibilities below this count as this.
const MIN_VISIBILITY: f32 = 1e-5;
/// Share of the probability that ignores the estimates and follows the energy.
const DEFENSIVE_SHARE: f64 = 0.05;

/// Probabilities of regions are multiples of one over this.
const REGION_SCALE: u32 = 1 << 16;
/// Exponent of the visibility in the weight of a candidate.
const TARGET_EXPONENT: f32 = 0.7;
/// Binary orders of magnitude that the levels of the weight of a candidate cover.
const TARGET_RANGE: f32 = 10.5;

/// Tables that the entries of all cells share.
pub struct EntryTables {
    /// Share of the energy of every region.
    shares: Vec<f64>,
    /// V̂ to the power of [`VISIBILITY_EXPONENT`] and the level of the weight of a candidate, by
    /// [`power_index`].
    powers: Vec<(f32, u32)>,
}

/// Index of a visibility in [`EntryTables::powers`]: its upper bits, 64 steps per octave.
fn power_index(visibility: f32) -> usize {
    let bits = |value: f32| (value.to_bits() >> 17) as usize;
    bits(visibility.clamp(MIN_VISIBILITY, 1.0)) - bits(MIN_VISIBILITY)
}

impl EntryTables {
    pub fn new(partition: &Partition) -> Self {
        let first = MIN_VISIBILITY.to_bits() >> 17;
        let steps = (GUIDE_VISIBILITY_LEVELS - 1) as f32;
        let power = |index: u32| {
            // The middle of the step; the last is 1.
            let middle = f32::from_bits((first + index) << 17 | 1 << 16).min(1.0);
            let octaves = -middle.log2();
            let level = (octaves * (TARGET_EXPONENT / TARGET_RANGE * steps)).round().min(steps);
            ((-VISIBILITY_EXPONENT * octaves).exp2(), level as u32)
        };
        Self {
            shares: partition.regions.iter().map(|region| region.share).collect(),
            powers: (0..=power_index(1.0) as u32).map(power).collect(),
        }
    }
}

/// Writes entries cell by cell, in scratch memory of its own.
pub struct EntryWriter<'a> {
    tables: &'a EntryTables,
    weights: Vec<f64>,
    levels: Vec<u32>,
    parts: Vec<u32>,
    starts: Vec<u32>,
}

impl<'a> EntryWriter<'a> {
    pub fn new(tables: &'a EntryTables) -> Self {
        let (weights, levels, parts, starts) = Default::default();
        Self { tables, weights, levels, parts, starts }
    }

    /// Writes the entries of a cell, one per region: `guide_word` of `glsl/guided/guide.glsl`.
    pub fn write(&mut self, estimates: &Estimates, entries: &mut [u32]) {
        let Self { tables, weights, levels, parts, starts } = self;
        weights.clear();
        levels.clear();
        weights.extend(estimates.regions.iter().zip(&tables.shares).map(|(estimate, share)| {
            let (power, level) = tables.powers[power_index(estimate.visibility)];
            levels.push(level);
            share * f64::from(estimate.response * power)
        }));
        let scale = (1.0 - DEFENSIVE_SHARE) / weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        for (weight, share) in weights.iter_mut().zip(&tables.shares) {
            *weight = scale * *weight + DEFENSIVE_SHARE * share;
        }
        quantise(weights, parts);
        interval_starts(parts, starts);
        let mut before = 0;
        for (((entry, part), level), start) in entries.iter_mut().zip(parts).zip(levels).zip(starts)
        {
            // After the last region that can be drawn all are before, which is 0 as in the next cell.
            let begin = before % REGION_SCALE;
            *entry = begin | *start << 16 | *level << 26;
            before += *part;
        }
    }
}

/// Whole numbers proportional to `weights` that sum to [`REGION_SCALE`], or all 0 if the weights are. Every
/// positive weight gets at least 1: the sampler is unbiased only if it can draw the region.
fn quantise(weights: &[f64], parts: &mut Vec<u32>) {
    parts.clear();
    let sum: f64 = weights.iter().sum();
    if sum <= 0.0 || sum.is_subnormal() {
        parts.resize(weights.len(), 0);
        return;
    }
    let scale = f64::from(REGION_SCALE - weights.len() as u32) / sum;
    let part = |weight: &f64| (weight * scale) as i32 as u32 + u32::from(*weight > 0.0);
    parts.extend(weights.iter().map(part));
    // Give the remainder of the rounding to the largest.
    let total: u32 = parts.iter().sum();
    if let Some(largest) = parts.iter_mut().max_by_key(|part| **part) {
        *largest += REGION_SCALE.saturating_sub(total);
    }
}

/// Splits the random numbers into as many equal intervals as there are regions and finds, for each, where to
/// start the search: the last region that begins at or before the interval. The search of the first interval
/// always starts at region 0, so its place holds the last region that can be drawn.
fn interval_starts(parts: &[u32], starts: &mut Vec<u32>) {
    let count = parts.len() as u32;
    starts.clear();
    // One more, for regions after the last that can be drawn.
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

/// Probability of every region of a cell over its share of the energy, by the `entries` of the cell and the
/// `shares`; 0 where there is no energy. Twin of `guide_entry` in `glsl/guided/guide.glsl`.
pub fn ratios(entries: &[u32], shares: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let next = entries.iter().skip(1).chain([&0]);
    entries.iter().zip(next).zip(shares).map(|((entry, next), share)| {
        let part = next.wrapping_sub(*entry).wrapping_sub(1) % REGION_SCALE + 1;
        if share > 0.0 { f64::from(part) / (f64::from(REGION_SCALE) * share) } else { 0.0 }
    })
}

/// Decodes an entry: cumulative probability of the regions before it, in 65,536ths; region to start the
/// search from in the interval of this index, at index 0 the last region that can be drawn; weight of a
/// candidate by visibility. Twin of `guide_word` and `guide_entry`.
pub fn decode_entry(entry: u32) -> (u32, u32, f32) {
    let level = (entry >> 26) as f32;
    let weight = (-level * (TARGET_RANGE / (GUIDE_VISIBILITY_LEVELS - 1) as f32)).exp2();
    (entry & 0xffff, entry >> 16 & 0x3ff, weight)
}

/// V̂ of an entry, quantised to its levels.
pub fn decode_visibility(entry: u32) -> f64 {
    f64::from(decode_entry(entry).2.powf(1.0 / TARGET_EXPONENT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_fill_the_scale_and_every_positive_weight_has_one() {
        for weights in [vec![0.0, 1e-12, 3.0, 0.0, 1.0, 0.0], vec![1.0; 1024], vec![0.0, 5.0]] {
            let mut parts = Vec::new();
            quantise(&weights, &mut parts);
            assert_eq!(parts.iter().sum::<u32>(), REGION_SCALE);
            for (weight, part) in weights.iter().zip(&parts) {
                assert_eq!(*weight > 0.0, *part > 0, "{weight} {part}");
            }
        }
        let mut parts = vec![7];
        quantise(&[0.0; 3], &mut parts);
        assert_eq!(parts, [0; 3]);
    }

    #[test]
    fn intervals_start_at_or_before_the_region_that_a_linear_search_finds() {
        let (mut parts, mut starts) = (Vec::new(), Vec::new());
        quantise(&[0.0, 0.1, 0.0, 7.0, 1e-9, 2.0, 0.5, 0.0, 0.0], &mut parts);
        interval_starts(&parts, &mut starts);
        assert_eq!(starts[0], 6, "the last region that can be drawn");
        let count = parts.len() as u64;
        for bits in (0..=u32::MAX).step_by(99_991) {
            let mut end = 0;
            let expected = parts.iter().position(|part| {
                end += part;
                bits >> 16 < end
            });
            let interval = ((u64::from(bits) * count) >> 32) as usize;
            let low = if interval == 0 { 0 } else { starts[interval] };
            let high = starts[(interval + 1) % parts.len()];
            let expected = expected.map_or(u32::MAX, |region| region as u32);
            assert!((low..=high).contains(&expected), "{bits}: {expected} not in {low} to {high}");
        }
    }
}
