//! Chooses the number of candidates per shadow ray under `auto`: samples of a few pixels, time per
//! sample → variance × time → number of candidates.
//!
//! The error at equal time is variance × time. The variance of a pixel's samples is taken relative
//! to the squared mean of its block of pixels, so that dark regions count as much as bright ones;
//! the geometric mean over the blocks keeps a few fireflies from deciding.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::Result;

/// Numbers of candidates that `guided` can choose a shadow ray from.
pub const GUIDED_CANDIDATES: [u32; 3] = [1, 4, 8];

/// Ratio of variance × time below which more candidates are chosen over fewer.
const CLEAR_GAIN: f64 = 0.9;
/// Standard errors of the logarithm by which the ratio must be below [`CLEAR_GAIN`]: few samples of
/// pixels with rare bright ones say little.
const CONFIDENCE: f64 = 2.0;
/// Standard error where it is unknown, so that no gain is clear. Finite, since files cannot hold
/// infinities.
const UNKNOWN_ERROR: f64 = 1e3;
/// Ratio of variance × time above which more candidates are not measured again, however uncertain.
const CLEAR_LOSS: f64 = 1.4;
/// Ratio of variance × time above which more candidates are not measured again if it lies above by
/// [`CONFIDENCE`]. Far from [`CLEAR_GAIN`], since this error knows nothing of the times'.
const LIKELY_LOSS: f64 = 1.0;

/// Measured cost of a number of candidates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CandidateCost {
    /// Candidates per shadow ray.
    pub candidates: u32,
    /// Device milliseconds of all passes for one sample of every pixel.
    pub ms_per_sample: f64,
    /// Variance of a pixel's samples relative to the squared mean of its block, geometric mean over
    /// the blocks.
    pub relative_variance: f64,
    /// Standard error over the blocks of the logarithm of the variance relative to that of the
    /// fewest candidates measured; 0 for these, 1000 if there is only one block.
    pub log_variance_error: f64,
}

impl fmt::Display for CandidateCost {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { candidates, ms_per_sample, relative_variance, log_variance_error } = self;
        let percent = 100.0 * log_variance_error;
        write!(
            formatter,
            "{candidates}: {ms_per_sample:.2} ms a sample, relative variance {relative_variance:.3} \
             (±{percent:.0}%)"
        )
    }
}

/// Relative variance after a millisecond of samples.
fn variance_time(cost: &CandidateCost) -> f64 {
    cost.relative_variance * cost.ms_per_sample
}

/// Chooses a number of candidates: the fewest, unless more are clearly better. `costs` are in
/// ascending order of candidates.
///
/// # Panics
/// If there are no costs.
pub fn choose_candidates(costs: &[CandidateCost]) -> u32 {
    assert!(!costs.is_empty(), "something was measured");
    let mut chosen = &costs[0];
    for more in &costs[1..] {
        let at_most = variance_time(more) * (CONFIDENCE * more.log_variance_error).exp();
        if at_most < CLEAR_GAIN * variance_time(chosen) {
            chosen = more;
        }
    }
    chosen.candidates
}

/// Returns true if the largest number of candidates has so much more variance × time than a smaller
/// one that more measurements would hardly change the choice.
pub fn is_largest_clearly_worse(costs: &[CandidateCost]) -> bool {
    let Some((largest, fewer)) = costs.split_last() else { return false };
    let at_least = LIKELY_LOSS * (CONFIDENCE * largest.log_variance_error).exp();
    let limit = at_least.min(CLEAR_LOSS);
    fewer.iter().any(|cost| variance_time(largest) > limit * variance_time(cost))
}

/// Compares numbers of candidates pair by pair, from the fewest up, until more do not pay.
/// `compare` measures two numbers and returns the costs of all numbers measured so far, in
/// ascending order, or none if nothing can be measured. Returns the choice and the last costs.
///
/// # Errors
/// Those of `compare`.
pub fn choose_by_comparison(
    mut compare: impl FnMut(u32, u32) -> Result<Vec<CandidateCost>>,
) -> Result<(u32, Vec<CandidateCost>)> {
    let mut chosen = GUIDED_CANDIDATES[0];
    let mut costs = Vec::new();
    for &more in &GUIDED_CANDIDATES[1..] {
        costs = compare(chosen, more)?;
        if costs.is_empty() {
            break;
        }
        chosen = choose_candidates(&costs);
        if chosen != more {
            break;
        }
    }
    Ok((chosen, costs))
}

/// Median, the upper one of two middle values: up to half of the timings may be too small by chance
/// on a machine that is busy with other work.
///
/// # Panics
/// If there are no values.
pub fn upper_median(values: &[f64]) -> f64 {
    assert!(!values.is_empty(), "something was measured");
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// Moments of the samples of the pixels in one block.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    count: f64,
    sum: f64,
    squared_deviations: f64,
    degrees_of_freedom: f64,
    has_rays: bool,
}

/// Spread of the samples around the mean of their pixel, by block of pixels.
#[derive(Clone, Debug, Default)]
pub struct PixelSpread {
    blocks: Vec<Block>,
}

impl PixelSpread {
    /// Adds the samples of a pixel; `has_rays` is true if any of them traced a shadow ray.
    pub fn add(&mut self, block: usize, samples: &[f64], has_rays: bool) {
        if self.blocks.len() <= block {
            self.blocks.resize(block + 1, Block::default());
        }
        let block = &mut self.blocks[block];
        block.has_rays |= has_rays;
        if samples.is_empty() || samples.iter().any(|sample| !sample.is_finite()) {
            return;
        }
        let count = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / count;
        block.count += count;
        block.sum += count * mean;
        block.squared_deviations +=
            samples.iter().map(|sample| (sample - mean).powi(2)).sum::<f64>();
        block.degrees_of_freedom += count - 1.0;
    }
}

/// Relative variance of each of several spreads of the same pixels, and standard error of the
/// logarithm of its ratio to the first, 1000 if there is only one block.
///
/// The relative variance is the geometric mean over the blocks where all spreads vary, each
/// relative to the squared mean over all spreads. Blocks without a shadow ray are left out, since
/// no choice of directions changes them; `None` if no block is left.
pub fn relative_variances(spreads: &[&PixelSpread]) -> Option<Vec<(f64, f64)>> {
    let block_count = spreads.iter().map(|spread| spread.blocks.len()).min().unwrap_or(0);
    let mut logarithms = vec![Vec::new(); spreads.len()];
    for index in 0..block_count {
        let blocks = || spreads.iter().map(|spread| &spread.blocks[index]);
        let count: f64 = blocks().map(|block| block.count).sum();
        let mean = blocks().map(|block| block.sum).sum::<f64>() / count;
        if !blocks().any(|block| block.has_rays)
            || !blocks().all(|block| block.squared_deviations > 0.0)
            || mean <= 0.0
        {
            continue;
        }
        for (logarithms, block) in logarithms.iter_mut().zip(blocks()) {
            let variance = block.squared_deviations / block.degrees_of_freedom;
            logarithms.push((variance / (mean * mean)).ln());
        }
    }
    let first = logarithms.first().filter(|first| !first.is_empty())?;
    let count = first.len() as f64;
    let of_spread = |logarithms: &Vec<f64>| {
        let mean = logarithms.iter().sum::<f64>() / count;
        let differences = || logarithms.iter().zip(first).map(|(more, fewer)| more - fewer);
        let difference = differences().sum::<f64>() / count;
        let squares: f64 = differences().map(|value| (value - difference).powi(2)).sum();
        let error =
            if count > 1.0 { (squares / (count - 1.0) / count).sqrt() } else { UNKNOWN_ERROR };
        (mean.exp(), error)
    };
    let mut variances: Vec<(f64, f64)> = logarithms.iter().map(of_spread).collect();
    variances[0].1 = 0.0;
    Some(variances)
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    fn cost(candidates: u32, ms_per_sample: f64, relative_variance: f64) -> CandidateCost {
        CandidateCost { candidates, ms_per_sample, relative_variance, log_variance_error: 0.0 }
    }

    fn variances(spreads: &[&PixelSpread]) -> Vec<f64> {
        relative_variances(spreads).unwrap().into_iter().map(|(variance, _)| variance).collect()
    }

    #[test]
    fn the_least_variance_by_time_is_chosen_if_it_is_clearly_less() {
        let choice =
            |four: (f64, f64)| choose_candidates(&[cost(1, 2.0, 3.0), cost(4, four.0, four.1)]);
        assert_eq!(choice((4.0, 2.0)), 1, "a third less variance in twice the time");
        assert_eq!(choice((2.4, 2.0)), 4, "in a fifth more time");
        assert_eq!(choice((2.0, 2.75)), 1, "a twelfth less is not clear");
        assert_eq!(choice((2.0, 2.65)), 4, "an eighth less is");
        assert_eq!(choice((f64::NAN, 1.0)), 1);
        assert_eq!(choice((1.0, f64::NAN)), 1);
        assert_eq!(choose_candidates(&[cost(1, f64::NAN, f64::NAN), cost(4, 1.0, 1.0)]), 1);
        let four = [cost(1, 2.0, 3.0), cost(4, 2.2, 2.0)];
        assert_eq!(choose_candidates(&[four[0], four[1], cost(8, 2.6, 1.8)]), 4);
        assert_eq!(choose_candidates(&[four[0], four[1], cost(8, 2.4, 1.5)]), 8);
        assert_eq!(choose_candidates(&four[..1]), 1);
    }

    #[test]
    fn a_gain_within_the_noise_is_not_clear() {
        let choice = |error: f64| {
            let four = CandidateCost { log_variance_error: error, ..cost(4, 2.2, 2.0) };
            choose_candidates(&[cost(1, 2.0, 3.0), four])
        };
        // ln(0.9 · 6 / 4.4) is 0.205.
        assert_eq!((choice(0.10), choice(0.11)), (4, 1));
        assert_eq!(choice(UNKNOWN_ERROR), 1);
        assert_eq!(choice(f64::NAN), 1);
    }

    #[test]
    fn the_error_is_that_of_the_difference_over_blocks() {
        let (mut one, mut four) = (PixelSpread::default(), PixelSpread::default());
        let pair = |deviation: f64| [1.0 - deviation, 1.0 + deviation];
        // Variances of 1, 4 and 16 against the same, half and a quarter of it.
        for (block, (deviation, root)) in
            [(0.1, 1.0), (0.2, 0.5_f64.sqrt()), (0.4, 0.5)].into_iter().enumerate()
        {
            one.add(block, &pair(deviation), true);
            four.add(block, &pair(deviation * root), true);
            if block == 0 {
                let lone = relative_variances(&[&one, &four]).unwrap();
                assert_eq!((lone[0].1, lone[1].1), (0.0, UNKNOWN_ERROR), "one block says nothing");
            }
        }
        let both = relative_variances(&[&one, &four]).unwrap();
        assert_eq!(both[0].1, 0.0);
        // Logarithms differ by 0, ln 2 and 2 ln 2: a deviation of ln 2.
        let expected = 2.0_f64.ln() / 3.0_f64.sqrt();
        assert!((both[1].1 / expected - 1.0).abs() < 1e-9, "{both:?}");
        assert!((both[0].0 / both[1].0 - 2.0).abs() < 1e-9, "{both:?}");
    }

    #[test]
    fn more_candidates_are_tried_as_long_as_they_pay() {
        let all = [cost(1, 1.0, 8.0), cost(4, 2.0, 2.0), cost(8, 3.0, 1.0)];
        let try_all = |all: [CandidateCost; 3]| {
            let mut compared = Vec::new();
            let result = choose_by_comparison(|chosen, more| {
                compared.push((chosen, more));
                Ok(all.iter().filter(|cost| cost.candidates <= more).copied().collect())
            });
            (result.unwrap().0, compared)
        };
        assert_eq!(try_all(all), (8, vec![(1, 4), (4, 8)]));
        assert_eq!(try_all([all[0], all[1], cost(8, 4.0, 1.0)]), (4, vec![(1, 4), (4, 8)]));
        // 8 would be best of all, but the search stops at the first number that does not pay.
        assert_eq!(try_all([all[0], cost(4, 4.0, 2.0), all[2]]), (1, vec![(1, 4)]));
        let nothing = choose_by_comparison(|_, _| Ok(Vec::new()));
        assert_eq!(nothing.unwrap(), (1, Vec::new()));
    }

    #[test]
    fn two_in_four_may_be_too_small() {
        assert_eq!(upper_median(&[2.0]), 2.0);
        assert_eq!(upper_median(&[2.0, 0.1]), 2.0);
        assert_eq!(upper_median(&[2.0, 9.0, 0.1]), 2.0);
        assert_eq!(upper_median(&[0.1, 2.1, 0.2, 2.0]), 2.0);
    }

    #[test]
    fn only_losses_are_clear_early() {
        let is_loss = |four: f64, error: f64| {
            let four = CandidateCost { log_variance_error: error, ..cost(4, four, 3.0) };
            is_largest_clearly_worse(&[cost(1, 2.0, 3.0), four])
        };
        // Ratios of 1.45, 1.35 and 0.05; ln 1.35 is 0.30.
        assert!(is_loss(2.9, UNKNOWN_ERROR) && !is_loss(2.7, UNKNOWN_ERROR));
        assert!(is_loss(2.7, 0.14) && !is_loss(2.7, 0.16));
        assert!(is_loss(2.02, 0.0) && !is_loss(1.98, 0.0) && !is_loss(0.1, 0.0));
        assert!(!is_largest_clearly_worse(&[cost(1, 2.0, 3.0)]) && !is_largest_clearly_worse(&[]));
        let best = [cost(1, 4.0, 1.0), cost(4, 2.0, 1.0), cost(8, 3.0, 1.0)];
        assert!(is_largest_clearly_worse(&best), "against the best of the fewer");
    }

    #[test]
    fn evenly_spaced_samples_have_their_variance() {
        // 0 … n − 1 have the sample variance n (n + 1) / 12 and the mean (n − 1) / 2.
        let samples = |count: u32| (0..count).map(f64::from).collect::<Vec<_>>();
        let mut spread = PixelSpread::default();
        spread.add(0, &samples(7), true);
        let expected = 7.0 * 8.0 / 12.0 / 9.0;
        assert!((variances(&[&spread])[0] / expected - 1.0).abs() < 1e-12);
        // A second pixel of the block, far brighter: the mean is that of the block, deviations are
        // from the mean of the pixel.
        let shifted: Vec<f64> = samples(5).iter().map(|value| value + 100.0).collect();
        spread.add(0, &shifted, true);
        let (variance, mean) = ((28.0 + 10.0) / 10.0, (7.0 * 3.0 + 5.0 * 102.0) / 12.0);
        let expected = variance / (mean * mean);
        assert!((variances(&[&spread])[0] / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn every_block_counts_alike_however_bright() {
        // Two pixels of samples ±d around m have the relative variance 2 d² / m².
        let pair = |mean: f64, deviation: f64| [mean - deviation, mean + deviation];
        let (mut one, mut four) = (PixelSpread::default(), PixelSpread::default());
        for (block, brightness) in [1.0, 1e4, 1e-4].into_iter().enumerate() {
            one.add(block, &pair(brightness, 0.4 * brightness), true);
            four.add(block, &pair(brightness, 0.2 * brightness), true);
        }
        let both = variances(&[&one, &four]);
        assert!((both[0] - 0.32).abs() < 1e-12 && (both[1] - 0.08).abs() < 1e-12, "{both:?}");
        // A firefly in one of three blocks multiplies the result by the cube root of its factor
        // there.
        four.add(0, &pair(0.0, 0.0), true);
        let lone = variances(&[&four])[0];
        four.blocks[0].squared_deviations *= 1000.0;
        assert!((variances(&[&four])[0] / lone - 10.0).abs() < 1e-9);
    }

    #[test]
    fn blocks_that_say_nothing_are_left_out() {
        let (mut one, mut four) = (PixelSpread::default(), PixelSpread::default());
        assert_eq!(relative_variances(&[&one, &four]), None);
        // The environment itself: samples differ, but no choice of directions changes them.
        one.add(0, &[1.0, 2.0], false);
        four.add(0, &[1.0, 2.0], false);
        // A block that is dark, or the same in every sample, for one of the two.
        one.add(1, &[0.0, 0.0], true);
        four.add(1, &[0.0, 1.0], true);
        one.add(2, &[1.0, f64::NAN], true);
        four.add(2, &[1.0, 2.0], true);
        assert_eq!(relative_variances(&[&one, &four]), None);
        one.add(3, &[1.0, 3.0], true);
        four.add(3, &[1.5, 2.5], true);
        let both = variances(&[&one, &four]);
        let [one, four] = [both[0], both[1]];
        assert!((one - 0.5).abs() < 1e-12 && (four - 0.125).abs() < 1e-12, "{both:?}");
    }
}
