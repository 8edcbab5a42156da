//! What Rust and GLSL share, declared once.

pub mod constants;
pub mod spirv;
pub mod structs;
