//! The passes of product sampling and visibility guidance: `product` once per hit, `sample_lobes` in
//! the place of `sample`, and for the sampler `visibility` `cache` and `cdf` after every shadow ray, with
//! `cache_entries` after the last one where that layer is asked for.

use std::sync::Arc;

use crate::{
    error::Result,
    gpu::{Commands, DescriptorSet, Device, Pipeline},
    sampler::{CacheScope, Elevation, LobeOrder, LobeParameters, Sampler, Threshold},
    shader::{
        constants::{
            CONSTANT_BRDF_LOBES, CONSTANT_BRDF_SHARE, CONSTANT_CACHE_CAPACITY,
            CONSTANT_CACHE_OF_PIXEL, CONSTANT_COUNT_VISIBLE, CONSTANT_ENVIRONMENT_LOBES,
            CONSTANT_ENVIRONMENT_SHARE, CONSTANT_FIXED_THRESHOLD, CONSTANT_KEPT_LOBES,
            CONSTANT_MATERIAL_KINDS, CONSTANT_METROPOLIS, CONSTANT_ORDER_BY_COEFFICIENT,
            CONSTANT_SAMPLER, CONSTANT_STRONGEST_ENVIRONMENT_LOBE, CONSTANT_THRESHOLD_SCALE,
            CONSTANT_VIEWS, CONSTANT_VISIBILITY_EXPONENT,
        },
        spirv,
        structs::Wave,
    },
};

/// Sizes of the fits on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSizes {
    /// Lobes of the environment; 0 where nothing could be fitted.
    pub environment_lobes: u32,
    /// Logarithm of the largest integral of an environment lobe over 2π, in the form of
    /// `product.comp`; of the largest amplitude where lobes are ordered by coefficient.
    pub strongest_environment_lobe: f32,
    /// Most lobes of a material in one view.
    pub brdf_lobes: u32,
    /// View elevations.
    pub views: u32,
}

/// The pipelines.
pub struct Lobes {
    product: Pipeline,
    sample: Pipeline,
    cache: Option<Cache>,
}

struct Cache {
    record: Pipeline,
    rebuild: Pipeline,
    entries: Pipeline,
    scope: CacheScope,
}

impl Lobes {
    /// Creates the pipelines for one of the two samplers at `shadow_rays` rays per hit.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn new(
        device: &Arc<Device>,
        sampler: Sampler,
        parameters: &LobeParameters,
        shadow_rays: u32,
        sizes: FitSizes,
        material_kinds: u32,
    ) -> Result<Self> {
        let with_cache = sampler == Sampler::Visibility;
        let capacity = if with_cache { parameters.cache_places(shadow_rays) } else { 0 };
        let of_pixel = u32::from(with_cache && parameters.cache == CacheScope::Pixel);
        // What product.glsl and weights.glsl are specialized by.
        let shared_constants = [
            (CONSTANT_KEPT_LOBES, parameters.kept_lobes),
            (CONSTANT_THRESHOLD_SCALE, parameters.threshold_scale.to_bits()),
            (CONSTANT_FIXED_THRESHOLD, u32::from(parameters.threshold == Threshold::Fixed)),
            (CONSTANT_CACHE_CAPACITY, capacity),
            (CONSTANT_CACHE_OF_PIXEL, of_pixel),
            (CONSTANT_COUNT_VISIBLE, u32::from(parameters.count_visible)),
            (CONSTANT_VISIBILITY_EXPONENT, parameters.exponent.to_bits()),
        ];
        let create = |name: &str, constants: &[(u32, u32)]| {
            let all: Vec<_> = shared_constants.iter().chain(constants).copied().collect();
            Pipeline::new(device, name, spirv::pass(name), &all)
        };
        let product = create(
            "product",
            &[
                (CONSTANT_ENVIRONMENT_LOBES, sizes.environment_lobes),
                (CONSTANT_STRONGEST_ENVIRONMENT_LOBE, sizes.strongest_environment_lobe.to_bits()),
                (CONSTANT_BRDF_LOBES, sizes.brdf_lobes.max(1)),
                (CONSTANT_VIEWS, sizes.views),
                (
                    CONSTANT_ORDER_BY_COEFFICIENT,
                    u32::from(parameters.order == LobeOrder::Coefficient),
                ),
            ],
        )?;
        let sample = create(
            "sample_lobes",
            &[
                (CONSTANT_SAMPLER, sampler.tag()),
                (CONSTANT_BRDF_SHARE, parameters.brdf_share.to_bits()),
                (CONSTANT_ENVIRONMENT_SHARE, parameters.environment_share.to_bits()),
                (CONSTANT_METROPOLIS, u32::from(parameters.elevation == Elevation::Metropolis)),
                (CONSTANT_MATERIAL_KINDS, material_kinds),
            ],
        )?;
        let cache = with_cache
            .then(|| -> Result<Cache> {
                Ok(Cache {
                    record: create("cache", &[])?,
                    rebuild: create("cdf", &[])?,
                    entries: create("cache_entries", &[])?,
                    scope: parameters.cache,
                })
            })
            .transpose()?;
        Ok(Self { product, sample, cache })
    }

    /// Whether the outcome of a shadow ray matters to the next one, which then needs a dispatch of its
    /// own.
    pub fn learns_from_rays(&self) -> bool {
        self.cache.is_some()
    }

    /// Records the product at every hit of `wave`, before its first shadow ray. `sets` are scene, SRBF
    /// tables, wave and film.
    pub fn record_product(&self, commands: &mut Commands, sets: &[&DescriptorSet; 4], wave: &Wave) {
        dispatch(commands, &self.product, &sets[1..], wave);
        if let Some(cache) = &self.cache
            && cache.scope == CacheScope::Pixel
        {
            dispatch(commands, &cache.rebuild, &[sets[0], sets[2], sets[3]], wave);
        }
    }

    /// Records the choice of directions.
    pub fn record_sample(&self, commands: &mut Commands, sets: &[&DescriptorSet; 4], wave: &Wave) {
        dispatch(commands, &self.sample, &[sets[0], sets[2]], wave);
    }

    /// Records what the shadow rays of `wave` taught; nothing for `product`.
    pub fn record_learn(&self, commands: &mut Commands, sets: &[&DescriptorSet; 4], wave: &Wave) {
        let Some(cache) = &self.cache else { return };
        // What the last ray of a hit teaches serves nobody but the pixel's next sample.
        let is_last = wave.first_shadow_ray + wave.shadow_ray_count >= wave.total_shadow_rays;
        if is_last && cache.scope == CacheScope::Hit {
            return;
        }
        let sets = [sets[0], sets[2], sets[3]];
        dispatch(commands, &cache.record, &sets, wave);
        if !is_last {
            dispatch(commands, &cache.rebuild, &sets, wave);
        }
    }

    /// Records how many directions the caches of `wave` hold after the last shadow ray of a vertex, into
    /// the film; nothing for `product`.
    pub fn record_entries(&self, commands: &mut Commands, sets: &[&DescriptorSet; 4], wave: &Wave) {
        if let Some(cache) = &self.cache {
            let sets = [sets[0], sets[2], sets[3]];
            let push = bytemuck::bytes_of(wave);
            commands.dispatch(&cache.entries, &sets, push, wave.pixel_count.max(1));
        }
    }
}

fn dispatch(commands: &mut Commands, pipeline: &Pipeline, sets: &[&DescriptorSet], wave: &Wave) {
    let paths = wave.pixel_count * wave.sample_count;
    commands.dispatch(pipeline, sets, bytemuck::bytes_of(wave), paths.max(1));
}
