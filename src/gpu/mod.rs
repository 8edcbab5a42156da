//! Vulkan on the host, and the libraries of the denoiser and of the host's tracer: one concept per file, and
//! the only module with `unsafe` code.

#![expect(unsafe_code, reason = "calls of C are unsafe; each block states why it is sound")]

pub mod buffer;
pub mod capabilities;
pub mod commands;
pub(crate) mod denoiser;
pub(crate) mod descriptors;
pub mod device;
pub(crate) mod embree;
pub(crate) mod embree_rays;
pub(crate) mod embree_scene;
pub mod instance;
pub(crate) mod labels;
pub(crate) mod lavapipe;
mod library;
pub mod pipeline;
mod pipelines;
mod set_layouts;
pub(crate) mod swapchain;
pub(crate) mod timestamps;
mod transfer;

pub use buffer::Buffer;
pub use capabilities::Capabilities;
pub use commands::Commands;
pub(crate) use commands::MOST_INVOCATIONS;
pub(crate) use denoiser::Denoiser;
pub use descriptors::DescriptorSet;
pub use device::{Device, Tracer};
pub(crate) use embree::Embree;
pub use pipeline::Pipeline;
pub(crate) use swapchain::{Presented, Swapchain};
pub(crate) use timestamps::PassTimes;

use crate::error::{Error, Result};

/// Result of a call of Vulkan.
trait Called<T> {
    /// Names the call in the error, as [`vulkan_error`] does.
    fn called(self, call: &str) -> Result<T>;
}

impl<T> Called<T> for ash::prelude::VkResult<T> {
    fn called(self, call: &str) -> Result<T> {
        self.map_err(|result| vulkan_error(call, result))
    }
}

/// Returns the [`Error::Vulkan`] for a failed call, or [`Error::Device`] for a lost device.
fn vulkan_error(call: &str, result: ash::vk::Result) -> Error {
    if result == ash::vk::Result::ERROR_DEVICE_LOST {
        return Error::Device {
            reason: format!("Vulkan: {call} failed: the device is lost"),
            help:
                "the driver crashed, was reset or was replaced: try again, with another --device \
                   or a newer driver; --resume continues from the last checkpoint, which long renders \
                   write every minute"
                    .into(),
        };
    }
    Error::Vulkan { call: call.to_owned(), result: result.to_string() }
}
