//! Storage buffers, uploads and downloads.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::{
    MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme},
};

use super::{commands::Commands, device::Device, labels, vulkan_error};
use crate::error::{Error, Result};

/// Maximum size of one staging copy between host and device, bytes.
const STAGING_BYTES: usize = 16 << 20;

/// A named storage buffer in device memory.
pub struct Buffer {
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
    /// [`Error::Vulkan`] if memory runs out.
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

    /// Creates a buffer that holds `data` and is read only as a uniform texel buffer, so the limit
    /// on storage buffers does not apply. The descriptor set checks the number of texels.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if memory runs out.
    pub fn texels_from_slice<T: Pod>(device: &Arc<Device>, name: &str, data: &[T]) -> Result<Self> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = Self::with_location(
            device,
            name,
            bytes.len() as u64,
            MemoryLocation::GpuOnly,
            vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
                | vk::BufferUsageFlags::TRANSFER_SRC
                | vk::BufferUsageFlags::TRANSFER_DST,
        )?;
        buffer.upload(bytes)?;
        Ok(buffer)
    }

    /// Creates a storage buffer that holds `data`.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn from_slice<T: Pod>(device: &Arc<Device>, name: &str, data: &[T]) -> Result<Self> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = Self::new(device, name, bytes.len() as u64)?;
        buffer.upload(bytes)?;
        Ok(buffer)
    }

    /// Creates a storage buffer filled with zeros.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn zeroed(device: &Arc<Device>, name: &str, size: u64) -> Result<Self> {
        let buffer = Self::new(device, name, size)?;
        let mut commands = Commands::begin(device)?;
        commands.fill(&buffer, 0);
        commands.submit_and_wait()?;
        Ok(buffer)
    }

    fn with_location(
        device: &Arc<Device>,
        name: &str,
        size: u64,
        location: MemoryLocation,
        usage: vk::BufferUsageFlags,
    ) -> Result<Self> {
        let size = size.max(16).next_multiple_of(4);
        let info = vk::BufferCreateInfo::default()
            .size(size)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the device is alive and `info` valid.
        let raw = unsafe { device.raw().create_buffer(&info, None) }
            .map_err(|result| vulkan_error(&format!("vkCreateBuffer({name})"), result))?;
        // SAFETY: `raw` was just created from this device.
        let requirements = unsafe { device.raw().get_buffer_memory_requirements(raw) };
        // From here on `Drop` cleans up.
        let mut buffer =
            Self { raw, size, name: name.to_owned(), allocation: None, device: Arc::clone(device) };
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
            .map_err(|error| Error::Vulkan {
                call: format!("memory for buffer {name} ({size} bytes)"),
                result: error.to_string(),
            })?;
        // SAFETY: the allocation was made for this buffer's requirements and is bound once.
        unsafe { device.raw().bind_buffer_memory(raw, allocation.memory(), allocation.offset()) }
            .map_err(|result| vulkan_error(&format!("vkBindBufferMemory({name})"), result))?;
        buffer.allocation = Some(allocation);
        labels::name_object(device, raw, name);
        Ok(buffer)
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Name shown by debug tools and memory reports.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// Copies `bytes` into the buffer, from its start.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails.
    ///
    /// # Panics
    /// If `bytes` does not fit, which is a bug in the caller.
    pub fn upload(&self, bytes: &[u8]) -> Result<()> {
        assert!(bytes.len() as u64 <= self.size, "upload into {} is too long", self.name);
        if bytes.is_empty() {
            return Ok(());
        }
        let mut staging = Self::with_location(
            &self.device,
            "staging (upload)",
            bytes.len().min(STAGING_BYTES) as u64,
            MemoryLocation::CpuToGpu,
            vk::BufferUsageFlags::TRANSFER_SRC,
        )?;
        for (index, piece) in bytes.chunks(STAGING_BYTES).enumerate() {
            staging.mapped()?[..piece.len()].copy_from_slice(piece);
            let mut commands = Commands::begin(&self.device)?;
            commands.copy(
                &staging,
                0,
                self,
                (index * STAGING_BYTES) as u64,
                piece.len().next_multiple_of(4) as u64,
            );
            commands.submit_and_wait()?;
        }
        Ok(())
    }

    /// Downloads the first `length` elements.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails.
    ///
    /// # Panics
    /// If the buffer is shorter, which is a bug in the caller.
    pub fn download<T: Pod>(&self, length: usize) -> Result<Vec<T>> {
        let mut result = Vec::with_capacity(length);
        self.download_pieces(length, |piece| result.extend_from_slice(piece))?;
        Ok(result)
    }

    /// Downloads the first `length` elements and passes them to `take` in order, piece by piece.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails.
    ///
    /// # Panics
    /// If the buffer is shorter, which is a bug in the caller.
    pub fn download_pieces<T: Pod>(&self, length: usize, mut take: impl FnMut(&[T])) -> Result<()> {
        let bytes = length * size_of::<T>();
        assert!(bytes as u64 <= self.size, "download from {} is too long", self.name);
        if bytes == 0 {
            return Ok(());
        }
        let longest = STAGING_BYTES / size_of::<T>() * size_of::<T>();
        let mut staging = Self::with_location(
            &self.device,
            "staging (download)",
            bytes.min(longest) as u64,
            MemoryLocation::GpuToCpu,
            vk::BufferUsageFlags::TRANSFER_DST,
        )?;
        for first in (0..bytes).step_by(longest) {
            let piece = longest.min(bytes - first);
            let mut commands = Commands::begin(&self.device)?;
            let copied = piece.next_multiple_of(4) as u64;
            commands.copy(self, first as u64, &staging, 0, copied);
            commands.make_visible_to_host();
            commands.submit_and_wait()?;
            take(bytemuck::cast_slice(&staging.mapped()?[..piece]));
        }
        Ok(())
    }

    fn mapped(&mut self) -> Result<&mut [u8]> {
        self.allocation.as_mut().and_then(Allocation::mapped_slice_mut).ok_or_else(|| {
            Error::Vulkan {
                call: format!("mapping of {}", self.name),
                result: "memory is not visible to the host".into(),
            }
        })
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: every submission has been waited for, so the device no longer uses the buffer.
        unsafe { self.device.raw().destroy_buffer(self.raw, None) };
        if let (Some(allocator), Some(allocation)) =
            (self.device.allocator().as_mut(), self.allocation.take())
            && let Err(error) = allocator.free(allocation)
        {
            log::error!("memory of buffer {} was not freed: {error}", self.name);
        }
    }
}
