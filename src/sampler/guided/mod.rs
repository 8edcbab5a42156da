//! Sampler `guided`: learns visibility and reflection between passes.
//!
//! Splits the environment into up to 1024 rectangles of its sampling cells
//! ([`Partition`](super::regions::Partition)) and draws directions within a rectangle exactly in
//! proportion to the map. The [`Guide`] learns how often each rectangle is visible from each cell of
//! the scene, and how strongly the surfaces there reflect it: passes count rays, and between passes
//! [`Estimates`] turns the counts into probabilities for the next ones. From bounce rays it learns
//! where light arrives from other surfaces ([`ArrivingLight`]). Now and then it splits the environment
//! again, into more rectangles, finely where the scene sees it.
//!
//! A pass reads only tables learned by earlier passes ([`Snapshot`]). Its samples are therefore
//! independent of them and every estimate stays unbiased, as in Vévoda et al. 2018 for light sources.
//!
//! Rectangles, counts → `guide_regions`, `guide_entries`, `guide_arriving`, read by `sample_guided`
//! and `bounce_guided`.

pub mod arm;
mod arriving;
mod budget;
mod buffers;
mod cell_readback;
mod cells;
pub mod cost;
mod counts;
mod entries;
mod epoch;
mod estimate;
mod guide;
mod key;
mod packing;
mod parameters;
mod race;
mod readback;
mod share;
mod snapshot;
mod state;
mod steps;
mod technique;

pub use arm::Arm;
pub use arriving::{ARRIVAL_DIRECTIONS, ArrivalWords, ArrivingLight, Reflected};
pub use buffers::{GuideBuffers, GuideSize};
pub use cell_readback::{CellReadback, RegionReadback};
pub use cells::MAX_CELLS;
pub use counts::{Count, CountWords, PARTS_PER_RAY};
pub use entries::{decode_entry, decode_visibility, ratios};
pub use epoch::with_epoch;
pub use estimate::Estimates;
pub use guide::Guide;
pub use key::CellKey;
pub use parameters::GuidedParameters;
pub use readback::{GuideReadback, GuidedRay};
pub use share::{SHARE_WORDS, ShareEvidence, share_in_256ths};
pub use snapshot::Snapshot;
pub use state::{GuideState, Origin};
pub use steps::GuidedSteps;
pub use technique::Guided;
pub(super) use technique::GuidedRoom;
