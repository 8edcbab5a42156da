//! Passes of `control-variates`: those of `mis` with `record_visibility` in the pilot, `sample_controlled`
//! afterwards.

use super::records::RecordGrid;
use crate::{
    error::Result,
    pass::Surfaces,
    sampler::{
        Parameters,
        basic::{self, AUTO_RIS_CANDIDATES, RIS_CANDIDATES},
        rays::RaySteps,
    },
    shader::{
        constants::{CONSTANT_CANDIDATES, CONSTANT_COMPENSATION},
        rooms::control_variates::{
            CONSTANT_CONTROL_BITS, CONSTANT_CONTROL_CHOICE, CONSTANT_CONTROL_SHARE,
        },
    },
};

/// Returns the candidates per shadow ray; [`crate::Error::Usage`] for an unsupported number.
pub(super) fn candidates(parameters: &Parameters) -> Result<u32> {
    parameters.candidates_among("control-variates", &RIS_CANDIDATES, AUTO_RIS_CANDIDATES)
}

/// Returns the steps of the picture, or [`crate::Error::Usage`] for an unsupported number of candidates.
pub fn steps(parameters: &Parameters, grid: RecordGrid, surfaces: Surfaces) -> Result<RaySteps> {
    let control = parameters.control_variates;
    let own = [
        (CONSTANT_CANDIDATES, candidates(parameters)?),
        (CONSTANT_COMPENSATION, u32::from(parameters.compensation)),
        (CONSTANT_CONTROL_SHARE, control.control_share.to_bits()),
        (CONSTANT_CONTROL_BITS, u32::from(control.control_bits)),
        (CONSTANT_CONTROL_CHOICE, u32::from(control.control_choice)),
    ];
    let own = [&own[..], &grid.constants()].concat();
    // Light that `sample_controlled` adds to a path is in no shadow ray that a pixel could share.
    Ok(RaySteps { shares_paths: false, ..RaySteps::new("sample_controlled", &own, surfaces) })
}

/// Returns the steps of the pilot, or [`crate::Error::Usage`] as those of `mis` do.
pub fn pilot_steps(
    parameters: &Parameters,
    grid: RecordGrid,
    surfaces: Surfaces,
) -> Result<RaySteps> {
    let mis = basic::MIS.steps(parameters, surfaces)?;
    Ok(mis.learning("record_visibility", &grid.constants()))
}
