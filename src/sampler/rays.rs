//! Samplers that choose each shadow ray by itself, in one pass: those of the kind of `mis`. Such a room
//! supplies the pass, which draws a light direction and knows its density, and its constants.

use std::collections::BTreeMap;

use crate::{
    gpu::DescriptorSet,
    pass::{Domain, Kernel, Passes, Report, Roulette, Steps, Surfaces, Technique},
    shader::structs::Wave,
};

/// The pass, and where it departs from other samplers.
#[derive(Clone, Debug, PartialEq)]
pub struct RaySteps {
    pub(super) sample: Kernel,
    /// Pass that counts the rays, for a technique to learn from.
    pub(super) learn: Option<Kernel>,
    /// Shadow rays at the first and at later vertices, if fewer than the most.
    pub(super) rays: Option<[u32; 2]>,
    /// True if the pixels of a cohort share paths.
    pub(super) shares_paths: bool,
    /// Where paths end by chance, if not as the settings say.
    pub(super) roulette: Option<Roulette>,
    /// Specialization of `gather`, if bounce rays that escape are samples of the environment too.
    pub(super) escape: Option<Vec<(u32, u32)>>,
}

impl RaySteps {
    /// Returns the steps for the pass `shader`, specialized by `own` and by the surfaces of the scene.
    pub fn new(shader: &'static str, own: &[(u32, u32)], surfaces: Surfaces) -> Self {
        let constants = [own, &surfaces.constants()].concat();
        Self {
            sample: Kernel::new(shader, Domain::Surfaces, &constants),
            learn: None,
            rays: None,
            shares_paths: true,
            roulette: None,
            escape: None,
        }
    }

    /// Returns the same steps for a pilot: the pass `shader` counts the shadow rays, and bounce rays are no
    /// samples of the environment.
    pub(super) fn learning(self, shader: &'static str, constants: &[(u32, u32)]) -> Self {
        let learn = Some(Kernel::new(shader, Domain::ShadowRays, constants));
        Self { learn, escape: None, ..self }
    }
}

impl Steps for RaySteps {
    fn walks_lists(&self) -> bool {
        true
    }

    fn shadow_rays_at(&self, vertex: u32, most: u32) -> u32 {
        let [first, later] = self.rays.unwrap_or([most; 2]);
        most.min(if vertex == 0 { first } else { later })
    }

    fn shares_paths(&self) -> bool {
        self.shares_paths
    }

    fn roulette(&self) -> Option<Roulette> {
        self.roulette
    }

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        vec![self.sample.clone()]
    }

    fn after_shadow_rays(&self, _wave: &Wave) -> Vec<Kernel> {
        self.learn.iter().cloned().collect()
    }

    fn escape(&self, _vertex: u32) -> Option<Vec<(u32, u32)>> {
        self.escape.clone()
    }
}

/// A technique that learns nothing: steps, and tables that stay as they are.
pub struct Unlearned<S> {
    /// The steps.
    pub steps: S,
    /// Descriptor set 1.
    pub set: Option<DescriptorSet>,
    /// Milliseconds of the host by stage.
    pub host_ms: BTreeMap<String, f64>,
}

impl<S: Steps> Passes for Unlearned<S> {
    fn steps(&self) -> &dyn Steps {
        &self.steps
    }

    fn set(&self) -> Option<&DescriptorSet> {
        self.set.as_ref()
    }
}

impl<S: Steps + 'static> Technique for Unlearned<S> {
    fn report(&self) -> Report {
        Report { host_ms: self.host_ms.clone(), ..Report::default() }
    }
}
