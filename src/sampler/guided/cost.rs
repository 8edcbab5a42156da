//! Decides between arms of an estimator: samples of a few pixels, time of a sample → variance × time → arm.
//!
//! The error at equal time is variance × time. The variance of a pixel's samples is taken relative to the
//! squared mean of its block, as relMSE does. Rare bright samples say little by few: the ratio of two arms
//! leaves the worst pixels out, and a jackknife over groups of blocks says how far to trust it.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::Result;

/// Numbers of candidates that `guided` can choose a shadow ray from.
pub const GUIDED_CANDIDATES: [u32; 3] = [1, 4, 8];

/// Most rounds of a race.
pub const MOST_ROUNDS: u32 = 6;
const GROUPS: usize = 8;
/// Share of the pixels that the trimmed figure leaves out. In seven scenes, ratios by four rounds had three
/// quarters of the error of those that leave out a thousandth.
const TRIMMED: f64 = 0.01;
/// Standard errors of its logarithm by which the ratio must lie above 1 for an arm to leave a race.
const CONFIDENCE: f64 = 2.0;
/// Logarithm of a ratio that times may be wrong by.
const ERROR_OF_TIMES: f64 = 0.1;
/// Ratio of variance × time below which another arm replaces the one in use.
const CLEAR_GAIN: f64 = 0.9;
/// Ratio of variance × time below which, by a standard error, two rounds are enough.
const CLOSE: f64 = 1.1;
/// Standard error of a logarithm where it is unknown. Finite, since files cannot hold infinities.
const UNKNOWN_ERROR: f64 = 1e3;

/// Measured cost of an arm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ArmCost {
    /// The arm, in words.
    pub arm: String,
    /// Samples per pixel of the film when it was measured.
    pub at_samples: u32,
    /// Rounds that it took part in.
    pub rounds: u32,
    /// Camera and bounce rays of a path.
    pub rays: f64,
    /// Shadow rays of a path.
    pub shadow_rays: f64,
    /// Time that this work is worth by the device's prices: microseconds of a core, or nanoseconds of a GPU.
    pub time: f64,
    /// Device milliseconds for one sample of every pixel, for comparison.
    pub ms_per_sample: f64,
    /// Variance of a pixel's samples relative to the squared mean of its block, mean over the pixels.
    pub relative_variance: f64,
    /// The same without the worst 1% of the pixels.
    pub trimmed_variance: f64,
    /// Trimmed variance × time relative to the best of the race in the arm's last round.
    pub relative_cost: f64,
    /// Standard error of its logarithm.
    pub log_error: f64,
    /// True if the race chose it.
    pub is_chosen: bool,
}

impl fmt::Display for ArmCost {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { arm, time, ms_per_sample, relative_variance, trimmed_variance, .. } = self;
        write!(
            formatter,
            "{arm}: {time:.2} a path ({ms_per_sample:.2} ms a sample), relative variance \
             {relative_variance:.3} ({trimmed_variance:.3} trimmed), cost {:.2} ±{:.0}%",
            self.relative_cost,
            100.0 * self.log_error
        )
    }
}

/// Samples of the pixels of one block.
#[derive(Clone, Debug, Default)]
struct Block {
    count: f64,
    sum: f64,
    /// Variance of one sample of every pixel.
    variances: Vec<f64>,
}

/// Spread of the samples around the mean of their pixel, by block of pixels.
#[derive(Clone, Debug, Default)]
pub struct Spread {
    blocks: Vec<Block>,
}

impl Spread {
    /// Adds the samples of a pixel, at least two.
    pub fn add(&mut self, block: usize, samples: &[[f32; 3]]) {
        if self.blocks.len() <= block {
            self.blocks.resize(block + 1, Block::default());
        }
        if samples.as_flattened().iter().any(|value| !value.is_finite()) {
            return;
        }
        let count = samples.len() as f64;
        let mut variance = 0.0;
        let mut mean_of_channels = 0.0;
        for channel in 0..3 {
            let values = || samples.iter().map(|sample| f64::from(sample[channel]));
            let mean = values().sum::<f64>() / count;
            let squares: f64 = values().map(|value| (value - mean).powi(2)).sum();
            variance += squares / (count - 1.0) / 3.0;
            mean_of_channels += mean / 3.0;
        }
        let block = &mut self.blocks[block];
        block.count += count;
        block.sum += count * mean_of_channels;
        block.variances.push(variance);
    }

    /// Number of blocks.
    pub fn block_count(&self) -> usize {
        self.blocks.len()
    }
}

/// Relative variance of an arm.
#[derive(Clone, Debug)]
struct RelativeVariance {
    raw: f64,
    trimmed: f64,
    /// The trimmed one of all groups of blocks but one, for each.
    without: Vec<f64>,
}

/// Relative variances of spreads over the same pixels; none if nothing varies or nothing is lit.
fn relative_variances(spreads: &[&Spread]) -> Option<Vec<RelativeVariance>> {
    let block_count = spreads.iter().map(|spread| spread.blocks.len()).min()?;
    let mean_of = |blocks: &[&Block]| {
        let count: f64 = blocks.iter().map(|block| block.count).sum();
        if count > 0.0 { blocks.iter().map(|block| block.sum).sum::<f64>() / count } else { 0.0 }
    };
    let at = |index: usize| spreads.iter().map(move |spread| &spread.blocks[index]);
    let image_mean = mean_of(&(0..block_count).flat_map(at).collect::<Vec<_>>());
    if image_mean <= 0.0 {
        return None;
    }
    let scales: Vec<f64> = (0..block_count)
        .map(|index| mean_of(&at(index).collect::<Vec<_>>()).powi(2) + 0.01 * image_mean.powi(2))
        .collect();
    let group_count = GROUPS.min(block_count);
    let of_spread = |spread: &&Spread| {
        let blocks = spread.blocks.iter().zip(&scales).enumerate();
        let mut all: Vec<(f64, usize)> = blocks
            .flat_map(|(index, (block, scale))| {
                block.variances.iter().map(move |variance| (variance / scale, index % group_count))
            })
            .collect();
        all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let values = |without: Option<usize>| {
            let kept = all.iter().filter(|(_, group)| Some(*group) != without);
            kept.map(|(value, _)| *value).collect::<Vec<f64>>()
        };
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let trimmed = |values: Vec<f64>| {
            mean(&values[..values.len() - (values.len() as f64 * TRIMMED).ceil() as usize])
        };
        RelativeVariance {
            raw: mean(&values(None)),
            trimmed: trimmed(values(None)),
            without: (0..group_count).map(|group| trimmed(values(Some(group)))).collect(),
        }
    };
    let variances: Vec<RelativeVariance> = spreads.iter().map(of_spread).collect();
    variances.iter().all(|variance| variance.trimmed > 0.0).then_some(variances)
}

/// Logarithm of the ratio of two trimmed variances, and its standard error by a jackknife over the groups.
fn log_ratio(variance: &RelativeVariance, other: &RelativeVariance) -> (f64, f64) {
    let pairs = variance.without.iter().zip(&other.without);
    let logarithms: Vec<f64> = pairs.map(|(a, b)| (a / b).ln()).collect();
    let count = logarithms.len() as f64;
    let mean = logarithms.iter().sum::<f64>() / count;
    let squares: f64 = logarithms.iter().map(|value| (value - mean).powi(2)).sum();
    let error = ((count - 1.0) / count * squares).sqrt();
    let is_known = count > 1.0 && error.is_finite();
    ((variance.trimmed / other.trimmed).ln(), if is_known { error } else { UNKNOWN_ERROR })
}

/// An arm in a race.
#[derive(Default)]
struct Runner {
    spread: Spread,
    /// Time of a path, by round.
    times: Vec<f64>,
    cost: ArmCost,
}

/// Races `count` arms, of which the first is in use: in every round `measure` renders the same pixels by each
/// arm, adds their samples to the spread and returns the time of a path. Arms that lose leave. Returns the
/// arm of least variance × time, or the one in use where no other is clearly better, and the costs of all.
///
/// # Errors
/// Those of `measure`.
pub fn race(
    count: usize,
    mut measure: impl FnMut(usize, u32, &mut Spread) -> Result<f64>,
) -> Result<(usize, Vec<ArmCost>)> {
    let mut runners: Vec<Runner> = (0..count).map(|_| Runner::default()).collect();
    let mut live: Vec<usize> = (0..count).collect();
    let mut order: Vec<(usize, f64)> = Vec::new();
    for round in 0..MOST_ROUNDS {
        for index in &live {
            let runner = &mut runners[*index];
            let time = measure(*index, round, &mut runner.spread)?;
            runner.times.push(time);
        }
        let Some(costs) = costs_of(&mut runners, &live) else { break };
        order = costs;
        live.retain(|index| {
            let cost = &runners[*index].cost;
            let logarithm = cost.relative_cost.ln();
            logarithm <= (CONFIDENCE * cost.log_error).max(ERROR_OF_TIMES)
        });
        // The rest is too close to pay for another round.
        let is_close = |index: &usize| {
            let cost = &runners[*index].cost;
            cost.relative_cost.ln() + cost.log_error < CLOSE.ln()
        };
        if live.len() < 2 || round > 0 && live.iter().all(is_close) {
            break;
        }
    }
    let best = order.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| *index);
    let in_use = order.iter().find(|(index, _)| *index == 0);
    let keeps = in_use.is_some_and(|(_, ratio)| live.contains(&0) && CLEAR_GAIN * ratio <= 1.0);
    let chosen = if keeps { 0 } else { best };
    let mut costs: Vec<ArmCost> = runners.into_iter().map(|runner| runner.cost).collect();
    costs[chosen].is_chosen = true;
    Ok((chosen, costs))
}

/// Computes the costs of the arms in a race, relative to the best of them; none if nothing varies.
fn costs_of(runners: &mut [Runner], live: &[usize]) -> Option<Vec<(usize, f64)>> {
    let spreads: Vec<&Spread> = live.iter().map(|index| &runners[*index].spread).collect();
    let variances = relative_variances(&spreads)?;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let times: Vec<f64> = live.iter().map(|index| mean(&runners[*index].times)).collect();
    let log_cost = |place: usize| log_ratio(&variances[place], &variances[0]).0 + times[place].ln();
    let best = (0..live.len()).min_by(|a, b| log_cost(*a).total_cmp(&log_cost(*b)))?;
    let costs = (0..live.len()).map(|place| {
        let (ratio, error) = log_ratio(&variances[place], &variances[best]);
        let relative_cost = (ratio + (times[place] / times[best]).ln()).exp();
        let runner = &mut runners[live[place]];
        runner.cost = ArmCost {
            rounds: runner.times.len() as u32,
            time: times[place],
            relative_variance: variances[place].raw,
            trimmed_variance: variances[place].trimmed,
            relative_cost,
            log_error: error,
            ..ArmCost::default()
        };
        (live[place], relative_cost)
    });
    Some(costs.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::hash_4d;

    #[test]
    fn variances_and_their_errors_are_those_of_the_books() {
        let mut spread = Spread::default();
        spread.add(0, &[[1.0, 2.0, 0.0], [3.0, 2.0, 2.0], [2.0, 2.0, 4.0]]);
        // Unbiased variances 1, 0 and 4 of the channels.
        assert!((spread.blocks[0].variances[0] - 5.0 / 3.0).abs() < 1e-12, "{spread:?}");
        assert!((spread.blocks[0].sum - 6.0).abs() < 1e-12, "{spread:?}");
        let of = |trimmed: f64, logarithms: &[f64]| RelativeVariance {
            raw: 1.0,
            trimmed,
            without: logarithms.iter().map(|value| value.exp()).collect(),
        };
        // Logarithms 0, 1 and 5 of all groups but one: squares of 14 around their mean, of which two thirds.
        let (ratio, error) = log_ratio(&of(3.0, &[1.0, 2.0, 6.0]), &of(2.0, &[1.0; 3]));
        assert!((ratio - 1.5_f64.ln()).abs() < 1e-12, "{ratio}");
        assert!((error - (28.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{error}");
        assert_eq!(log_ratio(&of(1.0, &[2.0]), &of(1.0, &[1.0])), (0.0, UNKNOWN_ERROR));
        // Variances 2 and ½ around means of 2 and 0, in an image of mean 1.
        let mut spread = Spread::default();
        spread.add(0, &[[1.0; 3], [3.0; 3]]);
        spread.add(1, &[[-0.5; 3], [0.5; 3]]);
        let raw = relative_variances(&[&spread]).unwrap()[0].raw;
        assert!((raw / (0.5 * (2.0 / 4.01 + 0.5 / 0.01)) - 1.0).abs() < 1e-12, "{raw}");
    }

    /// Arms whose samples are the same: their times alone differ, by less than times may be wrong by.
    #[test]
    fn times_are_means_over_rounds() {
        let (_, costs) = race(2, |index, round, spread| {
            for block in 0..GROUPS {
                spread.add(spread.block_count().max(block), &[[1.0; 3], [2.0; 3], [3.0; 3]]);
            }
            Ok([1.0, 1.04][index] + 0.02 * f64::from(round))
        })
        .unwrap();
        assert_eq!([costs[0].rounds, costs[1].rounds], [2, 2]);
        assert!((costs[0].time - 1.01).abs() < 1e-12 && (costs[1].time - 1.05).abs() < 1e-12);
    }

    /// An arm whose samples are known: its time, and the deviation of its samples relative to their mean.
    #[derive(Clone, Copy)]
    struct Planted {
        time: f64,
        deviation: f32,
        /// One sample in so many is bright; 0 for none.
        rare: u32,
    }

    fn planted(time: f64, deviation: f32) -> Planted {
        Planted { time, deviation, rare: 0 }
    }

    /// Races arms over 64 blocks of different brightness in every round; returns winner, costs and the number
    /// of waves.
    fn race_planted(arms: &[Planted], seed: u32) -> (usize, Vec<ArmCost>, usize) {
        let mut waves = 0;
        let result = race(arms.len(), |index, round, spread| {
            waves += 1;
            let arm = arms[index];
            let first = spread.block_count();
            for pixel in 0..64 * 64 {
                let block = pixel / 64;
                let sample = |sample: u32| {
                    let words = hash_4d([seed + index as u32, round, pixel, sample]);
                    let noise = words[0] as f32 / u32::MAX as f32 - 0.5;
                    let is_rare = arm.rare > 0 && words[1].is_multiple_of(arm.rare);
                    let firefly = if is_rare { 100.0 } else { 0.0 };
                    [(1.0 + arm.deviation * noise + firefly) * f32::from(block as u8 + 1); 3]
                };
                spread.add(first + block as usize, &[0, 1, 2, 3].map(sample));
            }
            Ok(arm.time)
        });
        let (winner, costs) = result.unwrap();
        (winner, costs, waves)
    }

    #[test]
    fn the_cheaper_arm_is_chosen() {
        for seed in [0, 100, 200] {
            let winner = |arms: &[Planted]| race_planted(arms, seed).0;
            assert_eq!(winner(&[planted(1.0, 1.0), planted(0.7, 1.0)]), 1, "the same in less time");
            assert_eq!(winner(&[planted(1.0, 1.0), planted(0.5, 1.3)]), 1, "1.7 times in half");
            assert_eq!(winner(&[planted(1.0, 1.0), planted(0.5, 1.6)]), 0, "2.6 times in half");
            assert_eq!(winner(&[planted(1.0, 1.0), planted(1.0, 0.99)]), 0, "no clear gain");
            let many = [1.0, 0.9, 0.5, 0.8].map(|time| planted(time, 1.0));
            assert_eq!(winner(&many), 2);
        }
    }

    #[test]
    fn clear_losers_leave_after_one_round() {
        let (winner, costs, waves) = race_planted(&[planted(1.0, 1.0), planted(2.0, 1.0)], 7);
        assert_eq!((winner, waves), (0, 2));
        assert!(costs[0].is_chosen && !costs[1].is_chosen);
        assert!((costs[1].relative_cost / 2.0 - 1.0).abs() < 0.1, "{costs:?}");
        // A uniform deviate has the variance 1/12; the scale is the squared mean and a floor.
        assert!((0.6 / 12.0..1.0 / 12.0).contains(&costs[0].relative_variance), "{costs:?}");
    }

    #[test]
    fn few_fireflies_do_not_decide() {
        // They carry nearly all of the raw variance, and fall on the cheap arm by chance.
        let mut wins = 0;
        for seed in 0..10 {
            let cheap = Planted { rare: 50_000, ..planted(0.6, 1.0) };
            let (winner, costs, _) = race_planted(&[planted(1.0, 1.0), cheap], 10 * seed);
            assert!(costs[1].relative_variance >= costs[1].trimmed_variance);
            wins += winner;
        }
        assert!(wins >= 8, "{wins} of 10");
    }

    #[test]
    fn who_is_uncertain_stays() {
        // Fireflies in one pixel of a hundred: the arm in use seems dearer, and nobody can be sure.
        let rounds = |seed| {
            let rare = Planted { rare: 350, ..planted(0.8, 1.0) };
            race_planted(&[planted(1.0, 1.0), rare], seed).1[0].rounds
        };
        let stays = (0..10).filter(|seed| rounds(10 * seed) > 1).count();
        assert!(stays >= 3, "{stays} of 10");
    }

    #[test]
    fn many_fireflies_do() {
        let bright = Planted { rare: 50, ..planted(0.6, 1.0) };
        assert_eq!(race_planted(&[planted(1.0, 1.0), bright], 3).0, 0);
    }

    #[test]
    fn who_knows_nothing_keeps_the_arm_in_use() {
        let (winner, costs, waves) = race_planted(&[planted(1.0, 0.0), planted(0.1, 0.0)], 1);
        assert_eq!((winner, waves), (0, 2));
        assert_eq!(costs[1].relative_cost, 0.0);
        let dark = race(2, |_, _, spread| {
            spread.add(0, &[[0.0; 3]; 4]);
            Ok(1.0)
        });
        assert_eq!(dark.unwrap().0, 0);
        let broken = race(2, |index, _, spread| {
            spread.add(0, &[[1.0; 3], [if index == 1 { f32::NAN } else { 2.0 }; 3]]);
            Ok(1.0)
        });
        assert_eq!(broken.unwrap().0, 0);
    }
}
