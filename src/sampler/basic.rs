//! Samplers without learning or tables: the pass `sample` with a tag.

use std::collections::BTreeMap;

use super::{
    Context, Parameters, Room,
    rays::{RaySteps, Unlearned},
};
use crate::{
    error::Result,
    pass::{Surfaces, Technique},
    shader::constants::{
        CONSTANT_CANDIDATES, CONSTANT_COMPENSATION, CONSTANT_SAMPLER, SAMPLER_MIS, SAMPLER_RIS,
    },
};

/// A sampler of `sample.comp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Basic {
    /// `SAMPLER_…`.
    pub(super) tag: u32,
}

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
    pub fn steps(self, parameters: &Parameters, surfaces: Surfaces) -> Result<RaySteps> {
        let compensates = self.tag == SAMPLER_MIS && parameters.compensation;
        let compensation = (CONSTANT_COMPENSATION, u32::from(compensates));
        let own = [
            (CONSTANT_SAMPLER, self.tag),
            (CONSTANT_CANDIDATES, self.candidates(parameters)?),
            compensation,
        ];
        let escape = (self.tag == SAMPLER_MIS).then(|| vec![compensation]);
        Ok(RaySteps { escape, ..RaySteps::new("sample", &own, surfaces) })
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
        let surfaces = context.runner.settings.surfaces;
        let steps = self.steps(context.parameters, surfaces)?;
        Ok(Box::new(Unlearned { steps, set: None, host_ms: BTreeMap::new() }))
    }
}
