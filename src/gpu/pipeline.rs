//! Compute pipelines with specialization constants, made once for each device.

use std::sync::Arc;

use ash::vk;

use super::{
    Called, descriptors::DescriptorSet, device::Device, labels, pipelines::Made,
    set_layouts::SetLayout, vulkan_error,
};
use crate::{error::Result, shader::spirv::used_bindings, stage};

/// A compute pipeline.
pub struct Pipeline {
    pub(super) made: Made,
    pub(super) name: String,
    /// Keeps the pipeline's owner.
    _device: Arc<Device>,
}

impl Pipeline {
    /// Makes a pipeline from `spirv`, with specialization constants as (`constant_id`, 32-bit value),
    /// or takes the one that was made from them before.
    ///
    /// # Errors
    /// [`Error::Vulkan`](crate::Error::Vulkan) if a call fails.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        spirv: &[u8],
        constants: &[(u32, u32)],
    ) -> Result<Self> {
        let key = (name, spirv, constants);
        let made = device.pipelines.get_or_make(key, || make(device, name, spirv, constants))?;
        Ok(Self { made, name: name.to_owned(), _device: Arc::clone(device) })
    }

    /// Numbers of the buffers that the shader uses, if they are those of this set.
    pub(super) fn used(&self, set: &DescriptorSet) -> Option<&Arc<[u32]>> {
        let numbers = &self.made.used[set.index() as usize];
        numbers.first().is_some_and(|number| set.has(*number)).then_some(numbers)
    }
}

fn make(device: &Arc<Device>, name: &str, spirv: &[u8], constants: &[(u32, u32)]) -> Result<Made> {
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(spirv);
    let all_used = used_bindings(&words);
    let used = [0, 1, 2, 3].map(|set| {
        let of_set = all_used.iter().filter(|(other, _)| *other == set);
        of_set.map(|(_, number)| *number).collect::<Arc<[u32]>>()
    });
    let sets = used.iter().map(|numbers| SetLayout::new(&device.raw, numbers));
    let sets = sets.collect::<Result<Vec<_>>>()?;
    let layouts: Vec<_> = sets.iter().map(|set| set.raw).collect();
    let push_constants =
        [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(128)];
    let layout_info = vk::PipelineLayoutCreateInfo::default()
        .set_layouts(&layouts)
        .push_constant_ranges(&push_constants);
    // SAFETY: the device and the set layouts are alive.
    let layout = unsafe { device.raw.create_pipeline_layout(&layout_info, None) }
        .called(&format!("vkCreatePipelineLayout({name})"))?;
    let raw = compile(device, name, &words, constants, layout).inspect_err(|_| {
        // SAFETY: nothing uses the layout of a pipeline that was not made.
        unsafe { device.raw.destroy_pipeline_layout(layout, None) };
    })?;
    labels::name_object(device, raw, name);
    Ok(Made { raw, layout, used })
}

fn compile(
    device: &Device,
    name: &str,
    words: &[u32],
    constants: &[(u32, u32)],
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    stage::enter(format_args!("compiling {name}"));
    let raw_device = &device.raw;
    let module_info = vk::ShaderModuleCreateInfo::default().code(words);
    // SAFETY: `words` is SPIR-V that the build compiled.
    let module = unsafe { raw_device.create_shader_module(&module_info, None) }
        .called(&format!("vkCreateShaderModule({name})"))?;
    let entries: Vec<_> = constants
        .iter()
        .enumerate()
        .map(|(position, (id, _))| {
            vk::SpecializationMapEntry::default()
                .constant_id(*id)
                .offset(u32::try_from(4 * position).unwrap_or(u32::MAX))
                .size(4)
        })
        .collect();
    let values: Vec<u32> = constants.iter().map(|(_, value)| *value).collect();
    let specialization =
        vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&values));
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module)
        .name(c"main")
        .specialization_info(&specialization);
    let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
    let queue = device.idle_queue();
    // SAFETY: module, layout and cache are alive; the module is not needed afterwards.
    let result = unsafe {
        let result = raw_device.create_compute_pipelines(device.pipeline_cache.raw, &info, None);
        raw_device.destroy_shader_module(module, None);
        result
    };
    drop(queue);
    let pipelines = result.map_err(|(_, result)| {
        vulkan_error(&format!("vkCreateComputePipelines({name})"), result)
    })?;
    Ok(pipelines.first().copied().unwrap_or_default())
}
