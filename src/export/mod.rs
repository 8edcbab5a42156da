//! Writers of scenes for other renderers: validated [`crate::scene::Scene`] → files.

pub mod mitsuba;
mod ply;
