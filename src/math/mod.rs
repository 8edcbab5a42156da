//! Mathematics that several stages share: that of scenes (frames, random numbers, colour, a square map of
//! the sphere), packed directions, rectangles seen from a point, alias tables and the order of refinement.

pub mod alias;
pub mod octahedron;
pub(crate) mod refinement;
pub mod spherical_rectangle;

pub use fenestra_scene::math::{colour, equal_area, frame, random};
