//! Product sampling: directions from the lobes of environment × BRDF. \[Tsai et al. 2008\].
//!
//! [`Fits`] of the environment and of every material → [`LobeBuffers`] → strongest lobes of the
//! product at each hit (`glsl/product/multiply_lobes.comp`) → directions from the mixture of lobes,
//! BRDF and environment (`glsl/product/sample_lobes.comp`).

mod fits;
mod lobes;
mod parameters;

use std::collections::BTreeMap;

pub use fits::{FitSizes, Fits};
pub use lobes::{LobeBuffers, LobeSize};
pub use parameters::{Elevation, LobeOrder, ProductParameters};

use super::{Context, Parameters, Room, knob::Knobs};
use crate::{
    error::Result,
    gpu::DescriptorSet,
    pass::{Domain, Kernel, Passes, PathDemand, PixelReadback, Report, Steps, Surfaces, Technique},
    shader::{
        rooms::product::{
            CONSTANT_BRDF_LOBES, CONSTANT_BRDF_SHARE, CONSTANT_ENVIRONMENT_LOBES,
            CONSTANT_ENVIRONMENT_SHARE, CONSTANT_KEPT_LOBES, CONSTANT_METROPOLIS,
            CONSTANT_ORDER_BY_COEFFICIENT, CONSTANT_STRONGEST_ENVIRONMENT_LOBE, CONSTANT_VIEWS,
        },
        structs::Wave,
    },
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
        self.lobes.read(&vec![1.0; self.lobes.count()?], &mut pixel.lobes)
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

/// Steps of `product`, also used by `visibility`: `multiply_lobes` once per hit, `sample_lobes` per group of
/// rays.
#[derive(Clone, Debug, PartialEq)]
pub struct ProductSteps {
    /// Parameters of product sampling.
    pub parameters: ProductParameters,
    /// Sizes of the fits.
    pub fits: FitSizes,
    /// Specialization by the surfaces of the scene.
    pub surfaces: Surfaces,
    /// Specialization of the visibility cache; empty without one.
    pub cache: Vec<(u32, u32)>,
}

impl ProductSteps {
    /// Returns the steps of `product`.
    pub fn new(parameters: ProductParameters, fits: FitSizes, surfaces: Surfaces) -> Self {
        Self { parameters, fits, surfaces, cache: Vec::new() }
    }

    /// Makes a kernel over paths that knows lobes and cache.
    pub fn kernel(&self, shader: &'static str, constants: &[(u32, u32)]) -> Kernel {
        let mut all = vec![(CONSTANT_KEPT_LOBES, self.parameters.kept_lobes)];
        all.extend(&self.cache);
        all.extend(constants);
        Kernel::new(shader, Domain::Paths, &all)
    }

    /// Specialization of the passes that draw from the mixture.
    pub fn mixture_constants(&self) -> [(u32, u32); 3] {
        let walks = self.parameters.elevation == Elevation::Metropolis;
        [
            (CONSTANT_BRDF_SHARE, self.parameters.brdf_share.to_bits()),
            (CONSTANT_ENVIRONMENT_SHARE, self.parameters.environment_share.to_bits()),
            (CONSTANT_METROPOLIS, u32::from(walks)),
        ]
    }
}

impl Steps for ProductSteps {
    /// The energy of the lobes that were kept, in 256ths of all.
    fn counts(&self) -> u32 {
        256
    }

    fn prepare(&self, _wave: &Wave) -> Vec<Kernel> {
        let by_coefficient = self.parameters.order == LobeOrder::Coefficient;
        vec![self.kernel(
            "multiply_lobes",
            &[
                (CONSTANT_ENVIRONMENT_LOBES, self.fits.environment_lobes),
                (
                    CONSTANT_STRONGEST_ENVIRONMENT_LOBE,
                    self.fits.strongest_environment_lobe.to_bits(),
                ),
                (CONSTANT_BRDF_LOBES, self.fits.brdf_lobes.max(1)),
                (CONSTANT_VIEWS, self.fits.views),
                (CONSTANT_ORDER_BY_COEFFICIENT, u32::from(by_coefficient)),
            ],
        )]
    }

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        let constants = [&self.mixture_constants()[..], &self.surfaces.constants()].concat();
        vec![self.kernel("sample_lobes", &constants)]
    }
}
