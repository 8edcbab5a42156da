//! Storage buffers.

use std::{
    slice,
    sync::{Arc, atomic::AtomicU32},
};

use ash::vk;
use gpu_allocator::{
    AllocationError, MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme},
};

use super::{device::Device, labels, vulkan_error};
use crate::{
    error::{Error, Result},
    memory,
};

/// A named storage buffer in device memory, which lives as long as any of its clones.
#[derive(Clone)]
pub struct Buffer(Arc<Owned>);

struct Owned {
    raw: vk::Buffer,
    size: u64,
    name: String,
    allocation: Option<Allocation>,
    device: Arc<Device>,
}

impl Buffer {
    /// Creates a storage buffer of `size` bytes (at least 16) with undefined content.
    ///
    /// # Errors
    /// [`Error::Device`] if `size` exceeds the device's range of a storage buffer;
    /// [`Error::Memory`] if memory runs out, [`Error::Vulkan`] if a call fails.
    pub fn new(device: &Arc<Device>, name: &str, size: u64) -> Result<Self> {
        let allowed = device.capabilities().max_storage_buffer_range;
        if size > allowed {
            return Err(Error::Device {
                reason: format!(
                    "buffer {name} needs {size} bytes, but {} allows {allowed} bytes for one \
                     storage buffer",
                    device.capabilities().name
                ),
                help: "choose another device with --device, or a smaller scene, map or film".into(),
            });
        }
        Self::with_location(
            device,
            name,
            size,
            MemoryLocation::GpuOnly,
            vk::BufferUsageFlags::STORAGE_BUFFER
                | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
                | vk::BufferUsageFlags::TRANSFER_SRC
                | vk::BufferUsageFlags::TRANSFER_DST,
        )
    }

    /// Creates a buffer of `size` bytes, at least 16 and a multiple of 4, bound to memory of its own.
    pub(super) fn with_location(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        location: MemoryLocation,
        usage: vk::BufferUsageFlags,
    ) -> Result<Self> {
        let size = size.max(16).next_multiple_of(4);
        let asker = || format!("buffer {name} on {}", device.capabilities().name);
        if device.capabilities().is_software() {
            memory::check(asker(), size).map_err(Error::memory)?;
        }
        let info = vk::BufferCreateInfo::default()
            .size(size)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the device is alive and `info` valid.
        let raw = unsafe { device.raw.create_buffer(&info, None) }
            .map_err(|result| failed_buffer(&asker(), size, "vkCreateBuffer", result))?;
        // SAFETY: `raw` was just created from this device.
        let requirements = unsafe { device.raw.get_buffer_memory_requirements(raw) };
        // From here on `Drop` cleans up.
        let (name, device) = (name.to_owned(), Arc::clone(device));
        let mut owned = Owned { raw, size, name, allocation: None, device };
        let (name, device) = (&owned.name, &owned.device);
        let allocation = device
            .allocator()
            .as_mut()
            .ok_or_else(|| vulkan_error(name, vk::Result::ERROR_DEVICE_LOST))?
            .allocate(&AllocationCreateDesc {
                name,
                requirements,
                location,
                linear: true,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            })
            .map_err(|error| match error {
                AllocationError::OutOfMemory => out_of_memory(&asker(), size),
                other => Error::Vulkan {
                    call: format!("memory for buffer {name} ({size} bytes)"),
                    result: other.to_string(),
                },
            })?;
        // SAFETY: the allocation was made for this buffer's requirements and is bound once.
        unsafe { device.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) }
            .map_err(|result| failed_buffer(&asker(), size, "vkBindBufferMemory", result))?;
        labels::name_object(device, raw, name);
        owned.allocation = Some(allocation);
        Ok(Self(Arc::new(owned)))
    }

    pub(super) fn raw(&self) -> vk::Buffer {
        self.0.raw
    }

    pub(super) fn device(&self) -> &Arc<Device> {
        &self.0.device
    }

    /// Size in bytes.
    pub(crate) fn size(&self) -> u64 {
        self.0.size
    }

    /// Name shown by debug tools and memory reports.
    pub(crate) fn name(&self) -> &str {
        &self.0.name
    }

    /// Returns the words of a buffer whose memory the host shares with the device, as software devices do.
    /// The device must not be at work on it. Fails if the host does not see the memory.
    pub(crate) fn words(&self) -> Result<&[AtomicU32]> {
        let start = self.0.allocation.as_ref().and_then(Allocation::mapped_ptr);
        let start = start.ok_or_else(|| self.unmapped())?.cast::<AtomicU32>();
        // SAFETY: the allocation is mapped as long as it lives, which is as long as `self`; it is aligned
        // for storage buffers and holds `size` bytes, a multiple of 4. Any bits are a word, and threads
        // of the host share atomic words. Submissions are waited for, so the device is not at work.
        Ok(unsafe { slice::from_raw_parts(start.as_ptr(), (self.size() / 4) as usize) })
    }

    /// Returns the memory of a buffer that the host sees and that has no clones.
    pub(super) fn mapped(&mut self) -> Result<&mut [u8]> {
        let error = self.unmapped();
        let allocation = Arc::get_mut(&mut self.0).and_then(|owned| owned.allocation.as_mut());
        allocation.and_then(Allocation::mapped_slice_mut).ok_or(error)
    }

    fn unmapped(&self) -> Error {
        Error::Vulkan {
            call: format!("mapping of {}", self.name()),
            result: "memory is not visible to the host".into(),
        }
    }
}

impl Drop for Owned {
    fn drop(&mut self) {
        // SAFETY: every submission has been waited for, so the device no longer uses the buffer.
        unsafe { self.device.raw.destroy_buffer(self.raw, None) };
        if let (Some(allocator), Some(allocation)) =
            (self.device.allocator().as_mut(), self.allocation.take())
            && let Err(error) = allocator.free(allocation)
        {
            log::error!("memory of buffer {} was not freed: {error}", self.name);
        }
    }
}

fn out_of_memory(asker: &str, size: u64) -> Error {
    let size = memory::size(size);
    Error::Memory {
        message: format!("the device is out of memory: {asker} asks for {size}"),
        help: Some("make the scene or the film smaller, or choose another device with --device"),
    }
}

/// Makes an error of a failed call; running out of memory is one of its own.
fn failed_buffer(asker: &str, size: u64, call: &str, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            out_of_memory(asker, size)
        }
        other => vulkan_error(&format!("{call} ({asker})"), other),
    }
}
