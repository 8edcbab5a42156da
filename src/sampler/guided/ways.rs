//! Chooses sampler and numbers of shadow rays by measurement: from a short ladder of ways to render a
//! sample, the next one as long as it clearly lowers variance × time.
//!
//! Measures as `choice.rs` does, with the guide as the first sample will find it: no ray
//! of it is in the picture, which depends on it through the chosen way only.

use std::time::Instant;

use super::{
    choice::{MOST_ROUNDS, Measured, Trial},
    cost::{Verdict, judge, relative_variances, upper_median},
};
use crate::{
    error::Result,
    film::statistics::{RayChoice, RayCost},
    pass::{Progress, Runner},
};

/// Least number of rounds before another way is taken.
const FEWEST_ROUNDS_FOR_CHANGE: u32 = 2;

/// A way to render a sample: sampler, and shadow rays at the first and at each later vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    /// True for `mis`, false for `guided`.
    pub is_mis: bool,
    /// Shadow rays at the first and at each later vertex.
    pub rays: [u32; 2],
}

impl Way {
    /// Returns the way for statistics.
    pub fn described(&self) -> RayChoice {
        let sampler = if self.is_mis { "mis" } else { "guided" }.to_owned();
        RayChoice { sampler, first: self.rays[0], later: self.rays[1] }
    }
}

/// Lists the rays to try after `rays`, each fewer than the one before, in a render of `depth` vertices.
/// `later` is a number for later vertices that the user asked for.
pub fn fewer_rays(rays: [u32; 2], depth: u32, later: Option<u32>) -> Vec<[u32; 2]> {
    let ladder: &[[u32; 2]] = if depth > 1 { &[[2, 1], [1, 1]] } else { &[[2, 2], [1, 1]] };
    let pinned = |[first, own]: [u32; 2]| match later {
        Some(later) => [first, later.min(first)],
        None => [first, own.min(rays[1])],
    };
    ladder.iter().copied().filter(|[first, _]| *first < rays[0]).map(pinned).collect()
}

/// Bounds the ratio of the times of two ways: fewer rays of the same sampler save time, but no more than
/// their share. On a busy machine single timings are far off.
pub fn plausible_ratio(ratio: f64, [chosen, other]: [Way; 2]) -> f64 {
    let saves = other.rays[0] <= chosen.rays[0] && other.rays[1] <= chosen.rays[1];
    if chosen.is_mis != other.is_mis || !saves {
        return ratio;
    }
    let share =
        |vertex: usize| f64::from(other.rays[vertex]) / f64::from(chosen.rays[vertex].max(1));
    ratio.clamp(share(0).min(share(1)), 1.0)
}

/// The chosen way, with the measurements behind it.
pub(super) struct ChosenWay {
    pub(super) way: Way,
    pub(super) costs: Vec<RayCost>,
    pub(super) ms: f64,
}

impl Trial<'_> {
    /// Goes through `ways` from the first on, and takes the next as long as it is clearly better.
    /// `other`, if any, is compared with the first before and decides the sampler of the rest. Forgets
    /// the counts since the last rebuild.
    pub(super) fn choose_way(
        mut self,
        runner: &mut Runner,
        progress: &Progress,
        first: Way,
        other: Option<Way>,
        later: Option<u32>,
    ) -> Result<ChosenWay> {
        let start = Instant::now();
        let mut chosen = first;
        let mut costs = Vec::new();
        let mut round = 0;
        if let Some(other) = other
            && self.is_better(runner, progress, [chosen, other], &mut round, &mut costs)?
        {
            chosen = other;
        }
        for rays in fewer_rays(chosen.rays, runner.settings().depth, later) {
            let next = Way { rays, ..chosen };
            if !self.is_better(runner, progress, [chosen, next], &mut round, &mut costs)? {
                break;
            }
            chosen = next;
        }
        self.buffers.clear_counts()?;
        runner.take_counters()?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let figures: Vec<String> = costs.iter().map(ToString::to_string).collect();
        let described = chosen.described();
        log::info!("{described} by measurement in {ms:.0} ms: {}", figures.join("; "));
        Ok(ChosenWay { way: chosen, costs, ms })
    }

    /// Measures two ways in turns, adds their costs, and returns true if the second is clearly better.
    fn is_better(
        &mut self,
        runner: &mut Runner,
        progress: &Progress,
        ways: [Way; 2],
        round: &mut u32,
        costs: &mut Vec<RayCost>,
    ) -> Result<bool> {
        self.take(ways[0]);
        let samples = self.samples_to_measure(runner, progress, self.steps.candidates)?;
        let mut measured = [Measured::default(), Measured::default()];
        let (first_round, mut first_ms, mut ratios) = (*round, None, Vec::new());
        let mut verdict = Verdict::Unclear;
        let mut found: Option<[RayCost; 2]> = None;
        for _ in 0..MOST_ROUNDS {
            let mut ms = [0.0; 2];
            for turn in 0..2 {
                let index = (turn + *round as usize) % 2;
                self.take(ways[index]);
                let candidates = self.steps.candidates;
                let (wave_ms, paths) =
                    self.measure(runner, progress, candidates, *round, samples)?;
                ms[index] = wave_ms / paths.len().max(1) as f64;
                measured[index].add(&paths, samples);
            }
            *round += 1;
            ratios.push(plausible_ratio(ms[1] / ms[0], ways));
            let first_ms = *first_ms.get_or_insert(ms[0]);
            let spreads = [&measured[0].spread, &measured[1].spread];
            let Some(variances) = relative_variances(&spreads) else { continue };
            let pixels = f64::from(runner.film().padded_pixels());
            let times = [first_ms, first_ms * upper_median(&ratios)];
            let cost = |index: usize| RayCost {
                way: ways[index].described(),
                ms_per_sample: times[index] * pixels,
                relative_variance: variances[index].0,
                log_variance_error: variances[index].1,
            };
            let pair = [cost(0), cost(1)];
            let product = |cost: &RayCost| cost.relative_variance * cost.ms_per_sample;
            verdict = judge(product(&pair[0]), product(&pair[1]), pair[1].log_variance_error);
            found = Some(pair);
            // A single pair of waves does not tell that less time is needed.
            let is_sure = *round - first_round >= FEWEST_ROUNDS_FOR_CHANGE;
            if verdict == Verdict::Worse || verdict == Verdict::Better && is_sure {
                break;
            }
        }
        costs.extend(found.into_iter().flatten());
        Ok(verdict == Verdict::Better)
    }

    /// Makes a way current.
    fn take(&mut self, way: Way) {
        self.is_mis = way.is_mis;
        self.steps = self.steps.with_rays(Some(way.rays));
        self.open_steps = self.open_steps.with_rays(Some(way.rays));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_believed_within_reason() {
        let way = |is_mis, rays| Way { is_mis, rays };
        let fewer = [way(false, [5, 2]), way(false, [2, 1])];
        assert_eq!([0.1, 0.7, 3.0].map(|ratio| plausible_ratio(ratio, fewer)), [0.4, 0.7, 1.0]);
        assert_eq!(plausible_ratio(0.1, [way(true, [5, 1]), way(false, [5, 2])]), 0.1);
    }

    #[test]
    fn the_ladder_leads_to_fewer_rays() {
        assert_eq!(fewer_rays([5, 2], 6, None), [[2, 1], [1, 1]]);
        assert_eq!(fewer_rays([2, 1], 6, None), [[1, 1]]);
        assert!(fewer_rays([1, 1], 6, None).is_empty());
        assert_eq!(fewer_rays([5, 5], 1, None), [[2, 2], [1, 1]]);
        // A number that was asked for stays, as far as the first vertex has as many.
        assert_eq!(fewer_rays([5, 2], 6, Some(2)), [[2, 2], [1, 1]]);
    }
}
