//! Visibility guidance: product sampling with less weight on lobes near blocked directions.
//!
//! `sample_and_trace.comp` draws the shadow rays of a hit one after another, records blocked ones in the
//! visibility cache of the hit and lowers the weights of the lobes close to them. \[Wu & Shih 2009\], the
//! thesis.

mod parameters;
mod readback;
mod steps;

use std::collections::BTreeMap;

pub use parameters::{CacheScope, Threshold, VisibilityParameters};
pub use steps::VisibilitySteps;

use super::{
    Context, Parameters, Room,
    knob::Knobs,
    product::{self, Fits, LobeBuffers, LobeSize},
};
use crate::{
    error::{Error, Result},
    film::Aov,
    gpu::DescriptorSet,
    pass::{Passes, PathDemand, PixelReadback, Progress, Report, Runner, Steps, Technique},
    shader::rooms::product as bindings,
};

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
        let factors = self.visibility_weights(product::readback::lobe_count(&self.lobes)?)?;
        product::readback::read_lobes(&self.lobes, &factors, &mut pixel.lobes)?;
        pixel.cached = Some(self.cached_directions()?);
        Ok(())
    }

    fn report(&self) -> Report {
        product::report(&self.lobes)
    }
}
