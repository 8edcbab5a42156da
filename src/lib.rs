//! Fenestra: a physically based renderer for scenes lit by an environment map, in Vulkan compute.
//!
//! Modules stand in pipeline order:
//!
//! | stage | module | shader |
//! |---|---|---|
//! | scene file → validated [`scene::Scene`] | [`scene`], [`brdf`] | |
//! | triangles → wide BVH | [`accel`] | `include/bvh.glsl` |
//! | scene → device buffers | [`gpu`] | `include/layout.glsl` |
//! | progressive passes | [`pass`] | `camera`, `trace`, `sample`, `shadow`, `gather`, `bounce`, `accumulate` |
//! | sums → image files | [`film`] | |
//! | comparisons | [`study`] | |
//!
//! Notation: directions point away from the surface; `outgoing_direction` leads to the viewer,
//! `incident_direction` to the light; names that end in `_local` are in the shading frame, whose
//! z axis is the shading normal. Densities (`pdf`) are per steradian unless named otherwise.
//! Radiance is linear Rec.709.

pub mod accel;
pub mod benchmark;
pub mod brdf;
pub mod cache;
pub mod cli;
pub mod command;
pub mod error;
pub mod film;
pub mod fit;
pub mod frame;
pub mod gpu;
pub mod pass;
pub mod random;
pub mod renderer;
pub mod sampler;
pub mod scene;
pub mod srbf;
pub mod study;

pub use error::{Error, Result};
