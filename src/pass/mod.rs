//! Passes of the path tracer: kernels, their order, the runner that records them, and shared buffers.
//!
//! A pass is one dispatch; the name of its `.comp` file is also its debug label and its row in the
//! timings. [`order::wave_order`] lists the passes of a wave; a [`Technique`] adds those of a sampler.

pub(crate) mod compilers;
pub(crate) mod explanation;
pub(crate) mod film_buffers;
pub mod geometry;
mod host_parts;
pub mod host_tracer;
pub mod kernel;
pub(crate) mod lamp_cells;
pub mod lamps;
pub mod order;
mod passages;
pub mod recording;
pub mod runner;
pub mod scene_buffers;
pub mod sharing;
pub mod steps;
pub mod surfaces;
pub mod technique;
pub(crate) mod texture_buffers;
mod totals;
pub(crate) mod wave_buffers;

pub(crate) use explanation::{Explanation, LobeReadback, PixelReadback, RayReadback};
pub(crate) use film_buffers::BLOCK_PIXELS;
pub use geometry::{GeometryBuffers, Schedule};
pub(crate) use kernel::Domain;
pub use kernel::{Dispatch, Kernel, Pass};
pub use order::{PassSettings, PathLists, WaveOrder, wave_order};
pub use recording::Recording;
pub(crate) use runner::{Runner, Watch};
pub use scene_buffers::SceneBuffers;
pub(crate) use steps::SHADOW_RAYS_PER_GROUP;
pub use steps::{Passes, PathDemand, Roulette, Steps};
pub use surfaces::Surfaces;
pub(crate) use technique::{Progress, Report, Saved, Technique};
pub use totals::Totals;
pub use wave_buffers::WaveBuffers;
