//! Layouts of descriptor sets, made from the tables of `shader::rooms`.

use ash::vk;

use super::Called;
use crate::{
    error::Result,
    shader::{
        bindings::{Binding, BindingTable, Kind},
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

/// The layout of every table, and an empty one for the sets that a shader does not use.
pub(super) struct SetLayouts {
    tables: Vec<vk::DescriptorSetLayout>,
    pub(super) empty: vk::DescriptorSetLayout,
}

impl SetLayouts {
    pub(super) fn new(device: &ash::Device) -> Result<Self> {
        let tables = rooms::tables().map(|table| create_layout(device, table.bindings));
        Ok(Self { tables: tables.collect::<Result<_>>()?, empty: create_layout(device, &[])? })
    }

    pub(super) fn with_buffer(&self, set: u32, number: u32) -> vk::DescriptorSetLayout {
        let has_buffer = |table: &BindingTable| {
            table.set == set && table.bindings.iter().any(|binding| binding.number == number)
        };
        let found = rooms::tables().position(has_buffer);
        found.map_or(self.empty, |index| self.tables[index])
    }

    pub(super) fn of(&self, table: &BindingTable) -> vk::DescriptorSetLayout {
        let first = table.bindings.first();
        first.map_or(self.empty, |binding| self.with_buffer(binding.set, binding.number))
    }

    /// # Safety
    /// No pipeline layout or descriptor set made from these may be in use.
    pub(super) unsafe fn destroy(&self, device: &ash::Device) {
        for layout in self.tables.iter().chain([&self.empty]) {
            // SAFETY: promised by the caller.
            unsafe { device.destroy_descriptor_set_layout(*layout, None) };
        }
    }
}

fn create_layout(device: &ash::Device, bindings: &[Binding]) -> Result<vk::DescriptorSetLayout> {
    let bindings: Vec<_> = bindings
        .iter()
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
