//! Passes of product sampling: `multiply_lobes` once per hit, `sample_lobes` per group of rays.

use super::{
    fits::FitSizes,
    parameters::{Elevation, LobeOrder, ProductParameters},
};
use crate::{
    pass::{Domain, Kernel, Steps, Surfaces},
    shader::{
        rooms::product::{
            CONSTANT_BRDF_LOBES, CONSTANT_BRDF_SHARE, CONSTANT_ENVIRONMENT_LOBES,
            CONSTANT_ENVIRONMENT_SHARE, CONSTANT_KEPT_LOBES, CONSTANT_METROPOLIS,
            CONSTANT_ORDER_BY_COEFFICIENT, CONSTANT_STRONGEST_ENVIRONMENT_LOBE, CONSTANT_VIEWS,
        },
        structs::Wave,
    },
};

/// Steps of `product`, also used by `visibility`.
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
