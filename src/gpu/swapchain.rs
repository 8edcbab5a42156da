//! Pictures in a window: surface, swapchain, and the copy of a buffer to the window.
//!
//! Everything is waited for, as in the rest of the program: an image is acquired, filled and handed to
//! the display one after the other, by one thread.

use std::sync::Arc;

use ash::{khr, vk};
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::{
    Called,
    buffer::Buffer,
    commands::Commands,
    device::{Device, cannot_present},
    vulkan_error,
};
use crate::error::{Error, Result};

/// Longest wait for an image to draw on, nanoseconds: a hidden window may give none.
const ACQUIRE_TIMEOUT: u64 = 200_000_000;

/// A window of any toolkit.
pub(crate) trait Target: HasWindowHandle + HasDisplayHandle + Send + Sync {}

impl<T: HasWindowHandle + HasDisplayHandle + Send + Sync> Target for T {}

/// Outcome of [`Swapchain::present`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Presented {
    /// Shown, unless the display had no room for it: the next one may be shown.
    Done,
    /// The window has another size now: [`Swapchain::resize`] comes first.
    Outdated,
    /// The window's surface is gone: [`Swapchain::renew`] comes first.
    Lost,
}

pub(crate) struct Swapchain {
    surfaces: khr::surface::Instance,
    functions: khr::swapchain::Device,
    surface: vk::SurfaceKHR,
    raw: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    /// Width and height of the images; zeros while nothing can be shown.
    pub(crate) size: [u32; 2],
    /// True if the bytes of a pixel are blue, green, red, else red, green, blue; the fourth is unused.
    pub(crate) is_bgra: bool,
    acquired: vk::Fence,
    device: Arc<Device>,
    // Last: the window must outlive its surface.
    window: Arc<dyn Target>,
}

impl Swapchain {
    /// Makes images of `size` pixels for a window, on a device opened for its display. A size of zero
    /// shows nothing until [`Swapchain::resize`]. Fails with [`Error::Device`] if the device cannot show
    /// pictures there, with [`Error::Vulkan`] if a call fails.
    pub(crate) fn new(
        device: &Arc<Device>,
        window: Arc<dyn Target>,
        size: [u32; 2],
    ) -> Result<Self> {
        let instance = &device.instance;
        let surfaces = khr::surface::Instance::new(&instance.entry, &instance.raw);
        let functions = khr::swapchain::Device::new(&instance.raw, &device.raw);
        // From here on `Drop` cleans up.
        let mut swapchain = Self {
            surfaces,
            functions,
            surface: vk::SurfaceKHR::null(),
            raw: vk::SwapchainKHR::null(),
            images: Vec::new(),
            size: [0, 0],
            is_bgra: true,
            acquired: vk::Fence::null(),
            device: Arc::clone(device),
            window,
        };
        // SAFETY: the device is alive.
        swapchain.acquired =
            unsafe { device.raw.create_fence(&vk::FenceCreateInfo::default(), None) }
                .called("vkCreateFence")?;
        swapchain.renew(size)?;
        Ok(swapchain)
    }

    /// Makes a surface of the window, in place of one that was lost, and its images. Fails as
    /// [`Swapchain::new`].
    pub(crate) fn renew(&mut self, size: [u32; 2]) -> Result<()> {
        let no_handle = |error| Error::Device {
            reason: format!("the window has no handle for Vulkan: {error}"),
            help: "`fenestra render` needs no window".into(),
        };
        let display = self.window.display_handle().map_err(no_handle)?.as_raw();
        let handle = self.window.window_handle().map_err(no_handle)?.as_raw();
        self.drop_images();
        let instance = &self.device.instance;
        // SAFETY: the images of the old surface, if there was one, are gone. The handles are valid as long as
        // the window, which outlives the surface; the instance has the extensions of this display, which was
        // given to `Device::open_checked`.
        let surface = unsafe {
            self.surfaces.destroy_surface(self.surface, None);
            self.surface = vk::SurfaceKHR::null();
            ash_window::create_surface(&instance.entry, &instance.raw, display, handle, None)
        };
        self.surface = surface.called("surface of the window")?;
        // SAFETY: device, family and surface belong together.
        let presents = unsafe {
            self.surfaces.get_physical_device_surface_support(
                self.device.physical,
                self.device.queue_family(),
                self.surface,
            )
        };
        match presents {
            Ok(true) => self.resize(size),
            Ok(false) => Err(cannot_present(self.device.capabilities())),
            Err(result) => Err(vulkan_error("vkGetPhysicalDeviceSurfaceSupportKHR", result)),
        }
    }

    /// Makes images of another size; the display may insist on its own, see [`Swapchain::size`]. Fails as
    /// [`Swapchain::new`].
    pub(crate) fn resize(&mut self, [width, height]: [u32; 2]) -> Result<()> {
        let physical = self.device.physical;
        // SAFETY: device and surface belong together.
        let (limits, formats) = unsafe {
            (
                self.surfaces.get_physical_device_surface_capabilities(physical, self.surface),
                self.surfaces.get_physical_device_surface_formats(physical, self.surface),
            )
        };
        let limits = limits.called("vkGetPhysicalDeviceSurfaceCapabilitiesKHR")?;
        let formats = formats.called("vkGetPhysicalDeviceSurfaceFormatsKHR")?;
        // The passes apply the sRGB curve themselves, so the format must not.
        let is_plain = |format: &&vk::SurfaceFormatKHR| {
            matches!(format.format, vk::Format::B8G8R8A8_UNORM | vk::Format::R8G8B8A8_UNORM)
        };
        let format = *formats
            .iter()
            .find(is_plain)
            .ok_or_else(|| cannot_present(self.device.capabilities()))?;
        if !limits.supported_usage_flags.contains(vk::ImageUsageFlags::TRANSFER_DST) {
            return Err(cannot_present(self.device.capabilities()));
        }
        // Where the display does not fix the size, it says 2³² − 1.
        let fixed = limits.current_extent;
        let extent = if fixed.width == u32::MAX {
            let (low, high) = (limits.min_image_extent, limits.max_image_extent);
            vk::Extent2D {
                width: width.clamp(low.width, high.width),
                height: height.clamp(low.height, high.height),
            }
        } else {
            fixed
        };
        self.drop_images();
        if extent.width == 0 || extent.height == 0 || width == 0 || height == 0 {
            return Ok(());
        }
        let most = if limits.max_image_count == 0 { u32::MAX } else { limits.max_image_count };
        let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
        let alpha = if limits.supported_composite_alpha.contains(opaque) {
            opaque
        } else {
            vk::CompositeAlphaFlagsKHR::INHERIT
        };
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(self.surface)
            .min_image_count((limits.min_image_count + 1).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::TRANSFER_DST)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(limits.current_transform)
            .composite_alpha(alpha)
            // The one mode that every driver has.
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true);
        // SAFETY: the surface is alive and has no other swapchain.
        self.raw = unsafe { self.functions.create_swapchain(&info, None) }
            .called("vkCreateSwapchainKHR")?;
        // SAFETY: the swapchain was just created.
        self.images = unsafe { self.functions.get_swapchain_images(self.raw) }
            .called("vkGetSwapchainImagesKHR")?;
        self.size = [extent.width, extent.height];
        self.is_bgra = format.format == vk::Format::B8G8R8A8_UNORM;
        Ok(())
    }

    /// Shows the pixels of a buffer, four bytes each, row by row from the top. Fails if a call does otherwise
    /// than by the states in [`Presented`]. Panics if the buffer has fewer pixels than the images.
    pub(crate) fn present(&mut self, pixels: &Buffer) -> Result<Presented> {
        let [width, height] = self.size;
        if self.images.is_empty() {
            return Ok(Presented::Done);
        }
        assert!(pixels.size() >= 4 * u64::from(width) * u64::from(height), "a pixel for each");
        let raw = &self.device.raw;
        // SAFETY: the fence is not in use: every wait below ends before it is handed out again.
        let acquired = unsafe {
            self.functions.acquire_next_image(
                self.raw,
                ACQUIRE_TIMEOUT,
                vk::Semaphore::null(),
                self.acquired,
            )
        };
        let (index, is_suboptimal) = match acquired {
            Ok(acquired) => acquired,
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(Presented::Done),
            Err(result) => return outcome("vkAcquireNextImageKHR", result),
        };
        // SAFETY: the fence was handed to the call above, and is waited for before its reset.
        unsafe {
            raw.wait_for_fences(&[self.acquired], true, u64::MAX)
                .and_then(|()| raw.reset_fences(&[self.acquired]))
                .called("fence of an image of the window")?;
        }
        let image = self.images[index as usize];
        let mut commands = Commands::begin(&self.device)?;
        self.record_copy(&mut commands, pixels, image);
        commands.submit_and_wait()?;
        let (swapchains, indices) = ([self.raw], [index]);
        let info = vk::PresentInfoKHR::default().swapchains(&swapchains).image_indices(&indices);
        let queue = self.device.queue();
        // SAFETY: the image was acquired, and the commands that fill it have been waited for.
        let presented = unsafe { self.functions.queue_present(*queue, &info) };
        drop(queue);
        match presented {
            Ok(false) if !is_suboptimal => Ok(Presented::Done),
            Ok(_) => Ok(Presented::Outdated),
            Err(result) => outcome("vkQueuePresentKHR", result),
        }
    }

    /// Records the copy of `pixels` to an image, and makes this ready for the display.
    fn record_copy(&self, commands: &mut Commands, pixels: &Buffer, image: vk::Image) {
        let whole = vk::ImageSubresourceRange::default()
            .aspect_mask(vk::ImageAspectFlags::COLOR)
            .level_count(1)
            .layer_count(1);
        let image_barrier = vk::ImageMemoryBarrier::default()
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(whole);
        let before = image_barrier
            .dst_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let after = image_barrier
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .old_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
            .new_layout(vk::ImageLayout::PRESENT_SRC_KHR);
        let written = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE)
            .dst_access_mask(vk::AccessFlags::TRANSFER_READ);
        let [width, height] = self.size;
        let region = vk::BufferImageCopy::default()
            .image_subresource(
                vk::ImageSubresourceLayers::default()
                    .aspect_mask(vk::ImageAspectFlags::COLOR)
                    .layer_count(1),
            )
            .image_extent(vk::Extent3D { width, height, depth: 1 });
        let raw = &self.device.raw;
        // SAFETY: recording; buffer and image are large enough and kept alive by the caller.
        unsafe {
            raw.cmd_pipeline_barrier(
                commands.raw,
                vk::PipelineStageFlags::COMPUTE_SHADER,
                vk::PipelineStageFlags::TRANSFER,
                vk::DependencyFlags::empty(),
                &[written],
                &[],
                &[before],
            );
            raw.cmd_copy_buffer_to_image(
                commands.raw,
                pixels.raw(),
                image,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &[region],
            );
            raw.cmd_pipeline_barrier(
                commands.raw,
                vk::PipelineStageFlags::TRANSFER,
                vk::PipelineStageFlags::BOTTOM_OF_PIPE,
                vk::DependencyFlags::empty(),
                &[],
                &[],
                &[after],
            );
        }
    }

    fn drop_images(&mut self) {
        let queue = self.device.queue();
        // SAFETY: no other thread uses the queue; once it is idle nothing uses the images.
        unsafe {
            // A failure is a lost device, after which destroying is all that is left.
            let _ = self.device.raw.queue_wait_idle(*queue);
            self.functions.destroy_swapchain(self.raw, None);
        }
        self.raw = vk::SwapchainKHR::null();
        self.images.clear();
        self.size = [0, 0];
    }
}

/// Sorts the failure of a call.
fn outcome(call: &str, result: vk::Result) -> Result<Presented> {
    match result {
        vk::Result::ERROR_OUT_OF_DATE_KHR => Ok(Presented::Outdated),
        vk::Result::ERROR_SURFACE_LOST_KHR => Ok(Presented::Lost),
        other => Err(vulkan_error(call, other)),
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        self.drop_images();
        // SAFETY: the swapchain is gone and every acquisition has been waited for; destroying null handles
        // is allowed.
        unsafe {
            self.device.raw.destroy_fence(self.acquired, None);
            self.surfaces.destroy_surface(self.surface, None);
        }
    }
}
