//! `fenestra render`: scene file → finished image.

mod arguments;
mod pixel;
mod statistics;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use arguments::denoised_path;

pub use arguments::Arguments;

use super::{
    denoise::{Denoised, denoise},
    guide,
    interrupt::Interrupt,
    progress::{Patience, Progress, Standing},
};
use crate::{
    error::{Error, Result},
    files::{is_special_file, sweep_leftovers},
    film::{
        Aov, Checkpoint, Image, Metadata, SampleRange, Sums, Window, checkpoint::checkpoint_path,
        display::DisplayServer, metadata::seconds_of, png::write_preview,
    },
    gpu::{Denoiser, Device},
    pass::Roulette,
    renderer::{Renderer, Settings, window_of},
    sampler::Sampler,
    scene::Scene,
    study::watch::next_pass_samples,
};

/// Samples per pixel if no stop rule is given.
const DEFAULT_SPP: u32 = 64;
/// Interval of error estimates and display updates, which need the film on the host.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);
/// Samples per pixel of `--quick`.
const QUICK_SPP: u32 = 16;

/// Rule that ended a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StopReason {
    Spp,
    Time,
    Error,
    /// The seed has no more samples.
    LastSample,
    Interrupt,
}

impl StopReason {
    fn name(self) -> &'static str {
        match self {
            Self::Spp => "spp",
            Self::Time => "time",
            Self::Error => "error",
            Self::LastSample => "last-sample",
            Self::Interrupt => "interrupt",
        }
    }

    fn explain(self) -> &'static str {
        match self {
            Self::Spp => "stopped by --spp",
            Self::Time => "stopped by --time",
            Self::Error => "stopped by --error (stopping by the data is slightly biased)",
            Self::LastSample => "stopped at the last sample of the seed",
            Self::Interrupt => "interrupted",
        }
    }
}

/// Renders a scene.
///
/// # Errors
/// Wrong options, an unusable scene, no device, a failing device or disk; [`Error::Interrupted`]
/// after Ctrl-C, once the partial result has been written.
pub fn run(arguments: &Arguments) -> Result<()> {
    let interrupt = Interrupt::listen();
    let settings = arguments.settings()?;
    let start = Instant::now();
    let patience =
        Patience::new(&format!("loading {}", arguments.scene.display()), arguments.quiet);
    let mut scene = arguments.scene_options.load(&arguments.scene)?;
    let load_ms = start.elapsed().as_secs_f64() * 1e3;
    arguments.resize(&mut scene.film);
    let output =
        arguments.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}.exr", scene.name)));
    // Fail before the work, not after it.
    arguments.check_outputs(&scene, &output)?;
    sweep_leftovers(&output);
    if let Some(at) = arguments.pixel {
        pixel::check(&settings, &scene, &output, at)?;
    }

    let denoiser = arguments.denoise.then(Denoiser::load).transpose()?;

    interrupt.wait_for_caller();
    let device = Device::open(arguments.device.as_deref(), arguments.validate)?;
    if !arguments.quiet {
        let capabilities = device.capabilities();
        eprintln!("device: {} ({})", capabilities.name, capabilities.driver);
    }
    let mut job = RenderJob::new(arguments, &settings, &scene, &device, output);
    job.denoiser = denoiser;
    if let Some(warning) = settings.sampler.portal_warning(&scene) {
        job.warn(warning);
    }
    let mut renderer = Renderer::new(&device, &scene, settings.clone())?;
    if let Some(path) = &arguments.load_guide {
        guide::load(&mut renderer, path)?;
    }
    job.metadata.fit_hashes = renderer.report().fit_hashes;
    job.resume(&mut renderer)?;
    drop(patience);

    let reason = job.render(&mut renderer, &interrupt)?;
    device.save_pipeline_cache();
    job.finish(&renderer, reason, load_ms)?;
    if let Some(at) = arguments.pixel {
        let written = if settings.sampler == Sampler::Guided {
            pixel::write_guided(&mut renderer, &scene, &job.output, at)?
        } else {
            drop(renderer);
            pixel::write(&device, &scene, &settings, &job.output, at)?
        };
        for path in written {
            if !arguments.quiet {
                eprintln!("wrote {}", display(&path));
            }
        }
    }
    if arguments.validate {
        let messages = device.validation_messages();
        if let Some(first) = messages.first() {
            return Err(Error::Vulkan {
                call: "validation".into(),
                result: format!("{} messages, the first: {first}", messages.len()),
            });
        }
    }
    if reason == StopReason::Interrupt { Err(Error::Interrupted) } else { Ok(()) }
}

/// One render, from its first pass to its files.
struct RenderJob<'a> {
    arguments: &'a Arguments,
    scene: &'a Scene,
    /// Part of the film that is rendered.
    window: Window,
    output: PathBuf,
    metadata: Metadata,
    /// Layers of the image.
    aovs: Vec<Aov>,
    /// Denoiser, under `--denoise`.
    denoiser: Option<Denoiser>,
    /// Wall time that earlier runs spent in passes, seconds.
    earlier_seconds: f64,
    /// Wall time that this run has spent in passes.
    elapsed: Duration,
    /// None as long as no sample has found light.
    relative_error: Option<f64>,
    found_light: bool,
    /// Warnings of the render itself.
    warnings: Vec<String>,
}

impl<'a> RenderJob<'a> {
    fn new(
        arguments: &'a Arguments,
        settings: &Settings,
        scene: &'a Scene,
        device: &Device,
        output: PathBuf,
    ) -> Self {
        let capabilities = device.capabilities();
        let mut parameters = settings.sampler.describe(&settings.parameters);
        if settings.depth > settings.roulette.vertex {
            let Roulette { vertex, throughput } = settings.roulette;
            parameters.insert("roulette-depth".to_owned(), vertex.to_string());
            parameters.insert("roulette-throughput".to_owned(), throughput.to_string());
        }
        let metadata = Metadata {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.name.clone(),
            scene_hash: scene.hash.clone(),
            sampler: arguments.sampler.name().to_owned(),
            sampler_parameters: parameters,
            shadow_rays: settings.shadow_rays,
            depth: arguments.depth,
            device: capabilities.name.clone(),
            driver: capabilities.driver.clone(),
            ..Metadata::default()
        };
        Self {
            arguments,
            scene,
            window: window_of(settings, scene),
            output,
            metadata,
            aovs: settings.aovs.clone(),
            denoiser: None,
            earlier_seconds: 0.0,
            elapsed: Duration::ZERO,
            relative_error: None,
            found_light: false,
            warnings: Vec::new(),
        }
    }

    /// Restores the output's checkpoint under `--resume`, if there is one.
    fn resume(&mut self, renderer: &mut Renderer) -> Result<()> {
        let path = checkpoint_path(&self.output);
        if !self.arguments.resume {
            return Ok(());
        }
        if !path.exists() {
            log::warn!("--resume: there is no {}; starting from the beginning", path.display());
            return Ok(());
        }
        let (checkpoint, guide) = Checkpoint::read_with_guide(&path)?;
        let sums = renderer.sums()?;
        checkpoint.check_resume(
            &path,
            &self.metadata,
            &sums,
            self.arguments.seed,
            self.arguments.sample_offset,
        )?;
        renderer.restore(&checkpoint.sums)?;
        if self.arguments.sampler == Sampler::Guided {
            let (guide_path, guide) =
                guide.ok_or_else(|| Error::format(&path, "the checkpoint has no guide"))?;
            guide::resume(renderer, &guide_path, &guide)?;
        }
        self.earlier_seconds = checkpoint.metadata.seconds;
        Ok(())
    }

    fn seconds(&self) -> f64 {
        self.earlier_seconds + self.elapsed.as_secs_f64()
    }

    /// Returns the target of `--spp`, or the default if no stop rule is given.
    fn target_spp(&self) -> Option<u32> {
        let none = self.arguments.time.is_none() && self.arguments.error.is_none();
        let default = if self.arguments.quick { QUICK_SPP } else { DEFAULT_SPP };
        self.arguments.spp.or_else(|| none.then_some(default))
    }

    /// Returns the samples per pixel up to the last of the seed, whose index is below 2³².
    fn most_samples(&self) -> u32 {
        u32::MAX - self.arguments.sample_offset
    }

    /// Renders passes until a stop rule is met.
    fn render(&mut self, renderer: &mut Renderer, interrupt: &Interrupt) -> Result<StopReason> {
        let mut progress = Progress::new(self.scene.name.clone(), self.arguments.quiet);
        let mut display = self.open_display()?;
        let mut next_look = Instant::now() + LOOK_INTERVAL;
        let mut last_checkpoint = Instant::now();
        let mut pass_samples = 1;
        let reason = loop {
            if let Some(reason) = self.stop_reason(renderer, interrupt) {
                break reason;
            }
            let target = self.target_spp().unwrap_or(u32::MAX).min(self.most_samples());
            let samples = pass_samples.min(target.saturating_sub(renderer.sample_count()));
            let start = Instant::now();
            renderer.render_pass(samples)?;
            let took = start.elapsed();
            self.elapsed += took;
            let left = self.time_left().unwrap_or(f64::INFINITY);
            pass_samples = next_pass_samples(samples, took.as_secs_f64(), left);

            if Instant::now() >= next_look || self.arguments.error.is_some() {
                let start = Instant::now();
                let sums = renderer.sums()?;
                self.look(&sums);
                if self.arguments.error.is_some() && renderer.sample_count() >= DEFAULT_SPP {
                    self.warn_of_darkness(" so far: --error waits for light");
                }
                if let Some(display) = display.as_mut().filter(|display| display.is_connected()) {
                    display.update(&sums.to_image(&self.aovs));
                }
                // Reading back a large film takes time from the passes.
                next_look = Instant::now() + LOOK_INTERVAL.max(20 * start.elapsed());
            }
            if let Some(interval) = self.arguments.checkpoint_interval
                && last_checkpoint.elapsed() >= interval
            {
                // A full disk may have room again at the next interval or for the image.
                if let Err(error) = self.write_checkpoint(renderer, renderer.sums()?)? {
                    log::warn!("{error}; the next checkpoint tries again");
                }
                last_checkpoint = Instant::now();
            }
            progress.update(&self.standing(renderer));
        };
        let sums = renderer.sums()?;
        self.look(&sums);
        if let Some(display) = display.as_mut().filter(|display| display.is_connected()) {
            display.update(&sums.to_image(&self.aovs));
        }
        progress.finish(&self.standing(renderer), reason.explain());
        Ok(reason)
    }

    /// Takes the error and the presence of light from the film. A black film has no error to speak
    /// of, so that `--error` never stops on one.
    fn look(&mut self, sums: &Sums) {
        self.found_light = sums.found_light();
        self.relative_error = self.found_light.then(|| sums.relative_standard_error());
    }

    /// Warns once if no sample has found light.
    fn warn_of_darkness(&mut self, end: &str) {
        if !self.found_light && self.warnings.is_empty() {
            self.warn(format!("no sample has found any light{end}"));
        }
    }

    fn warn(&mut self, warning: String) {
        log::warn!("{warning}");
        self.warnings.push(warning);
    }

    /// Connects to the viewer named by `--display-server`. Images of other files and samplers stay there.
    fn open_display(&self) -> Result<Option<DisplayServer>> {
        let connect = |address: &String| {
            let name = format!("{} ({})", self.output.display(), self.arguments.sampler.name());
            DisplayServer::connect(address, &name)
        };
        self.arguments.display_server.as_ref().map(connect).transpose()
    }

    fn time_left(&self) -> Option<f64> {
        self.arguments.time.map(|time| time.as_secs_f64() - self.seconds())
    }

    fn stop_reason(&self, renderer: &Renderer, interrupt: &Interrupt) -> Option<StopReason> {
        let samples = renderer.sample_count();
        if interrupt.is_raised() && samples > 0 {
            return Some(StopReason::Interrupt);
        }
        if self.target_spp().is_some_and(|spp| samples >= spp) {
            return Some(StopReason::Spp);
        }
        if samples >= self.most_samples() {
            return Some(StopReason::LastSample);
        }
        if samples > 0 && self.time_left().is_some_and(|left| left <= 0.0) {
            return Some(StopReason::Time);
        }
        let reached = |limit: f64| samples > 1 && self.relative_error.is_some_and(|e| e <= limit);
        if self.arguments.error.is_some_and(reached) {
            return Some(StopReason::Error);
        }
        None
    }

    fn standing(&self, renderer: &Renderer) -> Standing {
        let totals = renderer.totals();
        let rays = totals.camera_rays + totals.bounce_rays + totals.shadow_rays_traced;
        let share = |done: f64, target: f64| (done / target).clamp(0.0, 1.0);
        let by_spp =
            self.target_spp().map(|spp| share(f64::from(renderer.sample_count()), f64::from(spp)));
        let by_time = self.arguments.time.map(|time| share(self.seconds(), time.as_secs_f64()));
        // The error falls with the square root of the work.
        let by_error = self.arguments.error.zip(self.relative_error).map(|(target, error)| {
            if error > 0.0 { share((target / error).powi(2), 1.0) } else { 0.0 }
        });
        let fraction = [by_spp, by_time, by_error].into_iter().flatten().fold(0.0, f64::max);
        Standing {
            fraction,
            samples: renderer.sample_count(),
            rays_per_second: rays as f64 / self.elapsed.as_secs_f64().max(1e-9),
            relative_error: self.relative_error,
        }
    }

    /// Returns the metadata for the samples so far.
    fn metadata(&self, renderer: &Renderer) -> Metadata {
        Metadata {
            sample_ranges: vec![SampleRange {
                seed: self.arguments.seed,
                first: self.arguments.sample_offset,
                count: renderer.sample_count(),
            }],
            candidates: renderer.report().candidates,
            seconds: self.seconds(),
            gpu_seconds: seconds_of(&renderer.totals().gpu_ms),
            ..self.metadata.clone()
        }
    }

    /// Writes a checkpoint. The outer error is the device's, the inner one the disk's.
    fn write_checkpoint(&self, renderer: &Renderer, sums: Sums) -> Result<Result<()>> {
        let checkpoint = Checkpoint { sums, metadata: self.metadata(renderer) };
        let path = checkpoint_path(&self.output);
        let guide = renderer.guide_state()?.map(|state| state.to_bytes()).transpose();
        Ok(guide
            .map_err(|source| Error::io(&path, "write", source))
            .and_then(|guide| checkpoint.write_with_guide(&path, guide.as_deref())))
    }

    /// Writes the image, then all other files asked for, each of them even if another fails.
    ///
    /// # Errors
    /// The first failure; others are logged.
    fn finish(&mut self, renderer: &Renderer, reason: StopReason, load_ms: f64) -> Result<()> {
        let sums = renderer.sums()?;
        let totals = renderer.totals();
        self.warnings.clear();
        self.warn_of_darkness(": the image is black");
        if totals.dropped_samples > 0 {
            self.warn(format!(
                "{} samples were left out because their radiance was not finite",
                totals.dropped_samples
            ));
        }
        if let Some([left, top, right, bottom]) = totals.overrun_pixels {
            let Window { x, y, .. } = self.window;
            self.warn(format!(
                "{} rays were given up after too many steps of traversal, where many triangles meet in \
                 one place: pixels within --crop {},{},{},{} may be wrong",
                totals.traversal_overruns,
                left + x,
                top + y,
                right + x,
                bottom + y
            ));
        }
        let metadata = self.metadata(renderer);
        let mut image = sums.to_image(&self.aovs);
        metadata.store(&mut image);
        let mut written = Vec::new();
        let mut failure = None;
        let mut note = |path: &Path, result: Result<()>| match (result, &failure) {
            (Ok(()), _) => written.push(display(path)),
            (Err(error), None) => failure = Some(error),
            (Err(error), Some(_)) => log::error!("{error}"),
        };
        note(&self.output, image.write_exr(&self.output));
        if self.arguments.png {
            let path = self.output.with_extension("png");
            let preview = |rgb| write_preview(&path, &rgb, self.arguments.exposure);
            note(&path, image.rgb(&self.output).and_then(preview));
        }
        if let Some(denoiser) = &self.denoiser {
            self.write_denoised(denoiser, &image, &mut note);
        }
        drop(image);
        if let Some(path) = &self.arguments.stats {
            note(path, self.statistics(renderer, &metadata, reason, load_ms).write(path));
        }
        let is_interrupted = reason == StopReason::Interrupt && !is_special_file(&self.output);
        if is_interrupted || self.arguments.checkpoint_interval.is_some() {
            let path = checkpoint_path(&self.output);
            note(&path, self.write_checkpoint(renderer, sums).and_then(|written| written));
        }
        if let Some(path) = &self.arguments.save_guide {
            note(path, guide::save(renderer, path));
        }
        if !self.arguments.quiet && !written.is_empty() {
            eprintln!("wrote {}", written.join(", "));
        }
        failure.map_or(Ok(()), Err)
    }

    /// Writes the denoised picture, and its preview beside that of the image.
    fn write_denoised(
        &self,
        denoiser: &Denoiser,
        film: &Image,
        note: &mut impl FnMut(&Path, Result<()>),
    ) {
        let path = denoised_path(&self.output, "exr");
        let Denoised { image, line } = match denoise(denoiser, film, &self.output) {
            Ok(denoised) => denoised,
            Err(error) => return note(&path, Err(error)),
        };
        if !self.arguments.quiet {
            eprintln!("{line}");
        }
        note(&path, image.write_exr(&path));
        if self.arguments.png {
            let shown = denoised_path(&self.output, "png");
            let preview = |rgb| write_preview(&shown, &rgb, self.arguments.exposure);
            note(&shown, image.rgb(&path).and_then(preview));
        }
    }
}

fn display(path: &Path) -> String {
    path.display().to_string()
}
