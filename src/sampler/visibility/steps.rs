//! Passes of visibility guidance: `record_blocked` and `reweight` after each single shadow ray.

use super::parameters::{CacheScope, Threshold, VisibilityParameters};
use crate::{
    pass::{Domain, Kernel, Steps, Surfaces},
    sampler::product::{FitSizes, ProductParameters, ProductSteps},
    shader::{
        constants::{
            AOV_CACHE_ENTRIES, CONSTANT_CACHE_CAPACITY, CONSTANT_CACHE_OF_PIXEL,
            CONSTANT_FIXED_THRESHOLD, CONSTANT_THRESHOLD_SCALE, CONSTANT_VISIBILITY_EXPONENT,
            SAMPLER_VISIBILITY,
        },
        structs::Wave,
    },
};

/// Steps of `visibility`.
#[derive(Clone, Debug, PartialEq)]
pub struct VisibilitySteps {
    product: ProductSteps,
    scope: CacheScope,
}

impl VisibilitySteps {
    /// Returns the steps at `shadow_rays` rays per hit.
    pub fn new(
        parameters: VisibilityParameters,
        product: ProductParameters,
        fits: FitSizes,
        surfaces: Surfaces,
        shadow_rays: u32,
    ) -> Self {
        let VisibilityParameters { exponent, threshold_scale, threshold, cache, .. } = parameters;
        let constants = vec![
            (CONSTANT_THRESHOLD_SCALE, threshold_scale.to_bits()),
            (CONSTANT_FIXED_THRESHOLD, u32::from(threshold == Threshold::Fixed)),
            (CONSTANT_CACHE_CAPACITY, parameters.cache_places(shadow_rays)),
            (CONSTANT_CACHE_OF_PIXEL, u32::from(cache == CacheScope::Pixel)),
            (CONSTANT_VISIBILITY_EXPONENT, exponent.to_bits()),
        ];
        let product = ProductSteps {
            sampler: SAMPLER_VISIBILITY,
            cache: constants,
            ..ProductSteps::new(product, fits, surfaces)
        };
        Self { product, scope: cache }
    }
}

impl Steps for VisibilitySteps {
    /// One, since each shadow ray teaches the next.
    fn rays_per_group(&self) -> u32 {
        1
    }

    fn prepare(&self, wave: &Wave) -> Vec<Kernel> {
        let mut kernels = self.product.prepare(wave);
        if self.scope == CacheScope::Pixel {
            kernels.push(self.product.kernel("reweight", &[]));
        }
        kernels
    }

    fn sample(&self, wave: &Wave) -> Vec<Kernel> {
        self.product.sample(wave)
    }

    fn after_shadow_rays(&self, wave: &Wave) -> Vec<Kernel> {
        let is_last = wave.first_shadow_ray + wave.shadow_ray_count >= wave.total_shadow_rays;
        let mut kernels = Vec::new();
        // Only the pixel's next sample can use the last ray of a hit.
        if !is_last || self.scope == CacheScope::Pixel {
            kernels.push(self.product.kernel("record_blocked", &[]));
        }
        if !is_last {
            kernels.push(self.product.kernel("reweight", &[]));
        }
        kernels
    }

    fn finish(&self, wave: &Wave) -> Vec<Kernel> {
        if wave.aovs & AOV_CACHE_ENTRIES == 0 || wave.total_shadow_rays == 0 {
            return Vec::new();
        }
        let kernel = self.product.kernel("count_entries", &[]);
        vec![Kernel { domain: Domain::Pixels, ..kernel }]
    }
}
