//! Passes of the path tracer: kernels, their order, the runner that records them, and shared buffers.
//!
//! A pass is one dispatch; the name of its `.comp` file is also its debug label and its row in the
//! timings. [`order::wave_order`] lists the passes of a wave; a [`Technique`] adds those of a sampler.

pub mod explanation;
pub mod film_buffers;
pub mod geometry;
pub mod kernel;
pub mod lamps;
pub mod order;
pub mod roulette;
pub mod runner;
pub mod scene_buffers;
pub mod sharing;
pub mod sharing_buffers;
pub mod steps;
pub mod surfaces;
pub mod technique;
pub mod texture_buffers;
mod totals;
pub mod wave_buffers;

pub use explanation::{Explanation, RecordedLobe, RecordedPixel, RecordedRay};
pub use film_buffers::BLOCK_PIXELS;
pub use geometry::{GeometryBuffers, Schedule};
pub use kernel::{Dispatch, Domain, Kernel, Pass};
pub use order::{PassSettings, PathLists, wave_order};
pub use roulette::Roulette;
pub use runner::{Runner, Watch};
pub use scene_buffers::SceneBuffers;
pub use steps::{Passes, PathDemand, SHADOW_RAYS_PER_GROUP, Steps};
pub use surfaces::Surfaces;
pub use technique::{Progress, Report, Saved, Technique};
pub use texture_buffers::{TextureAccess, TextureBuffers};
pub use totals::Totals;
pub use wave_buffers::WaveBuffers;
