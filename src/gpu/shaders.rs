//! SPIR-V of the passes, compiled by `build.rs`.

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
