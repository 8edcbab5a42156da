//! Identity, limits and features of the devices, and the choice among them.

use std::sync::LazyLock;

use ash::vk;
use serde::Serialize;

use super::{
    Called,
    instance::{Instance, no_driver},
};
use crate::{
    error::{Error, Result},
    memory,
    shader::{
        bindings::{Binding, Kind},
        rooms,
        spirv::{PASSES, used_bindings},
    },
};

/// Identity, limits and features of a Vulkan device, as far as Fenestra needs them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Capabilities {
    /// Position in the loader's list.
    pub index: usize,
    /// Name reported by the driver.
    pub name: String,
    /// "discrete", "integrated", "virtual", "software" or "other".
    pub kind: &'static str,
    /// Driver name and version.
    pub driver: String,
    /// Vulkan version as (major, minor, patch).
    pub api_version: (u32, u32, u32),
    /// Largest range of one storage-buffer binding, bytes.
    pub max_storage_buffer_range: u64,
    /// Maximum number of texels in a texel buffer.
    pub max_texel_buffer_elements: u64,
    /// Maximum number of storage buffers that one pipeline may see.
    pub max_storage_buffers: u32,
    /// Maximum number of texel buffers that one pipeline may see.
    pub max_texel_buffers: u32,
    /// Maximum size of the push constants, bytes.
    pub max_push_constants_size: u32,
    /// Maximum number of workgroups in a dispatch along x.
    pub max_workgroup_count: u32,
    /// Maximum number of invocations in a workgroup.
    pub max_workgroup_invocations: u32,
    /// Maximum shared memory of a workgroup, bytes.
    pub max_shared_memory: u32,
    /// Number of invocations in a subgroup.
    pub subgroup_size: u32,
    /// True if compute shaders support subgroup ballots.
    pub subgroup_ballot: bool,
    /// Total size of the device-local memory heaps, bytes.
    pub device_memory: u64,
    /// True if the device is software and all its memory is the host's.
    pub shares_memory: bool,
    /// True if structs may have `scalar` layout.
    pub scalar_block_layout: bool,
    /// Queue family with compute and timestamps, if any.
    pub queue_family: Option<u32>,
    /// Number of valid bits in that family's timestamps.
    pub timestamp_valid_bits: u32,
    /// Nanoseconds per timestamp tick.
    pub timestamp_period: f32,
    /// Driver's pipeline-cache UUID, which names the cache file.
    pub pipeline_cache_uuid: [u8; 16],
}

impl Capabilities {
    /// Lists the requirements that this device does not meet; empty if it can be used.
    pub fn missing(&self) -> Vec<String> {
        let mut missing = Vec::new();
        let mut need = |what: &str, needed: u64, found: u64| {
            if found < needed {
                missing.push(format!("{what}: needed {needed}, found {found}"));
            }
        };
        let [storage_buffers, texel_buffers] = most_bindings();
        need("storage buffers per stage", storage_buffers, self.max_storage_buffers.into());
        need("texel buffers per stage", texel_buffers, self.max_texel_buffers.into());
        need("push constants in bytes", 128, self.max_push_constants_size.into());
        need("workgroup invocations", 64, self.max_workgroup_invocations.into());
        need("workgroups per dispatch", 65_535, self.max_workgroup_count.into());
        need("storage buffer range in bytes", 128 << 20, self.max_storage_buffer_range);
        if self.api_version < (1, 2, 0) {
            let (major, minor, patch) = self.api_version;
            missing.push(format!("Vulkan version: needed 1.2, found {major}.{minor}.{patch}"));
        }
        if !self.scalar_block_layout {
            missing.push("feature scalarBlockLayout: needed, not found".into());
        }
        if !self.subgroup_ballot {
            missing.push("subgroup ballot in compute shaders: needed, not found".into());
        }
        if self.queue_family.is_none() {
            missing.push("a compute queue with timestamps: needed, not found".into());
        }
        missing
    }

    /// True if the device is a program on the host's processor, whose memory it shares.
    pub fn is_software(&self) -> bool {
        self.kind == "software"
    }

    /// Memory that buffers may take: of a software device no more than the process may use.
    pub(crate) fn memory_for_buffers(&self) -> u64 {
        if self.is_software() { self.device_memory.min(memory::room()) } else { self.device_memory }
    }

    /// Rank by which devices are chosen; the smallest wins.
    fn rank(&self) -> u32 {
        match self.kind {
            "discrete" => 0,
            "integrated" => 1,
            "virtual" => 2,
            "other" => 3,
            _ => 4,
        }
    }
}

/// Largest numbers of storage and of texel buffers that a pass uses.
fn most_bindings() -> [u64; 2] {
    static MOST: LazyLock<[u64; 2]> = LazyLock::new(|| {
        let all = || rooms::tables().flat_map(|table| table.bindings);
        let is_texels = |binding: &Binding| matches!(binding.kind, Kind::Texels(_));
        let counts = PASSES.iter().map(|(_, spirv)| {
            let used = used_bindings(&bytemuck::pod_collect_to_vec(spirv));
            let numbers = || used.iter().map(|(_, number)| *number);
            let count = |texels: bool| {
                let of_kind = all().filter(|binding| is_texels(binding) == texels);
                of_kind.filter(|of| numbers().any(|number| number == of.number)).count() as u64
            };
            [count(false), count(true)]
        });
        counts.fold([0; 2], |most, own| [most[0].max(own[0]), most[1].max(own[1])])
    });
    *MOST
}

/// Lists the devices of an instance.
///
/// # Errors
/// [`Error::Device`] if there is none.
pub fn list(instance: &Instance) -> Result<Vec<Capabilities>> {
    Ok(enumerate(instance)?.into_iter().map(|(_, capabilities)| capabilities).collect())
}

pub(super) fn enumerate(instance: &Instance) -> Result<Vec<(vk::PhysicalDevice, Capabilities)>> {
    // SAFETY: the instance is alive.
    let devices = unsafe { instance.raw.enumerate_physical_devices() }
        .called("vkEnumeratePhysicalDevices")?;
    if devices.is_empty() {
        return Err(no_driver());
    }
    Ok(devices
        .into_iter()
        .enumerate()
        .map(|(index, device)| (device, capabilities(instance, index, device)))
        .collect())
}

fn capabilities(instance: &Instance, index: usize, physical: vk::PhysicalDevice) -> Capabilities {
    let raw = &instance.raw;
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut properties =
        vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut subgroup);
    let mut features12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut features12);
    // SAFETY: `physical` comes from this instance; the chained structures live through the calls.
    let (families, memory) = unsafe {
        raw.get_physical_device_properties2(physical, &mut properties);
        raw.get_physical_device_features2(physical, &mut features);
        (
            raw.get_physical_device_queue_family_properties(physical),
            raw.get_physical_device_memory_properties(physical),
        )
    };
    let properties = properties.properties;
    let limits = properties.limits;
    // Prefer a family that also has graphics: capture tools want one.
    let queue_family = families
        .iter()
        .enumerate()
        .filter(|(_, family)| {
            family.queue_flags.contains(vk::QueueFlags::COMPUTE) && family.timestamp_valid_bits > 0
        })
        .max_by_key(|(_, family)| family.queue_flags.contains(vk::QueueFlags::GRAPHICS))
        .and_then(|(index, family)| {
            Some((u32::try_from(index).ok()?, family.timestamp_valid_bits))
        });
    let text = |text: Result<&std::ffi::CStr, _>| match text {
        Ok(text) => text.to_string_lossy().into_owned(),
        Err(std::ffi::FromBytesUntilNulError { .. }) => String::new(),
    };
    Capabilities {
        index,
        name: text(properties.device_name_as_c_str()),
        kind: match properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
            vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
            vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
            vk::PhysicalDeviceType::CPU => "software",
            _ => "other",
        },
        driver: format!(
            "{} {}",
            text(driver.driver_name_as_c_str()),
            text(driver.driver_info_as_c_str())
        )
        .trim()
        .to_owned(),
        api_version: (
            vk::api_version_major(properties.api_version),
            vk::api_version_minor(properties.api_version),
            vk::api_version_patch(properties.api_version),
        ),
        max_storage_buffer_range: limits.max_storage_buffer_range.into(),
        max_texel_buffer_elements: limits.max_texel_buffer_elements.into(),
        max_storage_buffers: limits
            .max_per_stage_descriptor_storage_buffers
            .min(limits.max_descriptor_set_storage_buffers),
        max_texel_buffers: limits
            .max_per_stage_descriptor_sampled_images
            .min(limits.max_descriptor_set_sampled_images),
        max_push_constants_size: limits.max_push_constants_size,
        max_workgroup_count: limits.max_compute_work_group_count[0],
        max_workgroup_invocations: limits
            .max_compute_work_group_invocations
            .min(limits.max_compute_work_group_size[0]),
        max_shared_memory: limits.max_compute_shared_memory_size,
        subgroup_size: subgroup.subgroup_size,
        subgroup_ballot: subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
            && subgroup
                .supported_operations
                .contains(vk::SubgroupFeatureFlags::VOTE | vk::SubgroupFeatureFlags::BALLOT),
        device_memory: memory
            .memory_heaps_as_slice()
            .iter()
            .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|heap| heap.size)
            .sum(),
        shares_memory: properties.device_type == vk::PhysicalDeviceType::CPU
            && memory.memory_types_as_slice().iter().all(|memory| {
                memory.property_flags.contains(
                    vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT,
                )
            }),
        scalar_block_layout: features12.scalar_block_layout == vk::TRUE,
        queue_family: queue_family.map(|(index, _)| index),
        timestamp_valid_bits: queue_family.map_or(0, |(_, bits)| bits),
        timestamp_period: limits.timestamp_period,
        pipeline_cache_uuid: properties.pipeline_cache_uuid,
    }
}

/// Chooses the device that `wanted` names by index or by part of its name. Without `wanted`,
/// prefers a discrete GPU to an integrated one, and that to a software device.
///
/// # Errors
/// [`Error::Device`] if none fits; the message lists the devices and what each lacks.
pub fn choose<'a>(devices: &'a [Capabilities], wanted: Option<&str>) -> Result<&'a Capabilities> {
    let describe = || {
        devices
            .iter()
            .map(|device| {
                let missing = device.missing();
                let state = if missing.is_empty() { "usable".into() } else { missing.join(", ") };
                format!("[{}] {} ({}): {state}", device.index, device.name, device.kind)
            })
            .collect::<Vec<_>>()
            .join("; ")
    };
    let is_named = |device: &Capabilities, wanted: &str| match wanted.parse::<usize>() {
        Ok(index) => device.index == index,
        Err(_) => device.name.to_lowercase().contains(&wanted.to_lowercase()),
    };
    let is_wanted = |device: &&Capabilities| wanted.is_none_or(|wanted| is_named(device, wanted));
    let mut candidates: Vec<&Capabilities> = devices.iter().filter(is_wanted).collect();
    if candidates.is_empty() {
        return Err(Error::Device {
            reason: format!(
                "no Vulkan device matches --device {}; there are: {}",
                wanted.unwrap_or_default(),
                describe()
            ),
            help: "`fenestra devices` lists the devices with their index".into(),
        });
    }
    candidates.retain(|device| device.missing().is_empty());
    candidates.into_iter().min_by_key(|device| (device.rank(), device.index)).ok_or_else(|| {
        Error::Device {
            reason: format!("no Vulkan device can run Fenestra: {}", describe()),
            help: "update the driver, or run ./setup to install the software device lavapipe"
                .into(),
        }
    })
}
