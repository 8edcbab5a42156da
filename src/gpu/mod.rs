//! Vulkan on the host: one concept per file, and the only module with `unsafe` code.

#![expect(unsafe_code, reason = "raw Vulkan calls are unsafe; each block states why it is sound")]

pub mod buffer;
pub mod capabilities;
pub mod commands;
pub mod descriptors;
pub mod device;
pub mod instance;
pub(crate) mod labels;
pub mod pipeline;
mod pipeline_cache;
mod set_layouts;
pub mod swapchain;
pub(crate) mod timestamps;
mod transfer;

pub use buffer::Buffer;
pub use capabilities::Capabilities;
pub use commands::Commands;
pub use descriptors::DescriptorSet;
pub use device::Device;
pub use pipeline::Pipeline;
pub use swapchain::{Presented, Swapchain};
pub use timestamps::PassTimes;

use crate::error::Error;

/// Returns the [`Error::Vulkan`] for a failed call.
fn vulkan_error(call: &str, result: ash::vk::Result) -> Error {
    Error::Vulkan { call: call.to_owned(), result: result.to_string() }
}
