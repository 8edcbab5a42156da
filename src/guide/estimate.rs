//! Counts of visible rays → probability of every region, for one cell.
//!
//! Where a cell has seen little, it leans on what its surroundings have seen: a fine cell on its
//! coarse cell, that on all cells of its face, those on the rate of the whole scene. A fine cell
//! that differs from its coarse cell does so over whole parts of the sky, so the coarse cell's rate
//! is first scaled by what the cell found in the angular parent of the region.

use glam::Vec3;

use super::{
    alias::{AliasEntry, alias_table, probabilities},
    partition::{Partition, Region},
};

/// Weight of the prior, in rays.
const PRIOR: f64 = 4.0;
/// Largest factor by which a parent region raises the prior.
const LARGEST_RATIO: f64 = 8.0;
/// Least estimate of visibility.
const FLOOR: f64 = 1e-4;
/// Share of the regions' probability that does not look at what was learned.
const DEFENSIVE_SHARE: f64 = 0.05;

/// Scale of the thresholds of an alias table over regions.
const REGION_SCALE: u64 = 1 << 16;
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
}

impl Default for EstimateOptions {
    fn default() -> Self {
        Self { hierarchy: true }
    }
}

/// Estimates of visibility of every region.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates(pub Vec<f64>);

/// Hits and trials per region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Rays that reached the environment.
    pub hits: u64,
    /// Rays traced.
    pub trials: u64,
}

impl Count {
    fn rate(self, prior: f64, weight: f64) -> f64 {
        (self.hits as f64 + weight * prior) / (self.trials as f64 + weight)
    }
}

impl Estimates {
    /// Of all cells of one face, against the rate of the whole scene.
    pub fn of_face(counts: &[Count], scene: Count) -> Self {
        let rate = (scene.hits as f64 + 1.0) / (scene.trials as f64 + 2.0);
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
            found[region.parent] += count.hits as f64;
            expected[region.parent] += count.trials as f64 * prior;
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

    /// The entries of the device for a cell whose surfaces point along `normal`: an alias table over
    /// the regions with, for each, its probability divided by its share of the energy and the
    /// visibility that weights candidates. See [`decode_entry`].
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
        let Some(table) = alias_table(&weights, REGION_SCALE) else {
            return vec![[0; 2]; weights.len()];
        };
        let chosen = probabilities(&table, REGION_SCALE);
        let steps = (VISIBILITY_LEVELS - 1) as f32;
        let per_octave = TARGET_EXPONENT / TARGET_RANGE * steps;
        let encode = |((entry, probability), (visibility, region)): (
            (&AliasEntry, &f64),
            (&f64, &Region),
        )| {
            let share = region.share;
            let ratio = if share > 0.0 { (probability / share) as f32 } else { 0.0 };
            // A full column keeps its own index either way.
            let threshold = entry.threshold.min(REGION_SCALE - 1) as u32;
            let octaves = -(*visibility as f32).clamp(1e-5, 1.0).log2();
            let level = (octaves * per_octave).round().min(steps) as u32;
            [ratio.to_bits(), threshold | entry.alias << 16 | level << 26]
        };
        table.iter().zip(&chosen).zip(self.0.iter().zip(&partition.regions)).map(encode).collect()
    }
}

/// Ratio of probability to share, threshold of 65,536, alias and weight of visibility of an entry;
/// twin of what `glsl/include/guide.glsl` reads.
pub fn decode_entry(entry: [u32; 2]) -> (f32, u32, u32, f32) {
    let level = (entry[1] >> 26) as f32;
    let range = TARGET_RANGE;
    let weight = (-level * (range / (VISIBILITY_LEVELS - 1) as f32)).exp2();
    (f32::from_bits(entry[0]), entry[1] & 0xffff, entry[1] >> 16 & 0x3ff, weight)
}
