//! `results.json` and `results.csv`: every run of a study and its circumstances.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::{
    engine::Results,
    folder::Folder,
    overhead::{Overhead, overheads},
    plan::{Plan, PublishedErrors, PublishedOverhead, Rule},
    quality::{Figure, THRESHOLDS, Time, TimeToQuality, time_of_run, times_to_quality},
    runs::{Measurement, Round, Run, StudiedScene, assignments},
    summary::{Curve, Summary, curves, summaries},
};
use crate::{
    error::Result,
    files::{write_json, write_text},
    gpu::Device,
    session::Figures,
};

const DEFAULT_TITLE: &str = "Comparison of samplers";

/// Machine, version and command of a study.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Circumstances {
    pub version: String,
    /// When the results were written, UTC.
    pub date: String,
    pub command: String,
    /// Processor, cores that the program may use, operating system.
    pub machine: String,
    pub device: String,
    pub driver: String,
}

impl Circumstances {
    /// Describes this process and device, now.
    pub(crate) fn new(device: &Device) -> Self {
        let capabilities = device.capabilities();
        // The program's own folder says nothing about the study.
        let mut command = "fenestra".to_owned();
        for argument in std::env::args_os().skip(1) {
            command += &format!(" {}", argument.display());
        }
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            date: jiff::Timestamp::now().strftime("%Y-%m-%d %H:%M UTC").to_string(),
            command,
            machine: machine(),
            device: capabilities.name.clone(),
            driver: device.driver_and_tracer(),
        }
    }
}

/// Name of the processor, if the system tells it, number of cores and operating system.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let information = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = information
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(':').map(|(_, name)| name))
        .map_or_else(|| std::env::consts::ARCH.to_owned(), |name| name.trim().to_owned());
    format!("{name}, {cores} cores, {}", std::env::consts::OS)
}

/// Everything in `results.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    pub title: String,
    pub notes: Vec<String>,
    /// True unless the study was interrupted before its end.
    pub is_complete: bool,
    pub circumstances: Circumstances,
    /// Directions traced at every vertex; each sampler's own number if absent.
    pub shadow_rays: Option<u32>,
    /// Path vertices at which environment light is gathered.
    pub depth: u32,
    /// Runs of each sampler.
    pub seeds: u32,
    /// Parameters of each sampler, by label.
    pub samplers: BTreeMap<String, BTreeMap<String, String>>,
    /// Samplers in the order of the plan.
    pub order: Vec<String>,
    /// Rules in the order of the plan.
    #[serde(skip)]
    pub rules: Vec<Rule>,
    pub scenes: Vec<StudiedScene>,
    pub summaries: Vec<Summary>,
    pub curves: Vec<Curve>,
    /// Seconds until errors fall to thresholds.
    pub times_to_quality: Vec<TimeToQuality>,
    pub overheads: Vec<Overhead>,
    pub published_errors: Vec<PublishedErrors>,
    pub published_overheads: Vec<PublishedOverhead>,
    pub runs: Vec<Run>,
    pub rounds: Vec<Round>,
}

impl Report {
    /// Computes the figures of `results`.
    pub(crate) fn new(
        plan: &Plan,
        results: Results,
        is_complete: bool,
        circumstances: Circumstances,
    ) -> Self {
        let baseline = plan.overhead.as_ref().map(|overhead| overhead.baseline.label.clone());
        Self {
            title: plan.description.title.clone().unwrap_or_else(|| DEFAULT_TITLE.to_owned()),
            notes: plan.description.notes.clone(),
            is_complete,
            circumstances,
            shadow_rays: plan.shadow_rays,
            depth: plan.depth,
            seeds: plan.seeds,
            samplers: plan
                .contenders
                .iter()
                .map(|contender| (contender.label.clone(), contender.describe_parameters()))
                .collect(),
            order: plan.contenders.iter().map(|contender| contender.label.clone()).collect(),
            rules: plan.rules(),
            summaries: summaries(plan, &results.scenes, &results.runs),
            curves: curves(plan, &results.scenes, &results.runs),
            times_to_quality: times_to_quality(plan, &results.scenes, &results.runs),
            overheads: baseline
                .map_or_else(Vec::new, |baseline| overheads(&results.rounds, &baseline)),
            published_errors: plan.description.published_errors.clone(),
            published_overheads: plan.description.published_overheads.clone(),
            scenes: results.scenes,
            runs: results.runs,
            rounds: results.rounds,
        }
    }

    pub(crate) fn write(&self, folder: &Folder) -> Result<()> {
        write_json(&folder.path.join("results.json"), self)?;
        write_text(&folder.path.join("results.csv"), &self.csv())
    }

    /// Formats a row for every run and rule; columns of figures that a run lacks are empty.
    fn csv(&self) -> String {
        let columns = columns(&self.runs);
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let mut text = names.join(",") + "\n";
        for run in &self.runs {
            for (rule, measurement) in
                self.rules.iter().filter_map(|rule| Some((*rule, run.at(*rule)?)))
            {
                let fields =
                    columns.iter().map(|(_, field)| quoted(&field(run, rule, measurement)));
                text += &(fields.collect::<Vec<_>>().join(",") + "\n");
            }
        }
        text
    }
}

/// Column of `results.csv`: its name, and the field of a run under a rule.
type Column = (String, Box<dyn Fn(&Run, Rule, &Measurement) -> String>);

fn column(
    name: impl Into<String>,
    field: impl Fn(&Run, Rule, &Measurement) -> String + 'static,
) -> Column {
    (name.into(), Box::new(field))
}

/// Lists the columns: those of every run, and one for each figure that some run has.
fn columns(runs: &[Run]) -> Vec<Column> {
    fn names<V>(runs: &[Run], figures: fn(&Figures) -> &BTreeMap<String, V>) -> BTreeSet<String> {
        runs.iter().flat_map(|run| figures(&run.figures).keys().cloned()).collect()
    }
    fn optional(value: Option<impl ToString>) -> String {
        value.map(|value| value.to_string()).unwrap_or_default()
    }
    let mut columns = vec![
        column("scene", |run, _, _| run.scene.clone()),
        column("sampler", |run, _, _| run.sampler.clone()),
        column("parameters", |run, _, _| assignments(&run.conditions.parameters, " ")),
        column("rule", |_, rule, _| rule.describe()),
        column("seed", |run, _, _| run.seed.to_string()),
        column("shadow_rays", |run, _, _| run.conditions.shadow_rays.to_string()),
        column("depth", |run, _, _| run.conditions.depth.to_string()),
        column("spp", |_, _, m| m.spp.to_string()),
        column("seconds", |_, _, m| m.seconds.to_string()),
        column("gpu_seconds", |_, _, m| m.gpu_seconds.to_string()),
        column("rays", |_, _, m| m.rays.to_string()),
    ];
    columns.extend(names(runs, |figures| &figures.rays).into_iter().map(|kind| {
        column(format!("rays_{kind}_of_run"), move |run, _, _| {
            optional(run.figures.rays.get(&kind))
        })
    }));
    columns.extend([
        column("visible_share", |run, _, _| optional(run.figures.visible_share)),
        column("rmse", |_, _, m| m.errors.rmse.to_string()),
        column("mse", |_, _, m| m.errors.mse.to_string()),
        column("relmse", |_, _, m| m.errors.relmse.to_string()),
        column("relmse_trimmed", |_, _, m| m.errors.relmse_trimmed.to_string()),
        column("relmse_p999", |_, _, m| m.errors.relmse_p999.to_string()),
        column("relmse_max", |_, _, m| m.errors.relmse_max.to_string()),
        column("mean_ratio", |_, _, m| m.mean_ratio.to_string()),
        column("mean_deviation", |_, _, m| optional(m.mean_deviation)),
        column("mse_judged", |_, _, m| m.mse_judged.to_string()),
        column("relmse_judged", |_, _, m| m.relmse_judged.to_string()),
        column("surfaces_mse", |_, _, m| optional(m.parts.surfaces.map(|part| part.mse))),
        column("surfaces_relmse", |_, _, m| optional(m.parts.surfaces.map(|part| part.relmse))),
        column("surfaces_relmse_trimmed", |_, _, m| {
            optional(m.parts.surfaces.map(|part| part.relmse_trimmed))
        }),
        column("surfaces_judged", |_, _, m| m.parts.surfaces_judged.to_string()),
        column("environment_mse", |_, _, m| optional(m.parts.environment.map(|part| part.mse))),
        column("environment_relmse", |_, _, m| {
            optional(m.parts.environment.map(|part| part.relmse))
        }),
        column("flip", |_, _, m| optional(m.flip)),
    ]);
    for (figure, threshold) in
        Figure::ALL.into_iter().flat_map(|figure| THRESHOLDS.map(|threshold| (figure, threshold)))
    {
        let name = format!("seconds_to_{}_{threshold}_of_run", figure.name());
        columns.push(column(name, move |run, _, _| {
            optional(time_of_run(run, figure, threshold).and_then(Time::seconds))
        }));
    }
    columns.extend(names(runs, |figures| &figures.gpu_ms_per_sample).into_iter().map(|pass| {
        column(format!("gpu_ms_per_sample_{pass}"), move |run, _, _| {
            optional(run.figures.gpu_ms_per_sample.get(&pass))
        })
    }));
    columns.extend(names(runs, |figures| &figures.statistics).into_iter().map(|name| {
        column(name.clone(), move |run, _, _| optional(run.figures.statistics.get(&name)))
    }));
    columns
}

/// Quotes a field that needs it (RFC 4180). An apostrophe keeps spreadsheets from computing a text.
fn quoted(field: &str) -> String {
    let is_formula =
        field.starts_with(['=', '+', '-', '@', '\t', '\r']) && field.parse::<f64>().is_err();
    let field = if is_formula { format!("'{field}") } else { field.to_owned() };
    if is_formula || field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{
        metrics::{Errors, parts::PartErrors},
        runs::Conditions,
        surfaces::Parts,
    };

    #[test]
    fn columns_hold_what_they_say() {
        let part = |mse| PartErrors { mse, relmse: mse + 1.0, relmse_trimmed: mse + 2.0 };
        let measurement = Measurement {
            spp: 1,
            seconds: 2.0,
            gpu_seconds: 3.0,
            rays: 4,
            errors: Errors { mse: 5.0, relmse: 6.0, ..Errors::default() },
            mean_deviation: Some(7.0),
            parts: Parts {
                surfaces: Some(part(10.0)),
                environment: Some(part(20.0)),
                surfaces_judged: true,
            },
            ..Measurement::default()
        };
        let rays = BTreeMap::from([("shadow".to_owned(), 8)]);
        let run = Run {
            scene: "room".into(),
            sampler: "mis".into(),
            rule: Rule::Spp(1),
            seed: 9,
            conditions: Conditions { depth: 3, ..Conditions::default() },
            measurements: vec![measurement.clone()],
            figures: Figures { rays, visible_share: Some(0.5), ..Figures::default() },
        };
        let columns = columns(std::slice::from_ref(&run));
        for (name, expected) in [
            ("rule", "1 spp"),
            ("seed", "9"),
            ("depth", "3"),
            ("seconds", "2"),
            ("gpu_seconds", "3"),
            ("rays", "4"),
            ("rays_shadow_of_run", "8"),
            ("visible_share", "0.5"),
            ("mse", "5"),
            ("relmse", "6"),
            ("mean_deviation", "7"),
            ("surfaces_mse", "10"),
            ("surfaces_relmse", "11"),
            ("surfaces_relmse_trimmed", "12"),
            ("surfaces_judged", "true"),
            ("mse_judged", "false"),
            ("environment_mse", "20"),
            ("environment_relmse", "21"),
            ("flip", ""),
        ] {
            let (_, field) = columns.iter().find(|(own, _)| own == name).unwrap();
            assert_eq!(field(&run, run.rule, &measurement), expected, "{name}");
        }
    }

    #[test]
    fn fields_with_commas_are_quoted() {
        assert_eq!(quoted("plain"), "plain");
        assert_eq!(quoted("a,\"b\""), "\"a,\"\"b\"\"\"");
    }

    #[test]
    fn no_field_is_a_formula() {
        for start in ["=", "+", "-", "@", "\t"] {
            assert_eq!(quoted(&format!("{start}room")), format!("\"'{start}room\""));
        }
        assert_eq!(["-1.5", "+2e-7", "-inf"].map(quoted), ["-1.5", "+2e-7", "-inf"]);
    }
}
