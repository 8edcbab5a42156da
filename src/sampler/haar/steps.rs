//! Passes of `haar`: `multiply_nodes` once per hit, `sample_nodes` per group of rays, and with a cache
//! `lower_nodes` after each single ray.

use crate::{
    pass::{Domain, Kernel, SHADOW_RAYS_PER_GROUP, Steps, Surfaces},
    sampler::Parameters,
    shader::{
        rooms::haar::{CONSTANT_HAAR_DEPTH, CONSTANT_HAAR_LEVEL},
        rooms::product::{CONSTANT_BRDF_SHARE, CONSTANT_ENVIRONMENT_SHARE},
        rooms::visibility::{
            CONSTANT_CACHE_CAPACITY, CONSTANT_THRESHOLD_SCALE, CONSTANT_VISIBILITY_EXPONENT,
        },
        structs::Wave,
    },
};

/// Steps of `haar`.
#[derive(Clone, Debug, PartialEq)]
pub struct HaarSteps {
    parameters: Parameters,
    depth: u32,
    surfaces: Surfaces,
    shadow_rays: u32,
}

impl HaarSteps {
    /// Returns the steps at `shadow_rays` rays per hit, with the environment's texels at level `depth`.
    pub fn new(parameters: &Parameters, depth: u32, surfaces: Surfaces, shadow_rays: u32) -> Self {
        Self { parameters: *parameters, depth, surfaces, shadow_rays }
    }

    fn kernel(&self, shader: &'static str, constants: &[(u32, u32)]) -> Kernel {
        let own = [
            (CONSTANT_HAAR_LEVEL, self.parameters.haar.level),
            (CONSTANT_HAAR_DEPTH, self.depth),
            (CONSTANT_CACHE_CAPACITY, cache_places(&self.parameters, self.shadow_rays)),
        ];
        Kernel::new(shader, Domain::Paths, &[&own[..], constants].concat())
    }
}

/// Directions that the cache of a hit has room for: those of all rays before the last; 0 without a cache.
pub(super) fn cache_places(parameters: &Parameters, shadow_rays: u32) -> u32 {
    if parameters.haar.has_cache { shadow_rays.saturating_sub(1).max(1) } else { 0 }
}

impl Steps for HaarSteps {
    /// One with a cache, since each shadow ray teaches the next.
    fn rays_per_group(&self) -> u32 {
        if self.parameters.haar.has_cache { 1 } else { SHADOW_RAYS_PER_GROUP }
    }

    fn prepare(&self, _wave: &Wave) -> Vec<Kernel> {
        vec![self.kernel("multiply_nodes", &self.surfaces.constants())]
    }

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        let shares = self.parameters.product;
        let own = [
            (CONSTANT_BRDF_SHARE, shares.brdf_share.to_bits()),
            (CONSTANT_ENVIRONMENT_SHARE, shares.environment_share.to_bits()),
        ];
        vec![self.kernel("sample_nodes", &[&own[..], &self.surfaces.constants()].concat())]
    }

    fn after_shadow_rays(&self, wave: &Wave) -> Vec<Kernel> {
        let is_last = wave.first_shadow_ray + wave.shadow_ray_count >= wave.total_shadow_rays;
        if !self.parameters.haar.has_cache || is_last {
            return Vec::new();
        }
        let visibility = self.parameters.visibility;
        let own = [
            (CONSTANT_THRESHOLD_SCALE, visibility.threshold_scale.to_bits()),
            (CONSTANT_VISIBILITY_EXPONENT, visibility.exponent.to_bits()),
        ];
        vec![self.kernel("lower_nodes", &own)]
    }
}
