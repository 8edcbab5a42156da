//! `fenestra render`: scene file → finished image.

mod arguments;
mod finish;
mod frames;
mod preview;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

pub use arguments::Arguments;
use arguments::PNG_INTERVAL;
use frames::is_finished;
use preview::Preview;

use super::{
    interrupt::Interrupt,
    progress::{Patience, Progress},
};
use crate::{
    error::{Error, Result},
    files::sweep_leftovers,
    film::{Aov, Image, checkpoint::checkpoint_path, display::DisplayServer},
    gpu::{Denoiser, Device},
    pass::Explanation,
    scene::{Scene, still_hash},
    session::{Event, Flag, Limit, Observer, Quality, Rules, Session, Settings, StopReason, pixel},
    terminal::say,
};

const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(60);
const QUICK_SPP: u32 = 16;

/// Renders a scene, or frames of it.
///
/// # Errors
/// Wrong options, an unusable scene, no device, a failing device or disk; [`Error::Interrupted`]
/// after Ctrl-C, once the partial result has been written.
pub fn run(arguments: &Arguments) -> Result<()> {
    let interrupt = Interrupt::listen();
    // A picture to show is denoised where the library is found; `--denoise` insists on it.
    let offered = arguments.shows().then(Denoiser::load);
    let denoises = arguments.denoise || matches!(offered, Some(Ok(_)));
    arguments.settings(denoises)?;
    let denoiser = offered.and_then(Result::ok);
    let mut sequence = Sequence {
        interrupt,
        denoises,
        denoiser,
        device: None,
        carried: None,
        warned: BTreeSet::new(),
    };
    arguments.frame_list()?.into_iter().try_for_each(|frame| sequence.render(arguments, frame))
}

/// Renderer of a scene in which the camera alone moves, from one frame to the next.
struct Carried {
    session: Session,
    still_hash: String,
}

/// All that renders one frame after the other.
struct Sequence {
    interrupt: Arc<Interrupt>,
    denoises: bool,
    denoiser: Option<Denoiser>,
    device: Option<Arc<Device>>,
    carried: Option<Carried>,
    /// Warnings given so far.
    warned: BTreeSet<String>,
}

impl Sequence {
    /// Renders one frame, or the scene as it stands.
    fn render(&mut self, arguments: &Arguments, frame: Option<u32>) -> Result<()> {
        let arguments = &arguments.of_frame(frame);
        let output = arguments.image_path(frame);
        if arguments.skip_existing && is_finished(&output) {
            if !arguments.quiet {
                say!("{} is there: skipped", output.display());
            }
            return Ok(());
        }
        let mut settings = arguments.settings(self.denoises)?;
        let start = Instant::now();
        let loading = format!("loading {}", arguments.scene.display());
        let patience = Patience::new(&loading, arguments.quiet);
        let time = frame.map(|frame| f64::from(frame) / arguments.fps);
        let mut scene = arguments.scene_options.load_at(&arguments.scene, time)?;
        scene.warnings.iter().for_each(|warning| self.warn(warning));
        let load_ms = start.elapsed().as_secs_f64() * 1e3;
        arguments.resize(&mut scene.film);
        let notes = [arguments.take_asked(&scene, &mut settings), arguments.unshared(&settings)];
        for line in notes.into_iter().flatten().filter(|_| !arguments.quiet) {
            say!("{line}");
        }
        // Fail before the work, not after it.
        arguments.check_outputs(&scene, &output, self.denoises)?;
        sweep_leftovers(&output);
        if let Some(at) = arguments.pixel {
            pixel::check(&settings, &scene, &output, at)?;
        }
        if self.denoises && self.denoiser.is_none() {
            self.denoiser = Some(Denoiser::load()?);
        }
        self.interrupt.wait_for_caller();
        if frame.is_some() && self.interrupt.flag.is_raised() {
            return Err(Error::Interrupted);
        }
        let device = self.device(arguments)?;
        if let Some(warning) = settings.sampler.portal_warning(&scene) {
            self.warn(&warning);
        }
        if let (Some(frame), Some(time), false) = (frame, time, arguments.quiet) {
            say!("frame {frame} at {time:.3} s: {}", output.display());
        }
        let aovs = settings.aovs.clone();
        let checkpoint = checkpoint_path(&output);
        let resumes = (arguments.resume || arguments.skip_existing) && checkpoint.exists();
        let still_hash = frame.filter(|_| settings.window.is_none()).map(|_| still_hash(&scene));
        let carried = self
            .carried
            .take()
            .filter(|carried| Some(&carried.still_hash) == still_hash.as_ref() && !resumes);
        let mut session = match carried {
            Some(Carried { mut session, .. }) => {
                session.next_frame(&scene, settings.seed)?;
                session
            }
            None => prepare(arguments, &device, &scene, settings)?,
        };
        if resumes {
            session.resume(&checkpoint)?;
        } else if arguments.resume {
            let path = checkpoint.display();
            log::warn!("--resume: there is no {path}; starting from the beginning");
        }
        drop(patience);

        let denoiser = self.denoiser.as_ref();
        let job = RenderJob { arguments, scene: &scene, output, aovs, denoiser, load_ms, time };
        let reason = job.render(&mut session, &self.interrupt)?;
        let finished = job.finish(&mut session, reason);
        device.save_pipeline_cache();
        finished?;
        if let Some(at) = arguments.pixel {
            job.explain(session.renderer.explain_pixel(&device, &scene, at)?.as_deref(), at)?;
        } else {
            self.carried = still_hash.map(|still_hash| Carried { session, still_hash });
        }
        device.check_validation()?;
        if reason == StopReason::Interrupt { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Opens the device before the first frame.
    fn device(&mut self, arguments: &Arguments) -> Result<Arc<Device>> {
        if let Some(device) = &self.device {
            return Ok(Arc::clone(device));
        }
        let device = arguments.device.announce(arguments.validate, arguments.quiet)?;
        Ok(Arc::clone(self.device.insert(device)))
    }

    /// Logs a warning, for the first frame that has it.
    fn warn(&mut self, warning: &str) {
        if self.warned.insert(warning.to_owned()) {
            log::warn!("{warning}");
        }
    }
}

fn prepare(
    arguments: &Arguments,
    device: &Arc<Device>,
    scene: &Scene,
    settings: Settings,
) -> Result<Session> {
    let mut session = Session::new(device, scene, settings)?;
    if let Some(path) = &arguments.load_guide {
        session.renderer.load_guide(path)?;
    }
    Ok(session)
}

/// Loads the scene that the arguments name.
///
/// # Errors
/// As [`Scene::load_with`]; any warning under `--strict`.
pub fn load(arguments: &Arguments) -> Result<Scene> {
    arguments.scene_options.load(&arguments.scene)
}

/// Renders `scene` by the sampler, film, layers and stop rules of the arguments, which otherwise are those
/// of a picture to show, to an image in memory. No file is written.
///
/// # Errors
/// As [`run`]; [`Error::Interrupted`] only before any pixel has a sample.
pub fn film(
    arguments: &Arguments,
    scene: &mut Scene,
    observer: &mut dyn Observer,
) -> Result<(Image, StopReason)> {
    let mut settings = arguments.settings(false)?;
    arguments.resize(&mut scene.film);
    if let Some(line) = arguments.take_asked(scene, &mut settings) {
        observer.notice(&Event::Note(&line));
    }
    let aovs = settings.aovs.clone();
    let device = arguments.device.announce(arguments.validate, arguments.quiet)?;
    if let Some(warning) = settings.sampler.portal_warning(scene) {
        log::warn!("{warning}");
    }
    let mut session = prepare(arguments, &device, scene, settings)?;
    let reason = session.run(&arguments.rules(scene.asked), observer)?;
    device.save_pipeline_cache();
    let image = session.image(&aovs)?;
    device.check_validation()?;
    Ok((image, reason))
}

/// One render, from its first pass to its files.
struct RenderJob<'a> {
    arguments: &'a Arguments,
    scene: &'a Scene,
    output: PathBuf,
    aovs: Vec<Aov>,
    /// Denoiser, if the picture is to be denoised.
    denoiser: Option<&'a Denoiser>,
    load_ms: f64,
    /// Time of the frame in the animation, seconds.
    time: Option<f64>,
}

impl RenderJob<'_> {
    /// Renders passes until a stop rule is met.
    fn render(&self, session: &mut Session, interrupt: &Interrupt) -> Result<StopReason> {
        let interval = self.arguments.checkpoint_interval.unwrap_or(CHECKPOINT_INTERVAL);
        let writes = self.arguments.writes_checkpoints(&self.output);
        let checkpoints = writes.then(|| (checkpoint_path(&self.output), interval));
        let rules = Rules { checkpoints, ..self.arguments.rules(self.scene.asked) };
        let progress = Progress::new(self.scene.name.clone(), self.arguments.quiet);
        let display = self.open_display()?;
        let is_asked = self.arguments.asked_samples(self.scene.asked).is_some();
        let quality = self.arguments.quality().filter(|_| !is_asked);
        if let Some(quality) = quality {
            progress.print(&announce(quality));
        }
        let interval = self.arguments.shows().then_some(PNG_INTERVAL);
        let preview = self.arguments.png_every.or(interval).map(|interval| {
            let path = self.output.with_extension("png");
            Preview::new(path, self.arguments.exposure, interval)
        });
        let mut observer =
            Display { display, preview, aovs: &self.aovs, ..Display::new(progress, interrupt) };
        let reason = session.run(&rules, &mut observer)?;
        observer.progress.finish(&session.standing(&rules), &explain(reason, quality));
        Ok(reason)
    }

    /// Connects to the viewer named by `--display-server`. Images of other files and samplers stay there.
    fn open_display(&self) -> Result<Option<DisplayServer>> {
        let connect = |address: &String| {
            let name = format!("{} ({})", self.output.display(), self.arguments.sampler.name());
            DisplayServer::connect(address, &name)
        };
        self.arguments.display_server.as_ref().map(connect).transpose()
    }

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
                say!("wrote {}", display(&path));
            }
        }
        Ok(())
    }
}

/// Progress, viewer and interrupts, as seen by a session or a study.
pub(super) struct Display<'a> {
    pub(super) progress: Progress,
    display: Option<DisplayServer>,
    preview: Option<Preview>,
    aovs: &'a [Aov],
    interrupt: &'a Interrupt,
}

impl<'a> Display<'a> {
    /// Shows progress alone.
    pub(super) fn new(progress: Progress, interrupt: &'a Interrupt) -> Self {
        Self { progress, display: None, preview: None, aovs: &[], interrupt }
    }
}

impl Observer for Display<'_> {
    fn interrupt(&self) -> Flag {
        self.interrupt.flag.clone()
    }

    fn notice(&mut self, event: &Event<'_>) {
        match event {
            Event::Pass { standing, .. } => self.progress.update(standing),
            Event::Look(sums) => {
                let display = self.display.as_mut().filter(|display| display.is_connected());
                if let Some(display) = display {
                    display.update(&sums.to_image(self.aovs));
                }
                if let Some(preview) = &mut self.preview {
                    preview.update(sums);
                }
            }
            Event::Note(line) => self.progress.print(line),
        }
    }
}

/// Says before the work when a picture to show will be there.
fn announce(quality: Quality) -> String {
    let rules = quality.rules();
    let limits = [rules.seconds.map(Limit::Seconds), rules.samples.map(Limit::Samples)];
    let limits: Vec<String> = limits.iter().flatten().map(Limit::to_string).collect();
    format!("quality {} (--quality): stops after {}", quality.name(), limits.join(" or "))
}

/// Says which option ended the render.
fn explain(reason: StopReason, quality: Option<Quality>) -> String {
    let option = match reason {
        StopReason::Samples => "stopped by --spp",
        StopReason::Time => "stopped by --time",
        StopReason::Error => "stopped by --error (stopping by the data is slightly biased)",
        StopReason::LastSample => "stopped at the last sample of the seed",
        StopReason::Interrupt => "interrupted",
    };
    match (reason, quality) {
        (StopReason::Samples | StopReason::Time, Some(quality)) => {
            format!("stopped by --quality {}", quality.name())
        }
        _ => option.to_owned(),
    }
}

fn display(path: &Path) -> String {
    path.display().to_string()
}
