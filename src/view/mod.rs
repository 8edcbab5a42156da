//! A window in which a scene refines while the camera moves.
//!
//! The window's thread turns events into `message::Input`; the rendering thread owns everything of Vulkan.
//! It renders by the same [`Renderer`](crate::session::Renderer) as `fenestra render`: through a camera at
//! rest the whole film, through one that moves a small one. `docs/view.md` describes it and its keys.

pub mod camera;
mod controls;
pub mod keys;
mod message;
mod overlay;
mod panel;
pub(crate) mod projector;
mod save;
mod side;
mod window;
mod worker;

pub(crate) use window::Display;
pub use window::Options;
