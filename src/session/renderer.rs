//! Progressive rendering of a scene on a device.

use std::{any::Any, collections::BTreeMap, io::Write, path::Path, sync::Arc};

use super::{Settings, traced_window, window_of};
use crate::{
    error::{Error, Result},
    files::{self, write_atomically},
    film::{Aov, Sums, reconstruction::shared_offset, sums::Ahead},
    gpu::Device,
    pass::{
        PassSettings, Progress, Report, Runner, Saved, SceneBuffers, Schedule, Technique, Totals,
        Watch,
        film_buffers::{BLOCK_PIXELS, aov_bits, check_memory},
        wave_buffers::most_paths,
    },
    sampler::Context,
    scene::{Camera, Scene, light_group::LightGroups},
    shader::{constants::MOST_LIGHT_GROUPS, structs::Wave},
};

/// Fewest paths in flight to try where memory does not suffice for more.
const FEWEST_PATHS: u32 = 1 << 9;
/// Factor between two tries.
const PATHS_STEP: u32 = 1 << 4;

/// Number of groups of lights that the settings ask for.
fn light_group_count(settings: &Settings, groups: &LightGroups) -> Result<u32> {
    if !settings.aovs.contains(&Aov::LightGroups) {
        return Ok(0);
    }
    let names = &groups.names;
    let count = u32::try_from(names.len()).unwrap_or(u32::MAX);
    if count > MOST_LIGHT_GROUPS {
        return Err(Error::usage(format!(
            "--aov light-groups: expected at most {MOST_LIGHT_GROUPS} groups, found {count}: {}; give \
             lamps and objects the same light_group",
            names.join(", ")
        )));
    }
    Ok(count)
}

/// A scene on a device, and the film it is rendered to.
pub struct Renderer {
    pub(crate) runner: Runner,
    pub(super) technique: Box<dyn Technique>,
    pub(super) settings: Settings,
    /// Width and height of the film in use, pixels.
    pub(crate) film_size: [u32; 2],
    pub(super) sample_count: u32,
    /// Sweep that was stopped on its way.
    pub(super) ahead: Ahead,
}

impl Renderer {
    /// Uploads `scene` and prepares to render it. Fails if an option is out of range, memory runs
    /// out or a limit of the device is exceeded.
    pub fn new(device: &Arc<Device>, scene: &Scene, settings: Settings) -> Result<Self> {
        settings.check([scene.film.width, scene.film.height])?;
        // Before the work on buffers.
        light_group_count(&settings, &LightGroups::new(scene))?;
        let window = traced_window(&settings, scene);
        let buffers = Arc::new(SceneBuffers::new(device, scene, window)?);
        Self::with_scene_buffers(device, buffers, scene, settings)
    }

    /// As [`Renderer::new`], sharing buffers of the same scene and [`traced_window`]. With those of the
    /// window alone, the filter of its outermost pixels ends there.
    ///
    /// # Panics
    /// If the buffers were made for another window.
    pub fn with_scene_buffers(
        device: &Arc<Device>,
        buffers: Arc<SceneBuffers>,
        scene: &Scene,
        settings: Settings,
    ) -> Result<Self> {
        let film_size = [scene.film.width, scene.film.height];
        settings.check(film_size)?;
        let window = window_of(&settings, scene);
        assert!(
            [window, traced_window(&settings, scene)].contains(&buffers.window),
            "buffers belong to one window"
        );

        let surfaces = buffers.surfaces;
        let shares = settings.depth > 1 && surfaces.can_share();
        let cohort_edge = settings.sampler.cohort_edge(&settings.parameters);
        let cohort_edge = if shares { cohort_edge } else { 1 };
        let passes = PassSettings {
            shadow_rays: settings.shadow_rays,
            depth: settings.depth,
            aovs: aov_bits(&settings.aovs),
            light_groups: light_group_count(&settings, &buffers.light_groups)?,
            roulette: settings.roulette,
            path_lists: settings.path_lists,
            cohort_edge,
            surfaces,
            traversal: buffers.geometry.traversal,
            incoherent: Schedule::incoherent(device.capabilities()),
            film_page_bytes: settings.film_page_bytes,
            most_paths: most_paths(device.capabilities()),
        };
        check_memory(device, buffers.window, passes.aovs, passes.light_groups)?;
        let demand = settings.sampler.room().demand(&settings.parameters, settings.shadow_rays);
        let attempt = |most_paths| -> Result<_> {
            let passes = PassSettings { most_paths, ..passes };
            let mut runner = Runner::new(device, Arc::clone(&buffers), passes, demand)?;
            runner.film.kept = window;
            let context = Context { scene, parameters: &settings.parameters, runner: &runner };
            let technique = settings.sampler.room().create(context)?;
            runner.warm_up(technique.as_ref())?;
            // Room for what comes back from a device with memory of its own.
            runner.take_counters()?;
            Ok((runner, technique))
        };
        let mut most_paths = passes.most_paths;
        let (runner, technique) = loop {
            match attempt(most_paths) {
                Err(Error::Memory { message, .. }) if most_paths > FEWEST_PATHS => {
                    most_paths /= PATHS_STEP;
                    log::warn!("{message}; trying with {most_paths} paths at a time");
                }
                result => break result?,
            }
        };
        let ahead = Ahead::default();
        Ok(Self { runner, technique, settings, film_size, sample_count: 0, ahead })
    }

    pub(super) fn progress(&self) -> Progress {
        Progress {
            first_sample: self.settings.first_sample,
            sample_count: self.sample_count,
            seed: self.settings.seed,
        }
    }

    /// Adds `samples` samples to every pixel, the rest of a stopped sweep first. A crop window that needs
    /// samples around it ends its sweep: it does not keep those. Fails if the device does.
    pub fn render_pass(&mut self, samples: u32) -> Result<()> {
        self.sweep(samples)?;
        self.runner.take_counters()
    }

    fn sweep(&mut self, samples: u32) -> Result<()> {
        let mut left = samples;
        while left > 0 {
            let progress = self.progress();
            let together = self.runner.samples_per_wave().clamp(1, left);
            let together = together.min(self.technique.learn(&mut self.runner, &progress)?);
            if self.runner.is_stopped {
                return Ok(());
            }
            let before = std::mem::take(&mut self.ahead);
            let together = if before.is_none() { together } else { 1 };
            let wave = Wave {
                first_pixel: before.blocks * BLOCK_PIXELS,
                first_sample: progress.next_sample(),
                sample_count: together,
                seed: progress.seed,
                pixel_stride: 1,
                ..Wave::default()
            };
            let wave = self.technique.complete(wave, &progress);
            let pixels = self.runner.film.padded_pixels() - wave.first_pixel;
            let done = self.runner.sweep(self.technique.as_ref(), wave, pixels)?;
            if done < pixels {
                let blocks = before.blocks + done / BLOCK_PIXELS;
                let offset =
                    shared_offset(self.runner.scene.filter(), wave.first_sample, wave.seed);
                self.ahead = Ahead { blocks, offset };
            } else {
                self.sample_count += together;
                left = left.saturating_sub(together);
            }
            if self.runner.is_stopped {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Empties the film to render with another seed. The technique forgets what it learned: every
    /// run pays for its own learning. Fails if the device does.
    pub fn restart(&mut self, seed: u32) -> Result<()> {
        self.runner.restart()?;
        self.technique.restart(&mut self.runner)?;
        self.settings.seed = seed;
        self.sample_count = 0;
        self.ahead = Ahead::default();
        Ok(())
    }

    /// Continues from the sums of an earlier renderer with the same settings.
    ///
    /// # Errors
    /// [`Error::Usage`] if window or layers differ, or if the next sample depends on more than the
    /// sums; [`Error::Vulkan`] if the device fails.
    pub fn restore(&mut self, sums: &Sums) -> Result<()> {
        let most_samples = sums.sample_count.saturating_add(u32::from(!sums.ahead.is_none()));
        self.technique.check_resume(most_samples, &self.progress())?;
        let window = self.runner.film.kept;
        if sums.film_size != self.film_size
            || sums.origin != [window.x, window.y]
            || [sums.width, sums.height] != [window.width, window.height]
        {
            return Err(Error::usage(format!(
                "the checkpoint holds pixels {}x{} from {:?} of a film of {:?}, expected {}x{} from \
                 {:?} of {:?}",
                sums.width,
                sums.height,
                sums.origin,
                sums.film_size,
                window.width,
                window.height,
                [window.x, window.y],
                self.film_size
            )));
        }
        self.runner.film.upload(sums)?;
        self.sample_count = sums.sample_count;
        self.ahead = sums.ahead;
        Ok(())
    }

    /// Calls `work` with technique, runner and progress if the technique is a `T`.
    pub fn with_technique<T: Technique, R>(
        &mut self,
        work: impl FnOnce(&mut T, &mut Runner, &Progress) -> R,
    ) -> Option<R> {
        let progress = self.progress();
        let technique = (self.technique.as_mut() as &mut dyn Any).downcast_mut()?;
        Some(work(technique, &mut self.runner, &progress))
    }

    /// Settings of the render; its seed is that of the film.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Further samples of some pixels, where a sweep was stopped.
    pub fn ahead(&self) -> Ahead {
        self.ahead
    }

    /// Samples of every pixel in the film.
    pub fn sample_count(&self) -> u32 {
        self.sample_count
    }

    /// Names what traces: "device", or "Embree" with its version.
    pub fn tracer(&self) -> String {
        self.runner.tracer()
    }

    /// Counts and device times so far.
    pub fn totals(&self) -> &Totals {
        &self.runner.totals
    }

    /// Figures of the technique.
    pub fn report(&self) -> Report {
        self.technique.report()
    }

    /// Host milliseconds by stage, including those of the technique.
    pub fn host_ms(&self) -> BTreeMap<String, f64> {
        let mut host_ms = self.runner.scene.host_ms.clone();
        host_ms.extend(self.report().host_ms);
        host_ms
    }

    /// Device memory by buffer, bytes.
    pub fn buffer_bytes(&self) -> BTreeMap<String, u64> {
        let mut bytes = self.runner.buffer_bytes();
        bytes.extend(self.technique.set().iter().flat_map(|set| set.buffer_bytes()));
        bytes
    }

    /// Reads the film. Fails if the device does.
    pub fn sums(&self) -> Result<Sums> {
        let mut sums = self.runner.film.download()?;
        if !self.ahead.is_none() {
            self.runner.film.download_radiance(&mut sums)?;
            sums.ahead = self.ahead;
            sums.clear_behind();
        }
        let (film_size, sample_count, ahead) = (self.film_size, self.sample_count, self.ahead);
        Ok(Sums { film_size, sample_count, ahead, ..sums })
    }

    /// Empties the film to render through another camera, on a film of `size` pixels: the one that the
    /// renderer was made for, or a smaller one. `seed` must be new: what was learned stays, and numbers
    /// that it was learned from must not meet it again. What was counted since the last rebuild is used
    /// at once if `learns`, which takes time, else later. Fails if the device does.
    ///
    /// # Panics
    /// If the renderer has a crop window, or the film is larger than that.
    pub fn look(&mut self, camera: &Camera, size: [u32; 2], seed: u32, learns: bool) -> Result<()> {
        assert!(self.settings.window.is_none(), "a camera moves with the whole film");
        self.runner.look(camera, size)?;
        self.technique.look(&mut self.runner, learns)?;
        self.settings.seed = seed;
        self.film_size = size;
        self.sample_count = 0;
        self.ahead = Ahead::default();
        Ok(())
    }

    /// Calls `watch` after waves from now on. Where it returns true, [`Renderer::render_pass`] returns
    /// early, and some pixels may have more samples than others.
    pub fn set_watch(&mut self, watch: Watch) {
        self.runner.set_watch(watch);
    }

    /// True if the watch has stopped a pass since [`Renderer::look`].
    pub fn is_stopped(&self) -> bool {
        self.runner.is_stopped
    }

    /// Returns what the sampler has learned, as the content of a file; `None` for samplers that learn
    /// nothing. Fails if the device does.
    pub fn guide(&self) -> Result<Option<Vec<u8>>> {
        self.technique.save(self.sample_count)
    }

    /// Continues from what an earlier renderer learned, as [`Technique::load`].
    pub fn take_guide(&mut self, saved: Saved<'_>) -> Result<bool> {
        let progress = self.progress();
        self.technique.load(&mut self.runner, &progress, saved)
    }

    /// Starts from the guide of an earlier render, such as another frame of an animation. Warns if it was
    /// learned in another geometry.
    ///
    /// # Errors
    /// A file that cannot be read or belongs to another environment; a failing device.
    pub fn load_guide(&mut self, path: &Path) -> Result<()> {
        let bytes = files::read(path)?;
        if self.take_guide(Saved { path, bytes: &bytes, continues: false })? {
            let path = path.display();
            log::warn!("{path} was learned in another geometry: most of it counts no more");
        }
        Ok(())
    }

    /// Writes the guide, if the sampler learns one.
    ///
    /// # Errors
    /// A failing device or disk.
    pub fn save_guide(&self, path: &Path) -> Result<()> {
        let write = |bytes: Vec<u8>| write_atomically(path, |file| file.write_all(&bytes));
        self.guide()?.map_or(Ok(()), write)
    }
}
