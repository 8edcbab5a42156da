//! Passes of `control-variates`: those of `mis` with `record_visibility` in the pilot, `sample_controlled`
//! afterwards.

use super::records::RecordGrid;
use crate::{
    error::Result,
    pass::{Domain, Kernel, Steps, Surfaces},
    sampler::{
        Parameters,
        basic::{self, AUTO_RIS_CANDIDATES, BasicSteps, RIS_CANDIDATES},
    },
    shader::{
        constants::{CONSTANT_CANDIDATES, CONSTANT_COMPENSATION},
        rooms::control_variates::{
            CONSTANT_CONTROL_BITS, CONSTANT_CONTROL_CHOICE, CONSTANT_CONTROL_SHARE,
        },
        structs::Wave,
    },
};

/// Returns the candidates per shadow ray; [`crate::Error::Usage`] for an unsupported number.
pub(super) fn candidates(parameters: &Parameters) -> Result<u32> {
    parameters.candidates_among("control-variates", &RIS_CANDIDATES, AUTO_RIS_CANDIDATES)
}

/// Steps of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlledSteps {
    parameters: Parameters,
    candidates: u32,
    grid: RecordGrid,
    surfaces: Surfaces,
}

impl ControlledSteps {
    /// Returns the steps, or [`crate::Error::Usage`] for an unsupported number of candidates.
    pub fn new(parameters: &Parameters, grid: RecordGrid, surfaces: Surfaces) -> Result<Self> {
        let candidates = candidates(parameters)?;
        Ok(Self { parameters: *parameters, candidates, grid, surfaces })
    }
}

impl Steps for ControlledSteps {
    fn walks_lists(&self) -> bool {
        true
    }

    /// False: light that `sample_controlled` adds to a path is in no shadow ray that a pixel could share.
    fn shares_paths(&self) -> bool {
        false
    }

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        let control = self.parameters.control_variates;
        let own = [
            (CONSTANT_CANDIDATES, self.candidates),
            (CONSTANT_COMPENSATION, u32::from(self.parameters.compensation)),
            (CONSTANT_CONTROL_SHARE, control.control_share.to_bits()),
            (CONSTANT_CONTROL_BITS, u32::from(control.control_bits)),
            (CONSTANT_CONTROL_CHOICE, u32::from(control.control_choice)),
        ];
        let constants = [&own[..], &self.grid.constants(), &self.surfaces.constants()].concat();
        vec![Kernel::new("sample_controlled", Domain::Surfaces, &constants)]
    }
}

/// Steps of the pilot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PilotSteps {
    mis: BasicSteps,
    grid: RecordGrid,
}

impl PilotSteps {
    /// Returns the steps, or [`crate::Error::Usage`] as those of `mis` do.
    pub fn new(parameters: &Parameters, grid: RecordGrid, surfaces: Surfaces) -> Result<Self> {
        Ok(Self { mis: basic::MIS.steps(parameters, surfaces)?, grid })
    }
}

impl Steps for PilotSteps {
    fn walks_lists(&self) -> bool {
        self.mis.walks_lists()
    }

    fn shares_paths(&self) -> bool {
        false
    }

    fn sample(&self, wave: &Wave) -> Vec<Kernel> {
        self.mis.sample(wave)
    }

    fn after_shadow_rays(&self, _wave: &Wave) -> Vec<Kernel> {
        vec![Kernel::new("record_visibility", Domain::ShadowRays, &self.grid.constants())]
    }
}
