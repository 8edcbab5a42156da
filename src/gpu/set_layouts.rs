//! Layouts of descriptor sets: of the buffers that a shader uses, and of no others, since a device counts
//! all that a layout has.

use std::{
    collections::HashMap,
    sync::{Mutex, PoisonError},
};

use ash::vk;

use super::Called;
use crate::{
    error::Result,
    shader::{
        bindings::{Binding, Kind},
        rooms,
    },
};

/// Returns the type of descriptor that the buffer of `binding` takes.
pub(super) fn descriptor_type(binding: &Binding) -> vk::DescriptorType {
    match binding.kind {
        Kind::Texels(_) => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
        Kind::One(_) | Kind::Array(_) => vk::DescriptorType::STORAGE_BUFFER,
    }
}

/// Layouts by the numbers of their buffers, made when they are first asked for.
#[derive(Default)]
pub(super) struct SetLayouts {
    made: Mutex<HashMap<Box<[u32]>, vk::DescriptorSetLayout>>,
}

impl SetLayouts {
    pub(super) fn of(
        &self,
        device: &ash::Device,
        numbers: &[u32],
    ) -> Result<vk::DescriptorSetLayout> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(layout) = made.get(numbers) {
            return Ok(*layout);
        }
        let layout = create_layout(device, numbers)?;
        made.insert(numbers.into(), layout);
        Ok(layout)
    }

    /// # Safety
    /// No pipeline layout or descriptor set made from these may be in use.
    pub(super) unsafe fn destroy(&self, device: &ash::Device) {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        for (_, layout) in made.drain() {
            // SAFETY: promised by the caller.
            unsafe { device.destroy_descriptor_set_layout(layout, None) };
        }
    }
}

fn create_layout(device: &ash::Device, numbers: &[u32]) -> Result<vk::DescriptorSetLayout> {
    let bindings: Vec<_> = rooms::tables()
        .flat_map(|table| table.bindings)
        .filter(|binding| numbers.contains(&binding.number))
        .map(|binding| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding.number)
                .descriptor_type(descriptor_type(binding))
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: the device is alive and `info` valid.
    unsafe { device.create_descriptor_set_layout(&info, None) }
        .called("vkCreateDescriptorSetLayout")
}
