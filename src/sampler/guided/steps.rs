//! Passes of learned visibility: `sample_guided` replaces `sample`, then `learn` after the shadow
//! rays; `bounce_guided` replaces `bounce`, then `learn_arrivals` at the next vertex.

use super::parameters::GuidedParameters;
use crate::{
    pass::{Domain, Kernel, PassSettings, Roulette, Steps, Surfaces},
    sampler::rays::RaySteps,
    shader::{
        constants::{AOV_GUIDE_CELL, CONSTANT_CANDIDATES},
        rooms::guided::{
            CONSTANT_BOUNCE_CANDIDATES, CONSTANT_BRDF_CANDIDATES, GUIDE_SAMPLES_THAT_ALL_TEACH,
            GUIDE_TEACHING_STEP,
        },
        structs::Wave,
    },
};

/// Steps of `guided`.
#[derive(Clone, Debug, PartialEq)]
pub struct GuidedSteps {
    /// Candidates per shadow ray, a quarter of them from the BRDF; 1 is the one-sample model.
    pub candidates: u32,
    /// True if the pixels of a cohort share paths.
    pub shares_paths: bool,
    /// Shadow rays at the first and at later vertices.
    pub(super) rays: [u32; 2],
    pub(super) bounce_candidates: u32,
    /// False where `later` is given: bounces learn from the cells of later vertices.
    pub(super) guides_bounces: bool,
    /// Steps of later vertices, if those are not guided.
    pub(super) later: Option<RaySteps>,
    pub(super) surfaces: Surfaces,
    pub(super) roulette: Roulette,
}

impl GuidedSteps {
    /// Returns the steps of a render.
    pub fn new(candidates: u32, parameters: GuidedParameters, settings: &PassSettings) -> Self {
        Self {
            candidates,
            shares_paths: true,
            rays: [settings.shadow_rays, parameters.later_rays_of(settings.shadow_rays)],
            bounce_candidates: parameters.bounce_candidates,
            guides_bounces: parameters.guides_bounces(settings.depth),
            later: None,
            surfaces: settings.surfaces,
            roulette: settings.roulette,
        }
    }

    /// Returns the steps of a vertex that is not guided.
    fn unguided(&self, vertex: u32) -> Option<&RaySteps> {
        self.later.as_ref().filter(|_| vertex > 0)
    }
}

impl Steps for GuidedSteps {
    fn walks_lists(&self) -> bool {
        true
    }

    fn shadow_rays_at(&self, vertex: u32, most: u32) -> u32 {
        most.min(self.rays[usize::from(vertex > 0)])
    }

    fn shares_paths(&self) -> bool {
        self.shares_paths
    }

    fn roulette(&self) -> Option<Roulette> {
        Some(self.roulette)
    }

    fn sample(&self, wave: &Wave) -> Vec<Kernel> {
        if let Some(later) = self.unguided(wave.vertex) {
            return later.sample(wave);
        }
        let own = [
            (CONSTANT_CANDIDATES, self.candidates),
            (CONSTANT_BRDF_CANDIDATES, (self.candidates / 4).max(1)),
        ];
        let constants = [&own[..], &self.surfaces.constants()].concat();
        let mut kernels = vec![Kernel::new("sample_guided", Domain::Surfaces, &constants)];
        let has_arrived = wave.vertex > 0 && wave.first_shadow_ray == 0;
        if self.guides_bounces && has_arrived && teaches(wave) {
            kernels.push(Kernel::new("learn_arrivals", Domain::Arrivals, &[]));
        }
        kernels
    }

    fn after_shadow_rays(&self, wave: &Wave) -> Vec<Kernel> {
        let learns = teaches(wave) && self.unguided(wave.vertex).is_none();
        let learn = learns.then(|| Kernel::new("learn", Domain::ShadowRays, &[]));
        learn.into_iter().collect()
    }

    fn finish(&self, wave: &Wave, aovs: u32) -> Vec<Kernel> {
        let is_shown = wave.vertex == 0 && aovs & AOV_GUIDE_CELL != 0 && wave.is_training == 0;
        is_shown.then(|| Kernel::new("show_cells", Domain::Pixels, &[])).into_iter().collect()
    }

    fn escape(&self, vertex: u32) -> Option<Vec<(u32, u32)>> {
        self.unguided(vertex)?.escape(vertex)
    }

    fn bounce(&self, _wave: &Wave) -> Option<Kernel> {
        let own = [(CONSTANT_BOUNCE_CANDIDATES, self.bounce_candidates)];
        let constants = [&own[..], &self.roulette.constants(), &self.surfaces.constants()].concat();
        self.guides_bounces.then(|| Kernel::new("bounce_guided", Domain::Surfaces, &constants))
    }
}

/// Returns true if any sample of `wave` teaches.
fn teaches(wave: &Wave) -> bool {
    let first = wave.first_sample.wrapping_sub(wave.epoch_start);
    let next = if first < GUIDE_SAMPLES_THAT_ALL_TEACH {
        first
    } else {
        first.next_multiple_of(GUIDE_TEACHING_STEP)
    };
    next - first < wave.sample_count.max(1)
}
