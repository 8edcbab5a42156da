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

mod buffers;
mod parameters;
mod records;
mod steps;

use std::collections::BTreeMap;

pub use buffers::RecordBuffers;
pub use parameters::ControlVariatesParameters;
pub use records::RecordGrid;
pub use steps::{pilot_steps, steps};

use super::{Context, Parameters, Room, basic, knob::Knobs, pilot::Piloted};
use crate::{
    error::{Error, Result},
    pass::Technique,
};

pub(super) struct ControlVariatesRoom;

impl Room for ControlVariatesRoom {
    fn check(&self, parameters: &Parameters, _depth: u32) -> Result<()> {
        steps::candidates(parameters)?;
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
