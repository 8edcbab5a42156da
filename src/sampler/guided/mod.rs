//! Learned visibility: the sampler `guided` as tables.
//!
//! The environment is split into up to 1024 rectangles of its sampling cells
//! ([`Partition`]); within a rectangle directions are drawn exactly in proportion to the map. What
//! is learned is how often each rectangle is visible from each cell of the scene and how its surfaces
//! reflect it: passes count, and between passes [`Estimates`] turns the counts into the probabilities that the next passes read.
//! Where light arrives from by way of surfaces is learned from bounce rays ([`ArrivingLight`]).
//! Now and then the environment is split anew, finely where the scene sees it, and into more of them.
//! A pass reads only what earlier passes learned, so that its samples are independent of what they
//! read and every estimate stays unbiased (Vévoda et al. 2018 learn light sources in this way).
//!
//! Rectangles, counts → `guide_regions`, `guide_entries`, `guide_arriving` on the device; shaders
//! `sample_guided` and `bounce_guided`.

mod arriving;
pub mod cost;
mod estimate;
mod key;
mod learned;
mod partition;
mod share;
mod split;
mod state;

pub use arriving::{ARRIVAL_DIRECTIONS, ArrivalWords, ArrivingLight, Reflected, arrival_direction};
pub use estimate::{
    Count, CountWords, Estimates, PARTS_PER_RAY, VISIBILITY_LEVELS, decode_entry, decode_visibility,
};
pub use key::{CellKey, FACE_COUNT, face_normal};
pub use learned::{Learned, MOST_CELLS, Snapshot};
pub use partition::{MOST_REGIONS, PARENT_COUNT, Partition, Region};
pub use share::{SHARE_WORDS, ShareEvidence, share_in_256ths};
pub use state::{GuideState, Origin};
