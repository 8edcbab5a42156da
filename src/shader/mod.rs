//! Everything that Rust and GLSL share, declared once: numbers, structs, buffers, and the SPIR-V that
//! `build.rs` compiles against them.

pub mod bindings;
pub mod constants;
pub mod spirv;
pub mod structs;
