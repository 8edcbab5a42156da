//! The loop of a render: passes until a rule is met, looks at the film, checkpoints.

use std::{
    fmt,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use super::{Renderer, Rules, Settings, Standing, StopReason};
use crate::{
    error::{Error, Result},
    film::{Aov, Checkpoint, Image, Metadata, SampleRange, Sums, metadata::seconds_of},
    gpu::Device,
    pass::Saved,
    scene::{Camera, Scene},
};

/// Duration aimed at for a pass, and so the delay until stop rules and interrupts are noticed.
const PACE: Duration = Duration::from_millis(250);
/// Interval of looks at the film, which need it on the host.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);
/// Samples per pixel from which a film without light is reported to who waits for an error.
const DARK_AFTER: u32 = 64;

/// News of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// A pass has ended.
    Pass {
        /// Its samples per pixel.
        samples: u32,
        /// Wall time that it took, seconds.
        seconds: f64,
        /// State of the run.
        standing: Standing,
    },
    /// The film was read.
    Look(&'a Sums),
    /// A line to keep.
    Note(&'a str),
}

impl fmt::Display for Event<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pass { standing, .. } => write!(formatter, "{standing}"),
            Self::Look(sums) => write!(formatter, "{} spp read", sums.sample_count),
            Self::Note(line) => formatter.write_str(line),
        }
    }
}

/// Follower of a run.
pub trait Observer {
    /// True if the run should end before its next pass, though not before its first.
    fn is_interrupted(&self) -> bool {
        false
    }

    /// Takes notice of an event.
    fn notice(&mut self, event: &Event<'_>);
}

impl<F: FnMut(&Event<'_>)> Observer for F {
    fn notice(&mut self, event: &Event<'_>) {
        self(event);
    }
}

/// A render that finishes by itself: a [`Renderer`] with its clock and its description.
pub struct Session {
    /// The renderer at work.
    pub renderer: Renderer,
    /// Metadata without samples and times.
    description: Metadata,
    /// Duration aimed at for a pass.
    pace: Duration,
    /// Samples and seconds of the last pass.
    last_pass: Option<(u32, f64)>,
    /// Wall time that earlier runs spent in passes, seconds.
    earlier_seconds: f64,
    /// Wall time that this run has spent in passes, seconds.
    own_seconds: f64,
    /// Mean relative standard error at the last look; `None` as long as no sample has found light.
    pub(super) relative_error: Option<f64>,
    /// True if any sample had found light at the last look.
    pub(super) found_light: bool,
}

/// Describes a render by its settings, without fits, samples and times.
pub(crate) fn describe(device: &Device, scene: &Scene, settings: &Settings) -> Metadata {
    let capabilities = device.capabilities();
    let is_instanced = !scene.geometry.instances.is_empty();
    let mut parameters = settings.sampler.describe(&settings.parameters);
    let roulette = settings.roulette;
    if settings.depth > roulette.vertex {
        parameters.insert("roulette-depth".to_owned(), roulette.vertex.to_string());
        parameters.insert("roulette-throughput".to_owned(), roulette.throughput.to_string());
    }
    Metadata {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene.name.clone(),
        scene_hash: scene.hash.clone(),
        sampler: settings.sampler.name().to_owned(),
        sampler_parameters: parameters,
        shadow_rays: settings.shadow_rays,
        depth: settings.depth,
        device: capabilities.name.clone(),
        driver: capabilities.driver.clone(),
        tracer: if is_instanced { "device".to_owned() } else { device.tracer() },
        ..Metadata::default()
    }
}

impl Session {
    /// Prepares to render `scene`. Fails as [`Renderer::new`].
    pub fn new(device: &Arc<Device>, scene: &Scene, settings: Settings) -> Result<Self> {
        Ok(Self::of(Renderer::new(device, scene, settings)?, device, scene))
    }

    /// Drives a renderer of `scene` that has no samples yet.
    pub fn of(renderer: Renderer, device: &Device, scene: &Scene) -> Self {
        let (fit_hashes, tracer) = (renderer.report().fit_hashes, renderer.tracer());
        let description = describe(device, scene, renderer.settings());
        Self {
            renderer,
            description: Metadata { fit_hashes, tracer, ..description },
            pace: PACE,
            last_pass: None,
            earlier_seconds: 0.0,
            own_seconds: 0.0,
            relative_error: None,
            found_light: false,
        }
    }

    /// Aims at another duration of a pass.
    #[must_use]
    pub fn with_pace(self, pace: Duration) -> Self {
        Self { pace, ..self }
    }

    fn reset(&mut self) {
        (self.earlier_seconds, self.own_seconds) = (0.0, 0.0);
        (self.relative_error, self.found_light) = (None, false);
    }

    /// Starts again with another seed, as [`Renderer::restart`].
    pub fn restart(&mut self, seed: u32) -> Result<()> {
        self.reset();
        self.renderer.restart(seed)
    }

    /// Starts again through another camera, as [`Renderer::look`], with a pass of one sample.
    pub fn look(&mut self, camera: &Camera, size: [u32; 2], seed: u32, learns: bool) -> Result<()> {
        self.reset();
        self.last_pass = None;
        self.renderer.look(camera, size, seed, learns)
    }

    /// Wall time of the passes, those of earlier runs included, seconds.
    pub fn seconds(&self) -> f64 {
        self.earlier_seconds + self.own_seconds
    }

    /// Wall time of the passes of this run, seconds.
    pub fn own_seconds(&self) -> f64 {
        self.own_seconds
    }

    /// Describes the film with its samples and times so far.
    pub fn metadata(&self) -> Metadata {
        let settings = self.renderer.settings();
        Metadata {
            sample_ranges: vec![SampleRange {
                seed: settings.seed,
                first: settings.first_sample,
                count: self.renderer.sample_count(),
            }],
            candidates: self.renderer.report().candidates,
            seconds: self.seconds(),
            gpu_seconds: seconds_of(&self.renderer.totals().gpu_ms),
            ..self.description.clone()
        }
    }

    /// Returns the film as an image with `layers` and its metadata. Fails if the device does.
    pub fn image(&self, layers: &[Aov]) -> Result<Image> {
        let mut image = self.renderer.sums()?.to_image(layers);
        self.metadata().store(&mut image);
        Ok(image)
    }

    /// Renders one pass of at most `most` samples: at most twice as many as the last, to take about as long
    /// as the pace and to end within `left` seconds. Returns its seconds. Fails if the device does.
    pub fn pass(&mut self, most: u32, left: f64) -> Result<f64> {
        let left = left.min(self.pace.as_secs_f64());
        let next = |(samples, took)| next_pass_samples(samples, took, left);
        let samples = self.last_pass.map_or(1, next).min(most);
        let start = Instant::now();
        self.renderer.render_pass(samples)?;
        let took = start.elapsed().as_secs_f64();
        self.own_seconds += took;
        self.last_pass = Some((samples, took));
        Ok(took)
    }

    /// Renders until a rule is met, or the observer interrupts. Fails if the device does.
    pub fn run(&mut self, rules: &Rules, observer: &mut dyn Observer) -> Result<StopReason> {
        let mut next_look = Instant::now() + LOOK_INTERVAL;
        let mut last_checkpoint = Instant::now();
        let mut is_dark = false;
        let looks = rules.looks || rules.error.is_some();
        let reason = loop {
            let before = self.renderer.sample_count();
            if before > 0 && observer.is_interrupted() {
                break StopReason::Interrupt;
            }
            if let Some(reason) = self.met(rules) {
                break reason;
            }
            let seconds = self.pass(self.last_sample(rules) - before, self.seconds_left(rules))?;
            let samples = self.renderer.sample_count() - before;
            if looks && (Instant::now() >= next_look || rules.error.is_some()) {
                let start = Instant::now();
                self.look_at_film(observer)?;
                if rules.error.is_some()
                    && !is_dark
                    && !self.found_light
                    && before + samples >= DARK_AFTER
                {
                    log::warn!("no sample has found any light so far: --error waits for light");
                    is_dark = true;
                }
                // Reading back a large film takes time from the passes.
                next_look = Instant::now() + LOOK_INTERVAL.max(20 * start.elapsed());
            }
            if let Some((path, interval)) = &rules.checkpoints
                && last_checkpoint.elapsed() >= *interval
            {
                // A full disk may have room again at the next interval or for the image.
                if let Err(error) = self.write_checkpoint(path)? {
                    log::warn!("{error}; the next checkpoint tries again");
                }
                last_checkpoint = Instant::now();
            }
            observer.notice(&Event::Pass { samples, seconds, standing: self.standing(rules) });
        };
        if looks {
            self.look_at_film(observer)?;
        }
        Ok(reason)
    }

    /// Takes the error and the presence of light from the film. A black film has no error to speak of.
    fn look_at_film(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let sums = self.renderer.sums()?;
        self.found_light = sums.found_light();
        self.relative_error = self.found_light.then(|| sums.relative_standard_error());
        observer.notice(&Event::Look(&sums));
        Ok(())
    }

    /// Writes a checkpoint, with the guide of a sampler that learns. The outer error is the device's, the
    /// inner one the disk's.
    pub fn write_checkpoint(&self, path: &Path) -> Result<Result<()>> {
        let checkpoint = Checkpoint { sums: self.renderer.sums()?, metadata: self.metadata() };
        Ok(checkpoint.write_with_guide(path, self.renderer.guide()?.as_deref()))
    }

    /// Continues from a checkpoint of the same render, as if it had not stopped.
    ///
    /// # Errors
    /// A file that cannot be read or belongs to another render; a sampler that knows more than the
    /// checkpoint holds; a failing device.
    pub fn resume(&mut self, path: &Path) -> Result<()> {
        let (checkpoint, guide) = Checkpoint::read_with_guide(path)?;
        checkpoint.check_resume(path, &self.metadata(), &self.renderer.sums()?)?;
        self.renderer.restore(&checkpoint.sums)?;
        if self.renderer.settings().sampler.has_guide() {
            let (path, bytes) =
                guide.ok_or_else(|| Error::format(path, "the checkpoint has no guide"))?;
            self.renderer.take_guide(Saved { path: &path, bytes: &bytes, continues: true })?;
        }
        self.earlier_seconds = checkpoint.metadata.seconds;
        Ok(())
    }
}

/// Samples of the next pass after one of `samples` that took `took` seconds: at most twice as many, to
/// end within `left` seconds.
fn next_pass_samples(samples: u32, took: f64, left: f64) -> u32 {
    let per_sample = took.max(1e-6) / f64::from(samples);
    // At least 1, so that the cast is exact.
    (left.max(0.0) / per_sample).floor().clamp(1.0, f64::from(samples) * 2.0) as u32
}

#[cfg(test)]
mod tests {
    use super::next_pass_samples;

    #[test]
    fn passes_grow_and_end_with_the_time() {
        assert_eq!(next_pass_samples(1, 0.01, 0.25), 2);
        assert_eq!(next_pass_samples(8, 0.8, 0.25), 2);
        assert_eq!(next_pass_samples(8, 0.08, 0.03), 3);
        assert_eq!(next_pass_samples(8, 0.08, -1.0), 1);
    }
}
