//! Layouts of descriptor sets: of the buffers that a shader uses, and of no others, since a device counts
//! all that a layout has.

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

/// Layout of a descriptor set. What is made from it does not need it afterwards.
pub(super) struct SetLayout<'a> {
    pub raw: vk::DescriptorSetLayout,
    device: &'a ash::Device,
}

impl<'a> SetLayout<'a> {
    /// Makes the layout of the buffers with these numbers.
    pub(super) fn new(device: &'a ash::Device, numbers: &[u32]) -> Result<Self> {
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
        let raw = unsafe { device.create_descriptor_set_layout(&info, None) }
            .called("vkCreateDescriptorSetLayout")?;
        Ok(Self { raw, device })
    }
}

impl Drop for SetLayout<'_> {
    fn drop(&mut self) {
        // SAFETY: pipeline layouts and sets keep what they need of it, and no set is written any more.
        unsafe { self.device.destroy_descriptor_set_layout(self.raw, None) };
    }
}
