//! The logical device.

use std::{
    ffi::CStr,
    sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard},
};

use ash::{ext, khr, vk};
use gpu_allocator::{
    AllocationSizes, AllocatorDebugSettings,
    vulkan::{Allocator, AllocatorCreateDesc},
};
use winit::raw_window_handle::RawDisplayHandle;

use super::{
    Called,
    capabilities::{Capabilities, choose, enumerate},
    embree::Embree,
    instance::Instance,
    lavapipe,
    pipelines::{PipelineCache, Pipelines},
};
use crate::error::{Error, Result};

/// Part of the machine that traces rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Tracer {
    /// The host where the device is software and the library Embree is found, else the device.
    #[default]
    Auto,
    /// The device.
    Device,
    /// The host, by the library Embree; the device must be software.
    Host,
}

/// A logical device with its queue, allocator, pipelines and the driver's pipeline cache.
pub struct Device {
    pub(super) raw: ash::Device,
    pub(super) debug_names: Option<ext::debug_utils::Device>,
    queue: RwLock<vk::Queue>,
    capabilities: Capabilities,
    pub(super) physical: vk::PhysicalDevice,
    /// Part of the machine that was asked to trace.
    pub(crate) tracer: Tracer,
    /// The library by which the host traces, if it does.
    pub(crate) embree: Option<Arc<Embree>>,
    pub(super) pipeline_cache: PipelineCache,
    pub(super) pipelines: Pipelines,
    // Emptied in `drop`, before the device is destroyed.
    allocator: Mutex<Option<Allocator>>,
    // Last: the instance must outlive the device.
    pub(super) instance: Arc<Instance>,
}

impl Device {
    /// Opens the device that [`choose`] picks; the host traces where it can.
    ///
    /// # Errors
    /// No loader, no suitable device, or a failing driver.
    pub fn open(wanted: Option<&str>, validate: bool) -> Result<Arc<Self>> {
        Self::open_traced(wanted, validate, Tracer::Auto)
    }

    /// As [`Device::open`], with a choice of what traces.
    ///
    /// # Errors
    /// Also [`Error::Device`] if the host is to trace and cannot.
    pub fn open_traced(wanted: Option<&str>, validate: bool, tracer: Tracer) -> Result<Arc<Self>> {
        Self::open_checked(wanted, validate, tracer, None, |_| Ok(()))
    }

    /// As [`Device::open_traced`], once `check` has let the device pass: drivers may crash as soon as it is
    /// made. For windows on `display` too, if there is one. Fails also as `check` does, and with
    /// [`Error::Device`] if the device cannot show pictures in windows.
    pub(crate) fn open_checked(
        wanted: Option<&str>,
        validate: bool,
        tracer: Tracer,
        display: Option<RawDisplayHandle>,
        check: fn(&Capabilities) -> Result<()>,
    ) -> Result<Arc<Self>> {
        let instance = Arc::new(Instance::new(validate, display)?);
        let devices = enumerate(&instance)?;
        let list: Vec<Capabilities> =
            devices.iter().map(|(_, capabilities)| capabilities.clone()).collect();
        let capabilities = choose(&list, wanted)?.clone();
        lavapipe::check_vector_width(&capabilities)?;
        check(&capabilities)?;
        let (physical, _) = devices[capabilities.index];
        let embree = embree_for(&capabilities, tracer)?;
        let queue_family = capabilities.queue_family.unwrap_or_default();

        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(queue_family)
            .queue_priorities(&priorities)];
        let mut features12 =
            vk::PhysicalDeviceVulkan12Features::default().scalar_block_layout(true);
        let mut extensions = Vec::new();
        if display.is_some() {
            if !has_extension(&instance, physical, khr::swapchain::NAME)? {
                return Err(cannot_present(&capabilities));
            }
            extensions.push(khr::swapchain::NAME.as_ptr());
        }
        // A device that lacks a part of Vulkan wants this said.
        if has_extension(&instance, physical, khr::portability_subset::NAME)? {
            extensions.push(khr::portability_subset::NAME.as_ptr());
        }
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut features12);
        // SAFETY: `physical` belongs to this instance and has the family and feature asked for.
        let raw = unsafe { instance.raw.create_device(physical, &info, None) }
            .called("vkCreateDevice")?;
        // SAFETY: the queue was requested at creation.
        let queue = unsafe { raw.get_device_queue(queue_family, 0) };
        let debug_names =
            instance.has_debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &raw));
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: physical,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: AllocationSizes::new(16 << 20, 16 << 20),
        })
        .map_err(|error| Error::Vulkan {
            call: "memory allocator".into(),
            result: error.to_string(),
        })?;
        let pipeline_cache = PipelineCache::load(&raw, &capabilities);
        log::info!(
            "device {}: {} ({}), {}",
            capabilities.index,
            capabilities.name,
            capabilities.kind,
            capabilities.driver
        );
        Ok(Arc::new(Self {
            raw,
            debug_names,
            queue: RwLock::new(queue),
            capabilities,
            physical,
            tracer,
            embree,
            pipeline_cache,
            pipelines: Pipelines::default(),
            allocator: Mutex::new(Some(allocator)),
            instance,
        }))
    }

    /// Identity, limits and features of this device.
    pub fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    /// Names device, driver and tracer.
    pub(crate) fn describe(&self) -> String {
        format!("{} ({})", self.capabilities.name, self.driver_and_tracer())
    }

    /// Names the driver, and what traces if it is not the device.
    pub(crate) fn driver_and_tracer(&self) -> String {
        let driver = &self.capabilities.driver;
        self.embree
            .as_ref()
            .map_or_else(|| driver.clone(), |_| format!("{driver}, rays by {}", self.tracer()))
    }

    /// Names what traces: "device" or "Embree 3.13.5".
    pub fn tracer(&self) -> String {
        tracer_name(self.embree.as_ref())
    }

    /// Messages of the validation layers so far; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.instance.validation_messages()
    }

    /// Returns [`Error::Vulkan`] with the first message of the validation layers, if there is any.
    pub(crate) fn check_validation(&self) -> Result<()> {
        let messages = self.validation_messages();
        messages.first().map_or(Ok(()), |first| {
            Err(Error::Vulkan {
                call: "validation".into(),
                result: format!("{} messages, the first: {first}", messages.len()),
            })
        })
    }

    /// Writes compiled pipelines to the user's cache folder; failures are only logged.
    pub(crate) fn save_pipeline_cache(&self) {
        self.pipeline_cache.save(&self.raw, &self.capabilities);
    }

    /// Locks the queue for one thread.
    pub(super) fn queue(&self) -> RwLockWriteGuard<'_, vk::Queue> {
        self.queue.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps the queue idle while pipelines are made: software drivers compile a pipeline on the queue's own
    /// thread when a dispatch first uses it, and Mesa 22.3 was seen to crash there when tests ran in several
    /// threads.
    pub(super) fn idle_queue(&self) -> RwLockReadGuard<'_, vk::Queue> {
        self.queue.read().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn queue_family(&self) -> u32 {
        self.capabilities.queue_family.unwrap_or_default()
    }

    pub(super) fn allocator(&self) -> MutexGuard<'_, Option<Allocator>> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: every object made from the device holds it in an `Arc`, so only those destroyed here are
        // left, and they go before the device; the queue is idle, since every submission is waited for.
        unsafe {
            drop(self.allocator().take());
            self.pipelines.destroy(&self.raw);
            self.pipeline_cache.destroy(&self.raw);
            self.raw.destroy_device(None);
        }
    }
}

/// Loads the library by which the host traces, where it is to. Fails with [`Error::Device`] if the host was
/// asked for and cannot.
pub(crate) fn embree_for(
    capabilities: &Capabilities,
    tracer: Tracer,
) -> Result<Option<Arc<Embree>>> {
    match (tracer, capabilities.shares_memory) {
        (Tracer::Device, _) | (Tracer::Auto, false) => Ok(None),
        (Tracer::Host, false) => Err(Error::Device {
            reason: format!(
                "--tracer host: {} does not share its memory with the host, as software devices do",
                capabilities.name
            ),
            help: "take --tracer device".into(),
        }),
        (Tracer::Host, true) => Embree::load().map(Some),
        (Tracer::Auto, true) => {
            Ok(Embree::load().inspect_err(|error| log::info!("the device traces: {error}")).ok())
        }
    }
}

/// Names what traces, given the host's library if it does.
pub(crate) fn tracer_name(embree: Option<&Arc<Embree>>) -> String {
    embree.map_or_else(|| "device".to_owned(), |embree| format!("Embree {}", embree.version))
}

fn has_extension(instance: &Instance, physical: vk::PhysicalDevice, name: &CStr) -> Result<bool> {
    // SAFETY: `physical` belongs to this instance.
    let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }
        .called("vkEnumerateDeviceExtensionProperties")?;
    Ok(extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name)))
}

/// Returns the error for a device that cannot show pictures in a window.
pub(super) fn cannot_present(capabilities: &Capabilities) -> Error {
    Error::Device {
        reason: format!("{} cannot show pictures in windows of this display", capabilities.name),
        help: "choose another device with --device, or render to a file with `fenestra render`"
            .into(),
    }
}
