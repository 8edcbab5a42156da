//! Mathematics of scenes: frames, colour, a square map of the sphere, random numbers.

pub mod colour;
pub(crate) mod cumulative;
pub mod equal_area;
pub mod frame;
pub(crate) mod keys;
pub mod random;
