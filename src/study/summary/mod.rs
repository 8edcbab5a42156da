//! Figures over the seeds of a study: one summary for every scene, sampler and rule, and the curves
//! of error against samples and time.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::{
    metrics::{Errors, parts::PartErrors},
    plan::{Plan, Rule},
    reference::is_judged,
    runs::{Measurement, Run, StudiedScene},
    statistics::{Interval, geometric_interval, mean_interval, slope},
    surfaces::Parts,
};

/// Standard errors between the means beyond which the report points the deviation out.
pub(crate) const SUSPICIOUS_DEVIATION: f64 = 4.0;

/// One sampler in one scene under one rule, over all seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    pub scene: String,
    /// Contender's label.
    pub sampler: String,
    /// Rule that ended the runs, or a number of samples on the way.
    pub rule: Rule,
    pub runs: usize,
    /// Mean samples per pixel.
    pub spp: f64,
    /// Mean wall time of the passes, seconds.
    pub seconds: f64,
    /// Mean device time of the passes, seconds.
    pub gpu_seconds: f64,
    /// Means of the errors of the runs, and the root of the mean squared error.
    #[serde(flatten)]
    pub errors: Errors,
    /// True if `mse` passes [`is_judged`].
    pub mse_judged: bool,
    /// True if both relative errors pass it.
    pub relmse_judged: bool,
    /// RMSE over that of the first sampler, by pairs of one seed; absent if one is not judged.
    pub rmse_ratio: Option<Interval>,
    /// Root of trimmed relMSE over that of the first sampler, likewise.
    pub relative_ratio: Option<Interval>,
    /// MSE · seconds of the first sampler over that of this one: how many times as fast this one
    /// reaches the same error. Absent if one is not judged.
    pub efficiency: Option<Interval>,
    /// Means of the errors over lit surfaces and over the environment seen directly.
    pub parts: Parts,
    /// Trimmed relMSE over lit surfaces over that of the first sampler, by pairs of one seed; absent
    /// if one is not judged.
    pub surfaces_ratio: Option<Interval>,
    /// Mean of the pictures' mean FLIP.
    pub flip: Option<f64>,
    /// Mean over the seeds of the picture's mean over the reference's.
    pub mean_ratio: Interval,
    /// The largest deviation of a run's mean in standard errors.
    pub mean_deviation: Option<f64>,
    /// Mean share of shadow rays that reached the environment, over the whole run.
    pub visible_share: Option<f64>,
    /// Mean device milliseconds per sample by pass, over the whole run.
    pub gpu_ms_per_sample: BTreeMap<String, f64>,
    /// Mean of the sampler's other figures, over the whole run.
    pub statistics: BTreeMap<String, f64>,
}

impl Summary {
    /// True if the mean deviates from the reference's by more than noise explains.
    pub(crate) fn is_suspicious(&self) -> bool {
        self.mean_deviation.is_some_and(|deviation| deviation.abs() > SUSPICIOUS_DEVIATION)
    }
}

/// Summarises runs in the plan's order of scenes, rules and samplers; leaves out samplers without a
/// finished run.
pub fn summaries(plan: &Plan, scenes: &[StudiedScene], runs: &[Run]) -> Vec<Summary> {
    let mut all = Vec::new();
    for scene in scenes {
        for rule in plan.rules() {
            let first = plan.contenders.first();
            let baseline = first.map(|first| pairs(runs, &scene.name, &first.label, rule));
            for contender in &plan.contenders {
                let own = pairs(runs, &scene.name, &contender.label, rule);
                if !own.is_empty() {
                    let baseline = baseline.as_deref().unwrap_or_default();
                    all.push(summary(scene, &contender.label, rule, &own, baseline));
                }
            }
        }
    }
    all
}

/// Pairs the runs of a scene and sampler with their measurement under `rule`.
fn pairs<'a>(
    runs: &'a [Run],
    scene: &str,
    sampler: &str,
    rule: Rule,
) -> Vec<(&'a Run, &'a Measurement)> {
    runs.iter()
        .filter(|run| run.scene == scene && run.sampler == sampler)
        .filter_map(|run| run.at(rule).map(|measurement| (run, measurement)))
        .collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / f64::max(count, 1.0)
}

/// Mean of values that all are there.
fn mean_of_all(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values.collect::<Option<Vec<f64>>>().map(|values| mean(values.into_iter()))
}

/// Mean of figures over the runs, by name; a figure that a run lacks counts as 0.
fn means(
    own: &[(&Run, &Measurement)],
    figures: fn(&Run) -> &BTreeMap<String, f64>,
) -> BTreeMap<String, f64> {
    let names: BTreeSet<&String> = own.iter().flat_map(|(run, _)| figures(run).keys()).collect();
    let value = |run: &Run, name: &String| figures(run).get(name).copied().unwrap_or(0.0);
    let mean_of = |name: &String| mean(own.iter().map(|(run, _)| value(run, name)));
    names.into_iter().map(|name| (name.clone(), mean_of(name))).collect()
}

/// Means over the seeds of the errors over all pixels.
fn mean_errors(own: &[(&Run, &Measurement)]) -> Errors {
    let average = |error: fn(&Errors) -> f64| mean(own.iter().map(|(_, m)| error(&m.errors)));
    let mse = average(|errors| errors.mse);
    Errors {
        mse,
        rmse: mse.max(0.0).sqrt(),
        relmse: average(|errors| errors.relmse),
        relmse_trimmed: average(|errors| errors.relmse_trimmed),
        relmse_p999: average(|errors| errors.relmse_p999),
        relmse_max: average(|errors| errors.relmse_max),
    }
}

/// Means over the seeds of the errors in both parts of the picture.
fn mean_parts(own: &[(&Run, &Measurement)], scene: &StudiedScene) -> Parts {
    let surfaces = mean_of_parts(own.iter().map(|(_, m)| m.parts.surfaces));
    let environment = mean_of_parts(own.iter().map(|(_, m)| m.parts.environment));
    let own = scene.parts.unwrap_or_default();
    let surfaces_judged = surfaces.is_some_and(|part| own.judges(&part));
    Parts { surfaces, environment, surfaces_judged }
}

fn summary(
    scene: &StudiedScene,
    sampler: &str,
    rule: Rule,
    own: &[(&Run, &Measurement)],
    baseline: &[(&Run, &Measurement)],
) -> Summary {
    let average = |value: &dyn Fn(&Measurement) -> f64| mean(own.iter().map(|(_, m)| value(m)));
    let reference = scene.reference.clone().unwrap_or_default();
    let (errors, others) = (mean_errors(own), mean_errors(baseline));
    let mse_judged = is_judged(errors.mse, reference.mse);
    let both_judged = mse_judged && is_judged(others.mse, reference.mse);
    let relmse_judged = reference.judges_relative(&errors);
    let by_seed = |value: &dyn Fn(&Measurement, &Measurement) -> f64| {
        let ratios: Vec<f64> = own
            .iter()
            .filter_map(|(run, ours)| {
                let (_, theirs) = baseline.iter().find(|(other, _)| other.seed == run.seed)?;
                Some(value(ours, theirs))
            })
            .collect();
        geometric_interval(&ratios)
    };
    let parts = mean_parts(own, scene);
    let surfaces_judged = parts.surfaces_judged && mean_parts(baseline, scene).surfaces_judged;
    let trimmed = |m: &Measurement| m.parts.surfaces.map_or(0.0, |part| part.relmse_trimmed);
    let ratios: Vec<f64> = own.iter().map(|(_, m)| m.mean_ratio).collect();
    let largest = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
    Summary {
        scene: scene.name.clone(),
        sampler: sampler.to_owned(),
        rule,
        runs: own.len(),
        spp: average(&|m| f64::from(m.spp)),
        seconds: average(&|m| m.seconds),
        gpu_seconds: average(&|m| m.gpu_seconds),
        errors,
        mse_judged,
        relmse_judged,
        rmse_ratio: by_seed(&|ours, theirs| (ours.errors.mse / theirs.errors.mse).sqrt())
            .filter(|_| both_judged),
        relative_ratio: by_seed(&|ours, theirs| {
            (ours.errors.relmse_trimmed / theirs.errors.relmse_trimmed).sqrt()
        })
        .filter(|_| relmse_judged && reference.judges_relative(&others)),
        efficiency: by_seed(&|ours, theirs| {
            theirs.errors.mse * theirs.seconds / (ours.errors.mse * ours.seconds)
        })
        .filter(|_| both_judged),
        parts,
        surfaces_ratio: by_seed(&|ours, theirs| trimmed(ours) / trimmed(theirs))
            .filter(|_| surfaces_judged),
        flip: mean_of_all(own.iter().map(|(_, m)| m.flip)),
        mean_ratio: mean_interval(&ratios).unwrap_or(Interval { middle: 1.0, low: 1.0, high: 1.0 }),
        mean_deviation: own.iter().filter_map(|(_, m)| m.mean_deviation).reduce(largest),
        visible_share: mean_of_all(own.iter().map(|(run, _)| run.figures.visible_share)),
        gpu_ms_per_sample: means(own, |run| &run.figures.gpu_ms_per_sample),
        statistics: means(own, |run| &run.figures.statistics),
    }
}

/// Error after some samples, over all seeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    pub spp: u32,
    /// Mean wall time of the passes, seconds.
    pub seconds: f64,
    /// Root of the seeds' mean squared error, with the interval of the single runs' geometric mean
    /// scaled around it.
    pub rmse: Interval,
    /// Trimmed relMSE over lit surfaces, likewise; absent if it is not judged.
    pub relmse: Option<Interval>,
    /// 1 / (that figure × seconds of each run), likewise: it stays level while error falls as 1/time.
    pub efficiency: Option<Interval>,
}

/// Error of one sampler in one scene against samples and time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    pub scene: String,
    /// Contender's label.
    pub sampler: String,
    /// Ascending in samples, judged points only.
    pub points: Vec<CurvePoint>,
    /// Slope of log RMSE against log samples: −½ for independent samples.
    pub slope_spp: Option<f64>,
    /// Slope of log RMSE against log seconds.
    pub slope_seconds: Option<f64>,
}

/// Computes curves in the plan's order, from runs by samples if there are some, else from runs by
/// time. Points are at numbers of samples that every run has reached.
pub fn curves(plan: &Plan, scenes: &[StudiedScene], runs: &[Run]) -> Vec<Curve> {
    let mut all = Vec::new();
    for scene in scenes {
        for contender in &plan.contenders {
            let is_own = |run: &&Run| run.scene == scene.name && run.sampler == contender.label;
            let own = || runs.iter().filter(is_own);
            let is_by_samples = |run: &Run| matches!(run.rule, Rule::Spp(_));
            let by_samples = own().any(is_by_samples);
            let own: Vec<&Run> = own().filter(|run| is_by_samples(run) == by_samples).collect();
            if !own.is_empty() {
                all.push(curve(scene, &contender.label, &own));
            }
        }
    }
    all
}

/// Mean of errors in a part of the picture; `None` if there are none or one lacks the part.
fn mean_of_parts(parts: impl Iterator<Item = Option<PartErrors>>) -> Option<PartErrors> {
    let parts: Vec<PartErrors> = parts.collect::<Option<Vec<_>>>()?;
    (!parts.is_empty()).then(|| PartErrors::each(|error| mean(parts.iter().map(error))))
}

fn curve(scene: &StudiedScene, sampler: &str, runs: &[&Run]) -> Curve {
    let own = scene.reference.as_ref().and_then(|reference| reference.mse);
    let counts: BTreeSet<u32> =
        runs.iter().flat_map(|run| run.measurements.iter().map(|m| m.spp)).collect();
    let points: Vec<CurvePoint> = counts
        .into_iter()
        .filter_map(|spp| {
            let at = runs.iter().map(|run| run.measurements.iter().find(|m| m.spp == spp));
            let at: Vec<&Measurement> = at.collect::<Option<_>>()?;
            let mse = mean(at.iter().map(|measurement| measurement.errors.mse));
            let single: Vec<f64> = at.iter().map(|m| m.errors.mse.max(0.0).sqrt()).collect();
            let around = geometric_interval(&single).filter(|_| is_judged(mse, own))?;
            let middle = mse.sqrt();
            let scale = middle / around.middle;
            let trimmed = |m: &Measurement| m.parts.surfaces.map_or(0.0, |p| p.relmse_trimmed);
            let part = mean_of_parts(at.iter().map(|m| m.parts.surfaces));
            let part_judged =
                part.is_some_and(|part| scene.parts.is_none_or(|own| own.judges(&part)));
            let relative: Vec<f64> = at.iter().map(|m| trimmed(m)).collect();
            let worth: Vec<f64> = at.iter().map(|m| 1.0 / (trimmed(m) * m.seconds)).collect();
            Some(CurvePoint {
                spp,
                seconds: mean(at.iter().map(|measurement| measurement.seconds)),
                rmse: Interval { middle, low: around.low * scale, high: around.high * scale },
                relmse: geometric_interval(&relative).filter(|_| part_judged),
                efficiency: geometric_interval(&worth).filter(|_| part_judged),
            })
        })
        .collect();
    let line = |x: &dyn Fn(&CurvePoint) -> f64| {
        let logarithms: Vec<[f64; 2]> =
            points.iter().map(|point| [x(point).ln(), point.rmse.middle.ln()]).collect();
        slope(&logarithms).filter(|slope| slope.is_finite())
    };
    Curve {
        scene: scene.name.clone(),
        sampler: sampler.to_owned(),
        slope_spp: line(&|point| f64::from(point.spp)),
        slope_seconds: line(&|point| point.seconds),
        points,
    }
}

#[cfg(test)]
mod tests;
