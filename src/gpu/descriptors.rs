//! Descriptor sets by rate of change: 0 scene, 1 SRBF tables, 2 wave, 3 film.
//!
//! Every binding is a storage buffer. A pipeline sees only the sets that its shader uses, and a set
//! may leave bindings unwritten that the shader does not use.

use std::sync::Arc;

use ash::vk;

use super::{buffer::Buffer, device::Device, labels, vulkan_error};
use crate::error::Result;

/// Bindings of the four sets.
pub const SET_BINDING_COUNTS: [u32; 4] = [13, 4, 8, 8];

/// The layouts of the four sets and an empty one for the sets that a shader does not use.
pub(super) struct SetLayouts {
    sets: [vk::DescriptorSetLayout; 4],
    empty: vk::DescriptorSetLayout,
}

impl SetLayouts {
    pub(super) fn new(device: &ash::Device) -> Result<Self> {
        let mut layouts = Self {
            sets: [vk::DescriptorSetLayout::null(); 4],
            empty: vk::DescriptorSetLayout::null(),
        };
        for (layout, count) in layouts.sets.iter_mut().zip(SET_BINDING_COUNTS) {
            *layout = create_layout(device, count)?;
        }
        layouts.empty = create_layout(device, 0)?;
        Ok(layouts)
    }

    pub(super) fn get(&self, set: u32) -> vk::DescriptorSetLayout {
        self.sets[set as usize]
    }

    pub(super) fn empty(&self) -> vk::DescriptorSetLayout {
        self.empty
    }

    /// # Safety
    /// No pipeline layout or descriptor set made from these may be in use.
    pub(super) unsafe fn destroy(&self, device: &ash::Device) {
        for layout in self.sets.iter().chain([&self.empty]) {
            // SAFETY: promised by the caller.
            unsafe { device.destroy_descriptor_set_layout(*layout, None) };
        }
    }
}

fn create_layout(device: &ash::Device, count: u32) -> Result<vk::DescriptorSetLayout> {
    let bindings: Vec<_> = (0..count)
        .map(|binding| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: the device is alive and `info` valid.
    unsafe { device.create_descriptor_set_layout(&info, None) }
        .map_err(|result| vulkan_error("vkCreateDescriptorSetLayout", result))
}

/// One descriptor set with its own pool.
pub struct DescriptorSet {
    pool: vk::DescriptorPool,
    raw: vk::DescriptorSet,
    index: u32,
    device: Arc<Device>,
}

impl DescriptorSet {
    /// A set for set number `index` with `buffers` at their bindings. The buffers must outlive
    /// every submission that uses the set.
    ///
    /// # Errors
    /// [`Error::Vulkan`](crate::Error::Vulkan) if a call fails.
    ///
    /// # Panics
    /// If a binding is outside [`SET_BINDING_COUNTS`].
    pub fn new(device: &Arc<Device>, index: u32, buffers: &[(u32, &Buffer)]) -> Result<Self> {
        let count = SET_BINDING_COUNTS[index as usize];
        let sizes = [vk::DescriptorPoolSize::default()
            .ty(vk::DescriptorType::STORAGE_BUFFER)
            .descriptor_count(count)];
        let pool_info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive.
        let pool = unsafe { device.raw().create_descriptor_pool(&pool_info, None) }
            .map_err(|result| vulkan_error("vkCreateDescriptorPool", result))?;
        // From here on `Drop` cleans up.
        let mut set =
            Self { pool, raw: vk::DescriptorSet::null(), index, device: Arc::clone(device) };
        let layouts = [device.set_layouts().get(index)];
        let allocate =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has room for this one set.
        set.raw = unsafe { device.raw().allocate_descriptor_sets(&allocate) }
            .map_err(|result| vulkan_error("vkAllocateDescriptorSets", result))?[0];
        labels::name_object(device, set.raw, ["scene", "srbf", "wave", "film"][index as usize]);
        for (binding, buffer) in buffers {
            assert!(*binding < count, "set {index} has no binding {binding}");
            let info =
                [vk::DescriptorBufferInfo::default().buffer(buffer.raw()).range(vk::WHOLE_SIZE)];
            let write = vk::WriteDescriptorSet::default()
                .dst_set(set.raw)
                .dst_binding(*binding)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .buffer_info(&info);
            // SAFETY: set and buffer are alive and nothing uses the set yet.
            unsafe { device.raw().update_descriptor_sets(&[write], &[]) };
        }
        Ok(set)
    }

    pub(super) fn raw(&self) -> vk::DescriptorSet {
        self.raw
    }

    /// Set number.
    pub fn index(&self) -> u32 {
        self.index
    }
}

impl Drop for DescriptorSet {
    fn drop(&mut self) {
        // SAFETY: every submission is waited for; destroying the pool frees the set.
        unsafe { self.device.raw().destroy_descriptor_pool(self.pool, None) };
    }
}
