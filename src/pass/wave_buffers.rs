//! Buffers for the paths in flight.

use std::sync::Arc;

use super::{steps::PathDemand, surfaces::Surfaces};
use crate::{
    error::Result,
    gpu::{Buffer, Capabilities, DescriptorSet, Device},
    shader::{
        bindings::{WAVE, wave},
        constants::{
            PATH_LISTS, SURFACES_INSTANCED, SURFACES_LAMP_CELLS, SURFACES_TEXTURED, WORKGROUP_SIZE,
        },
        structs::{Feature, Hit, PathState, Ray, ShadowRay, Surface},
    },
};

/// Most paths in flight on a software device. A quarter as many take 3% more time, a sixteenth 21%.
const SOFTWARE_PATHS: u32 = 1 << 17;
/// Most paths in flight on a GPU.
const GPU_PATHS: u32 = 1 << 21;

/// Returns the most paths in flight on a device.
pub(crate) fn most_paths(capabilities: &Capabilities) -> u32 {
    if capabilities.is_software() { SOFTWARE_PATHS } else { GPU_PATHS }
}

/// Returns the bytes of the lists of living paths in a wave of `paths` paths.
pub(crate) fn path_list_bytes(paths: u64) -> u64 {
    (u64::from(PATH_LISTS) + 2 * paths) * size_of::<u32>() as u64
}

/// Rays, hits, shadow rays and path states of one wave.
pub struct WaveBuffers {
    /// Descriptor set 2.
    pub set: DescriptorSet,
    /// Largest number of paths in a wave.
    pub capacity: u32,
}

impl WaveBuffers {
    /// Allocates waves over a film of `padded_pixels` with up to `shadow_rays` rays per hit at a time,
    /// and no more than `most_paths` paths, nor more than `demand` and memory allow; textures and
    /// instances at hits only if `of` needs them. Fails if the device does or its limits are exceeded.
    pub fn new(
        device: &Arc<Device>,
        padded_pixels: u32,
        most_paths: u32,
        shadow_rays: u32,
        demand: PathDemand,
        of: Surfaces,
    ) -> Result<Self> {
        let capabilities = device.capabilities();
        let widest =
            (size_of::<Hit>() as u64).max(u64::from(shadow_rays) * size_of::<ShadowRay>() as u64);
        let group_bytes = u64::from(demand.light_groups) * size_of::<[f32; 3]>() as u64;
        let widest = widest.max(demand.bytes).max(group_bytes);
        let by_binding = capabilities.max_storage_buffer_range / widest;
        let by_texels = capabilities.max_texel_buffer_elements / demand.texels.max(1);
        let by_groups = u64::from(capabilities.max_workgroup_count) * u64::from(WORKGROUP_SIZE)
            / u64::from(shadow_rays);
        let by_memory = capabilities.memory_for_buffers() / 8 / (widest * 3);
        let by_paths = u64::from(most_paths);
        let limit = by_binding.min(by_texels).min(by_groups).min(by_memory).min(by_paths);
        // A small film needs only a handful of samples in flight.
        let useful = u64::from(padded_pixels) * 64;
        let capacity = u32::try_from(limit.min(useful)).unwrap_or(most_paths).max(WORKGROUP_SIZE)
            / WORKGROUP_SIZE
            * WORKGROUP_SIZE;

        let paths = u64::from(capacity);
        let shadow_ray_count = paths * u64::from(shadow_rays);
        let groups = u64::from(demand.light_groups);
        let make = |name, count: u64, size: usize| Buffer::new(device, name, count * size as u64);
        let make_if = |is_needed, name, size| make(name, if is_needed { paths } else { 1 }, size);
        let radiance_count = (groups * paths).max(1);
        let (words, colours) = (size_of::<u32>(), size_of::<[f32; 3]>());
        let [textured, instanced, by_place] =
            [SURFACES_TEXTURED, SURFACES_INSTANCED, SURFACES_LAMP_CELLS].map(|bit| of.has(bit));
        let bound = [
            (wave::RAYS, make("rays", paths, size_of::<Ray>())?),
            (wave::HITS, make("hits", paths, size_of::<Hit>())?),
            (wave::SHADOW_RAYS, make("shadow rays", shadow_ray_count, size_of::<ShadowRay>())?),
            (wave::VISIBILITY, make("visibility", shadow_ray_count, words)?),
            (wave::PATHS, make("paths", paths, size_of::<PathState>())?),
            (wave::HIT_SURFACES, make_if(textured, "hit surfaces", size_of::<Surface>())?),
            (wave::HIT_INSTANCES, make_if(instanced, "hit instances", words)?),
            (wave::PATH_LISTS, Buffer::new(device, "path lists", path_list_bytes(paths))?),
            (wave::LAMP_LISTS, make_if(by_place, "lamp lists", words)?),
            (wave::FEATURES, make_if(demand.has_features, "features", size_of::<Feature>())?),
            (wave::GROUP_RADIANCE, make("group radiance", radiance_count, colours)?),
            (wave::LAMP_GROUPS, make_if(groups > 0, "lamp groups", words)?),
        ];
        Ok(Self { set: DescriptorSet::new(device, &WAVE, &bound)?, capacity })
    }
}
