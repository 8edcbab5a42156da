//! Descriptor sets, by rate of change: 0 scene, 1 SRBF and guide tables, 2 wave, 3 film.
//!
//! A binding is a storage buffer unless `texel_format` lists it: traversal reads geometry and rays
//! through uniform texel buffers, which lavapipe loads several times as fast. A pipeline layout
//! holds only the sets that its shader uses. Bindings that the shader does not use may stay
//! unwritten.

use std::sync::Arc;

use ash::vk;

use super::{buffer::Buffer, device::Device, labels, vulkan_error};
use crate::error::{Error, Result};
use crate::shader::constants as c;

/// Number of bindings in each of the four sets.
pub const SET_BINDING_COUNTS: [u32; 4] = [14, 18, 16, 11];

/// Returns the format and the bytes per texel of a uniform texel binding, `None` for other
/// bindings.
pub(super) fn texel_format(set: u32, binding: u32) -> Option<(vk::Format, u64)> {
    match (set, binding) {
        (
            c::SET_SCENE,
            c::BINDING_BVH_NODES..=c::BINDING_TRIANGLES_3 | c::BINDING_MATERIAL_TEXELS,
        )
        | (c::SET_WAVE, c::BINDING_RAY_TEXELS | c::BINDING_HIT_TEXELS) => {
            Some((vk::Format::R32G32B32A32_UINT, 16))
        }
        (c::SET_SCENE, c::BINDING_ENVIRONMENT_TEXELS) => {
            Some((vk::Format::R32G32B32A32_SFLOAT, 16))
        }
        (c::SET_SCENE, c::BINDING_BRDF_CELLS) => Some((vk::Format::R16G16B16A16_SFLOAT, 8)),
        (
            c::SET_SCENE,
            c::BINDING_BRDF_TABLE | c::BINDING_ENVIRONMENT_ROWS | c::BINDING_ENVIRONMENT_CELLS,
        ) => Some((vk::Format::R32_SFLOAT, 4)),
        (c::SET_SRBF, c::BINDING_ENVIRONMENT_LOBES | c::BINDING_BRDF_LOBES) => {
            Some((vk::Format::R32G32B32A32_SFLOAT, 16))
        }
        (c::SET_SRBF, c::BINDING_MATERIAL_LOBES) => Some((vk::Format::R32G32_UINT, 8)),
        (c::SET_WAVE, c::BINDING_LOBE_TEXELS) => Some((vk::Format::R32G32_UINT, 8)),
        (c::SET_WAVE, c::BINDING_LOBE_SUM_TEXELS) => Some((vk::Format::R32_SFLOAT, 4)),
        (c::SET_WAVE, c::BINDING_CLOSE_LOBE_TEXELS) => Some((vk::Format::R32_UINT, 4)),
        (c::SET_SRBF, c::BINDING_GUIDE_REGIONS | c::BINDING_GUIDE_LIKELY) => {
            Some((vk::Format::R32G32B32A32_UINT, 16))
        }
        (
            c::SET_SRBF,
            c::BINDING_GUIDE_TABLE | c::BINDING_GUIDE_ENTRIES | c::BINDING_GUIDE_ALIASES,
        ) => Some((vk::Format::R32G32_UINT, 8)),
        (c::SET_SRBF, c::BINDING_GUIDE_ARRIVING) => Some((vk::Format::R32_SFLOAT, 4)),
        (c::SET_SRBF, c::BINDING_GUIDE_REFLECTED) => Some((vk::Format::R32_UINT, 4)),
        (c::SET_SRBF, c::BINDING_GUIDE_REGION_OF_CELL) => Some((vk::Format::R16_UINT, 2)),
        (c::SET_WAVE, c::BINDING_SHADOW_RAY_TEXELS) => Some((vk::Format::R32G32_UINT, 8)),
        _ => None,
    }
}

fn descriptor_type(set: u32, binding: u32) -> vk::DescriptorType {
    if texel_format(set, binding).is_some() {
        vk::DescriptorType::UNIFORM_TEXEL_BUFFER
    } else {
        vk::DescriptorType::STORAGE_BUFFER
    }
}

/// Layouts of the four sets, and an empty one for sets that a shader does not use.
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
        for ((set, layout), count) in (0..).zip(&mut layouts.sets).zip(SET_BINDING_COUNTS) {
            *layout = create_layout(device, set, count)?;
        }
        layouts.empty = create_layout(device, 0, 0)?;
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

fn create_layout(device: &ash::Device, set: u32, count: u32) -> Result<vk::DescriptorSetLayout> {
    let bindings: Vec<_> = (0..count)
        .map(|binding| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding)
                .descriptor_type(descriptor_type(set, binding))
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: the device is alive and `info` valid.
    unsafe { device.create_descriptor_set_layout(&info, None) }
        .map_err(|result| vulkan_error("vkCreateDescriptorSetLayout", result))
}

/// A descriptor set with its own pool.
pub struct DescriptorSet {
    pool: vk::DescriptorPool,
    raw: vk::DescriptorSet,
    views: Vec<vk::BufferView>,
    index: u32,
    device: Arc<Device>,
}

impl DescriptorSet {
    /// Creates set number `index` with `buffers`, which must outlive every submission that uses it.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails, [`Error::Device`] if a texel buffer has more texels than
    /// the device allows.
    ///
    /// # Panics
    /// If a binding is outside [`SET_BINDING_COUNTS`].
    pub fn new(device: &Arc<Device>, index: u32, buffers: &[(u32, &Buffer)]) -> Result<Self> {
        let count = SET_BINDING_COUNTS[index as usize];
        let sizes = [vk::DescriptorType::STORAGE_BUFFER, vk::DescriptorType::UNIFORM_TEXEL_BUFFER]
            .map(|ty| vk::DescriptorPoolSize::default().ty(ty).descriptor_count(count));
        let pool_info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive.
        let pool = unsafe { device.raw().create_descriptor_pool(&pool_info, None) }
            .map_err(|result| vulkan_error("vkCreateDescriptorPool", result))?;
        // From here on `Drop` cleans up.
        let mut set = Self {
            pool,
            raw: vk::DescriptorSet::null(),
            views: Vec::new(),
            index,
            device: Arc::clone(device),
        };
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
            let mut view = [vk::BufferView::null()];
            let write = vk::WriteDescriptorSet::default()
                .dst_set(set.raw)
                .dst_binding(*binding)
                .descriptor_type(descriptor_type(index, *binding));
            let write = match texel_format(index, *binding) {
                None => write.buffer_info(&info),
                Some((format, texel_bytes)) => {
                    view[0] = set.add_view(buffer, format, texel_bytes)?;
                    write.texel_buffer_view(&view)
                }
            };
            // SAFETY: set and buffer are alive and nothing uses the set yet.
            unsafe { device.raw().update_descriptor_sets(&[write], &[]) };
        }
        Ok(set)
    }

    /// Creates a view of `buffer` that lives as long as the set.
    fn add_view(
        &mut self,
        buffer: &Buffer,
        format: vk::Format,
        texel_bytes: u64,
    ) -> Result<vk::BufferView> {
        let texels = buffer.size() / texel_bytes;
        let capabilities = self.device.capabilities();
        if texels > capabilities.max_texel_buffer_elements {
            return Err(Error::Device {
                reason: format!(
                    "buffer {} needs {texels} texels, but {} allows {} for one texel buffer",
                    buffer.name(),
                    capabilities.name,
                    capabilities.max_texel_buffer_elements
                ),
                help: "choose another device with --device, or a smaller scene or film".into(),
            });
        }
        let info = vk::BufferViewCreateInfo::default()
            .buffer(buffer.raw())
            .format(format)
            .range(texels * texel_bytes);
        // SAFETY: the buffer is alive, has texel-buffer usage and holds that many texels.
        let view =
            unsafe { self.device.raw().create_buffer_view(&info, None) }.map_err(|result| {
                vulkan_error(&format!("vkCreateBufferView({})", buffer.name()), result)
            })?;
        self.views.push(view);
        labels::name_object(&self.device, view, buffer.name());
        Ok(view)
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
        // SAFETY: every submission has been waited for; destroying the pool frees the set, and
        // nothing else uses the views.
        unsafe {
            self.device.raw().destroy_descriptor_pool(self.pool, None);
            for view in &self.views {
                self.device.raw().destroy_buffer_view(*view, None);
            }
        }
    }
}
