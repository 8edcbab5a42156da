//! Shared by Rust and GLSL: constants, structs, buffers, and the SPIR-V that `build.rs` compiles.

pub mod bindings;
pub mod constants;
pub mod spirv;
pub mod structs;
