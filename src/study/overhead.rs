//! Overhead: how much more device time a sampler takes per sample than a baseline, pass by pass.
//!
//! Samplers take turns in rounds, rotating by one from round to round, so that a machine that slows
//! down or speeds up affects all alike. Each round gives one ratio per pass; the result is their
//! median with its 95% confidence interval.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::{
    contender::Contender,
    engine::{Study, pixels},
    plan::OverheadPlan,
    runs::{Round, Timing, assignments, distinct},
    statistics::{Interval, median_interval},
};
use crate::{
    error::Result,
    files::write_json,
    scene::Scene,
    session::{Figures, Rules, Session},
};

impl Study<'_> {
    /// Measures the rounds of a scene that the folder lacks and appends all to `rounds`.
    pub(super) fn measure_overhead(
        &mut self,
        plan: &OverheadPlan,
        scene: &Scene,
        rounds: &mut Vec<Round>,
    ) -> Result<()> {
        let OverheadPlan { baseline, contenders, spp, repetitions } = plan;
        let samplers: Vec<_> = std::iter::once(baseline).chain(contenders).collect();
        let conditions = self.conditions(scene, None)?;
        let paths_per_round = pixels(scene) * f64::from(*spp) * samplers.len() as f64;
        let mut sessions: Vec<Session> = Vec::new();
        let rules = Rules { samples: Some(*spp), ..Rules::default() };
        for repetition in 1..=*repetitions {
            if let Some(round) = self.finished_round(scene, repetition)? {
                self.watch.expect(-paths_per_round, 0.0);
                rounds.push(round);
                continue;
            }
            if sessions.is_empty() {
                for sampler in &samplers {
                    let mut session = self.session(scene, self.settings(sampler))?;
                    // Render until the size of the waves has settled.
                    self.watch.run(&mut session, &rules, false)?;
                    sessions.push(session);
                }
            }
            let mut timings = Vec::new();
            for index in 0..samplers.len() {
                let turned = (index + repetition as usize - 1) % samplers.len();
                let session = &mut sessions[turned];
                session.restart(repetition)?;
                self.watch.run(session, &rules, false)?;
                let figures = Figures::of(&session.renderer, session.seconds());
                timings.push(Timing {
                    sampler: samplers[turned].label.clone(),
                    wall_ms_per_sample: session.seconds() * 1e3 / f64::from(*spp),
                    gpu_ms_per_sample: figures.gpu_ms_per_sample,
                    visible_share: figures.visible_share,
                    statistics: figures.statistics,
                });
            }
            let round = Round {
                scene: scene.name.clone(),
                repetition,
                spp: *spp,
                conditions: conditions.clone(),
                timings,
            };
            write_json(&self.folder.round(&scene.name, repetition), &round)?;
            rounds.push(round);
        }
        let (scene, baseline) = (&scene.name, &baseline.label);
        self.watch.note(&format!("{scene}: overhead over {baseline}, {repetitions} rounds"));
        Ok(())
    }
}

/// Describes the samplers' parameters, by label, and marks the baseline.
pub(super) fn describe_parameters(plan: &OverheadPlan) -> BTreeMap<String, String> {
    let text = |contender: &Contender| assignments(&contender.describe_parameters(), ",");
    let mut all: BTreeMap<String, String> =
        plan.contenders.iter().map(|other| (other.label.clone(), text(other))).collect();
    let baseline = format!("baseline,{}", text(&plan.baseline));
    all.insert(plan.baseline.label.clone(), baseline);
    all
}

/// Overhead of one sampler in one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Overhead {
    pub scene: String,
    /// Contender's label.
    pub sampler: String,
    /// The baseline's label.
    pub baseline: String,
    /// Share of the baseline's shadow rays that are blocked; absent if none was traced.
    pub blocked_share: Option<f64>,
    /// The same for this sampler.
    pub own_blocked_share: Option<f64>,
    /// Device time of all passes over that of the baseline.
    pub total: Interval,
    /// Wall time of all passes over that of the baseline.
    pub wall: Interval,
    /// Median device milliseconds per sample: of the baseline, and of this sampler.
    pub total_ms: [f64; 2],
    pub passes: Vec<PassOverhead>,
    /// Median of the sampler's other figures, by name.
    pub statistics: BTreeMap<String, f64>,
    /// Rounds that went into the figures.
    pub rounds: usize,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassOverhead {
    pub pass: String,
    /// Median device milliseconds per sample: of the baseline, and of this sampler; 0 if absent.
    pub ms: [f64; 2],
    /// Ratio of the two; absent if one side has no such pass.
    pub ratio: Option<Interval>,
    /// Time that the pass adds, as a share of the baseline's whole time.
    pub added_share: Interval,
}

/// Computes the overhead of every sampler in every scene, in the order of the first round.
pub fn overheads(rounds: &[Round], baseline: &str) -> Vec<Overhead> {
    let mut all = Vec::new();
    for scene in distinct(rounds.iter().map(|round| round.scene.as_str())) {
        let rounds: Vec<&Round> = rounds.iter().filter(|round| round.scene == scene).collect();
        let Some(first) = rounds.first() else { continue };
        for timing in first.timings.iter().filter(|timing| timing.sampler != baseline) {
            let pairs: Vec<[&Timing; 2]> = rounds
                .iter()
                .filter_map(|round| Some([find(round, baseline)?, find(round, &timing.sampler)?]))
                .collect();
            all.push(overhead(scene, baseline, &timing.sampler, &pairs));
        }
    }
    all
}

fn find<'a>(round: &'a Round, sampler: &str) -> Option<&'a Timing> {
    round.timings.iter().find(|timing| timing.sampler == sampler)
}

/// Computes one sampler's overhead from pairs of timings, the baseline's first.
fn overhead(scene: &str, baseline: &str, sampler: &str, pairs: &[[&Timing; 2]]) -> Overhead {
    let each =
        |value: &dyn Fn(&[&Timing; 2]) -> f64| median_interval(pairs.iter().map(value).collect());
    let median =
        |side: usize, value: &dyn Fn(&Timing) -> f64| each(&|pair| value(pair[side])).middle;
    let ms =
        |timing: &Timing, pass: &str| timing.gpu_ms_per_sample.get(pass).copied().unwrap_or(0.0);
    let names: BTreeSet<&String> =
        pairs.iter().flatten().flat_map(|timing| timing.gpu_ms_per_sample.keys()).collect();
    let passes = names
        .into_iter()
        .map(|pass| {
            let medians = [0, 1].map(|side| median(side, &|timing| ms(timing, pass)));
            PassOverhead {
                pass: pass.clone(),
                ms: medians,
                ratio: (medians[0] > 0.0 && medians[1] > 0.0)
                    .then(|| each(&|[ours, theirs]| ms(theirs, pass) / ms(ours, pass).max(1e-9))),
                added_share: each(&|[ours, theirs]| {
                    (ms(theirs, pass) - ms(ours, pass)) / ours.total_ms().max(1e-9)
                }),
            }
        })
        .collect();
    let blocked = |side: usize| {
        let shares: Option<Vec<f64>> =
            pairs.iter().map(|pair| pair[side].visible_share.map(|share| 1.0 - share)).collect();
        shares.filter(|shares| !shares.is_empty()).map(|shares| median_interval(shares).middle)
    };
    let statistics: BTreeSet<&String> =
        pairs.iter().flat_map(|pair| pair[1].statistics.keys()).collect();
    Overhead {
        scene: scene.to_owned(),
        sampler: sampler.to_owned(),
        baseline: baseline.to_owned(),
        blocked_share: blocked(0),
        own_blocked_share: blocked(1),
        total: each(&|[ours, theirs]| theirs.total_ms() / ours.total_ms().max(1e-9)),
        wall: each(&|[ours, theirs]| theirs.wall_ms_per_sample / ours.wall_ms_per_sample.max(1e-9)),
        total_ms: [0, 1].map(|side| median(side, &Timing::total_ms)),
        passes,
        statistics: statistics
            .into_iter()
            .map(|name| {
                let value = |timing: &Timing| timing.statistics.get(name).copied().unwrap_or(0.0);
                (name.clone(), median(1, &value))
            })
            .collect(),
        rounds: pairs.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::runs::Conditions;

    fn timing(sampler: &str, passes: &[(&str, f64)], visible: f64) -> Timing {
        Timing {
            sampler: sampler.into(),
            wall_ms_per_sample: 1.1 * passes.iter().map(|(_, ms)| ms).sum::<f64>(),
            gpu_ms_per_sample: passes.iter().map(|(name, ms)| ((*name).into(), *ms)).collect(),
            visible_share: Some(visible),
            statistics: BTreeMap::from([("rebuilds".into(), 2.0)]),
        }
    }

    fn rounds() -> Vec<Round> {
        // The machine slows down from round to round; the ratios stay.
        (1..=9)
            .map(|repetition| {
                let slow = 1.0 + f64::from(repetition) / 3.0;
                Round {
                    scene: "room".into(),
                    repetition,
                    spp: 4,
                    conditions: Conditions::default(),
                    timings: vec![
                        timing("product", &[("sample", slow), ("shadow", slow)], 0.2),
                        timing(
                            "visibility",
                            &[("sample", 1.5 * slow), ("shadow", slow), ("cache", 0.2 * slow)],
                            0.4,
                        ),
                    ],
                }
            })
            .collect()
    }

    #[test]
    fn ratios_are_those_of_neighbours() {
        let all = overheads(&rounds(), "product");
        assert_eq!(all.len(), 1);
        let overhead = &all[0];
        assert_eq!((overhead.sampler.as_str(), overhead.rounds), ("visibility", 9));
        for value in [overhead.total.low, overhead.total.middle, overhead.total.high] {
            assert!((value - 1.35).abs() < 1e-12, "{value}");
        }
        assert!((overhead.wall.middle - 1.35).abs() < 1e-12);
        assert!((overhead.blocked_share.unwrap_or(0.0) - 0.8).abs() < 1e-12);
        assert!((overhead.own_blocked_share.unwrap_or(0.0) - 0.6).abs() < 1e-12);
        assert_eq!(overhead.statistics["rebuilds"], 2.0);
    }

    #[test]
    fn rounds_over_another_baseline_are_others() {
        let texts = ["mis", "ris:candidates=8"];
        let samplers = Contender::parse_all(&texts, Default::default()).unwrap_or_default();
        let described = |baseline: usize| {
            describe_parameters(&OverheadPlan {
                baseline: samplers[baseline].clone(),
                contenders: vec![samplers[1 - baseline].clone()],
                spp: 16,
                repetitions: 2,
            })
        };
        assert_eq!(described(0).len(), 2);
        assert_ne!(described(0), described(1));
    }

    #[test]
    fn passes_add_up() {
        let overhead = &overheads(&rounds(), "product")[0];
        let pass = |name: &str| overhead.passes.iter().find(|pass| pass.pass == name);
        let ratio = |name| pass(name).and_then(|pass| pass.ratio).map(|ratio| ratio.middle);
        assert!(ratio("sample").is_some_and(|ratio| (ratio - 1.5).abs() < 1e-12));
        assert_eq!(ratio("cache"), None, "the baseline has no such pass");
        let added: f64 = overhead.passes.iter().map(|pass| pass.added_share.middle).sum();
        assert!((added - (overhead.total.middle - 1.0)).abs() < 1e-12);
    }
}
