//! Progressive rendering of a scene on a device: scene → buffers → waves of paths → film sums.

mod arrival_buffers;
mod candidates;
mod film_buffers;
mod guide_buffers;
mod guide_room;
mod guided_pixel;
mod lobe_buffers;
mod pixel;
mod resume;
mod scene_buffers;
mod settings;
mod totals;
mod wave_buffers;

use std::{collections::BTreeMap, sync::Arc, time::Instant};

use crate::{
    error::Result,
    film::{Sums, Window},
    gpu::{Commands, Device, PassTimes},
    math::random::hash_4d,
    pass::{PassSettings, Passes, SHADOW_RAYS_PER_GROUP, Sets},
    sampler::{CacheScope, Elevation, Sampler},
    scene::Scene,
    shader::structs::Wave,
};
use candidates::Choice;
use film_buffers::FilmBuffers;
pub use guide_buffers::{GuideBuffers, GuideSize};
use guide_buffers::{SPLIT_AFTER, guide_schedule};
pub use guided_pixel::{CellLevel, GuidedRay, RecordedCell, RecordedGuide, RecordedRegion};
pub use lobe_buffers::LobeBuffers;
pub use pixel::{CachedDirection, RecordedLobe, RecordedPixel, RecordedRay};
pub use scene_buffers::SceneBuffers;
use settings::check;
pub use settings::{Settings, window_of};
pub use totals::Totals;
pub use wave_buffers::{LobeRoom, WaveBuffers};

/// Pixels of a block of the film order; waves hold whole blocks.
const BLOCK_PIXELS: u32 = 64;

/// Sweeps that teach the guide before the first sample, each over one pixel in as many.
const TRAINING_SWEEPS: u32 = 8;
/// Share of visible rays above which a scene is rendered as by `mis`: little is blocked, and learning
/// costs more than it brings.
const OPEN_SHARE: f64 = 0.5;
/// Tells the seeds of epochs from other hashes.
const EPOCH_TAG: u32 = 0x6b43_a9b5;
/// Tells the random numbers of training from those of the picture.
const TRAINING_SEED: u32 = 0x7e11_ab1e;

/// Dispatches are steered between these, milliseconds: short enough for the watchdog of a desktop
/// GPU, long enough for the submission not to count.
const SHORT_DISPATCH_MS: f64 = 50.0;
const LONG_DISPATCH_MS: f64 = 100.0;

/// A scene on a device, and the film it is rendered to.
pub struct Renderer {
    device: Arc<Device>,
    scene: Arc<SceneBuffers>,
    settings: Settings,
    window: Window,
    film_size: [u32; 2],
    passes: Passes,
    waves: WaveBuffers,
    film: FilmBuffers,
    /// What the sampler `guided` has learned.
    guide: Option<GuideBuffers>,
    /// Fits, for the samplers that use lobes.
    lobes: Option<LobeBuffers>,
    /// Paths of the next wave.
    wave_paths: u32,
    sample_count: u32,
    /// Whether the training sweeps are behind.
    is_trained: bool,
    /// Whether so little is blocked that there is nothing to learn.
    is_open: bool,
    /// Samples at the last rebuild of the guide.
    rebuilt_at: u32,
    /// From how many candidates the sampler `guided` chooses.
    choice: Choice,
    totals: Totals,
    compile_ms: PassTimes,
}

impl Renderer {
    /// Uploads `scene` and prepares to render it.
    ///
    /// # Errors
    /// A limit of the device, memory, or options out of range.
    pub fn new(device: &Arc<Device>, scene: &Scene, settings: Settings) -> Result<Self> {
        let window = window_of(&settings, scene);
        check(&settings, window, [scene.film.width, scene.film.height])?;
        let buffers = Arc::new(SceneBuffers::new(device, scene, window)?);
        Self::with_scene_buffers(device, buffers, scene, settings)
    }

    /// As [`Renderer::new`], sharing buffers that were made from the same scene and window.
    ///
    /// # Errors
    /// As [`Renderer::new`].
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
        let window = window_of(&settings, scene);
        check(&settings, window, film_size)?;
        assert_eq!(window, buffers.window(), "buffers belong to one window");

        let aovs = film_buffers::aov_bits(&settings.aovs);
        let uses_lobes = settings.sampler.uses_lobes();
        if uses_lobes && settings.parameters.lobes.elevation == Elevation::Metropolis {
            log::warn!("--set elevation=metropolis: a short random walk, so the image is biased");
        }
        let lobes = uses_lobes
            .then(|| LobeBuffers::new(device, scene, &settings.parameters.lobes))
            .transpose()?;
        let start = Instant::now();
        let passes = Passes::new(
            device,
            buffers.geometry(),
            PassSettings {
                sampler: settings.sampler,
                parameters: settings.parameters,
                shadow_rays: settings.shadow_rays,
                depth: settings.depth,
                aovs,
                roulette_vertex: settings.roulette_vertex,
                material_kinds: buffers.material_kinds(),
                fit_sizes: lobes.as_ref().map(LobeBuffers::sizes),
            },
        )?;
        let create_ms = start.elapsed().as_secs_f64() * 1e3;
        let film = FilmBuffers::new(device, window, aovs)?;
        let rays = settings.shadow_rays.clamp(1, SHADOW_RAYS_PER_GROUP);
        let waves =
            WaveBuffers::new(device, film.padded_pixels(), rays, lobe_room(&settings, window))?;
        let guide = (settings.sampler == Sampler::Guided)
            .then(|| {
                let size = GuideSize {
                    pixels: film.padded_pixels(),
                    paths: waves.capacity(),
                    shadow_rays: rays,
                    has_bounces: settings.parameters.guides_bounces(settings.depth),
                };
                GuideBuffers::new(device, scene, &settings.parameters, size)
            })
            .transpose()?;
        let mut renderer = Self {
            device: Arc::clone(device),
            scene: buffers,
            settings,
            window,
            film_size,
            passes,
            wave_paths: waves.first_wave_paths(),
            waves,
            film,
            guide,
            lobes,
            sample_count: 0,
            is_trained: false,
            is_open: false,
            rebuilt_at: 0,
            choice: Choice::default(),
            totals: Totals::default(),
            compile_ms: PassTimes::new(),
        };
        renderer.compile_ms = renderer.passes.warm_up(device, &renderer.sets())?;
        renderer.compile_ms.insert("pipelines".into(), create_ms);
        renderer.forget_choice()?;
        Ok(renderer)
    }

    fn sets(&self) -> Sets<'_> {
        Sets {
            scene: self.scene.set(),
            wave: self.waves.set(),
            film: self.film.set(),
            guide: self.guide.as_ref().filter(|_| !self.is_open).map(GuideBuffers::set),
            fits: self.lobes.as_ref().map(LobeBuffers::set),
        }
    }

    /// Adds `samples` samples to every pixel.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the device fails.
    pub fn render_pass(&mut self, samples: u32) -> Result<()> {
        let mut left = samples;
        while left > 0 {
            let mut together = (self.wave_paths / self.film.padded_pixels()).clamp(1, left);
            if self.guide.is_some() {
                together = together.min(self.learn()?);
            }
            if self.waves.keeps_caches() {
                // A sample learns from the samples before it.
                together = 1;
            }
            self.render_samples(together)?;
            left -= together;
        }
        Ok(())
    }

    /// Learns what is due before the next sample. Returns how many samples may follow before there
    /// is more to learn; that depends on their number alone, not on how they are grouped.
    fn learn(&mut self) -> Result<u32> {
        if self.is_open {
            return Ok(u32::MAX);
        }
        if !self.is_trained {
            for sweep in 0..TRAINING_SWEEPS {
                let wave = Wave {
                    first_pixel: sweep,
                    first_sample: self.settings.first_sample.wrapping_add(self.sample_count),
                    sample_count: 1,
                    seed: self.settings.seed ^ TRAINING_SEED,
                    pixel_stride: TRAINING_SWEEPS,
                    is_training: 1,
                    ..Wave::default()
                };
                let wave = with_epoch(wave, wave.first_sample);
                let before = self.totals.clone();
                self.sweep(wave, self.film.padded_pixels() / TRAINING_SWEEPS)?;
                self.take_counters()?;
                // The first sweep draws by environment and BRDF alone: nothing is known yet. It is
                // not in the picture, so the picture does not depend on its own samples here.
                let visible = self.totals.shadow_rays_visible - before.shadow_rays_visible;
                let traced = self.totals.shadow_rays_traced - before.shadow_rays_traced;
                if sweep == 0 && visible as f64 > OPEN_SHARE * traced as f64 {
                    log::info!("{visible} of {traced} rays of the first sweep are visible: as mis");
                    self.is_open = true;
                    return Ok(u32::MAX);
                }
                // Every rebuild costs time: after 1, 2, 4 and 8 sweeps.
                if (sweep + 1).is_power_of_two() {
                    self.rebuild(sweep + 1 == TRAINING_SWEEPS)?;
                }
            }
            self.is_trained = true;
        } else if self.rebuilt_at != self.sample_count
            && guide_schedule(self.sample_count) == self.sample_count
        {
            self.rebuild(self.sample_count == SPLIT_AFTER)?;
        }
        if self.choice.candidates.is_none() {
            self.choose_candidates()?;
        }
        Ok(guide_schedule(self.sample_count + 1) - self.sample_count)
    }

    fn rebuild(&mut self, splits: bool) -> Result<()> {
        self.rebuilt_at = self.sample_count;
        self.guide.as_mut().map_or(Ok(()), |guide| guide.rebuild(splits))
    }

    /// One sweep over the film with `samples` samples per pixel.
    fn render_samples(&mut self, samples: u32) -> Result<()> {
        let wave = Wave {
            first_sample: self.settings.first_sample.wrapping_add(self.sample_count),
            sample_count: samples,
            seed: self.settings.seed,
            pixel_stride: 1,
            ..Wave::default()
        };
        let epoch = self.settings.first_sample.wrapping_add(self.rebuilt_at);
        self.sweep(with_epoch(wave, epoch), self.film.padded_pixels())?;
        self.sample_count += samples;
        self.take_counters()
    }

    /// Waves like `wave` until `pixels` are done, the first of them at the first pixel of `wave`.
    fn sweep(&mut self, wave: Wave, pixels: u32) -> Result<()> {
        let mut done = 0;
        while done < pixels {
            let together =
                (self.wave_paths / wave.sample_count / BLOCK_PIXELS).max(1) * BLOCK_PIXELS;
            let wave = Wave {
                first_pixel: wave.first_pixel + done * wave.pixel_stride,
                pixel_count: together.min(pixels - done),
                ..wave
            };
            let mut commands =
                Commands::begin_timed(&self.device, self.passes.dispatches_per_wave())?;
            self.passes.record(&mut commands, &self.sets(), wave);
            let times = commands.submit_and_wait()?;
            self.steer(&times, wave);
            for (pass, ms) in times {
                *self.totals.gpu_ms.entry(pass).or_default() += ms;
            }
            done += wave.pixel_count;
        }
        Ok(())
    }

    /// Adds what the device counted to the totals.
    fn take_counters(&mut self) -> Result<()> {
        self.totals.add(&self.film.take_counters()?);
        Ok(())
    }

    /// Sizes the next wave so that its longest pass stays between the two bounds. Times are per
    /// pass name, summed over the vertices and groups of the wave, so this errs on the short side.
    fn steer(&mut self, times: &PassTimes, wave: Wave) {
        let longest = times.values().copied().fold(0.0, f64::max);
        let paths = wave.pixel_count * wave.sample_count;
        if longest > LONG_DISPATCH_MS {
            let shrink = 0.75 * LONG_DISPATCH_MS / longest;
            self.wave_paths = ((f64::from(paths) * shrink) as u32).max(BLOCK_PIXELS);
        } else if longest < SHORT_DISPATCH_MS && paths >= self.wave_paths / 2 {
            self.wave_paths = self.wave_paths.saturating_mul(2).min(self.waves.capacity());
        }
    }

    /// Empties the film to render the same settings with another seed, from nothing: a sampler that
    /// learns forgets, and `candidates=auto` is measured anew, since every run has to pay for it.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the device fails.
    pub fn restart(&mut self, seed: u32) -> Result<()> {
        self.film.clear(&self.device)?;
        self.waves.clear_caches(&self.device)?;
        if let Some(guide) = &mut self.guide {
            guide.forget()?;
        }
        self.is_trained = false;
        self.is_open = false;
        self.rebuilt_at = 0;
        self.settings.seed = seed;
        self.sample_count = 0;
        self.totals = Totals::default();
        self.forget_choice()
    }

    /// Samples per pixel in the film.
    pub fn sample_count(&self) -> u32 {
        self.sample_count
    }

    /// What has been done so far.
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Milliseconds that the first use of each pass took, and the creation of all as `pipelines`.
    pub fn compile_ms(&self) -> &PassTimes {
        &self.compile_ms
    }

    /// Host milliseconds by stage of the preparation, and of all rebuilds of the guide.
    pub fn host_ms(&self) -> BTreeMap<String, f64> {
        let mut host_ms = self.scene.host_ms().clone();
        if let Some(guide) = &self.guide {
            host_ms.insert("guide rebuilds".to_owned(), guide.rebuild_ms());
            host_ms.insert("choice of candidates".to_owned(), self.choice.ms);
        }
        if let Some(lobes) = &self.lobes {
            host_ms.insert("fits".to_owned(), lobes.fit_ms());
        }
        host_ms
    }

    /// Hashes of the fits by what was fitted; empty for samplers that use none.
    pub fn fit_hashes(&self) -> BTreeMap<String, String> {
        self.lobes.as_ref().map(|lobes| lobes.hashes().clone()).unwrap_or_default()
    }

    /// Device memory by buffer, bytes.
    pub fn buffer_bytes(&self) -> BTreeMap<String, u64> {
        let mut bytes = self.scene.buffer_bytes();
        bytes.extend(self.waves.buffer_bytes());
        bytes.extend(self.film.buffer_bytes());
        bytes.extend(self.lobes.iter().flat_map(LobeBuffers::buffer_bytes));
        bytes.extend(self.guide.iter().flat_map(GuideBuffers::buffer_bytes));
        bytes
    }

    /// Reads the film.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the device fails.
    pub fn sums(&self) -> Result<Sums> {
        let mut sums = self.film.download()?;
        sums.film_size = self.film_size;
        sums.sample_count = self.sample_count;
        Ok(sums)
    }
}

/// `wave` with numbers of its own for the epoch that begins at `sample`: those of the sampler `guided`
/// start anew after every rebuild.
fn with_epoch(wave: Wave, sample: u32) -> Wave {
    let [epoch_seed, ..] = hash_4d([wave.seed, sample, EPOCH_TAG, wave.is_training]);
    Wave { epoch_seed, epoch_start: sample, ..wave }
}

/// What product sampling with `settings` needs room for.
fn lobe_room(settings: &Settings, window: Window) -> Option<LobeRoom> {
    let parameters = &settings.parameters.lobes;
    let with_cache = settings.sampler == Sampler::Visibility;
    settings.sampler.uses_lobes().then(|| LobeRoom {
        kept_lobes: parameters.kept_lobes,
        cache_capacity: if with_cache { parameters.cache_places(settings.shadow_rays) } else { 0 },
        film_pixels: (with_cache && parameters.cache == CacheScope::Pixel)
            .then(|| u64::from(window.width) * u64::from(window.height)),
    })
}
