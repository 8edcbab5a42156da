//! Vulkan on the host: one concept per file, and the only module with `unsafe` code.

#![expect(unsafe_code, reason = "raw Vulkan calls are unsafe; each block states why it is sound")]

pub mod buffer;
pub mod commands;
pub mod descriptors;
pub mod device;
pub mod instance;
pub(crate) mod labels;
pub mod pipeline;
pub(crate) mod timestamps;

pub use buffer::Buffer;
pub use commands::{Commands, PassTimes};
pub use descriptors::DescriptorSet;
pub use device::{Capabilities, Device};
pub use pipeline::Pipeline;

use crate::error::Error;

/// Returns the [`Error::Vulkan`] for a failed call.
fn vulkan_error(call: &str, result: ash::vk::Result) -> Error {
    Error::Vulkan { call: call.to_owned(), result: result.to_string() }
}
