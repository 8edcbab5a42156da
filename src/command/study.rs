//! `fenestra study`: compares samplers with a reference and with each other in a report.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use super::{
    interrupt::Interrupt,
    options::{CAMERA, DeviceOptions, MACHINE, OUTPUT, SAMPLING, SCENE, STOPPING, check_strict},
    progress::Progress,
    render::Display,
};
use crate::{
    error::{Error, Result},
    sampler::Parameters,
    scene::Scene,
    session::{Observer, Standing, parse_duration, parse_size},
    study::{
        contender::Contender,
        engine,
        file::{StudyFile, is_study},
        folder::Folder,
        plan::{CheckPlan, Description, Options, Plan},
        report,
        results::{Circumstances, Report},
    },
    terminal::say,
};

/// Group of options in help: what the errors are measured against.
const REFERENCE: &str = "Reference";
/// Group: extra time per sample.
const OVERHEAD: &str = "Overhead";

/// Arguments of `study`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene files, or a study file (.toml with a line `study = "title"`); scenes given with a
    /// study file replace its own.
    #[arg(required = true, value_name = "SCENE|STUDY")]
    pub inputs: Vec<PathBuf>,
    /// Report folder; an interrupted study continues there.
    #[arg(short, long, value_name = "FOLDER", default_value = "report", help_heading = OUTPUT)]
    pub output: PathBuf,
    /// Samplers to compare; ratios are relative to the first. Parameters follow colons: mis,ris:candidates=8.
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = SAMPLING)]
    pub samplers: Option<Vec<String>>,
    /// Compare at these numbers of samples per pixel.
    #[arg(long, value_name = "N,…", value_delimiter = ',', help_heading = STOPPING)]
    pub spp: Option<Vec<u32>>,
    /// Compare after rendering for this much wall time: 500ms, 30s, 5m.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, help_heading = STOPPING)]
    pub time: Option<Duration>,
    /// Runs per sampler, with seeds 1, 2, … (default 3).
    #[arg(long, value_name = "N", help_heading = STOPPING)]
    pub seeds: Option<u32>,
    /// Fail if loading a scene gives any warning, such as a part of a file that is left out.
    #[arg(long, help_heading = SCENE, hide_short_help = true)]
    pub strict: bool,
    /// Film size in pixels, overriding the scenes'.
    #[arg(long, value_name = "WxH", value_parser = parse_size, help_heading = CAMERA)]
    pub size: Option<[u32; 2]>,
    /// Shadow rays traced at every vertex of a camera path (default 8 for guided, else 5).
    #[arg(long, value_name = "N", help_heading = SAMPLING, hide_short_help = true)]
    pub shadow_rays: Option<u32>,
    /// Number of path vertices lit by the environment (default 8; 1 is direct light).
    #[arg(long, value_name = "D", help_heading = SAMPLING)]
    pub depth: Option<u32>,
    /// Sampler that renders the reference (default mis).
    #[arg(long, value_name = "NAME", help_heading = REFERENCE, hide_short_help = true)]
    pub reference_sampler: Option<String>,
    /// Samples per pixel of the reference, both halves together (default 16 times the largest --spp).
    #[arg(long, value_name = "N", help_heading = REFERENCE)]
    pub reference_spp: Option<u32>,
    /// Reference to read instead of rendering one: an image, two independent halves (give it
    /// twice), or the report folder of another study.
    #[arg(long, value_name = "EXR|FOLDER", help_heading = REFERENCE)]
    pub reference: Vec<PathBuf>,
    /// Check the reference by an independent picture: a sampler, an EXR of another renderer, or off
    /// (default mis, or env for a reference by mis, in a tenth of the reference's time).
    #[arg(long, value_name = "NAME|EXR|off", help_heading = REFERENCE, hide_short_help = true)]
    pub reference_check: Option<String>,
    /// Measure the extra time per sample over that of the first sampler, pass by pass.
    #[arg(long, help_heading = OVERHEAD)]
    pub overhead: bool,
    /// Sampler against which overhead is measured (default the first).
    #[arg(long, value_name = "NAME", help_heading = OVERHEAD, hide_short_help = true)]
    pub baseline: Option<String>,
    /// Interleaved overhead measurements per sampler (default 15).
    #[arg(long, value_name = "N", help_heading = OVERHEAD, hide_short_help = true)]
    pub repetitions: Option<u32>,
    /// Parameter for all samplers; `--set help` lists them. May be repeated.
    #[arg(long, value_name = "KEY=VALUE", help_heading = SAMPLING)]
    pub set: Vec<String>,
    /// Run a small, fast version: the study file's quick settings, or an 80x60 film and few samples.
    #[arg(long, help_heading = STOPPING)]
    pub quick: bool,
    /// Discard finished runs in the folder that were made under other conditions.
    #[arg(long, help_heading = OUTPUT, hide_short_help = true)]
    pub redo: bool,
    /// Device and tracer.
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Run with the Vulkan validation layers; any message fails the command.
    #[arg(long, help_heading = MACHINE, hide_short_help = true)]
    pub validate: bool,
    /// Also print the results as JSON to standard output.
    #[arg(long, help_heading = OUTPUT, hide_short_help = true)]
    pub json: bool,
    /// Print errors only.
    #[arg(short, long, help_heading = OUTPUT)]
    pub quiet: bool,
}

/// Runs a study.
///
/// # Errors
/// Wrong options, an unusable scene, study file or reference, a folder that holds something else, no device,
/// a failing device or disk; [`Error::Interrupted`] after Ctrl-C. Finished runs are always kept.
pub fn run(arguments: &Arguments) -> Result<()> {
    let interrupt = Interrupt::listen();
    interrupt.wait_for_caller();
    let progress = Progress::new("study", arguments.quiet);
    run_with(arguments, Display::new(progress, &interrupt), |display, end| {
        let reason = match end {
            None => "finished",
            Some(Error::Interrupted) => "interrupted; the same command continues it",
            Some(_) => "failed; the same command continues it",
        };
        let fraction = if end.is_none() { 1.0 } else { 0.0 };
        display.progress.finish(&Standing { fraction, ..Standing::default() }, reason);
    })
}

/// As [`run`], for another observer than the terminal. `ended` hears once all runs are done or one has
/// failed, before the report is written.
///
/// # Errors
/// As [`run`]; [`Error::Interrupted`] if the observer interrupts.
pub fn run_with<O: Observer>(
    arguments: &Arguments,
    mut observer: O,
    ended: impl FnOnce(O, Option<&Error>),
) -> Result<()> {
    let plan = plan(arguments)?;
    if let Some(warning) = plan.missing_verdicts() {
        log::warn!("{warning}");
    }
    for path in plan.scenes.iter().filter(|_| arguments.strict) {
        check_strict(true, &Scene::load(path)?)?;
    }
    let folder = Folder::open(&arguments.output)?;
    let inputs = arguments.inputs.iter().map(PathBuf::as_path).chain(plan.pictures());
    folder.check_replaces_nothing(&inputs.collect::<Vec<_>>())?;
    let device = arguments.device.announce(arguments.validate, arguments.quiet)?;
    let (results, end) = engine::run(&plan, &folder, &device, &mut observer, arguments.redo)?;
    ended(observer, end.as_ref());

    let finished = results.runs.len() + results.rounds.len();
    let report = Report::new(&plan, results, end.is_none(), Circumstances::new(&device));
    let written = if finished > 0 { report::write(&report, &folder) } else { Ok(()) };
    // Report why the study ended rather than why its report could not be written.
    if let Some(error) = end {
        return Err(error);
    }
    written?;
    if arguments.json {
        super::print_line(&format!("{:#}", serde_json::json!(report)))?;
    }
    if !arguments.quiet {
        say!("wrote {}", folder.path.join("index.html").display());
    }
    device.check_validation()
}

/// Layers the options over the quick settings over the study file.
fn plan(arguments: &Arguments) -> Result<Plan> {
    let mut defaults = Parameters::default();
    arguments.set.iter().try_for_each(|assignment| defaults.set(assignment))?;
    let mut scenes = Vec::new();
    let mut study: Option<StudyFile> = None;
    for input in &arguments.inputs {
        if !is_study(input)? {
            scenes.push(input.clone());
        } else if study.is_none() {
            study = Some(StudyFile::load(input, defaults)?);
        } else {
            return Err(Error::usage(format!(
                "{}: expected one study file at most, found another",
                input.display()
            )));
        }
    }
    let (description, below) = match study {
        Some(study) => {
            if scenes.is_empty() {
                scenes = study.scenes;
            }
            let quick = if arguments.quick { study.quick } else { Options::default() };
            (study.description, quick.over(study.settings))
        }
        None if arguments.quick => (Description::default(), quick_options(arguments)),
        None => (Description::default(), Options::default()),
    };
    let named = |option: &str, text: &Option<String>| {
        let parse = |text: &String| {
            Contender::parse(text, defaults)
                .map_err(|error| Error::usage(format!("{option} {text}: {error}")))
        };
        text.as_ref().map(parse).transpose()
    };
    let check = |text: &String| {
        CheckPlan::parse(text, Path::new(""), defaults)
            .map_err(|error| Error::usage(format!("--reference-check {text}: {error}")))
    };
    let samplers = arguments.samplers.as_ref().map(|texts| {
        Contender::parse_all(texts, defaults)
            .map_err(|error| Error::usage(format!("--samplers: {error}")))
    });
    let options = Options {
        samplers: samplers.transpose()?,
        spp: arguments.spp.clone(),
        time: arguments.time,
        seeds: arguments.seeds,
        size: arguments.size,
        shadow_rays: arguments.shadow_rays,
        depth: arguments.depth,
        reference_sampler: named("--reference-sampler", &arguments.reference_sampler)?,
        reference_spp: arguments.reference_spp,
        reference_check: arguments.reference_check.as_ref().map(check).transpose()?,
        overhead: arguments.overhead.then_some(true),
        overhead_baseline: named("--baseline", &arguments.baseline)?,
        overhead_spp: None,
        overhead_repetitions: arguments.repetitions,
    };
    Plan::new(scenes, description, options.over(below), arguments.reference.clone())
}

/// Settings of `--quick` without a study file. Samples and time are set only if neither `--time`
/// nor `--overhead` is given.
fn quick_options(arguments: &Arguments) -> Options {
    let nothing_asked = arguments.time.is_none() && !arguments.overhead;
    Options {
        spp: nothing_asked.then(|| vec![16]),
        time: nothing_asked.then_some(Duration::from_secs(2)),
        seeds: Some(2),
        size: Some([80, 60]),
        reference_spp: Some(512),
        overhead_spp: Some(4),
        overhead_repetitions: Some(6),
        ..Options::default()
    }
}
