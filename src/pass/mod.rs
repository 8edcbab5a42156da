//! One file per dispatch: name = `glsl/<name>.comp` = debug label = timer row.

pub mod geometry;
pub mod shadow;
pub mod trace;
