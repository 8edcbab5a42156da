//! Passes of visibility guidance: `sample_and_trace` draws, traces and records the rays of a hit in turn.

use super::parameters::{CacheScope, Threshold, VisibilityParameters};
use crate::{
    pass::{Domain, Kernel, Steps, Surfaces, geometry::Traversal},
    sampler::product::{FitSizes, ProductParameters, ProductSteps},
    shader::{
        constants::AOV_CACHE_ENTRIES,
        rooms::visibility::{
            CONSTANT_CACHE_CAPACITY, CONSTANT_CACHE_OF_PIXEL, CONSTANT_FIXED_THRESHOLD,
            CONSTANT_THRESHOLD_SCALE, CONSTANT_VISIBILITY_EXPONENT,
        },
        structs::Wave,
    },
};

/// Steps of `visibility`.
#[derive(Clone, Debug, PartialEq)]
pub struct VisibilitySteps {
    product: ProductSteps,
    scope: CacheScope,
    traversal: Traversal,
}

impl VisibilitySteps {
    /// Returns the steps at `shadow_rays` rays per hit.
    pub fn new(
        parameters: VisibilityParameters,
        product: ProductParameters,
        fits: FitSizes,
        surfaces: Surfaces,
        traversal: Traversal,
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
        let product =
            ProductSteps { cache: constants, ..ProductSteps::new(product, fits, surfaces) };
        Self { product, scope: cache, traversal }
    }
}

impl Steps for VisibilitySteps {
    fn counts(&self) -> u32 {
        self.product.counts()
    }

    fn traces(&self) -> bool {
        true
    }

    fn prepare(&self, wave: &Wave) -> Vec<Kernel> {
        let mut kernels = self.product.prepare(wave);
        if self.scope == CacheScope::Pixel {
            kernels.push(self.product.kernel("reweight", &[]));
        }
        kernels
    }

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        let surfaces = self.traversal.constants(self.product.surfaces);
        let constants = [&self.product.mixture_constants()[..], &surfaces].concat();
        vec![self.product.kernel("sample_and_trace", &constants)]
    }

    fn finish(&self, wave: &Wave) -> Vec<Kernel> {
        if wave.aovs & AOV_CACHE_ENTRIES == 0 || wave.total_shadow_rays == 0 {
            return Vec::new();
        }
        let kernel = self.product.kernel("count_entries", &[]);
        vec![Kernel { domain: Domain::Pixels, ..kernel }]
    }
}
