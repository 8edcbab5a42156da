//! The passes of the path tracer, in the order they run in. A pass is one dispatch: its name is
//! `glsl/<name>.comp`, its debug label and its row in the timings.
//!
//! Per wave of paths: `camera`; then per vertex `trace`, and per group of shadow rays `sample`,
//! `shadow`, `gather`, with `product` before the first group and `cache` and `cdf` after each for the
//! samplers that need them; `cache_entries` after every vertex, `guide_cells` and `features` after the
//! first one, where their layers are asked for; `bounce` or `bounce_guided` between vertices; at last
//! `accumulate`.

pub mod geometry;
pub mod guided;
mod lobes;
pub mod shadow;
pub mod trace;

use std::{sync::Arc, time::Instant};

use crate::{
    error::Result,
    gpu::{Commands, DescriptorSet, Device, PassTimes, Pipeline},
    sampler::{Parameters, Sampler},
    shader::{
        constants::{
            AOV_ALBEDO, AOV_CACHE_ENTRIES, AOV_GUIDE_CELL, AOV_NORMAL, AOV_POSITION,
            CONSTANT_CANDIDATES, CONSTANT_MATERIAL_KINDS, CONSTANT_ROULETTE_VERTEX,
            CONSTANT_SAMPLER,
        },
        spirv,
        structs::Wave,
    },
};
pub use geometry::{GeometryBuffers, Schedule};
use guided::Guided;
pub use lobes::{FitSizes, Lobes};
use shadow::Shadow;
use trace::Trace;

/// Shadow rays per hit in one group: bounds the work of an invocation and the size of the buffers.
pub const SHADOW_RAYS_PER_GROUP: u32 = 8;

/// Bits of [`Wave::aovs`] that the `features` pass writes.
const FEATURES: u32 = AOV_ALBEDO | AOV_NORMAL | AOV_POSITION;

/// What shapes the passes of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassSettings {
    /// How directions are chosen.
    pub sampler: Sampler,
    /// Parameters of the sampler.
    pub parameters: Parameters,
    /// Shadow rays per hit; 0 renders emission seen by the camera only.
    pub shadow_rays: u32,
    /// Path vertices at which environment light is gathered.
    pub depth: u32,
    /// Bits `AOV_…`.
    pub aovs: u32,
    /// First vertex at which russian roulette may end a path.
    pub roulette_vertex: u32,
    /// Bit `1 << kind` for every kind of material in the scene.
    pub material_kinds: u32,
    /// Sizes of the fits, for the samplers that use lobes.
    pub fit_sizes: Option<FitSizes>,
}

/// The descriptor sets that the passes see.
pub struct Sets<'a> {
    /// Scene: geometry, materials, environment.
    pub scene: &'a DescriptorSet,
    /// State of the wave.
    pub wave: &'a DescriptorSet,
    /// Film.
    pub film: &'a DescriptorSet,
    /// What was learned, for the sampler `guided`.
    pub guide: Option<&'a DescriptorSet>,
    /// SRBF tables, for the samplers `product` and `visibility`.
    pub fits: Option<&'a DescriptorSet>,
}

/// The pipelines of all passes.
pub struct Passes {
    settings: PassSettings,
    camera: Pipeline,
    /// For camera rays, which stay together.
    trace: Trace,
    /// For bounce rays, which part at once.
    trace_bounce: Trace,
    sample: Pipeline,
    /// For the sampler `guided`, in the place of `sample`.
    guided: Option<Guided>,
    /// For the samplers `product` and `visibility`, in the place of `sample`.
    lobes: Option<Lobes>,
    shadow: Shadow,
    gather: Pipeline,
    bounce: Pipeline,
    features: Pipeline,
    accumulate: Pipeline,
    /// Shadow rays per hit that the passes were made for.
    most_shadow_rays: u32,
}

impl Passes {
    /// Creates the pipelines that `settings` call for.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the driver refuses one.
    pub fn new(
        device: &Arc<Device>,
        geometry: &GeometryBuffers,
        settings: PassSettings,
    ) -> Result<Self> {
        let incoherent = Schedule::incoherent(device.capabilities());
        let create = |name: &str, constants: &[(u32, u32)]| {
            Pipeline::new(device, name, spirv::pass(name), constants)
        };
        let candidates = settings.parameters.candidates_of(settings.sampler)?;
        let basic = match settings.sampler {
            Sampler::Guided => Sampler::Mis,
            sampler => sampler,
        };
        Ok(Self {
            camera: create("camera", &[])?,
            trace: Trace::new(device, geometry, Schedule::SINGLE)?,
            trace_bounce: Trace::new(device, geometry, incoherent)?,
            sample: create(
                "sample",
                &[
                    // Where nothing is blocked, `guided` samples as `mis` does.
                    (CONSTANT_SAMPLER, basic.tag()),
                    (CONSTANT_CANDIDATES, candidates),
                    (CONSTANT_MATERIAL_KINDS, settings.material_kinds),
                ],
            )?,
            guided: (settings.sampler == Sampler::Guided)
                .then(|| Guided::new(device, candidates, &settings))
                .transpose()?,
            lobes: settings
                .fit_sizes
                .map(|sizes| {
                    Lobes::new(
                        device,
                        settings.sampler,
                        &settings.parameters.lobes,
                        settings.shadow_rays,
                        sizes,
                        settings.material_kinds,
                    )
                })
                .transpose()?,
            shadow: Shadow::new(device, geometry, incoherent)?,
            gather: create("gather", &[])?,
            bounce: create(
                "bounce",
                &[
                    (CONSTANT_ROULETTE_VERTEX, settings.roulette_vertex),
                    (CONSTANT_MATERIAL_KINDS, settings.material_kinds),
                ],
            )?,
            features: create("features", &[(CONSTANT_MATERIAL_KINDS, settings.material_kinds)])?,
            accumulate: create("accumulate", &[])?,
            most_shadow_rays: settings.shadow_rays,
            settings,
        })
    }

    /// Traces fewer shadow rays per hit from now on than the passes were made for.
    ///
    /// # Panics
    /// If there are more: buffers have no room for them.
    pub fn limit_shadow_rays(&mut self, shadow_rays: u32) {
        assert!(shadow_rays <= self.most_shadow_rays, "buffers have room for {shadow_rays}");
        self.settings.shadow_rays = shadow_rays;
    }

    /// The passes of the sampler `guided`.
    pub fn guided(&mut self) -> Option<&mut Guided> {
        self.guided.as_mut()
    }

    /// Shadow rays per hit in one group of dispatches.
    pub fn rays_per_group(&self) -> u32 {
        if self.lobes.as_ref().is_some_and(Lobes::learns_from_rays) {
            1
        } else {
            SHADOW_RAYS_PER_GROUP
        }
    }

    /// Number of dispatches of one wave.
    pub fn dispatches_per_wave(&self) -> u32 {
        let groups = self.settings.shadow_rays.div_ceil(self.rays_per_group()).max(1);
        4 + self.settings.depth * (6 + 5 * groups)
    }

    /// Shadow rays at a vertex, `is_guided` where learned visibility chooses them.
    fn shadow_rays_at(&self, vertex: u32, is_guided: bool) -> u32 {
        let most = self.settings.shadow_rays;
        if is_guided && vertex > 0 { self.settings.parameters.later_rays_of(most) } else { most }
    }

    /// Records all passes of one wave.
    pub fn record(&self, commands: &mut Commands, sets: &Sets<'_>, wave: Wave) {
        self.record_vertices(commands, sets, wave, self.settings.depth);
    }

    /// Records the passes of one wave for the first `vertices` vertices of its paths.
    pub fn record_vertices(
        &self,
        commands: &mut Commands,
        sets: &Sets<'_>,
        wave: Wave,
        vertices: u32,
    ) {
        let Sets { scene, wave: wave_set, film, guide, fits } = *sets;
        let lobes = self.lobes.as_ref().zip(fits.map(|fits| [scene, fits, wave_set, film]));
        let paths = wave.pixel_count * wave.sample_count;
        let mut wave = Wave { aovs: self.settings.aovs, ..wave };

        let dispatch = |commands: &mut Commands,
                        pipeline: &Pipeline,
                        sets: &[&DescriptorSet],
                        wave: &Wave,
                        invocations: u32| {
            commands.dispatch(pipeline, sets, bytemuck::bytes_of(wave), invocations);
        };
        dispatch(commands, &self.camera, &[scene, wave_set], &wave, paths);
        for vertex in 0..vertices {
            wave.vertex = vertex;
            wave.total_shadow_rays = self.shadow_rays_at(vertex, guide.is_some());
            let trace = if vertex == 0 { &self.trace } else { &self.trace_bounce };
            trace.record(commands, &[scene, wave_set, film], &wave);
            let mut first = 0;
            if let Some((lobes, sets)) = &lobes
                && wave.total_shadow_rays > 0
            {
                wave.first_shadow_ray = 0;
                lobes.record_product(commands, sets, &wave);
            }
            loop {
                wave.first_shadow_ray = first;
                wave.shadow_ray_count = (wave.total_shadow_rays - first).min(self.rays_per_group());
                if wave.shadow_ray_count > 0 {
                    if let (Some(guided), Some(guide)) = (&self.guided, guide) {
                        guided.record_sample(commands, &[scene, guide, wave_set], &wave);
                        if vertex > 0 && first == 0 {
                            guided.record_arrivals(commands, guide, &wave);
                        }
                    } else if let Some((lobes, sets)) = &lobes {
                        lobes.record_sample(commands, sets, &wave);
                    } else {
                        dispatch(commands, &self.sample, &[scene, wave_set], &wave, paths);
                    }
                    self.shadow.record(commands, &[scene, wave_set, film], &wave);
                    if let (Some(guided), Some(guide)) = (&self.guided, guide) {
                        guided.record_learn(commands, &[guide, wave_set], &wave);
                    }
                    if let Some((lobes, sets)) = &lobes {
                        lobes.record_learn(commands, sets, &wave);
                    }
                }
                dispatch(commands, &self.gather, &[scene, wave_set], &wave, paths);
                first += wave.shadow_ray_count;
                if first >= wave.total_shadow_rays {
                    break;
                }
            }
            if let Some((lobes, sets)) = &lobes
                && wave.total_shadow_rays > 0
                && wave.aovs & AOV_CACHE_ENTRIES != 0
            {
                lobes.record_entries(commands, sets, &wave);
            }
            if let (Some(guided), Some(guide)) = (&self.guided, guide)
                && vertex == 0
                && wave.aovs & AOV_GUIDE_CELL != 0
                && wave.is_training == 0
            {
                guided.record_cells(commands, &[scene, guide, wave_set, film], &wave);
            }
            if vertex == 0 && wave.aovs & FEATURES != 0 && wave.is_training == 0 {
                dispatch(
                    commands,
                    &self.features,
                    &[scene, wave_set, film],
                    &wave,
                    wave.pixel_count,
                );
            }
            if vertex + 1 < vertices {
                let is_recorded = match (&self.guided, guide) {
                    (Some(guided), Some(guide)) if wave.total_shadow_rays > 0 => {
                        guided.record_bounce(commands, &[scene, guide, wave_set], &wave)
                    }
                    _ => false,
                };
                if !is_recorded {
                    dispatch(commands, &self.bounce, &[scene, wave_set], &wave, paths);
                }
            }
        }
        dispatch(commands, &self.accumulate, &[scene, wave_set, film], &wave, wave.pixel_count);
    }

    /// Runs every pass that a render will use once over nothing, which makes drivers that compile
    /// late compile now. Returns milliseconds by pass.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if a call fails.
    pub fn warm_up(&self, device: &Arc<Device>, sets: &Sets<'_>) -> Result<PassTimes> {
        let Sets { scene, wave, film, guide, fits } = *sets;
        let mut times = PassTimes::new();
        let mut run = |name: &str, record: &dyn Fn(&mut Commands)| -> Result<()> {
            let start = Instant::now();
            let mut commands = Commands::begin(device)?;
            record(&mut commands);
            commands.submit_and_wait()?;
            times.insert(name.to_owned(), start.elapsed().as_secs_f64() * 1e3);
            Ok(())
        };
        let nothing = Wave::default();
        let push = bytemuck::bytes_of(&nothing);
        let all = [scene, wave, film];
        run("camera", &|commands| commands.dispatch(&self.camera, &all[..2], push, 1))?;
        run("trace", &|commands| self.trace.record(commands, &all, &nothing))?;
        if self.settings.shadow_rays > 0 {
            if let (Some(guided), Some(guide)) = (&self.guided, guide) {
                run("sample_guided", &|commands| {
                    guided.record_sample(commands, &[scene, guide, wave], &nothing);
                })?;
                run("learn", &|commands| {
                    guided.record_learn(commands, &[guide, wave], &nothing);
                })?;
                if self.settings.parameters.guides_bounces(self.settings.depth) {
                    run("bounce_guided", &|commands| {
                        guided.record_bounce(commands, &[scene, guide, wave], &nothing);
                    })?;
                    run("learn_arrivals", &|commands| {
                        guided.record_arrivals(commands, guide, &nothing);
                    })?;
                }
                if self.settings.aovs & AOV_GUIDE_CELL != 0 {
                    run("guide_cells", &|commands| {
                        guided.record_cells(commands, &[scene, guide, wave, film], &nothing);
                    })?;
                }
            } else if let (Some(lobes), Some(fits)) = (&self.lobes, fits) {
                let sets = [scene, fits, wave, film];
                run("product", &|commands| lobes.record_product(commands, &sets, &nothing))?;
                run("sample_lobes", &|commands| lobes.record_sample(commands, &sets, &nothing))?;
                // A ray that is not the last one, so that both passes of the cache run.
                let first = Wave { total_shadow_rays: 1, ..nothing };
                run("cache, cdf", &|commands| lobes.record_learn(commands, &sets, &first))?;
                if self.settings.aovs & AOV_CACHE_ENTRIES != 0 {
                    run("cache_entries", &|commands| {
                        lobes.record_entries(commands, &sets, &nothing);
                    })?;
                }
            }
            if self.lobes.is_none() {
                run("sample", &|commands| commands.dispatch(&self.sample, &all[..2], push, 1))?;
            }
            run("shadow", &|commands| self.shadow.record(commands, &all, &nothing))?;
        }
        run("gather", &|commands| commands.dispatch(&self.gather, &all[..2], push, 1))?;
        if self.settings.depth > 1 {
            run("bounce", &|commands| commands.dispatch(&self.bounce, &all[..2], push, 1))?;
            run("trace (bounce)", &|commands| self.trace_bounce.record(commands, &all, &nothing))?;
        }
        if self.settings.aovs & FEATURES != 0 {
            run("features", &|commands| commands.dispatch(&self.features, &all, push, 1))?;
        }
        run("accumulate", &|commands| commands.dispatch(&self.accumulate, &all, push, 1))?;
        Ok(times)
    }
}
