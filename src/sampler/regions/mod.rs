//! Regions of directions and of space, for techniques that learn by them.
//!
//! [`Partition`] splits the environment into rectangles of its sampling cells, with an alias table each.
//! [`cell_edges`] says how large cells of the scene are that look alike in the picture.

mod cells;
mod partition;
mod split;

pub use cells::{FACE_COUNT, face_normal};
pub(super) use cells::{bounds_of, cell_edges};
pub use partition::{MAX_REGIONS, Partition, Region};
pub use split::{PARENT_COUNT, Rectangle};
