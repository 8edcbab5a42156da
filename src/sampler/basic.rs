//! Samplers without learning or tables: the pass `sample` with a tag.

use std::collections::BTreeMap;

use super::{Context, Parameters, Room};
use crate::{
    error::Result,
    pass::{Domain, Kernel, Passes, Steps, Surfaces, Technique},
    shader::{
        constants::{
            CONSTANT_CANDIDATES, CONSTANT_COMPENSATION, CONSTANT_SAMPLER, SAMPLER_BRDF,
            SAMPLER_COSINE, SAMPLER_ENV, SAMPLER_MIS, SAMPLER_RIS, SAMPLER_UNIFORM,
        },
        structs::Wave,
    },
};

/// A sampler of `sample.comp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Basic {
    tag: u32,
}

/// Uniform over the hemisphere.
pub const UNIFORM: Basic = Basic { tag: SAMPLER_UNIFORM };
/// Proportional to the cosine.
pub const COSINE: Basic = Basic { tag: SAMPLER_COSINE };
/// The BRDF's own sampling.
pub const BRDF: Basic = Basic { tag: SAMPLER_BRDF };
/// Proportional to the luminance of the environment map.
pub const ENV: Basic = Basic { tag: SAMPLER_ENV };
/// `brdf` and `env` in turns with the one-sample balance heuristic.
pub const MIS: Basic = Basic { tag: SAMPLER_MIS };
/// Resampling over candidates of `mis`.
pub const RIS: Basic = Basic { tag: SAMPLER_RIS };

/// Numbers of candidates that `ris` and `control-variates` support, half from the BRDF and half from the
/// environment.
pub(super) const RIS_CANDIDATES: [u32; 4] = [2, 4, 6, 8];
pub(super) const AUTO_RIS_CANDIDATES: u32 = 4;

impl Basic {
    fn candidates(self, parameters: &Parameters) -> Result<u32> {
        if self.tag == SAMPLER_RIS {
            parameters.candidates_among("ris", &RIS_CANDIDATES, AUTO_RIS_CANDIDATES)
        } else {
            Ok(1)
        }
    }

    /// Returns the passes, or [`crate::Error::Usage`] for an unsupported number of candidates.
    pub fn steps(self, parameters: &Parameters, surfaces: Surfaces) -> Result<BasicSteps> {
        let candidates = self.candidates(parameters)?;
        let compensates = self.tag == SAMPLER_MIS && parameters.compensation;
        Ok(BasicSteps {
            tag: self.tag,
            candidates,
            compensates,
            rays: None,
            shares_paths: true,
            surfaces,
        })
    }
}

impl Room for Basic {
    fn check(&self, parameters: &Parameters, _depth: u32) -> Result<()> {
        self.candidates(parameters).map(drop)
    }

    fn basic(&self) -> Option<Self> {
        Some(*self)
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        match self.tag {
            SAMPLER_RIS => {
                let candidates = parameters.candidates.unwrap_or(AUTO_RIS_CANDIDATES);
                [("candidates".to_owned(), candidates.to_string())].into()
            }
            SAMPLER_MIS => [parameters.shared("compensation")].into(),
            _ => BTreeMap::new(),
        }
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let surfaces = context.runner.settings().surfaces;
        Ok(Box::new(BasicTechnique { steps: self.steps(context.parameters, surfaces)? }))
    }
}

/// The pass `sample`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BasicSteps {
    tag: u32,
    candidates: u32,
    compensates: bool,
    rays: Option<[u32; 2]>,
    shares_paths: bool,
    surfaces: Surfaces,
}

impl BasicSteps {
    /// Returns the same steps with other numbers of shadow rays at the first and at later vertices.
    pub(super) fn with_rays(self, rays: [u32; 2]) -> Self {
        Self { rays: Some(rays), ..self }
    }

    /// Returns the same steps with or without shared paths.
    pub(super) fn with_sharing(self, shares_paths: bool) -> Self {
        Self { shares_paths, ..self }
    }
}

impl Steps for BasicSteps {
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

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        let own = [
            (CONSTANT_SAMPLER, self.tag),
            (CONSTANT_CANDIDATES, self.candidates),
            (CONSTANT_COMPENSATION, u32::from(self.compensates)),
        ];
        let constants = [&own[..], &self.surfaces.constants()].concat();
        vec![Kernel::new("sample", Domain::Surfaces, &constants)]
    }

    fn escape(&self) -> Option<Vec<(u32, u32)>> {
        let compensates = (CONSTANT_COMPENSATION, u32::from(self.compensates));
        (self.tag == SAMPLER_MIS).then(|| vec![compensates])
    }
}

struct BasicTechnique {
    steps: BasicSteps,
}

impl Passes for BasicTechnique {
    fn steps(&self) -> &dyn Steps {
        &self.steps
    }
}

impl Technique for BasicTechnique {}
