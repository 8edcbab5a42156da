//! Sampler `guided`: learns visibility and reflection between passes.
//!
//! The environment is split into up to 1024 rectangles of its sampling cells ([`Partition`]);
//! within a rectangle, directions are drawn exactly in proportion to the map. The [`Guide`] learns
//! how often each rectangle is visible from each cell of the scene and how strongly the surfaces
//! there reflect it: passes count rays, and between passes [`Estimates`] turns the counts into the
//! probabilities that the next passes read. It learns from bounce rays where light arrives from
//! other surfaces ([`ArrivingLight`]). Now and then the environment is split again, into more
//! rectangles and finely where the scene sees it.
//!
//! A pass reads only tables learned by earlier passes ([`Snapshot`]). Its samples are therefore
//! independent of the tables, and every estimate stays unbiased (Vévoda et al. 2018 learn light
//! sources in this way).
//!
//! Rectangles, counts → `guide_regions`, `guide_entries`, `guide_arriving` on the device; shaders
//! `sample_guided` and `bounce_guided`.

mod arrival_buffers;
mod arriving;
mod budget;
mod buffers;
mod cells;
mod choice;
pub mod cost;
mod counts;
mod entries;
mod epoch;
mod estimate;
mod guide;
mod key;
mod parameters;
mod partition;
mod record;
mod recorded_cell;
mod share;
mod snapshot;
mod split;
mod state;
mod steps;
mod technique;

pub use arriving::{ARRIVAL_DIRECTIONS, ArrivalWords, ArrivingLight, Reflected, arrival_direction};
pub use buffers::{GuideBuffers, GuideSize};
pub use cells::MAX_CELLS;
pub use counts::{Count, CountWords, PARTS_PER_RAY};
pub use entries::{decode_entry, decode_visibility};
pub use estimate::Estimates;
pub use guide::Guide;
pub use key::{CellKey, FACE_COUNT, face_normal};
pub use parameters::GuidedParameters;
pub use partition::{MAX_REGIONS, Partition, Region};
pub use record::{GuidedRay, RecordedGuide, RecordedRay};
pub use recorded_cell::{CellLevel, RecordedCell, RecordedRegion};
pub use share::{SHARE_WORDS, ShareEvidence, share_in_256ths};
pub use snapshot::Snapshot;
pub use split::PARENT_COUNT;
pub use state::{GuideState, Origin};
pub use steps::GuidedSteps;
pub use technique::Guided;
pub(super) use technique::GuidedRoom;
