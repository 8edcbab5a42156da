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
pub mod controlled;
mod parameters;
mod records;
mod steps;

use std::{collections::BTreeMap, time::Instant};

pub use buffers::RecordBuffers;
pub use parameters::ControlVariatesParameters;
pub use records::RecordGrid;
pub use steps::{ControlledSteps, PilotSteps};

use super::{Context, Parameters, Room, basic, knob::Knobs, pilot};
use crate::{
    error::{Error, Result},
    gpu::DescriptorSet,
    pass::{Passes, Progress, Report, Runner, Steps, Technique},
};

pub(super) struct ControlVariatesRoom;

impl Room for ControlVariatesRoom {
    fn check(&self, parameters: &Parameters, _depth: u32) -> Result<()> {
        steps::candidates(parameters)?;
        if parameters.share_tiles.is_some_and(|edge| edge > 1) {
            return Err(Error::usage(format!(
                "--set share-tiles={}: control-variates adds light that no shadow ray carries, which \
                 pixels cannot share; expected auto or off",
                parameters.share_tiles_text()
            )));
        }
        Ok(())
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = parameters.control_variates.describe();
        let candidates = parameters.candidates.unwrap_or(basic::AUTO_RIS_CANDIDATES);
        named.insert("candidates".to_owned(), candidates.to_string());
        named.extend(basic::MIS.describe(parameters));
        named
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let surfaces = runner.settings().surfaces;
        let grid = RecordGrid::new(scene, &parameters.control_variates);
        Ok(Box::new(ControlVariates {
            pilot: PilotSteps::new(parameters, grid, surfaces)?,
            steps: ControlledSteps::new(parameters, grid, surfaces)?,
            buffers: RecordBuffers::new(runner.device(), grid)?,
            has_records: false,
            freeze_ms: 0.0,
        }))
    }
}

/// `control-variates` in one render.
struct ControlVariates {
    pilot: PilotSteps,
    steps: ControlledSteps,
    buffers: RecordBuffers,
    has_records: bool,
    freeze_ms: f64,
}

impl Passes for ControlVariates {
    fn steps(&self) -> &dyn Steps {
        if self.has_records { &self.steps } else { &self.pilot }
    }

    fn other_steps(&self) -> Vec<Box<dyn Steps>> {
        vec![Box::new(self.steps)]
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(self.buffers.set())
    }
}

impl Technique for ControlVariates {
    /// Runs the pilot before the first sample: one sample of every pixel.
    fn learn(&mut self, runner: &mut Runner, progress: &Progress) -> Result<u32> {
        if self.has_records {
            return Ok(u32::MAX);
        }
        self.buffers.clear()?;
        if !pilot::shoot(self, runner, progress, 1)? {
            return Ok(u32::MAX);
        }
        let start = Instant::now();
        self.buffers.freeze()?;
        self.freeze_ms += start.elapsed().as_secs_f64() * 1e3;
        self.has_records = true;
        Ok(u32::MAX)
    }

    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        self.has_records = false;
        self.freeze_ms = 0.0;
        Ok(())
    }

    fn report(&self) -> Report {
        Report {
            host_ms: BTreeMap::from([("visibility records".to_owned(), self.freeze_ms)]),
            buffer_bytes: self.buffers.buffer_bytes(),
            ..Report::default()
        }
    }
}
