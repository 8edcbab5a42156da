//! The Vulkan host; the only module with `unsafe` code. One Vulkan concept per file.

pub mod constants;
pub mod layout;
pub mod shaders;
