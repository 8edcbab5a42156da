//! The loop of a render: passes until a rule is met, looks at the film, checkpoints.

use std::{
    cell::Cell,
    fmt,
    path::Path,
    rc::Rc,
    sync::Arc,
    time::{Duration, Instant},
};

use super::{Flag, Renderer, Rules, Settings, Standing, StopReason, stop::Rate};
use crate::{
    error::{Error, Result},
    film::{
        Aov, Checkpoint, Image, Metadata, SampleRange, Sums, checkpoint::remove_checkpoint,
        cryptomatte, metadata::seconds_of,
    },
    gpu::Device,
    pass::Saved,
    scene::{Camera, Scene},
};

/// Duration aimed at for a pass, and so the delay until stop rules are noticed. An interrupt stops one
/// that takes longer.
const PACE: Duration = Duration::from_millis(250);
/// Duration of a training that an interrupt does not stop, so that there is a picture of small films.
const SHORT_TRAINING: Duration = Duration::from_secs(4);
/// Interval of looks at the film, which need it on the host.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);
/// Bytes of an image file besides its pixels, at most.
const IMAGE_BESIDES_PIXELS: u64 = 1 << 20;
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
    /// Flag that ends the run: before its next pass, or after any wave of a pass that takes long. Some
    /// pixels may then have more samples than others.
    fn interrupt(&self) -> Flag {
        Flag::default()
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
    pub pace: Duration,
    /// Samples and seconds of the last pass.
    pub(super) last_pass: Option<(u32, f64)>,
    /// True if a checkpoint of this render lies on the disk: it was resumed from, or has been written.
    pub(crate) has_checkpoint: bool,
    /// Start of the pass under way, for its watch.
    pass_start: Rc<Cell<Instant>>,
    /// Wall time that earlier runs spent in passes, seconds.
    earlier_seconds: f64,
    /// Wall time that this run has spent in passes, seconds.
    pub(super) own_seconds: f64,
    /// Rate of the run, for forecasts.
    pub(super) rate: Rate,
    /// Mean relative standard error at the last look; `None` as long as no sample has found light.
    pub(super) relative_error: Option<f64>,
    /// True if any sample had found light at the last look.
    pub(super) found_light: bool,
}

/// Describes a render by its settings, without fits, tracer, samples and times.
pub(crate) fn describe(device: &Device, scene: &Scene, settings: &Settings) -> Metadata {
    let capabilities = device.capabilities();
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
        mattes: cryptomatte::attributes(
            scene,
            [Aov::CryptoObject, Aov::CryptoMaterial].map(|aov| settings.aovs.contains(&aov)),
        ),
        device: capabilities.name.clone(),
        driver: capabilities.driver.clone(),
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
            has_checkpoint: false,
            pass_start: Rc::new(Cell::new(Instant::now())),
            earlier_seconds: 0.0,
            own_seconds: 0.0,
            rate: Rate::from(0),
            relative_error: None,
            found_light: false,
        }
    }

    fn reset(&mut self) {
        (self.earlier_seconds, self.own_seconds) = (0.0, 0.0);
        (self.relative_error, self.found_light) = (None, false);
        self.rate = Rate::from(0);
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

    /// Goes on with the next frame of an animation in which the camera alone moves, as [`Session::look`]:
    /// what was learned from earlier frames stays. `seed` must be new.
    pub fn next_frame(&mut self, scene: &Scene, seed: u32) -> Result<()> {
        self.look(&scene.camera, [scene.film.width, scene.film.height], seed, true)?;
        self.description.scene_hash.clone_from(&scene.hash);
        self.has_checkpoint = false;
        Ok(())
    }

    /// Wall time of the passes, those of earlier runs included, seconds.
    pub fn seconds(&self) -> f64 {
        self.earlier_seconds + self.own_seconds
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
            ahead: self.renderer.ahead(),
            candidates: self.renderer.report().candidates,
            seconds: self.seconds(),
            gpu_seconds: seconds_of(&self.renderer.totals().gpu_ms),
            ..self.description.clone()
        }
    }

    /// Returns the film as an image with `layers` and its metadata. Fails if the device does.
    pub fn image(&self, layers: &[Aov]) -> Result<Image> {
        Ok(self.image_of(&self.renderer.sums()?, layers))
    }

    /// Returns sums of the film as [`Session::image`] does.
    pub(crate) fn image_of(&self, sums: &Sums, layers: &[Aov]) -> Image {
        let mut image = sums.to_image(layers);
        self.metadata().store(&mut image);
        image
    }

    /// Renders one pass of at most `most` samples: at most twice as many as the last, to take about as long
    /// as the pace and to end within `left` seconds. Returns its seconds. Fails if the device does.
    pub fn pass(&mut self, most: u32, left: f64) -> Result<f64> {
        let left = left.min(self.pace.as_secs_f64());
        let next = |(samples, took)| next_pass_samples(samples, took, left);
        let samples = self.last_pass.map_or(1, next).min(most);
        let start = Instant::now();
        self.pass_start.set(start);
        self.renderer.render_pass(samples)?;
        let took = start.elapsed().as_secs_f64();
        self.own_seconds += took;
        self.rate.note(self.own_seconds, self.renderer.sample_count());
        self.last_pass = Some((samples, took));
        Ok(took)
    }

    /// Stops passes that take long once the flag is raised.
    fn watch(&mut self, interrupt: &Flag) {
        let (interrupt, start) = (interrupt.clone(), Rc::clone(&self.pass_start));
        let pace = self.pace;
        self.renderer.set_watch(Box::new(move |wave| {
            let patience = if wave.is_training == 0 { pace } else { SHORT_TRAINING };
            interrupt.is_raised() && start.get().elapsed() > patience
        }));
    }

    /// Renders until a rule is met, or the observer interrupts.
    ///
    /// # Errors
    /// [`Error::Interrupted`] before any pixel has a sample; a failing device.
    pub fn run(&mut self, rules: &Rules, observer: &mut dyn Observer) -> Result<StopReason> {
        let interrupt = observer.interrupt();
        self.watch(&interrupt);
        let (start, seconds_before) = (Instant::now(), self.own_seconds);
        let mut next_look = Instant::now() + LOOK_INTERVAL;
        let mut next_checkpoint =
            rules.checkpoints.as_ref().map(|(_, interval)| Instant::now() + *interval);
        let mut is_dark = false;
        let looks = rules.looks || rules.error.is_some();
        let reason = loop {
            let before = self.renderer.sample_count();
            if interrupt.is_raised() {
                if before > 0 || !self.renderer.ahead().is_none() {
                    break StopReason::Interrupt;
                } else if self.renderer.is_stopped() {
                    return Err(Error::Interrupted);
                }
            }
            if let Some(reason) = self.met(rules) {
                break reason;
            }
            let seconds = self.pass(self.last_sample(rules) - before, self.seconds_left(rules))?;
            let samples = self.renderer.sample_count() - before;
            // Who interrupts does not wait for the error of a large film, nor for a checkpoint.
            let is_hurried = interrupt.is_raised();
            if looks && !is_hurried && (Instant::now() >= next_look || rules.error.is_some()) {
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
                && !is_hurried
                && next_checkpoint.is_some_and(|at| Instant::now() >= at)
            {
                let start = Instant::now();
                // A full disk may have room again at the next interval or for the image.
                match self.write_checkpoint(path, self.renderer.sums()?)? {
                    Ok(()) => self.leave_room_beside(path),
                    Err(error) => log::warn!("{error}; the next checkpoint tries again"),
                }
                // A large film takes time from the passes.
                let pause = (10 * start.elapsed()).clamp(*interval, 10 * *interval);
                next_checkpoint = Some(Instant::now() + pause);
            }
            let share =
                start.elapsed().as_secs_f64() / (self.own_seconds - seconds_before).max(1e-9);
            self.rate.wall_share = share;
            observer.notice(&Event::Pass { samples, seconds, standing: self.standing(rules) });
        };
        if looks && reason != StopReason::Interrupt {
            self.look_at_film(observer)?;
        }
        Ok(reason)
    }

    /// Reads the film, and notes whether it has found light.
    pub fn sums(&mut self) -> Result<Sums> {
        let sums = self.renderer.sums()?;
        self.found_light = sums.found_light();
        Ok(sums)
    }

    /// Takes the error and the presence of light from the film. A black film has no error to speak of.
    fn look_at_film(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let sums = self.sums()?;
        self.relative_error = self.found_light.then(|| sums.relative_standard_error());
        observer.notice(&Event::Look(&sums));
        Ok(())
    }

    /// Writes a checkpoint of the film's sums, with the guide of a sampler that learns. The outer error is
    /// the device's, the inner one the disk's.
    pub fn write_checkpoint(&mut self, path: &Path, sums: Sums) -> Result<Result<()>> {
        self.write_checkpoint_beside(path, sums, || ()).1
    }

    /// As [`Session::write_checkpoint`]: a thread prepares it beside `work`, after which it is written.
    pub(crate) fn write_checkpoint_beside<R: Send>(
        &mut self,
        path: &Path,
        sums: Sums,
        work: impl FnOnce() -> R + Send,
    ) -> (R, Result<Result<()>>) {
        let checkpoint = Checkpoint { sums, metadata: self.metadata() };
        let guide = self.renderer.guide();
        let prepare = || guide.map(|guide| checkpoint.encode(guide));
        let (done, encoded) = rayon::join(work, prepare);
        let written = encoded.map(|encoded| encoded.write(path));
        self.has_checkpoint |= matches!(written, Ok(Ok(())));
        (done, written)
    }

    /// Removes the checkpoint again if it leaves too little of the disk for the image.
    fn leave_room_beside(&mut self, path: &Path) {
        let settings = self.renderer.settings();
        let [width, height] = self.renderer.film_size.map(u64::from);
        let layers = 1 + settings.aovs.len() as u64;
        let image_bytes = width * height * 12 * layers + IMAGE_BESIDES_PIXELS;
        if free_bytes(path).is_some_and(|free| free < image_bytes as f64) {
            log::warn!("{}: removed, the disk has room for the image only", path.display());
            self.has_checkpoint = false;
            remove_checkpoint(path).unwrap_or_else(|error| log::warn!("{error}"));
        }
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
        if self.renderer.settings().sampler.room().has_guide() {
            let (path, bytes) =
                guide.ok_or_else(|| Error::format(path, "the checkpoint has no guide"))?;
            self.renderer.take_guide(Saved { path: &path, bytes: &bytes, continues: true })?;
        }
        self.has_checkpoint = true;
        self.earlier_seconds = checkpoint.metadata.seconds;
        self.rate = Rate::from(self.renderer.sample_count());
        Ok(())
    }
}

/// Bytes that are free on the disk of a file, where the system tells.
#[cfg(unix)]
fn free_bytes(path: &Path) -> Option<f64> {
    let disk = nix::sys::statvfs::statvfs(crate::files::parent_of(path)).ok()?;
    Some(disk.blocks_available() as f64 * disk.fragment_size() as f64)
}

#[cfg(not(unix))]
fn free_bytes(_: &Path) -> Option<f64> {
    None
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
