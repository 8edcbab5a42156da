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

use std::{collections::BTreeMap, sync::Arc};

use super::{
    Context, Parameters, Room,
    basic::{self, AUTO_RIS_CANDIDATES, RIS_CANDIDATES},
    knob::{Knobs, ON_OR_OFF, parameters},
    pilot::{Piloted, Tables},
    rays::RaySteps,
    regions::cell_edges,
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, DescriptorSet, Device},
    pass::{Surfaces, Technique},
    scene::Scene,
    shader::{
        constants::{CONSTANT_CANDIDATES, CONSTANT_COMPENSATION},
        rooms::control_variates::{
            CONSTANT_CONTROL_BITS, CONSTANT_CONTROL_CHOICE, CONSTANT_CONTROL_SHARE,
            CONSTANT_RECORD_EDGE, CONSTANT_RECORD_LARGEST_EDGE, CONSTANT_RECORD_SIDE,
            RECORD_COUNTS, RECORD_VISIBILITIES, TABLE, VISIBILITY_RECORDS,
        },
    },
};

/// Rays of all records together that a record leans on, where it has counted little itself.
const PRIOR_RAYS: f32 = 2.0;

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

/// The cubes and bins of visibility records. Places and directions find theirs by
/// `glsl/control_variates/records.glsl`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordGrid {
    /// Bins along each side of the square of directions.
    pub side: u32,
    /// Edge of a cube per metre of distance to the camera.
    pub edge_per_distance: f32,
    /// Largest edge, metres.
    pub largest_edge: f32,
}

impl RecordGrid {
    /// Returns the grid for the scene's camera and film.
    pub fn new(scene: &Scene, parameters: &ControlVariatesParameters) -> Self {
        let [edge_per_distance, largest_edge] = cell_edges(scene, parameters.record_pixels as f32);
        Self { side: parameters.record_side, edge_per_distance, largest_edge }
    }

    /// Number of entries of all records.
    pub fn entries(&self) -> usize {
        (VISIBILITY_RECORDS * self.side * self.side) as usize
    }

    /// Specialization constants of the passes over records.
    pub fn constants(&self) -> [(u32, u32); 3] {
        [
            (CONSTANT_RECORD_SIDE, self.side),
            (CONSTANT_RECORD_EDGE, self.edge_per_distance.to_bits()),
            (CONSTANT_RECORD_LARGEST_EDGE, self.largest_edge.to_bits()),
        ]
    }

    /// Expected visibility of all entries from their rays and visible rays. A record that has counted n
    /// rays in a bin, v of them visible, expects (v + 2 s) / (n + 2), with s the share of all records
    /// in that bin: never 0 or 1 unless all agree.
    ///
    /// # Panics
    /// There are not two counts for every entry.
    pub fn expected(&self, counts: &[[u32; 2]]) -> Vec<f32> {
        assert_eq!(counts.len(), self.entries(), "two counts for every entry");
        let bins = (self.side * self.side) as usize;
        let mut of_bin = vec![[0_u64; 2]; bins];
        for record in counts.chunks(bins) {
            for (sum, count) in of_bin.iter_mut().zip(record) {
                sum[0] += u64::from(count[0]);
                sum[1] += u64::from(count[1]);
            }
        }
        let share = |[rays, visible]: [f32; 2], prior: f32| {
            (visible + PRIOR_RAYS * prior) / (rays + PRIOR_RAYS)
        };
        let [rays, visible] =
            of_bin.iter().fold([0.0; 2], |sum, of| [sum[0] + of[0] as f32, sum[1] + of[1] as f32]);
        let of_all = share([rays, visible], 0.5);
        let priors: Vec<f32> =
            of_bin.iter().map(|count| share(count.map(|rays| rays as f32), of_all)).collect();
        let expect = |(index, count): (usize, &[u32; 2])| {
            share(count.map(|rays| rays as f32), priors[index % bins])
        };
        counts.iter().enumerate().map(expect).collect()
    }
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
