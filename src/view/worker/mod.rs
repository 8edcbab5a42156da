//! The rendering thread: renders what the window asks for, and shows it.

mod act;
mod denoise;

use std::{
    cell::RefCell,
    path::PathBuf,
    rc::Rc,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::Vec3;

use self::denoise::{Denoising, Filtered};
use super::{
    camera::Rig,
    keys::{Action, LAYERS},
    message::{Input, Status},
    panel::Panel,
    projector::Place,
    save::views,
    side::Side,
};
use crate::{
    error::Result,
    gpu::Device,
    math::random::hash_4d,
    pass::Watch,
    sampler::Sampler,
    scene::Scene,
    session::Settings,
    shader::constants::{SHOW_ERROR, SHOW_PICTURE},
};

/// Time without a motion after which the camera is at rest.
const REST: Duration = Duration::from_millis(150);
/// Aim for the time between two pictures of a moving camera.
const MOVING_TIME: Duration = Duration::from_millis(45);
/// Least side of the film of a moving camera, pixels, and the largest factor by which it shrinks.
const LEAST_SIDE: u32 = 16;
const MOST_SHRINKING: f32 = 32.0;
/// Time between rebuilds of the guide while the camera moves.
const LEARNING_INTERVAL: Duration = Duration::from_millis(500);
/// Longest rebuild that a moving camera may wait for.
const LEARNING_TIME: Duration = Duration::from_millis(30);
/// Longest time that one step of flying covers: after a pause the camera must not jump.
const LONGEST_STEP: f32 = 0.1;
/// Interval between looks at how near the things before a moving camera are.
const ADAPT_INTERVAL: Duration = Duration::from_millis(100);
/// Interval between looks at the error of a film at rest, which is read as a whole.
const ERROR_INTERVAL: Duration = Duration::from_secs(2);
/// Number of passes whose times are told.
const TOLD_PASSES: usize = 6;
/// Interval between insets, and between means of the film for its relative error.
const LOOK_INTERVAL: Duration = Duration::from_millis(400);
/// Tells the seeds of moved cameras from other hashes.
const MOVED_SEED: u32 = 0x51de_ca3b;

/// Where the camera is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// At rest: the whole film refines.
    Rest,
    /// Moving, since this moment at the latest.
    Moving(Instant),
}

/// Everything that the rendering thread has.
pub(crate) struct Worker {
    scene: Scene,
    /// The device, opened for the display.
    device: Arc<Device>,
    settings: Settings,
    /// Samples per pixel at which a film is finished.
    spp: u32,
    left: Side,
    panel: Rc<RefCell<Panel>>,
    /// Shows what the renderer does.
    announce: Box<dyn Fn(Status)>,
    right: Option<Side>,
    /// Sampler of the right side when it is shown next.
    right_sampler: Sampler,
    /// True if the number keys choose the sampler of the right side.
    chooses_right: bool,
    /// Guide of the last renderer of `guided`, for the next one.
    guide: Option<Vec<u8>>,
    rig: Rig,
    held: Vec3,
    motion: Motion,
    /// Factor between the whole film and that of a moving camera.
    shrinking: f32,
    /// Number of cameras so far, for the seeds.
    looks: u32,
    /// Seed of the settings, for the first film at rest: that shows what `render` writes.
    own_seed: Option<u32>,
    learned_at: Instant,
    adapted_at: Instant,
    /// Time that the last rebuild took; none is tried in motion before one at rest.
    learning_time: Option<Duration>,
    shows_inset: bool,
    /// True if files are to be written once the camera is at rest.
    saves_at_rest: bool,
    looked_at: Option<Instant>,
    mean_radiance: f32,
    error: Option<f64>,
    error_at: Instant,
    denoising: Denoising,
    /// Pixel of the window that was clicked, to focus on once the film shows it.
    clicked: Option<[f64; 2]>,
    /// Files of cameras that were written.
    views: Vec<PathBuf>,
    notice: String,
}

impl Worker {
    /// Shows `scene` in the window of `panel`; the `left` side was made before that was connected.
    pub(crate) fn new(
        scene: Scene,
        device: Arc<Device>,
        settings: Settings,
        spp: u32,
        left: Side,
        panel: Rc<RefCell<Panel>>,
        announce: Box<dyn Fn(Status)>,
    ) -> Self {
        let mut worker = Self {
            rig: Rig::new(scene.camera),
            views: views(&scene.name),
            right: None,
            right_sampler: Sampler::Mis,
            chooses_right: false,
            guide: None,
            held: Vec3::ZERO,
            motion: Motion::Rest,
            shrinking: if device.capabilities().is_software() { 8.0 } else { 2.0 },
            looks: 0,
            own_seed: Some(settings.seed),
            learned_at: Instant::now(),
            adapted_at: Instant::now(),
            learning_time: None,
            shows_inset: false,
            saves_at_rest: false,
            looked_at: None,
            mean_radiance: 0.0,
            error: None,
            error_at: Instant::now(),
            denoising: Denoising::default(),
            clicked: None,
            notice: String::new(),
            scene,
            device,
            settings,
            spp,
            left,
            panel,
            announce,
        };
        let watch = worker.watch();
        worker.left.session.renderer.set_watch(watch);
        worker
    }

    /// Attends to the window between the waves of a pass.
    fn watch(&self) -> Watch {
        let panel = Rc::clone(&self.panel);
        Box::new(move |_| {
            let mut panel = panel.borrow_mut();
            panel.attend() && !panel.is_moving
        })
    }

    /// Renders until the window is closed. Fails if the device does, if the display is lost, or if a file
    /// cannot be written.
    pub(crate) fn run(&mut self) -> Result<()> {
        self.tell();
        // A small film shows the scene at once; the whole one takes seconds on a software device.
        let shrinking = self.shrinking;
        self.start_moving()?;
        if self.left.sampler != self.settings.sampler {
            self.left = self.make_side(self.settings.sampler)?;
            // The time to compile the kernels of the window says nothing about the next film.
            self.shrinking = shrinking;
            self.start_moving()?;
        }
        let mut last = Instant::now();
        loop {
            self.panel.borrow_mut().attend();
            self.panel.borrow_mut().failure.take().map_or(Ok(()), Err)?;
            if std::mem::take(&mut self.panel.borrow_mut().is_changed) {
                self.tell();
            }
            let now = Instant::now();
            let step = (now - last).as_secs_f32().min(LONGEST_STEP);
            last = now;
            let mut moved = false;
            loop {
                let Some(input) = self.panel.borrow_mut().pending.pop_front() else { break };
                match input {
                    Input::Close | Input::Key(Action::Quit) => return Ok(()),
                    input => moved |= self.apply(input)?,
                }
            }
            self.focus()?;
            if self.held != Vec3::ZERO {
                self.rig.fly(self.held, step);
                moved = true;
            }
            if moved {
                self.start_moving()?;
            } else if let Motion::Moving(since) = self.motion {
                if since.elapsed() >= REST {
                    self.motion = Motion::Rest;
                    self.panel.borrow_mut().is_moving = false;
                    self.look(self.whole(), true)?;
                } else if !self.refine()? {
                    self.panel.borrow_mut().wait(REST / 4);
                }
            } else if self.is_stopped() {
                // Input stopped a pass that nothing has started again.
                self.look(self.whole(), true)?;
            } else if !self.refine()? {
                self.panel.borrow_mut().wait(Duration::from_secs(1));
                last = Instant::now();
            }
        }
    }

    /// Shows the scene through a camera that moves from now on.
    fn start_moving(&mut self) -> Result<()> {
        if self.motion == Motion::Rest {
            self.denoising.start_moving();
        }
        self.motion = Motion::Moving(Instant::now());
        self.panel.borrow_mut().is_moving = true;
        self.move_on()
    }

    fn sides(&mut self) -> impl Iterator<Item = &mut Side> {
        [Some(&mut self.left), self.right.as_mut()].into_iter().flatten()
    }

    fn is_stopped(&mut self) -> bool {
        self.sides().any(|side| side.session.renderer.is_stopped())
    }

    fn whole(&self) -> [u32; 2] {
        [self.scene.film.width, self.scene.film.height]
    }

    /// Starts all films again through the camera of now.
    fn look(&mut self, size: [u32; 2], learns: bool) -> Result<()> {
        self.looks = self.looks.wrapping_add(1);
        let [moved, ..] = hash_4d([self.settings.seed, self.looks, MOVED_SEED, 0]);
        let own = if self.motion == Motion::Rest { self.own_seed.take() } else { None };
        let seed = own.unwrap_or(moved);
        self.error = None;
        let camera = self.rig.camera;
        let start = Instant::now();
        for side in self.sides() {
            side.session.look(&camera, size, seed, learns)?;
        }
        if learns {
            self.learned_at = Instant::now();
            self.learning_time = Some(start.elapsed());
        }
        Ok(())
    }

    /// Shows the scene through a camera that has moved, on a film small enough to answer at once.
    fn move_on(&mut self) -> Result<()> {
        let start = Instant::now();
        let is_quick = self.learning_time.is_some_and(|time| time <= LEARNING_TIME);
        let learns = is_quick && self.learned_at.elapsed() >= LEARNING_INTERVAL;
        let shrinking = self.shrinking;
        let side = |side: u32| ((side as f32 / shrinking) as u32).clamp(LEAST_SIDE.min(side), side);
        let size = self.whole().map(side);
        self.look(size, learns)?;
        let before = Instant::now();
        for side in self.sides() {
            side.session.pass(1, f64::INFINITY)?;
        }
        if self.adapted_at.elapsed() >= ADAPT_INTERVAL {
            self.rig.adapt(self.left.points()?.into_iter().flatten());
            self.adapted_at = Instant::now();
        }
        self.show()?;
        let took = before.elapsed().as_secs_f32();
        let wanted = (took / MOVING_TIME.as_secs_f32()).sqrt().clamp(0.7, 2.0);
        self.shrinking = (self.shrinking * wanted).clamp(1.0, MOST_SHRINKING);
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let (all, looking) = (ms(start.elapsed()), ms(before - start));
        log::debug!("moving: {size:?} pixels in {all:.0} ms, {looking:.0} of them before the pass");
        Ok(())
    }

    /// Renders a pass of the side that had less time, and shows it. Returns false if all is done.
    fn refine(&mut self) -> Result<bool> {
        let spp = self.spp;
        let side = self
            .sides()
            .filter(|side| side.sample_count() < spp)
            .min_by(|a, b| a.session.seconds().total_cmp(&b.session.seconds()));
        let Some(side) = side else { return Ok(false) };
        let most = spp - side.sample_count();
        side.session.pass(most, f64::INFINITY)?;
        if !side.session.renderer.is_stopped() {
            self.show()?;
            if self.saves_at_rest && self.motion == Motion::Rest {
                self.saves_at_rest = false;
                self.save()?;
            }
        }
        Ok(true)
    }

    /// Takes over what the films show, and shows it.
    fn show(&mut self) -> Result<()> {
        let layer = self.panel.borrow().layer;
        let is_due = self.looked_at.is_none_or(|at| at.elapsed() >= LOOK_INTERVAL);
        if is_due && layer == SHOW_ERROR && self.left.sample_count() > 0 {
            let sums = self.left.session.renderer.sums()?;
            let mean = sums.means();
            let total: f64 = (0..sums.pixel_count()).map(|i| mean(i).iter().sum::<f64>()).sum();
            self.mean_radiance = (total / (3.0 * sums.pixel_count() as f64)) as f32;
            self.looked_at = Some(Instant::now());
        }
        if is_due && self.shows_inset && self.motion == Motion::Rest {
            self.draw_inset()?;
            self.looked_at = Some(Instant::now());
        }
        self.look_at_error()?;
        let mean = self.mean_radiance;
        let denoises = layer == SHOW_PICTURE && self.denoises();
        let mut panel = self.panel.borrow_mut();
        panel.has_right = self.right.is_some();
        for (side, place) in [(Some(&self.left), Place::Left), (self.right.as_ref(), Place::Right)]
        {
            // A film without a sample goes on showing what was there before.
            if let Some(side) = side.filter(|side| side.sample_count() > 0) {
                let has_ended = side.sample_count() >= self.spp;
                let denoised =
                    if denoises { self.denoising.filter(side, place, has_ended)? } else { None };
                match denoised {
                    Some(Filtered::Now(pixels)) => {
                        panel.projector.show(&side.session.renderer, place, SHOW_PICTURE, mean)?;
                        panel.projector.replace(place, &pixels)?;
                    }
                    Some(Filtered::Before) => {}
                    None => {
                        let layer = side.layer(layer);
                        panel.projector.show(&side.session.renderer, place, layer, mean)?;
                    }
                }
            }
        }
        panel.present()?;
        drop(panel);
        self.tell();
        Ok(())
    }

    /// Takes the error of the film at rest from its sums, from time to time and at its end.
    fn look_at_error(&mut self) -> Result<()> {
        let has_ended = self.left.sample_count() >= self.spp;
        let is_due = has_ended || self.error_at.elapsed() >= ERROR_INTERVAL;
        let is_shown = self.panel.borrow().projector.has_overlay();
        if is_due && is_shown && self.motion == Motion::Rest && self.left.sample_count() > 1 {
            self.error = Some(self.left.session.renderer.sums()?.relative_standard_error());
            self.error_at = Instant::now();
        }
        Ok(())
    }

    /// Tells title and controls what is shown.
    fn tell(&self) {
        (self.announce)(self.status(self.title()));
    }

    /// State of everything that the controls show.
    fn status(&self, title: String) -> Status {
        let samples = self.left.sample_count();
        let share = 1.0 / f64::from(samples.max(1));
        let times = &self.left.session.renderer.totals().gpu_ms;
        let mut pass_ms: Vec<(String, f64)> =
            times.iter().map(|(name, ms)| (name.clone(), ms * share)).collect();
        pass_ms.sort_by(|a, b| b.1.total_cmp(&a.1));
        pass_ms.truncate(TOLD_PASSES);
        let name = |path: &PathBuf| {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            stem.rsplit('.').next().unwrap_or_default().to_owned()
        };
        Status {
            title,
            sampler: if self.chooses_right { self.right_sampler } else { self.left.sampler },
            is_split: self.right.is_some(),
            depth: self.settings.depth,
            tone: self.panel.borrow().tone,
            denoise: self.denoising.choice,
            speed: self.rig.speed,
            camera: self.rig.camera,
            samples: [samples, self.spp],
            seconds: self.left.session.seconds(),
            error: self.error,
            pass_ms,
            views: self.views.iter().map(name).collect(),
            notice: self.notice.clone(),
        }
    }

    /// One line about what is shown.
    fn title(&self) -> String {
        let describe = |side: &Side| {
            let samples = side.sample_count();
            format!("{} {samples} spp {:.1} s", side.sampler.name(), side.session.seconds())
        };
        let mut title = format!("{} | {}", self.scene.name, describe(&self.left));
        if let Some(right) = &self.right {
            title += &format!(" | {}", describe(right));
        }
        let panel = self.panel.borrow();
        if panel.layer != SHOW_PICTURE {
            let name =
                LAYERS.iter().find(|(layer, ..)| *layer == panel.layer).map(|(_, name, _)| *name);
            title += &format!(" | {}", name.unwrap_or_default());
        }
        if self.motion != Motion::Rest {
            title += " | moving";
        }
        let Settings { depth, .. } = self.settings;
        title + &format!(" | depth {depth}, {:+.1} stops", panel.tone.exposure)
    }
}
