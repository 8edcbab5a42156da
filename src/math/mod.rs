//! Mathematics that several stages share: frames, random numbers, colour, packed directions, a square map
//! of the sphere, rectangles seen from a point, alias tables and the order of refinement.

pub mod alias;
pub mod colour;
pub mod equal_area;
pub mod frame;
pub mod octahedron;
pub mod random;
pub(crate) mod refinement;
pub mod spherical_rectangle;
