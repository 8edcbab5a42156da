//! Runs waves of paths over the film: records their passes, times them, and sizes the next wave.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque, btree_map::Entry},
    iter,
    ops::Range,
    sync::Arc,
    time::Instant,
};

use rayon::prelude::*;

use super::{
    compilers::{COMPILATION, Compilers},
    film_buffers::{BLOCK_PIXELS, FilmBuffers, padded_pixels},
    kernel::{Dispatch, Domain, Kernel, Pass},
    order::{FEATURES, PassSettings, PathLists, wave_order},
    recording::{Recording, add_times},
    scene_buffers::SceneBuffers,
    sharing::{sharing_demand, sharing_set},
    steps::{Passes, PathDemand, SHADOW_RAYS_PER_GROUP, Steps},
    totals::Totals,
    wave_buffers::WaveBuffers,
};
use crate::{
    error::Result,
    gpu::{Commands, DescriptorSet, Device, MOST_INVOCATIONS, PassTimes},
    scene::Camera,
    shader::{spirv, structs::Wave},
};

/// Target range of a dispatch, milliseconds: safe from a desktop GPU's watchdog, yet long against
/// the cost of a submission.
const SHORT_DISPATCH_MS: f64 = 50.0;
const LONG_DISPATCH_MS: f64 = 100.0;

/// Paths of the first wave, before any timing is known.
const FIRST_PATHS: u32 = 1 << 14;
/// Share of living paths, of all at later vertices, below which the passes there walk lists of them.
const MOST_LIVING: f64 = 0.4;

/// Called after every wave of a sweep; true stops the sweep.
pub(crate) type Watch = Box<dyn FnMut(&Wave) -> bool>;

/// A scene, a film and the paths in flight on a device. Knows no sampler.
pub struct Runner {
    pub(crate) device: Arc<Device>,
    pub(crate) scene: Arc<SceneBuffers>,
    pub(crate) waves: WaveBuffers,
    sharing: Option<DescriptorSet>,
    pub(crate) film: FilmBuffers,
    pub(crate) settings: PassSettings,
    passes: BTreeMap<Kernel, Pass>,
    /// Shadow rays per hit that fit the buffers.
    most_shadow_rays: u32,
    wave_paths: u32,
    /// Counts and device times so far.
    pub(crate) totals: Totals,
    /// Most that a counter of the device can hold since they were read.
    uncounted: u64,
    /// Milliseconds that the first use of each pass took, and the creation of all as `pipelines`.
    pub(crate) compile_ms: PassTimes,
    watch: Option<Watch>,
    /// True if the watch has stopped a sweep since it was set, or since [`Runner::look`].
    pub(crate) is_stopped: bool,
}

impl Runner {
    /// Allocates the film of `scene` and waves over it. Fails if the device does or its limits are exceeded.
    pub(crate) fn new(
        device: &Arc<Device>,
        scene: Arc<SceneBuffers>,
        settings: PassSettings,
        demand: PathDemand,
    ) -> Result<Self> {
        let window = scene.window;
        let padded_pixels = padded_pixels(window);
        let cohort_pixels = settings.cohort_edge * settings.cohort_edge;
        let rays = settings.shadow_rays.max(cohort_pixels).clamp(1, SHADOW_RAYS_PER_GROUP);
        let demand = sharing_demand(demand, cohort_pixels);
        let has_features = settings.aovs & FEATURES != 0;
        let waves = WaveBuffers::new(
            device,
            padded_pixels,
            settings.most_paths,
            rays,
            PathDemand { has_features, light_groups: settings.light_groups, ..demand },
            settings.surfaces,
        )?;
        let film = FilmBuffers::new(
            device,
            window,
            settings.aovs,
            &scene.light_groups.names[..settings.light_groups as usize],
            settings.film_page_bytes,
            (waves.capacity / padded_pixels).max(1),
        )?;
        let sharing = (cohort_pixels > 1)
            .then(|| sharing_set(device, waves.capacity, cohort_pixels))
            .transpose()?;
        Ok(Self {
            device: Arc::clone(device),
            scene,
            wave_paths: FIRST_PATHS.min(waves.capacity),
            waves,
            sharing,
            film,
            most_shadow_rays: settings.shadow_rays,
            settings,
            passes: BTreeMap::new(),
            totals: Totals::default(),
            uncounted: 0,
            compile_ms: PassTimes::new(),
            watch: None,
            is_stopped: false,
        })
    }

    /// Calls `watch` after the waves of all sweeps from now on.
    pub(crate) fn set_watch(&mut self, watch: Watch) {
        self.watch = Some(watch);
        self.is_stopped = false;
    }

    /// Empties the film for another camera and film size. Fails if the device does.
    pub(crate) fn look(&mut self, camera: &Camera, size: [u32; 2]) -> Result<()> {
        self.scene.look(camera, size)?;
        self.film.reshape(size);
        self.is_stopped = false;
        self.restart()
    }

    /// Compiles every pass that `technique` may use and runs it once over nothing, so that drivers
    /// that compile lazily compile now. Fails if the device does.
    pub(crate) fn warm_up(&mut self, technique: &dyn Passes) -> Result<()> {
        let others = technique.other_steps();
        let all = [technique.steps()].into_iter().chain(others.iter().map(Box::as_ref));
        let order = |steps| wave_order(&self.settings, steps, Wave::default(), self.settings.depth);
        let mut missing: Vec<Dispatch> = all.flat_map(|steps| order(steps).all()).collect();
        missing.push(Dispatch { kernel: self.accumulation(), wave: Wave::default() });
        let mut found = BTreeSet::new();
        missing.retain(|Dispatch { kernel, .. }| {
            !self.passes.contains_key(kernel) && found.insert(kernel.clone())
        });
        // After the first, which shows whether kernels are cached, long shaders come first and last:
        // processes that compile from both ends meet at a short one.
        let mut others = missing.split_off(missing.len().min(1));
        others.sort_by_key(|dispatch| spirv::pass(dispatch.kernel.shader).len());
        let mut order = VecDeque::new();
        for dispatch in others {
            if order.len().is_multiple_of(2) {
                order.push_front(dispatch);
            } else {
                order.push_back(dispatch);
            }
        }
        missing.extend(order);
        let start = Instant::now();
        let pass = |dispatch: &Dispatch| Pass::new(&self.device, dispatch.kernel.clone());
        let passes = missing.par_iter().with_max_len(1).map(pass).collect::<Result<Vec<_>>>()?;
        self.add_compile_ms("pipelines", start);
        let mut compilers = None;
        for (number, (Dispatch { kernel, wave }, pass)) in missing.iter().zip(passes).enumerate() {
            let start = Instant::now();
            let mut commands = Commands::begin(&self.device)?;
            let film = self.film.set(0);
            let sets = sets(&self.scene, technique, &self.waves, &self.sharing, film);
            pass.record(&mut commands, &sets, wave, None)?;
            commands.submit_and_wait()?;
            self.add_compile_ms(kernel.shader, start);
            self.passes.insert(kernel.clone(), pass);
            if start.elapsed() > COMPILATION && compilers.is_none() {
                let later = missing[number + 1..].iter().map(|dispatch| &dispatch.kernel);
                compilers = Some(Compilers::start(&self.device, later));
            }
        }
        Ok(())
    }

    fn add_compile_ms(&mut self, name: &str, start: Instant) {
        let ms = start.elapsed().as_secs_f64() * 1e3;
        *self.compile_ms.entry(name.to_owned()).or_default() += ms;
    }

    /// Runs waves like `wave` over `pixels` pixels, starting at its first, and takes the counters
    /// before they overflow. Once all pixels of the film have their samples, adds these to its sums. Returns
    /// the pixels done, all unless the watch stops it, for which it waits if they have several samples or are
    /// those of a window whose sums cannot go on. Fails if the device does.
    pub(crate) fn sweep(&mut self, technique: &dyn Passes, wave: Wave, pixels: u32) -> Result<u32> {
        let mut done = 0;
        while done < pixels {
            let together =
                (self.wave_paths / wave.sample_count / BLOCK_PIXELS).max(1) * BLOCK_PIXELS;
            let first_pixel = wave.first_pixel + done * wave.pixel_stride;
            // Training leaves the film alone, and its pixels lie in all pages.
            let of_page = match wave.is_training {
                0 => self.film.left_in_page(first_pixel),
                _ => pixels,
            };
            let pixel_count = together.min(pixels - done).min(of_page);
            let wave = Wave { first_pixel, pixel_count, ..wave };
            done += wave.pixel_count;
            // The last wave of a picture's sweep ends with its samples in the sums.
            let ends_sweep = done == pixels && wave.is_training == 0;
            let times = self.run(technique, wave, self.settings.depth, ends_sweep)?;
            self.steer(&times, wave);
            if self.watch.as_mut().is_some_and(|watch| watch(&wave)) {
                self.is_stopped = true;
                let can_go_on = wave.sample_count == 1 && self.film.is_whole();
                if wave.is_training != 0 || can_go_on {
                    break;
                }
            }
        }
        Ok(done)
    }

    /// Records the pass that adds the samples of a sweep like `wave` to the sums of the film, page by page.
    fn record_accumulation(
        &self,
        recording: &mut Recording<'_>,
        technique: &dyn Passes,
        wave: Wave,
    ) -> Result<()> {
        let pass = &self.passes[&self.accumulation()];
        self.film.copy_edges(&mut recording.commands, wave.sample_count);
        for Range { start: first_pixel, end } in self.accumulated() {
            let film_start = self.film.first_pixel(first_pixel);
            let film = self.film.set(first_pixel);
            let sets = sets(&self.scene, technique, &self.waves, &self.sharing, film);
            let pixel_count = end - first_pixel;
            recording.add(pass, &sets, &Wave { first_pixel, pixel_count, film_start, ..wave })?;
        }
        Ok(())
    }

    /// Positions in film order of each of these passes: all in one page, and as many as a dispatch may have.
    fn accumulated(&self) -> impl Iterator<Item = Range<u32>> {
        let all = self.film.padded_pixels();
        let after = move |start: u32| {
            let most = self.film.left_in_page(start).min(MOST_INVOCATIONS);
            (start < all).then(|| start..all.min(start + most))
        };
        iter::successors(after(0), move |before| after(before.end))
    }

    /// The pass that adds the samples of a sweep to the film.
    fn accumulation(&self) -> Kernel {
        Kernel::new("accumulate", Domain::Pixels, &[]).with_light_groups(self.settings.light_groups)
    }

    /// Most that one path adds to a counter: rays to environment and lamps at vertices, and to its cohort.
    fn counts_per_path(&self, steps: &dyn Steps) -> u64 {
        let PassSettings { shadow_rays, depth, cohort_edge, .. } = self.settings;
        let at_vertex = (2 * shadow_rays).max(steps.counts());
        u64::from(at_vertex) * u64::from(depth) + u64::from(cohort_edge * cohort_edge)
    }

    /// Runs one wave for `vertices` vertices; returns device ms by pass. All pixels lie in one page of
    /// the film, unless the wave is for training. After the last wave of a sweep, `accumulates` its
    /// samples. Fails if the device does.
    pub(crate) fn run(
        &mut self,
        technique: &dyn Passes,
        wave: Wave,
        vertices: u32,
        accumulates: bool,
    ) -> Result<PassTimes> {
        let paths = u64::from(wave.pixel_count * wave.sample_count);
        let counts = paths * self.counts_per_path(technique.steps());
        if self.uncounted + counts > u64::from(u32::MAX) {
            self.take_counters()?;
        }
        self.uncounted += counts;
        let film_start = self.film.first_pixel(wave.first_pixel);
        let wave = Wave { film_start, ..wave };
        let settings = PassSettings { path_lists: self.path_lists(), ..self.settings };
        let order = wave_order(&settings, technique.steps(), wave, vertices);
        let host = self.scene.geometry.host_tracer.as_ref();
        let pages = if accumulates { self.accumulated().count() } else { 0 };
        let accumulation = self.accumulation();
        made(&mut self.passes, &self.device, accumulation)?;
        let of_vertices = order.vertices.len();
        let dispatches = order.all();
        // Drivers make and reset all queries of a submission.
        let asks = |dispatch: &Dispatch| host.is_some() && dispatch.kernel.question.is_some();
        let between_questions = dispatches.split(asks).map(|passes| passes.len() + 1).max();
        let most_passes = (between_questions.unwrap_or(0) + pages) as u32;
        let ends = self.settings.path_lists != PathLists::Never;
        let mut recording = Recording::begin(&self.device, most_passes, host, ends)?;
        let film = self.film.set(wave.first_pixel);
        let sets = sets(&self.scene, technique, &self.waves, &self.sharing, film);
        let mut lives = true;
        for (place, Dispatch { kernel, wave }) in dispatches.into_iter().enumerate() {
            if !lives && place < of_vertices {
                continue;
            }
            let pass = made(&mut self.passes, &self.device, kernel)?;
            lives &= recording.add(pass, &sets, &wave)?;
            self.totals.passes += u64::from(lives || place >= of_vertices);
        }
        if accumulates {
            self.record_accumulation(&mut recording, technique, wave)?;
        }
        let times = recording.finish()?;
        add_times(&mut self.totals.gpu_ms, &times);
        Ok(times)
    }

    /// Decides by the paths so far.
    fn path_lists(&self) -> PathLists {
        let asked = self.settings.path_lists;
        let ends_early = self.totals.living_share(self.settings.depth) < MOST_LIVING;
        if asked == PathLists::WherePathsEnd && !ends_early { PathLists::Never } else { asked }
    }

    /// Sizes the next wave so that its longest pass stays within the target range. Times are sums
    /// by pass name over the vertices and groups of the wave, so this errs on the short side.
    fn steer(&mut self, times: &PassTimes, wave: Wave) {
        let longest = times.values().copied().fold(0.0, f64::max);
        let paths = wave.pixel_count * wave.sample_count;
        if longest > LONG_DISPATCH_MS {
            let shrink = 0.75 * LONG_DISPATCH_MS / longest;
            self.wave_paths = ((f64::from(paths) * shrink) as u32).max(BLOCK_PIXELS);
        } else if longest < SHORT_DISPATCH_MS && paths >= self.wave_paths / 2 {
            self.wave_paths = self.wave_paths.saturating_mul(2).min(self.waves.capacity);
        }
    }

    /// Number of samples of all pixels that fit into the next wave.
    pub(crate) fn samples_per_wave(&self) -> u32 {
        (self.wave_paths / self.film.padded_pixels()).min(self.film.sweep_samples())
    }

    /// Sets the number of shadow rays per hit. Panics if there are more than the buffers can hold.
    pub(crate) fn limit_shadow_rays(&mut self, shadow_rays: u32) {
        assert!(shadow_rays <= self.most_shadow_rays, "buffers have room for {shadow_rays}");
        self.settings.shadow_rays = shadow_rays;
    }

    /// Shadow rays per hit in the last group at the first vertex, the one left in the wave buffers.
    pub(crate) fn last_group_rays(&self, steps: &dyn Steps) -> u32 {
        match steps.shadow_rays_at(0, self.settings.shadow_rays) {
            _ if self.settings.surfaces.has_black_environment => 0,
            0 => 0,
            rays => (rays - 1) % steps.rays_per_group() + 1,
        }
    }

    /// Adds the device's counts to the totals. Fails if the device does.
    pub(crate) fn take_counters(&mut self) -> Result<()> {
        self.uncounted = 0;
        self.totals.add(&self.film.take_counters()?);
        Ok(())
    }

    /// Empties the film and the totals. Fails if the device does.
    pub(crate) fn restart(&mut self) -> Result<()> {
        self.film.clear(&self.device)?;
        self.totals = Totals::default();
        Ok(())
    }

    /// Names what traces this scene, as [`Device::tracer`] does: the device where the host has no tree.
    pub(crate) fn tracer(&self) -> String {
        match self.scene.geometry.host_tracer {
            Some(_) => self.device.tracer(),
            None => "device".to_owned(),
        }
    }

    /// Device memory by buffer, bytes.
    pub(crate) fn buffer_bytes(&self) -> BTreeMap<String, u64> {
        let mut bytes = self.film.buffer_bytes();
        let sets = [&self.scene.set, &self.waves.set].into_iter().chain(&self.sharing);
        bytes.extend(sets.flat_map(DescriptorSet::buffer_bytes));
        bytes
    }
}

/// The pass of a kernel, made if it is missing. Fails if the device does.
fn made<'a>(
    passes: &'a mut BTreeMap<Kernel, Pass>,
    device: &Arc<Device>,
    kernel: Kernel,
) -> Result<&'a Pass> {
    match passes.entry(kernel) {
        Entry::Occupied(occupied) => Ok(occupied.into_mut()),
        Entry::Vacant(vacant) => {
            let pass = Pass::new(device, vacant.key().clone())?;
            Ok(vacant.insert(pass))
        }
    }
}

fn sets<'a>(
    scene: &'a SceneBuffers,
    technique: &'a dyn Passes,
    waves: &'a WaveBuffers,
    sharing: &'a Option<DescriptorSet>,
    film: &'a DescriptorSet,
) -> Vec<&'a DescriptorSet> {
    let common = [&scene.set, &waves.set, film];
    common.into_iter().chain(technique.set()).chain(sharing).collect()
}
