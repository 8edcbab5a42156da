//! `fenestra render`: scene file → finished image.

mod arguments;
mod finish;
mod statistics;
mod stop;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use stop::StopReason;

pub use arguments::Arguments;

use super::{
    interrupt::Interrupt,
    progress::{Patience, Progress},
};
use crate::{
    error::{Error, Result},
    files::sweep_leftovers,
    film::{
        Aov, Checkpoint, Metadata, Sums, Window, checkpoint::checkpoint_path,
        display::DisplayServer,
    },
    gpu::{Denoiser, Device},
    pass::{Explanation, Roulette, Saved},
    scene::Scene,
    session::{Renderer, Settings, pixel, window_of},
    study::watch::next_pass_samples,
};

/// Samples per pixel if no stop rule is given.
const DEFAULT_SPP: u32 = 64;
/// Interval of error estimates and display updates, which need the film on the host.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);
/// Samples per pixel of `--quick`.
const QUICK_SPP: u32 = 16;

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
        renderer.load_guide(path)?;
    }
    job.metadata.fit_hashes = renderer.report().fit_hashes;
    job.resume(&mut renderer)?;
    drop(patience);

    let reason = job.render(&mut renderer, &interrupt)?;
    device.save_pipeline_cache();
    job.finish(&renderer, reason, load_ms)?;
    if let Some(at) = arguments.pixel {
        job.explain(renderer.explain_pixel(&device, &scene, at)?.as_deref(), at)?;
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
        if self.arguments.sampler.has_guide() {
            let (path, bytes) =
                guide.ok_or_else(|| Error::format(&path, "the checkpoint has no guide"))?;
            renderer.take_guide(Saved { path: &path, bytes: &bytes, continues: true })?;
        }
        self.earlier_seconds = checkpoint.metadata.seconds;
        Ok(())
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

    /// Writes the picture of `--pixel`.
    fn explain(&self, explanation: Option<&dyn Explanation>, at: [u32; 2]) -> Result<()> {
        let Some(explanation) = explanation else {
            let [x, y] = at;
            log::warn!(
                "--pixel {x},{y}: the pixel sees the environment; there is no hit to explain"
            );
            return Ok(());
        };
        for path in pixel::write(explanation, self.scene, &self.output, at)? {
            if !self.arguments.quiet {
                eprintln!("wrote {}", display(&path));
            }
        }
        Ok(())
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
}

fn display(path: &Path) -> String {
    path.display().to_string()
}
