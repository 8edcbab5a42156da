//! Product sampling: directions from the lobes of environment × BRDF. \[Tsai et al. 2008\].
//!
//! [`Fits`] of the environment and of every material → [`LobeBuffers`] → strongest lobes of the
//! product at each hit (`glsl/product/multiply_lobes.comp`) → directions from the mixture of lobes,
//! BRDF and environment (`glsl/product/sample_lobes.comp`).

mod fits;
mod lobes;
mod parameters;
pub(super) mod readback;
mod steps;

use std::collections::BTreeMap;

pub use fits::{FitSizes, Fits};
pub use lobes::{LobeBuffers, LobeSize};
pub use parameters::{Elevation, LobeOrder, ProductParameters};
pub use steps::ProductSteps;

use super::{Context, Parameters, Room, knob::Knobs};
use crate::{
    error::Result,
    gpu::DescriptorSet,
    pass::{Passes, PathDemand, PixelReadback, Report, Steps, Technique},
};

pub(super) struct ProductRoom;

fn size(parameters: &ProductParameters) -> LobeSize {
    LobeSize { kept_lobes: parameters.kept_lobes, cache_capacity: 0, cached_pixels: None }
}

impl Room for ProductRoom {
    fn check(&self, parameters: &Parameters, _depth: u32) -> Result<()> {
        parameters.product.check()
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        parameters.product.describe()
    }

    fn demand(&self, parameters: &Parameters, _shadow_rays: u32) -> PathDemand {
        size(&parameters.product).demand()
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let parameters = parameters.product;
        let fits = Fits::new(&runner.device, scene, &parameters)?;
        let steps = ProductSteps::new(parameters, fits.sizes, runner.settings.surfaces);
        let paths = runner.waves.capacity;
        let lobes = LobeBuffers::new(&runner.device, fits, size(&parameters), paths)?;
        Ok(Box::new(Product { steps, lobes }))
    }
}

/// `product` in one render.
pub struct Product {
    steps: ProductSteps,
    lobes: LobeBuffers,
}

impl Passes for Product {
    fn steps(&self) -> &dyn Steps {
        &self.steps
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(&self.lobes.set)
    }
}

impl Technique for Product {
    fn explain(&self, pixel: &mut PixelReadback) -> Result<()> {
        let count = readback::lobe_count(&self.lobes)?;
        readback::read_lobes(&self.lobes, &vec![1.0; count], &mut pixel.lobes)
    }

    fn report(&self) -> Report {
        report(&self.lobes)
    }
}

pub(super) fn report(lobes: &LobeBuffers) -> Report {
    Report {
        host_ms: [("fits".to_owned(), lobes.fits.fit_ms)].into(),
        fit_hashes: lobes.fits.hashes.clone(),
        ..Report::default()
    }
}
