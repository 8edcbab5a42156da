//! Shadow rays chosen among candidates, with recorded visibility as control variate.
//!
//! \[Clarberg & Akenine-Möller 2008b\]. A pilot counts in [`RecordGrid`] how many rays are visible from
//! each place of the scene in each direction (`glsl/control_variates/record_visibility.comp`). The
//! records then stay as they are. Every shadow ray of the picture is one of a few candidates
//! (`glsl/control_variates/sample_controlled.comp`): all of them bring the light that the records expect,
//! the traced one corrects it.
//!
//! The picture's samples are independent of those of the pilot (`src/sampler/pilot.rs`), and every estimate
//! is unbiased whatever the records hold.

mod records;

use std::{collections::BTreeMap, sync::Arc};

pub use records::RecordGrid;

use super::{
    Context, Parameters, Room,
    basic::{self, AUTO_RIS_CANDIDATES, RIS_CANDIDATES},
    knob::{Knobs, ON_OR_OFF, parameters},
    pilot::{Piloted, Tables},
    rays::RaySteps,
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, DescriptorSet, Device},
    pass::{Surfaces, Technique},
    shader::{
        constants::{CONSTANT_CANDIDATES, CONSTANT_COMPENSATION},
        rooms::control_variates::{
            CONSTANT_CONTROL_BITS, CONSTANT_CONTROL_CHOICE, CONSTANT_CONTROL_SHARE, RECORD_COUNTS,
            RECORD_VISIBILITIES, TABLE,
        },
    },
};

parameters! {
    /// Parameters of `control-variates` beside `candidates` and `compensation`.
    pub struct ControlVariatesParameters {
        /// `control-share`: α, the share of the expected visibility that is the control variate; 0 is none.
        "control-share" control_share: f32 = 1.0, 0.0..=1.0;
        /// `control-bits`: on if the expected visibility is rounded to 0 or 1 in the control variate, as in
        /// the paper.
        "control-bits" control_bits: bool = true, ON_OR_OFF;
        /// `control-choice`: on if shadow rays go where the records are in doubt, off if they go by light
        /// alone, as in the paper.
        "control-choice" control_choice: bool = true, ON_OR_OFF;
        /// `record-side`: bins of a record along each side of the square of directions.
        "record-side" record_side: u32 = 16, 4..=32;
        /// `record-pixels`: edge of a record's cube in the picture, at most, pixels.
        "record-pixels" record_pixels: u32 = 24, 1..=256;
    }
}

pub(super) struct ControlVariatesRoom;

impl Room for ControlVariatesRoom {
    fn check(&self, parameters: &Parameters, _depth: u32) -> Result<()> {
        candidates(parameters)?;
        if parameters.share_paths.is_some_and(|edge| edge > 1) {
            return Err(Error::usage(format!(
                "--set share-paths={}: control-variates adds light that no shadow ray carries, which \
                 pixels cannot share; expected auto or off",
                parameters.share_paths_text()
            )));
        }
        Ok(())
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = parameters.control_variates.describe();
        named.extend(basic::RIS.describe(parameters));
        named.extend(basic::MIS.describe(parameters));
        named
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let surfaces = runner.settings.surfaces;
        let grid = RecordGrid::new(scene, &parameters.control_variates);
        let pilot = pilot_steps(parameters, grid, surfaces)?;
        let steps = steps(parameters, grid, surfaces)?;
        let buffers = RecordBuffers::new(&runner.device, grid)?;
        Ok(Box::new(Piloted::new(buffers, [pilot, steps], 1, BTreeMap::new())))
    }
}

/// Returns the candidates per shadow ray; [`crate::Error::Usage`] for an unsupported number.
fn candidates(parameters: &Parameters) -> Result<u32> {
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

/// The visibility records on a device.
pub struct RecordBuffers {
    set: DescriptorSet,
    grid: RecordGrid,
}

impl RecordBuffers {
    /// Allocates records of undefined content. Fails if the device does or its limits are exceeded.
    pub fn new(device: &Arc<Device>, grid: RecordGrid) -> Result<Self> {
        let entries = grid.entries() as u64;
        let make = |name, bytes| Buffer::new(device, name, bytes);
        let bound = [
            (RECORD_COUNTS, make("record counts", 8 * entries)?),
            (RECORD_VISIBILITIES, make("record visibilities", 4 * entries)?),
        ];
        let set = DescriptorSet::new(device, &TABLE, &bound)?;
        Ok(Self { set, grid })
    }
}

impl Tables for RecordBuffers {
    const STAGE: &'static str = "visibility records";

    fn set(&self) -> &DescriptorSet {
        &self.set
    }

    fn forget(&self) -> Result<()> {
        self.set.buffer(RECORD_COUNTS).clear()
    }

    fn freeze(&self) -> Result<()> {
        let counts = self.set.buffer(RECORD_COUNTS).download(self.grid.entries())?;
        let expected = self.grid.expected(&counts);
        self.set.buffer(RECORD_VISIBILITIES).upload(bytemuck::cast_slice(&expected))
    }
}
