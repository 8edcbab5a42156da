//! Mathematics without a subject of its own: frames, random numbers, colour, packed directions, alias
//! tables.

pub mod alias;
pub mod colour;
pub mod frame;
pub mod octahedron;
pub mod random;
pub(crate) mod refinement;
