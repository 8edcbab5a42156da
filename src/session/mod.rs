//! A render that finishes by itself: scene, settings and device → sums and files.
//!
//! A [`Renderer`] adds samples to a film. A [`Session`] drives it: passes until one of its [`Rules`] is
//! met, [`Event`]s to an [`Observer`], checkpoints, resume, metadata and statistics. The commands
//! `render`, `study` and `view` and `docs/examples` are programs around it.

pub mod pixel;
mod progress;
mod renderer;
mod run;
mod settings;
mod statistics;
mod stop;

pub use renderer::Renderer;
pub(crate) use run::describe;
pub use run::{Event, Observer, Session};
pub use settings::{DEFAULT_DEPTH, Settings, parse_size, traced_window, window_of};
pub use statistics::Figures;
pub use stop::{Flag, Limit, Quality, Rules, Standing, StopReason, parse_duration};
