//! Time to quality: seconds until the relative error of a run falls to a threshold and stays there.
//!
//! Runs are looked at after powers of two of samples. Between two looks the error is taken as a
//! power of the time, a straight line between logarithms. Errors of fireflies go up and down, so
//! the time counted is that after which every later look of the run is at or below the threshold.

use serde::Serialize;

use super::{
    plan::{JUDGED_FROM, Plan},
    runs::{Measurement, Run, StudiedScene},
    statistics::median_interval,
};

/// Relative squared errors whose times are reported: a picture of visible noise, and one of little.
pub(crate) const THRESHOLDS: [f64; 2] = [0.1, 0.02];

/// Figure that falls to a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Figure {
    /// Mean relative squared error of all pixels.
    Relmse,
    /// The same without the worst 0.1% of the pixels.
    RelmseTrimmed,
}

impl Figure {
    pub const ALL: [Self; 2] = [Self::Relmse, Self::RelmseTrimmed];

    /// Name in `results.csv`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Relmse => "relmse",
            Self::RelmseTrimmed => "relmse_trimmed",
        }
    }

    pub(crate) fn of(self, measurement: &Measurement) -> f64 {
        match self {
            Self::Relmse => measurement.errors.relmse,
            Self::RelmseTrimmed => measurement.errors.relmse_trimmed,
        }
    }
}

/// Time after which one run stays at or below a threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Time {
    /// Interpolated between two looks, seconds.
    Reached(f64),
    /// Its first look was already there: no later than these seconds.
    AtMost(f64),
    /// Its last look is above the threshold, with that look's error, after these seconds.
    NotReached { seconds: f64, error: f64 },
}

impl Time {
    /// Seconds, if the threshold was reached.
    pub(crate) fn seconds(self) -> Option<f64> {
        match self {
            Self::Reached(seconds) | Self::AtMost(seconds) => Some(seconds),
            Self::NotReached { .. } => None,
        }
    }
}

/// Finds when a curve of seconds and errors, ascending in seconds, falls to `threshold` for good.
/// `None` for no looks.
///
/// An error that is not positive, which a reference in two halves can give, has no logarithm; then
/// the look's own time counts, which is too late rather than too early.
pub(crate) fn time_to(looks: &[[f64; 2]], threshold: f64) -> Option<Time> {
    let [seconds, error] = *looks.last()?;
    let is_above = |look: &[f64; 2]| look[1].is_nan() || look[1] > threshold;
    Some(match looks.iter().rposition(is_above) {
        None => Time::AtMost(looks[0][0]),
        Some(last) if last + 1 == looks.len() => Time::NotReached { seconds, error },
        Some(last) => {
            let ([t0, e0], [t1, e1]) = (looks[last], looks[last + 1]);
            let share = (e0 / threshold).ln() / (e0 / e1).ln();
            let is_usable = t0 > 0.0 && e1 > 0.0 && share.is_finite();
            Time::Reached(if is_usable { t0 * (t1 / t0).powf(share.clamp(0.0, 1.0)) } else { t1 })
        }
    })
}

pub(crate) fn time_of_run(run: &Run, figure: Figure, threshold: f64) -> Option<Time> {
    let looks: Vec<[f64; 2]> =
        run.measurements.iter().map(|look| [look.seconds, figure.of(look)]).collect();
    time_to(&looks, threshold)
}

/// Time of one sampler in one scene, over the seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimeToQuality {
    pub scene: String,
    /// Contender's label.
    pub sampler: String,
    /// Figure that falls.
    pub figure: Figure,
    /// Value that it falls to.
    pub threshold: f64,
    /// True if the threshold is well above the reference's own error, or that is not known.
    pub is_judged: bool,
    /// Runs, one of each seed.
    pub runs: usize,
    /// Those that reached the threshold.
    pub reached: usize,
    /// Median of the seconds; absent unless the middle runs reached the threshold.
    pub seconds: Option<f64>,
    /// True if a middle run was there at its first look, so that the median is an upper bound.
    pub is_upper_bound: bool,
    /// Seconds of the fastest run.
    pub fastest: Option<f64>,
    /// Seconds of the slowest run; absent if one run did not reach the threshold.
    pub slowest: Option<f64>,
    /// Median of the errors at the ends of the runs.
    pub last_error: f64,
    /// Median of the seconds at the ends of the runs.
    pub last_seconds: f64,
    /// Extrapolation, not a measurement: median seconds if the error of every run that ended too
    /// early went on to fall as 1/time. Absent if the threshold was reached.
    pub extrapolated_seconds: Option<f64>,
}

/// Computes the times of every sampler in every scene, in the plan's order, by threshold and figure.
pub fn times_to_quality(plan: &Plan, scenes: &[StudiedScene], runs: &[Run]) -> Vec<TimeToQuality> {
    let mut all = Vec::new();
    for scene in scenes {
        for figure in Figure::ALL {
            for threshold in THRESHOLDS {
                for contender in &plan.contenders {
                    let own = longest_runs(runs, &scene.name, &contender.label);
                    if !own.is_empty() {
                        all.push(over_seeds(scene, &contender.label, &own, figure, threshold));
                    }
                }
            }
        }
    }
    all
}

/// Runs of a sampler in a scene: for each seed the one that went on for the longest time.
fn longest_runs<'a>(runs: &'a [Run], scene: &str, sampler: &str) -> Vec<&'a Run> {
    let mut longest: Vec<&Run> = Vec::new();
    let end = |run: &Run| run.last().map_or(0.0, |last| last.seconds);
    for run in runs.iter().filter(|run| run.scene == scene && run.sampler == sampler) {
        match longest.iter_mut().find(|other| other.seed == run.seed) {
            Some(other) if end(run) > end(other) => *other = run,
            Some(_) => {}
            None => longest.push(run),
        }
    }
    longest
}

fn over_seeds(
    scene: &StudiedScene,
    sampler: &str,
    runs: &[&Run],
    figure: Figure,
    threshold: f64,
) -> TimeToQuality {
    let mut times: Vec<Time> =
        runs.iter().filter_map(|run| time_of_run(run, figure, threshold)).collect();
    let order = |time: &Time| time.seconds().unwrap_or(f64::INFINITY);
    times.sort_by(|a, b| order(a).total_cmp(&order(b)));
    let reached = times.iter().filter(|time| time.seconds().is_some()).count();
    // The one or two runs in the middle.
    let last = times.len().saturating_sub(1);
    let middle: Vec<Time> = times.get(last / 2..=last.div_ceil(2)).unwrap_or_default().to_vec();
    let seconds: Option<Vec<f64>> = middle.iter().map(|time| time.seconds()).collect();
    let seconds = seconds.filter(|seconds| !seconds.is_empty());
    let seconds = seconds.map(|seconds| seconds.iter().sum::<f64>() / seconds.len() as f64);
    let own = scene.reference.as_ref().and_then(|reference| match figure {
        Figure::Relmse => reference.relmse,
        Figure::RelmseTrimmed => reference.relmse_trimmed,
    });
    let ends = |value: &dyn Fn(&Measurement) -> f64| {
        median_interval(runs.iter().filter_map(|run| run.last()).map(value).collect()).middle
    };
    let extrapolated = times.iter().map(|time| match *time {
        Time::NotReached { seconds, error } => seconds * error / threshold,
        Time::Reached(seconds) | Time::AtMost(seconds) => seconds,
    });
    TimeToQuality {
        scene: scene.name.clone(),
        sampler: sampler.to_owned(),
        figure,
        threshold,
        is_judged: own.is_none_or(|own| threshold >= JUDGED_FROM * own),
        runs: times.len(),
        reached,
        seconds,
        is_upper_bound: middle.iter().any(|time| matches!(time, Time::AtMost(_))),
        fastest: times.first().and_then(|time| time.seconds()),
        slowest: times.last().and_then(|time| time.seconds()),
        last_error: ends(&|look| figure.of(look)),
        last_seconds: ends(&|look| look.seconds),
        extrapolated_seconds: seconds
            .is_none()
            .then(|| median_interval(extrapolated.collect()).middle),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::Figures;
    use crate::study::{
        metrics::Errors,
        plan::{Description, Options, Rule},
        reference::OwnErrors,
        runs::Conditions,
    };

    fn assert_near(found: Option<f64>, expected: f64) {
        let found = found.unwrap();
        assert!((found / expected - 1.0).abs() < 1e-9, "{found}, expected {expected}");
    }

    fn seconds(looks: &[[f64; 2]], threshold: f64) -> Option<f64> {
        time_to(looks, threshold).and_then(Time::seconds)
    }

    #[test]
    fn powers_of_the_time_are_found_exactly() {
        for exponent in [0.5_f64, 1.0, 2.0] {
            let look = |t: f64| [t, 3.0 * t.powf(-exponent)];
            let looks: Vec<_> = (0..12).map(|i| look(0.3 * f64::from(1 << i))).collect();
            for threshold in [0.2_f64, 0.9] {
                let expected = (3.0_f64 / threshold).powf(1.0 / exponent);
                assert_near(seconds(&looks, threshold), expected);
            }
        }
    }

    #[test]
    fn a_threshold_counts_when_it_is_kept() {
        // A firefly at 4 s lifts the error again.
        let looks = [[1.0, 0.2], [2.0, 0.08], [4.0, 0.2], [8.0, 0.05]];
        assert_near(seconds(&looks, 0.1), 4.0 * 2.0_f64.powf(0.5));
    }

    #[test]
    fn ends_are_bounds() {
        let looks = [[1.0, 0.4], [2.0, 0.3]];
        let end = Some(Time::NotReached { seconds: 2.0, error: 0.3 });
        assert_eq!(time_to(&looks, 0.1), end);
        assert_eq!(time_to(&looks, 0.5), Some(Time::AtMost(1.0)));
        assert_eq!(time_to(&[], 0.1), None);
        // No logarithm: the look's own time.
        assert_eq!(time_to(&[[1.0, 0.4], [2.0, -0.1]], 0.1), Some(Time::Reached(2.0)));
        assert_eq!(time_to(&[[0.0, 0.4], [2.0, 0.05]], 0.1), Some(Time::Reached(2.0)));
    }

    /// A run whose error is `scale` / seconds, at 1, 2, …, 32 s.
    fn run(seed: u32, rule: Rule, scale: f64) -> Run {
        let look = |exponent: u32| {
            let seconds = f64::from(1 << exponent);
            Measurement {
                spp: 1 << exponent,
                seconds,
                errors: Errors {
                    relmse: scale / seconds,
                    relmse_trimmed: 0.5 * scale / seconds,
                    ..Errors::default()
                },
                ..Measurement::default()
            }
        };
        Run {
            scene: "room".into(),
            sampler: "mis".into(),
            rule,
            seed,
            conditions: Conditions::default(),
            measurements: (0..6).map(look).collect(),
            figures: Figures::default(),
        }
    }

    fn times(runs: &[Run], own: f64) -> Vec<TimeToQuality> {
        let samplers = crate::study::contender::Contender::parse_all(&["mis"], Default::default());
        let options = Options { samplers: samplers.ok(), ..Options::default() };
        let plan = Plan::new(vec!["room.toml".into()], Description::default(), options, Vec::new());
        let (relmse, relmse_trimmed) = (Some(own), Some(0.5 * own));
        let reference = OwnErrors { relmse, relmse_trimmed, ..OwnErrors::default() };
        let reference = Some(reference);
        let scene = StudiedScene { name: "room".into(), reference, ..StudiedScene::default() };
        times_to_quality(&plan.unwrap(), &[scene], runs)
    }

    #[test]
    fn seeds_give_a_median_and_a_spread() {
        let rule = Rule::Seconds(32.0);
        let runs: Vec<Run> =
            [(1, 0.4), (2, 1.2), (3, 0.8)].map(|(seed, scale)| run(seed, rule, scale)).into();
        let all = times(&runs, 0.006);
        let [coarse, fine, trimmed_coarse, trimmed_fine] = &all[..] else { unreachable!() };
        assert_eq!((coarse.threshold, fine.threshold), (0.1, 0.02));
        assert_near(coarse.seconds, 8.0);
        assert_near(times(&[runs[0].clone(), runs[2].clone()], 0.006)[0].seconds, 6.0);
        assert_near(coarse.fastest, 4.0);
        assert_near(coarse.slowest, 12.0);
        assert_eq!(
            (coarse.reached, coarse.is_judged, coarse.extrapolated_seconds),
            (3, true, None)
        );
        assert_near(trimmed_coarse.seconds, 4.0);
        // At 32 s the errors are 0.0125, 0.0375 and 0.025.
        assert_eq!((fine.reached, fine.runs, fine.seconds), (1, 3, None));
        assert!(!fine.is_judged, "0.02 is below four times 0.006");
        assert!(trimmed_fine.is_judged, "but not below four times 0.003");
        assert_near(fine.fastest, 20.0);
        assert_eq!(fine.slowest, None);
        assert_near(Some(fine.last_error), 0.025);
        assert_near(fine.extrapolated_seconds, 40.0);
        // One run or two of four are below the threshold at their first look.
        let is_bound = |scale| {
            let [first, _, last] = &runs[..] else { unreachable!() };
            times(&[run(4, rule, 0.05), run(5, rule, scale), first.clone(), last.clone()], 0.0)[0]
                .is_upper_bound
        };
        assert_eq!([is_bound(0.8), is_bound(0.05)], [false, true]);
    }

    #[test]
    fn the_longest_run_of_a_seed_counts() {
        let mut short = run(1, Rule::Spp(2), 9.0);
        short.measurements.truncate(2);
        let all = times(&[short, run(1, Rule::Seconds(32.0), 0.8)], 0.0);
        assert_eq!(all[0].runs, 1);
        assert_near(all[0].seconds, 8.0);
    }
}
