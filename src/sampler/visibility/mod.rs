//! Visibility guidance: product sampling with less weight on lobes near blocked directions.
//!
//! `sample_and_trace.comp` draws the shadow rays of a hit one after another, records blocked ones in the
//! visibility cache of the hit and lowers the weights of the lobes close to them. \[Wu & Shih 2009\], the
//! thesis.

mod parameters;

use std::collections::BTreeMap;

use glam::Vec3;
pub use parameters::{CacheScope, Threshold, VisibilityParameters};

use super::{
    Context, Parameters, Room,
    knob::Knobs,
    product::{self, FitSizes, Fits, LobeBuffers, LobeSize, ProductParameters, ProductSteps},
};
use crate::{
    error::{Error, Result},
    film::Aov,
    gpu::DescriptorSet,
    math::octahedron,
    pass::{
        BLOCK_PIXELS, Domain, Kernel, Passes, PathDemand, PixelReadback, Progress, Report, Runner,
        Steps, Surfaces, Technique, geometry::Traversal,
    },
    shader::{
        constants::AOV_CACHE_ENTRIES,
        rooms::product as bindings,
        rooms::visibility::{
            CONSTANT_CACHE_CAPACITY, CONSTANT_CACHE_OF_PIXEL, CONSTANT_FIXED_THRESHOLD,
            CONSTANT_THRESHOLD_SCALE, CONSTANT_VISIBILITY_EXPONENT,
        },
        structs::Wave,
    },
};

/// Head bit of a cache that holds the last ray of its hit; twin of `cache.glsl`.
const CACHE_GROWN: u32 = 1 << 31;

pub(super) struct VisibilityRoom;

/// Size of lobes and caches, without caches of pixels.
fn size(parameters: &Parameters, shadow_rays: u32) -> LobeSize {
    LobeSize {
        kept_lobes: parameters.product.kept_lobes,
        cache_capacity: parameters.visibility.cache_places(shadow_rays),
        cached_pixels: None,
    }
}

impl Room for VisibilityRoom {
    fn check(&self, parameters: &Parameters, depth: u32) -> Result<()> {
        parameters.product.check()?;
        parameters.visibility.check(depth)
    }

    fn aovs(&self) -> &[Aov] {
        &[Aov::CacheEntries]
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = parameters.product.describe();
        named.extend(parameters.visibility.describe());
        named
    }

    fn demand(&self, parameters: &Parameters, shadow_rays: u32) -> PathDemand {
        size(parameters, shadow_rays).demand()
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let settings = &runner.settings;
        let fits = Fits::new(&runner.device, scene, &parameters.product)?;
        let steps = VisibilitySteps::new(
            parameters.visibility,
            parameters.product,
            fits.sizes,
            settings.surfaces,
            settings.traversal,
            settings.shadow_rays,
        );
        let window = runner.scene.window;
        let cached_pixels = (parameters.visibility.cache == CacheScope::Pixel)
            .then(|| u64::from(window.width) * u64::from(window.height));
        let size = LobeSize { cached_pixels, ..size(parameters, settings.shadow_rays) };
        let paths = runner.waves.capacity;
        Ok(Box::new(Visibility {
            steps,
            lobes: LobeBuffers::new(&runner.device, fits, size, paths)?,
            parameters: parameters.visibility,
            kept_lobes: size.kept_lobes,
            cache_places: size.cache_capacity,
        }))
    }
}

/// `visibility` in one render.
pub struct Visibility {
    steps: VisibilitySteps,
    lobes: LobeBuffers,
    parameters: VisibilityParameters,
    kept_lobes: u32,
    cache_places: u32,
}

impl Visibility {
    /// Returns true if caches outlive a wave.
    fn keeps_caches(&self) -> bool {
        self.parameters.cache == CacheScope::Pixel
    }

    /// V of the first path's lobes for its last ray, in a wave of one block; twin of
    /// `weights.glsl`. Fails if the device does.
    fn visibility_weights(&self, lobe_count: usize) -> Result<Vec<f64>> {
        let places = self.cache_places as usize;
        let cache: Vec<u32> =
            self.lobes.set.buffer(bindings::VISIBILITY_CACHE).download(1 + places)?;
        // Weights do not yet include what the last ray taught.
        let recorded =
            (cache[0] & !CACHE_GROWN) as usize - usize::from(cache[0] & CACHE_GROWN != 0);
        let stride = BLOCK_PIXELS as usize;
        let words_per_mask = self.kept_lobes.div_ceil(32) as usize;
        let length = ((places + 1) * words_per_mask - 1) * stride + 1;
        let masks: Vec<u32> = self.lobes.set.buffer(bindings::CLOSE_LOBES).download(length)?;
        let weight = |lobe: usize| {
            let is_close = |entry: &usize| {
                let word = entry % (places + 1) * words_per_mask + lobe / 32;
                masks[word * stride] >> (lobe % 32) & 1 != 0
            };
            let close = (recorded - recorded.min(places)..recorded).filter(is_close).count();
            (1.0 + close as f64).powf(-f64::from(self.parameters.exponent))
        };
        Ok((0..lobe_count).map(weight).collect())
    }

    /// Reads the first path's cached directions in world space, oldest first. Fails if the device does.
    fn cached_directions(&self) -> Result<Vec<Vec3>> {
        let places = self.cache_places as usize;
        let words: Vec<u32> =
            self.lobes.set.buffer(bindings::VISIBILITY_CACHE).download(1 + places)?;
        let recorded = (words[0] & !CACHE_GROWN) as usize;
        let oldest = if recorded > places { recorded % places } else { 0 };
        let in_order = (0..recorded.min(places)).map(|i| words[1 + (oldest + i) % places]);
        Ok(in_order.map(octahedron::unpack).collect())
    }
}

impl Passes for Visibility {
    fn steps(&self) -> &dyn Steps {
        &self.steps
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(&self.lobes.set)
    }
}

impl Technique for Visibility {
    /// With caches of pixels a sample learns from the samples before it.
    fn learn(&mut self, _runner: &mut Runner, _progress: &Progress) -> Result<u32> {
        Ok(if self.keeps_caches() { 1 } else { u32::MAX })
    }

    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        if self.keeps_caches() {
            self.lobes.set.buffer(bindings::VISIBILITY_CACHE).clear()?;
        }
        Ok(())
    }

    fn check_resume(&self, samples: u32, progress: &Progress) -> Result<()> {
        if !self.keeps_caches() || samples == 0 {
            return Ok(());
        }
        Err(Error::usage(format!(
            "--resume with --set cache=pixel: the {samples} samples per pixel of the checkpoint taught \
             visibility caches that it does not hold, so the image would not be that of one render; \
             render without --resume, or with --sample-offset {} and merge the two, or use cache=hit",
            progress.first_sample.saturating_add(samples)
        )))
    }

    fn explain(&self, pixel: &mut PixelReadback) -> Result<()> {
        let factors = self.visibility_weights(self.lobes.count()?)?;
        self.lobes.read(&factors, &mut pixel.lobes)?;
        pixel.cached = Some(self.cached_directions()?);
        Ok(())
    }

    fn report(&self) -> Report {
        product::report(&self.lobes)
    }
}

/// Steps of `visibility`: `sample_and_trace` draws, traces and records the rays of a hit in turn.
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

    fn finish(&self, wave: &Wave, aovs: u32) -> Vec<Kernel> {
        if aovs & AOV_CACHE_ENTRIES == 0 || wave.total_shadow_rays == 0 {
            return Vec::new();
        }
        let kernel = self.product.kernel("count_entries", &[]);
        vec![Kernel { domain: Domain::Pixels, ..kernel }]
    }
}
