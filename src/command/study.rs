//! `fenestra study`: samplers against each other and against a reference, as a report.

use std::{
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use super::{
    options::{parse_duration, parse_size},
    progress::{Progress, Standing},
    render::listen_for_interrupt,
};
use crate::{
    error::{Error, Result},
    gpu::Device,
    sampler::Parameters,
    study::{
        contender::Contender,
        engine,
        file::{StudyFile, ValueParsers, is_study},
        folder::Folder,
        plan::{Description, Options, Plan},
        report,
        results::{Circumstances, Report},
        watch::Observer,
    },
};

/// `--quick` without a study file.
const QUICK_SPP: u32 = 16;
const QUICK_TIME: Duration = Duration::from_secs(2);
const QUICK_SIZE: [u32; 2] = [80, 60];
const QUICK_REFERENCE_SPP: u32 = 512;

/// Arguments of `study`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene files, or a study file (.toml with a line `study = "title"`); scenes beside a study file
    /// take the place of its own.
    #[arg(required = true, value_name = "SCENE|STUDY")]
    pub inputs: Vec<PathBuf>,
    /// Folder of the report; a study that was interrupted continues where it was.
    #[arg(short, long, value_name = "FOLDER", default_value = "report")]
    pub output: PathBuf,
    /// Samplers to compare; ratios are taken to the first. Parameters follow colons:
    /// mis,ris:candidates=8.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub samplers: Option<Vec<String>>,
    /// Compare at these numbers of samples per pixel.
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    pub spp: Option<Vec<u32>>,
    /// Compare after this much wall time of passes: 500ms, 30s, 5m.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    pub time: Option<Duration>,
    /// Runs of each sampler, with seeds 1, 2, … (default 3).
    #[arg(long, value_name = "N")]
    pub seeds: Option<u32>,
    /// Film size in pixels instead of the scenes'.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Directions traced at every vertex of every camera path (default 5).
    #[arg(long, value_name = "N")]
    pub shadow_rays: Option<u32>,
    /// Path vertices at which environment light is gathered (default 1, direct light).
    #[arg(long, value_name = "D")]
    pub depth: Option<u32>,
    /// Sampler of the reference (default mis).
    #[arg(long, value_name = "NAME")]
    pub reference_sampler: Option<String>,
    /// Samples per pixel of the reference, both halves together (default 16 times the largest --spp).
    #[arg(long, value_name = "N")]
    pub reference_spp: Option<u32>,
    /// Reference to read instead: an image or, given twice, two independent halves of one scene; or
    /// the report folder of another study.
    #[arg(long, value_name = "EXR|FOLDER")]
    pub reference: Vec<PathBuf>,
    /// Measure how much more time the samplers take per sample than the first, pass by pass.
    #[arg(long)]
    pub overhead: bool,
    /// The sampler whose time overhead is measured against (default the first).
    #[arg(long, value_name = "NAME")]
    pub baseline: Option<String>,
    /// Interleaved overhead measurements of each sampler (default 15).
    #[arg(long, value_name = "N")]
    pub repetitions: Option<u32>,
    /// Sampler parameter for all samplers, may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// A small, fast version: the study file's quick settings, or a film of 80x60 and few samples.
    #[arg(long)]
    pub quick: bool,
    /// Remove finished runs in the folder that were made under other conditions.
    #[arg(long)]
    pub redo: bool,
    /// Device to use, by index or part of its name; see `fenestra devices`.
    #[arg(long, value_name = "INDEX|NAME")]
    pub device: Option<String>,
    /// Run with the Vulkan validation layers; any message fails the command.
    #[arg(long)]
    pub validate: bool,
    /// Print the results as JSON to standard output as well.
    #[arg(long)]
    pub json: bool,
    /// No progress and no messages but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// Runs a study.
///
/// # Errors
/// Wrong options, an unusable scene, study file or reference, a folder that holds something else, no
/// device, a failing device or disk; [`Error::Interrupted`] after Ctrl-C. Finished runs are kept in
/// every case.
pub fn run(arguments: &Arguments) -> Result<()> {
    let interrupted = listen_for_interrupt();
    let plan = plan(arguments)?;
    let folder = Folder::open(&arguments.output)?;
    let device = Device::open(arguments.device.as_deref(), arguments.validate)?;
    if !arguments.quiet {
        let capabilities = device.capabilities();
        eprintln!("device: {} ({})", capabilities.name, capabilities.driver);
    }
    let mut display =
        Display { progress: Progress::new("study", arguments.quiet), interrupted: &interrupted };
    let (results, end) = engine::run(&plan, &folder, &device, &mut display, arguments.redo)?;
    let reason = match &end {
        None => "finished",
        Some(Error::Interrupted) => "interrupted; the same command continues it",
        Some(_) => "failed; the same command continues it",
    };
    let fraction = if end.is_none() { 1.0 } else { 0.0 };
    display.progress.finish(&Standing { fraction, ..Standing::default() }, reason);

    let finished = results.runs.len() + results.rounds.len();
    let report = Report::new(&plan, results, end.is_none(), Circumstances::new(&device));
    let write = || {
        report.write(&plan, &folder)?;
        report::write(&report, &plan, &folder)
    };
    let written = if finished > 0 { write() } else { Ok(()) };
    // What ended the study matters more than that its report could not be written.
    if let Some(error) = end {
        return Err(error);
    }
    written?;
    if arguments.json {
        super::print_line(&format!("{:#}", serde_json::json!(report)))?;
    }
    if !arguments.quiet {
        eprintln!("wrote {}", folder.path().join("index.html").display());
    }
    if let Some(first) = device.validation_messages().first().filter(|_| arguments.validate) {
        return Err(Error::Vulkan {
            call: "validation".into(),
            result: format!("{} messages, the first: {first}", device.validation_messages().len()),
        });
    }
    Ok(())
}

/// Study file, quick settings and options, in layers.
fn plan(arguments: &Arguments) -> Result<Plan> {
    let mut defaults = Parameters::default();
    for assignment in &arguments.set {
        defaults.set(assignment)?;
    }
    let parsers = ValueParsers { duration: parse_duration, size: parse_size };
    let mut scenes = Vec::new();
    let mut study: Option<StudyFile> = None;
    for input in &arguments.inputs {
        if !is_study(input)? {
            scenes.push(input.clone());
        } else if study.is_none() {
            study = Some(StudyFile::load(input, defaults, parsers)?);
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
    let samplers = arguments.samplers.as_ref().map(|texts| {
        Contender::parse_all(texts.iter().map(String::as_str), defaults)
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
        overhead: arguments.overhead.then_some(true),
        overhead_baseline: named("--baseline", &arguments.baseline)?,
        overhead_spp: None,
        overhead_repetitions: arguments.repetitions,
    };
    Plan::new(scenes, description, options.over(below), arguments.reference.clone())
}

/// What `--quick` means without a study file. Samples and time are shortened only where they would be
/// chosen at all.
fn quick_options(arguments: &Arguments) -> Options {
    let nothing_asked = arguments.time.is_none() && !arguments.overhead;
    Options {
        spp: nothing_asked.then(|| vec![QUICK_SPP]),
        time: nothing_asked.then_some(QUICK_TIME),
        seeds: Some(2),
        size: Some(QUICK_SIZE),
        reference_spp: Some(QUICK_REFERENCE_SPP),
        overhead_spp: Some(4),
        overhead_repetitions: Some(6),
        ..Options::default()
    }
}

/// Progress and interrupt flag as the engine sees them.
struct Display<'a> {
    progress: Progress,
    interrupted: &'a AtomicBool,
}

impl Observer for Display<'_> {
    fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::SeqCst)
    }

    fn update(&mut self, fraction: f64, rays_per_second: f64) {
        self.progress.update(&Standing { fraction, rays_per_second, ..Standing::default() });
    }

    fn note(&mut self, line: &str) {
        self.progress.print(line);
    }
}
