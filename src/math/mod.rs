//! Mathematics that several stages share: that of scenes (frames, random numbers, colour, a square map of
//! the sphere), packed directions, alias tables and the order of refinement.

pub mod alias;
pub mod octahedron;
pub(crate) mod refinement;

pub use fenestra_scene::math::{colour, equal_area, frame, random};
