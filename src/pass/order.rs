//! Order of the passes in one wave, as data: camera, [`STAGES`] of every vertex, film. A sampler adds its own
//! passes by [`Steps`], and sharing by [`Moment`].

use super::{
    geometry::{Schedule, Traversal},
    kernel::{Dispatch, Domain, Kernel},
    sharing::{Moment, Sharing},
    steps::{Roulette, Steps},
    surfaces::Surfaces,
};
use crate::shader::{
    constants::{
        AOV_ALBEDO, AOV_MATERIALS, AOV_NORMAL, AOV_OBJECTS, AOV_POSITION, CONSTANT_AOVS,
        CONSTANT_ONLY_SPECULAR, PATH_LISTS, SURFACES_EMITTING, SURFACES_ROUGH_GLASS,
        SURFACES_SPECULAR, SURFACES_TEXTURED, TRAINING_WAVE,
    },
    structs::Wave,
};

/// Bits of [`PassSettings::aovs`] that the pass `features` serves.
pub(super) const FEATURES: u32 = AOV_ALBEDO | AOV_NORMAL | AOV_POSITION;
/// Vertices at which that pass looks for a surface that is not perfectly specular: enough to see through
/// a drinking glass and what it holds.
const FEATURE_VERTICES: u32 = 8;

/// When the passes of later vertices walk lists of the paths that are still alive. The picture is the same
/// to the bit. Where the host traces, waves also end with their last path, except with [`PathLists::Never`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PathLists {
    /// Where most paths end early: `docs/experiments.md`, lists_of_living_paths.
    #[default]
    WherePathsEnd,
    /// Everywhere.
    Always,
    /// Nowhere.
    Never,
}

/// Settings of a render that shape its passes, apart from the technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassSettings {
    /// Shadow rays per hit; 0 renders only the environment that the camera sees.
    pub shadow_rays: u32,
    /// Path vertices at which environment light is gathered.
    pub depth: u32,
    /// Bits `AOV_…`: which extra film buffers are written. Shaders know them as `CONSTANT_AOVS`.
    pub aovs: u32,
    /// Groups of lights that the film keeps apart; 0 if nobody asks for them.
    pub light_groups: u32,
    /// Where paths end by chance.
    pub roulette: Roulette,
    /// Edge of the cohorts whose pixels share second vertices: 2, 4, 8, or 1 for none.
    pub cohort_edge: u32,
    /// Specialization by the surfaces of the scene.
    pub surfaces: Surfaces,
    /// Specialization of the passes that traverse.
    pub traversal: Traversal,
    /// Schedule of incoherent rays.
    pub incoherent: Schedule,
    /// When passes walk lists of living paths instead of all.
    pub path_lists: PathLists,
    /// Most bytes of one buffer of the film.
    pub film_page_bytes: u64,
    /// Most paths in flight.
    pub most_paths: u32,
}

/// Stages of a vertex in their order. Each adds its passes, if scene, sampler and settings want any.
const STAGES: [fn(&mut Order); 11] = [
    |order| order.trace(),
    |order| order.list_paths(),
    |order| order.read_textures(),
    |order| order.add_emission(),
    |order| order.share(Moment::Met, order.wave),
    |order| order.sample_lamps(),
    |order| order.sample_environment(),
    |order| order.add_features(),
    |order| order.share(Moment::Leaving, order.wave),
    |order| order.bounce(),
    |order| order.share(Moment::Left, order.wave),
];

/// Stages where the last vertices' rays arrive, at light that is not sampled, or not sampled alone.
const LAST_STAGES: [fn(&mut Order); 4] = [
    |order| order.trace(),
    |order| order.add_emission(),
    |order| order.add_features(),
    |order| order.gather(order.wave),
];

/// Dispatches of one wave.
pub struct WaveOrder {
    /// Those of the vertices, from the camera on.
    pub vertices: Vec<Dispatch>,
    /// Those that follow in any case.
    pub end: Vec<Dispatch>,
}

impl WaveOrder {
    /// Returns all in their order.
    pub fn all(self) -> Vec<Dispatch> {
        [self.vertices, self.end].concat()
    }
}

/// Returns the dispatches of one wave for the first `vertices` vertices of its paths.
pub fn wave_order(
    settings: &PassSettings,
    steps: &dyn Steps,
    wave: Wave,
    vertices: u32,
) -> WaveOrder {
    let mut order = Order::new(settings, steps, wave, vertices);
    order.add(Kernel::new("camera", Domain::Paths, &[]));
    for vertex in 0..vertices {
        order.arrive_at(vertex);
        STAGES.iter().for_each(|stage| stage(&mut order));
    }
    if order.goes_on() {
        order.arrive_at(vertices);
        LAST_STAGES.iter().for_each(|stage| stage(&mut order));
    }
    let vertices = std::mem::take(&mut order.dispatches);
    if let Some(sharing) = order.sharing {
        order.dispatches.extend(sharing.connect_and_share(&order.wave));
    }
    order.add(Kernel::new("deposit", Domain::Pixels, &[(CONSTANT_AOVS, settings.aovs)]));
    WaveOrder { vertices, end: order.dispatches }
}

/// The dispatches so far, and the vertex under way.
struct Order<'a> {
    settings: &'a PassSettings,
    steps: &'a dyn Steps,
    sharing: Option<Sharing>,
    vertices: u32,
    /// First vertex with a list of living paths.
    first_listed: u32,
    wave: Wave,
    dispatches: Vec<Dispatch>,
}

impl<'a> Order<'a> {
    fn new(settings: &'a PassSettings, steps: &'a dyn Steps, wave: Wave, vertices: u32) -> Self {
        let PassSettings { surfaces, traversal, incoherent, cohort_edge, .. } = *settings;
        let is_lit = wave.is_training != TRAINING_WAVE;
        let shares = is_lit && cohort_edge > 1 && vertices > 1 && steps.shares_paths();
        let sharing = Sharing { cohort_edge, surfaces, traversal, schedule: incoherent };
        let walks_lists = steps.walks_lists() && settings.path_lists != PathLists::Never;
        Self {
            settings,
            steps,
            sharing: shares.then_some(sharing),
            vertices,
            // Cohorts keep the second vertices of all paths.
            first_listed: if walks_lists { 1 + u32::from(shares) } else { u32::MAX },
            wave,
            dispatches: Vec::new(),
        }
    }

    fn add(&mut self, kernel: Kernel) {
        self.add_with(kernel, self.wave);
    }

    fn add_all(&mut self, kernels: Vec<Kernel>) {
        kernels.into_iter().for_each(|kernel| self.add(kernel));
    }

    fn add_with(&mut self, kernel: Kernel, wave: Wave) {
        let path_list = path_list(kernel.domain, wave.vertex, self.first_listed);
        let kernel = kernel.with_light_groups(self.settings.light_groups);
        self.dispatches.push(Dispatch { kernel, wave: Wave { path_list, ..wave } });
    }

    fn add_over(&mut self, shader: &'static str, domain: Domain) {
        self.add(Kernel::new(shader, domain, &self.settings.surfaces.constants()));
    }

    /// Adds the pass of sharing at a moment of the vertex, if there is one.
    fn share(&mut self, moment: Moment, wave: Wave) {
        let vertex = self.wave.vertex;
        if let Some(kernel) = self.sharing.and_then(|sharing| sharing.at(moment, vertex)) {
            self.add_with(kernel, wave);
        }
    }

    /// True unless the wave teaches the visibility of the environment, which needs no other light.
    fn is_lit(&self) -> bool {
        self.wave.is_training != TRAINING_WAVE
    }

    fn is_last_vertex(&self) -> bool {
        self.wave.vertex + 1 >= self.vertices
    }

    fn emits(&self) -> bool {
        self.is_lit() && self.settings.surfaces.has(SURFACES_EMITTING)
    }

    /// True if paths go on from their last vertices.
    fn goes_on(&self) -> bool {
        self.emits() || self.is_lit() && self.settings.surfaces.has(SURFACES_SPECULAR)
    }

    /// Begins a vertex. After the last one no light is sampled.
    fn arrive_at(&mut self, vertex: u32) {
        let most = self.settings.shadow_rays;
        let is_sampled = vertex < self.vertices;
        let rays = if is_sampled { self.steps.shadow_rays_at(vertex, most) } else { 0 };
        self.wave = Wave {
            vertex,
            arriving_shadow_rays: self.wave.bounce_rays * self.wave.total_shadow_rays,
            total_shadow_rays: rays,
            first_shadow_ray: 0,
            shadow_ray_count: 0,
            ..self.wave
        };
        let is_counted = rays > 0 && self.steps.escape(vertex).is_some();
        self.wave.bounce_rays = u32::from(is_counted && (!self.is_last_vertex() || self.emits()));
    }

    fn trace(&mut self) {
        let PassSettings { surfaces, traversal, incoherent, .. } = *self.settings;
        // Camera rays stay coherent, bounce rays do not.
        let schedule = if self.wave.vertex == 0 { Schedule::SINGLE } else { incoherent };
        self.add(traversal.trace(schedule, surfaces));
    }

    fn list_paths(&mut self) {
        if self.wave.vertex >= self.first_listed {
            self.add(Kernel::new("list_paths", Domain::Arrivals, &[]));
        }
    }

    fn read_textures(&mut self) {
        if self.settings.surfaces.has(SURFACES_TEXTURED) {
            self.add_over("texture", Domain::Surfaces);
        }
    }

    fn add_emission(&mut self) {
        if self.emits() {
            let is_listed = self.wave.vertex < self.vertices;
            self.add_over("emit", if is_listed { Domain::Surfaces } else { Domain::Arrivals });
        }
    }

    /// One shadow ray to a lamp after another.
    fn sample_lamps(&mut self) {
        let PassSettings { surfaces, traversal, incoherent, .. } = *self.settings;
        let has_lamps = surfaces.lamp_count > 0;
        if !self.is_lit() || !has_lamps && !surfaces.has(SURFACES_ROUGH_GLASS) {
            return;
        }
        // Half as many as to the environment, at least one: docs/experiments.md, rays_to_lamps.
        let rays = if has_lamps { self.wave.total_shadow_rays.div_ceil(2).max(1) } else { 1 };
        let to_lamps =
            Wave { to_lamps: 1, shadow_ray_count: 1, total_shadow_rays: rays, ..self.wave };
        // The density of the environment with which bounce rays will be weighed where they arrive.
        let density = self.steps.escape(self.wave.vertex + 1).unwrap_or_default();
        let constants = [surfaces.constants(), density].concat();
        let sample = Kernel::new("sample_lamps", Domain::Surfaces, &constants);
        for ray in 0..rays {
            let wave = Wave { first_shadow_ray: ray, ..to_lamps };
            self.add_with(sample.clone(), wave);
            self.add_with(traversal.shadow(incoherent, surfaces), wave);
            self.gather(wave);
        }
    }

    /// The sampler's own shadow rays, in groups.
    fn sample_environment(&mut self) {
        let PassSettings { surfaces, traversal, incoherent, .. } = *self.settings;
        let steps = self.steps;
        let rays = if surfaces.has_black_environment { 0 } else { self.wave.total_shadow_rays };
        if rays > 0 {
            self.add_all(steps.prepare(&self.wave));
        }
        loop {
            let left = rays - self.wave.first_shadow_ray;
            self.wave.shadow_ray_count = left.min(steps.rays_per_group());
            if self.wave.shadow_ray_count > 0 {
                self.add_all(steps.sample(&self.wave));
                if !steps.traces() {
                    self.add(traversal.shadow(incoherent, surfaces));
                }
                self.add_all(steps.after_shadow_rays(&self.wave));
            }
            self.gather(self.wave);
            if self.wave.shadow_ray_count == left {
                break;
            }
            self.wave.first_shadow_ray += self.wave.shadow_ray_count;
        }
        self.add_all(steps.finish(&self.wave, self.settings.aovs));
    }

    fn gather(&mut self, wave: Wave) {
        if wave.to_lamps == 0 && self.settings.surfaces.has_black_environment {
            return;
        }
        let escape = self.steps.escape(wave.vertex).filter(|_| wave.to_lamps == 0);
        let escape = escape.unwrap_or_default();
        self.add_with(Kernel::new("gather", Domain::Arrivals, &escape), wave);
        self.share(Moment::Gathered, wave);
    }

    fn add_features(&mut self) {
        let Wave { vertex, is_training, .. } = self.wave;
        let PassSettings { surfaces, aovs, .. } = *self.settings;
        if vertex == 0 && aovs & (AOV_OBJECTS | AOV_MATERIALS) != 0 && is_training == 0 {
            let constants = [&surfaces.constants()[..], &[(CONSTANT_AOVS, aovs)]].concat();
            self.add(Kernel::new("mattes", Domain::Pixels, &constants));
        }
        let is_asked_for = aovs & FEATURES != 0 && is_training == 0;
        if is_asked_for && vertex == 0 {
            self.add_over("features", Domain::Arrivals);
        } else if is_asked_for && vertex < FEATURE_VERTICES && surfaces.has(SURFACES_SPECULAR) {
            if vertex == self.vertices && surfaces.has(SURFACES_TEXTURED) {
                self.add_over("texture", Domain::Arrivals);
            }
            self.add_over("features", Domain::Arrivals);
        }
    }

    fn bounce(&mut self) {
        if !self.is_last_vertex() {
            let samples = self.wave.total_shadow_rays > 0;
            let guided = samples.then(|| self.steps.bounce(&self.wave)).flatten();
            self.add(guided.unwrap_or_else(|| self.bounce_by_brdf(false)));
        } else if self.goes_on() {
            self.add(self.bounce_by_brdf(!self.settings.surfaces.has(SURFACES_EMITTING)));
        }
    }

    /// The pass that continues paths by the BRDF's own sampling; `only_specular` ends all others.
    fn bounce_by_brdf(&self, only_specular: bool) -> Kernel {
        let roulette = self.steps.roulette().unwrap_or(self.settings.roulette);
        let mut constants = self.settings.surfaces.constants();
        constants.extend(roulette.constants());
        constants.push((CONSTANT_ONLY_SPECULAR, u32::from(only_specular)));
        Kernel::new("bounce", Domain::Surfaces, &constants)
    }
}

/// Returns the list of paths that a pass walks at a vertex, as in [`Wave::path_list`].
fn path_list(domain: Domain, vertex: u32, first_listed: u32) -> u32 {
    let listed_at = match domain {
        Domain::Surfaces | Domain::ShadowRays => Some(vertex),
        Domain::Arrivals => vertex.checked_sub(1),
        Domain::Paths | Domain::Pixels => None,
    };
    listed_at.filter(|vertex| *vertex >= first_listed).map_or(0, |vertex| 1 + vertex % PATH_LISTS)
}
