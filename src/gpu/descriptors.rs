//! Descriptor sets, made from the tables of `shader::bindings`.
//!
//! A pipeline sees only the sets and buffers that its shader uses; a set may lack the others.

use std::{
    borrow::Borrow,
    collections::{BTreeMap, HashMap},
    sync::{Arc, Mutex, PoisonError},
};

use ash::vk;

use super::{
    Called,
    buffer::Buffer,
    device::Device,
    labels,
    set_layouts::{SetLayout, descriptor_type},
};
use crate::{
    error::{Error, Result},
    shader::bindings::{Binding, BindingTable, Kind, TexelFormat},
};

fn vulkan_format(format: TexelFormat) -> vk::Format {
    match format {
        TexelFormat::R16Uint => vk::Format::R16_UINT,
        TexelFormat::R32Uint => vk::Format::R32_UINT,
        TexelFormat::Rg32Uint => vk::Format::R32G32_UINT,
        TexelFormat::Rgba32Uint => vk::Format::R32G32B32A32_UINT,
        TexelFormat::R32Float => vk::Format::R32_SFLOAT,
        TexelFormat::Rgba32Float => vk::Format::R32G32B32A32_SFLOAT,
        TexelFormat::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
    }
}

/// A descriptor set and the pool that it has for itself.
type Seen = (vk::DescriptorPool, vk::DescriptorSet);

/// Buffers at the bindings of a table, and a descriptor set with its own pool for each choice of them that a
/// shader has used.
pub struct DescriptorSet {
    seen: Mutex<HashMap<Arc<[u32]>, Seen>>,
    /// Buffers with their views as texels.
    buffers: Vec<(Binding, Buffer, vk::BufferView)>,
    table: &'static BindingTable,
    device: Arc<Device>,
}

impl DescriptorSet {
    /// Creates a set of `table` with `buffers` at their bindings, and where they are read as texels too.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails, [`Error::Device`] if a texel buffer has more texels than
    /// the device allows.
    pub fn new(
        device: &Arc<Device>,
        table: &'static BindingTable,
        buffers: &[(Binding, impl Borrow<Buffer>)],
    ) -> Result<Self> {
        // From here on `Drop` cleans up.
        let mut set = Self {
            seen: Mutex::default(),
            buffers: Vec::with_capacity(buffers.len()),
            table,
            device: Arc::clone(device),
        };
        let is_free =
            |again: &&Binding| !buffers.iter().any(|(other, _)| other.number == again.number);
        for (binding, buffer) in buffers {
            let buffer = buffer.borrow();
            for at in [binding].into_iter().chain(binding.again.iter().filter(is_free)) {
                let view = match at.kind {
                    Kind::One(_) | Kind::Array(_) => vk::BufferView::null(),
                    Kind::Texels(format) => set.view(buffer, format)?,
                };
                set.buffers.push((*at, buffer.clone(), view));
            }
        }
        Ok(set)
    }

    /// The set with the buffers of these numbers alone, which a shader uses.
    pub(super) fn with(&self, numbers: &Arc<[u32]>) -> Result<vk::DescriptorSet> {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, set)) = seen.get(numbers) {
            return Ok(*set);
        }
        let device = &self.device;
        // Alive until the set is written.
        let layout = SetLayout::new(&device.raw, numbers)?;
        let layouts = [layout.raw];
        let sizes = [vk::DescriptorType::STORAGE_BUFFER, vk::DescriptorType::UNIFORM_TEXEL_BUFFER]
            .map(|ty| {
                vk::DescriptorPoolSize::default().ty(ty).descriptor_count(numbers.len() as u32)
            });
        let pool_info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive.
        let pool = unsafe { device.raw.create_descriptor_pool(&pool_info, None) }
            .called("vkCreateDescriptorPool")?;
        let allocate =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has room for this one set, and nothing uses it if there is none.
        let allocated = unsafe { device.raw.allocate_descriptor_sets(&allocate) }
            .called("vkAllocateDescriptorSets")
            .inspect_err(|_| unsafe { device.raw.destroy_descriptor_pool(pool, None) })?;
        let set = allocated[0];
        labels::name_object(device, set, self.table.name);
        for (binding, buffer, view) in &self.buffers {
            if !numbers.contains(&binding.number) {
                continue;
            }
            let info =
                [vk::DescriptorBufferInfo::default().buffer(buffer.raw()).range(vk::WHOLE_SIZE)];
            let view = [*view];
            let write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding.number)
                .descriptor_type(descriptor_type(binding));
            let write = match binding.kind {
                Kind::One(_) | Kind::Array(_) => write.buffer_info(&info),
                Kind::Texels(_) => write.texel_buffer_view(&view),
            };
            // SAFETY: set and buffer are alive and nothing uses the set yet.
            unsafe { device.raw.update_descriptor_sets(&[write], &[]) };
        }
        seen.insert(Arc::clone(numbers), (pool, set));
        Ok(set)
    }

    /// As [`DescriptorSet::new`], with `spare` for the buffers that are not named.
    pub(crate) fn filled(
        device: &Arc<Device>,
        table: &'static BindingTable,
        buffers: &[(Binding, &Buffer)],
        spare: &Buffer,
    ) -> Result<Self> {
        let is_named = |binding: &Binding| {
            buffers.iter().any(|(other, _)| other == binding || other.again.contains(binding))
        };
        let mut all = buffers.to_vec();
        let free = table.bindings.iter().filter(|binding| !is_named(binding));
        all.extend(free.map(|binding| (*binding, spare)));
        Self::new(device, table, &all)
    }

    /// Makes a view of `buffer` that the set is to destroy.
    fn view(&self, buffer: &Buffer, format: TexelFormat) -> Result<vk::BufferView> {
        let texel_bytes = format.bytes();
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
            .format(vulkan_format(format))
            .range(texels * texel_bytes);
        // SAFETY: the buffer is alive, has texel-buffer usage and holds that many texels.
        let view = unsafe { self.device.raw.create_buffer_view(&info, None) }
            .called(&format!("vkCreateBufferView({})", buffer.name()))?;
        labels::name_object(&self.device, view, buffer.name());
        Ok(view)
    }

    /// Bytes of the buffers in the set by their names.
    pub fn buffer_bytes(&self) -> BTreeMap<String, u64> {
        self.buffers
            .iter()
            .map(|(_, buffer, _)| (buffer.name().to_owned(), buffer.size()))
            .collect()
    }

    /// Returns the buffer at a binding.
    ///
    /// # Panics
    /// If the set was made without.
    pub fn buffer(&self, binding: Binding) -> &Buffer {
        match self.buffers.iter().find(|(at, ..)| at.number == binding.number) {
            Some((_, buffer, _)) => buffer,
            None => panic!("no buffer {} in the set {}", binding.name, self.table.name),
        }
    }

    /// Returns true if the set has a buffer with this number.
    pub(crate) fn has(&self, number: u32) -> bool {
        self.table.bindings.iter().any(|binding| binding.number == number)
    }

    pub(crate) fn index(&self) -> u32 {
        self.table.set
    }
}

impl Drop for DescriptorSet {
    fn drop(&mut self) {
        let seen = self.seen.get_mut().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: every submission is waited for; destroying a pool frees its set, and the views belong to
        // the sets alone.
        unsafe {
            for (pool, _) in seen.values() {
                self.device.raw.destroy_descriptor_pool(*pool, None);
            }
            for (.., view) in &self.buffers {
                self.device.raw.destroy_buffer_view(*view, None);
            }
        }
    }
}
