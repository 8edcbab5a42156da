//! Shared by the tests: temporary folders, files to read, and mutations of them.

pub mod folder;
pub mod fuzz;
pub mod gltf;
pub mod seeds;
pub mod tensor;
