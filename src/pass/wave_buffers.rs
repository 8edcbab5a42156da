//! Buffers for the paths in flight.

use std::sync::Arc;

use super::{host_tracer::Answers, steps::PathDemand, surfaces::Surfaces};
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

/// Most paths in flight on a software device; more would only fall out of its caches.
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
    /// Buffers that passes answer in, or the host where it traces.
    pub answers: Answers,
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
        let answers = Answers {
            rays: make("rays", paths, size_of::<Ray>())?,
            hits: make("hits", paths, size_of::<Hit>())?,
            instances: make_if(of.has(SURFACES_INSTANCED), "hit instances", size_of::<u32>())?,
            shadow_rays: make("shadow rays", shadow_ray_count, size_of::<ShadowRay>())?,
            visibility: make("visibility", shadow_ray_count, size_of::<u32>())?,
            paths: make("paths", paths, size_of::<PathState>())?,
            path_lists: Buffer::new(device, "path lists", path_list_bytes(paths))?,
        };
        let surfaces = make_if(of.has(SURFACES_TEXTURED), "hit surfaces", size_of::<Surface>())?;
        let lamp_lists = make_if(of.has(SURFACES_LAMP_CELLS), "lamp lists", size_of::<u32>())?;
        let features = make_if(demand.has_features, "features", size_of::<Feature>())?;
        let radiance_count = (groups * paths).max(1);
        let group_radiance = make("group radiance", radiance_count, size_of::<[f32; 3]>())?;
        let lamp_groups = make_if(groups > 0, "lamp groups", size_of::<u32>())?;
        let Answers { rays, hits, instances, shadow_rays, visibility, paths, path_lists } =
            &answers;
        let bound = [
            (wave::RAYS, rays),
            (wave::RAY_TEXELS, rays),
            (wave::HITS, hits),
            (wave::HIT_TEXELS, hits),
            (wave::SHADOW_RAYS, shadow_rays),
            (wave::SHADOW_RAY_TEXELS, shadow_rays),
            (wave::VISIBILITY, visibility),
            (wave::PATHS, paths),
            (wave::HIT_SURFACES, &surfaces),
            (wave::HIT_INSTANCES, instances),
            (wave::PATH_LISTS, path_lists),
            (wave::PATH_LIST_TEXELS, path_lists),
            (wave::LAMP_LISTS, &lamp_lists),
            (wave::FEATURES, &features),
            (wave::GROUP_RADIANCE, &group_radiance),
            (wave::LAMP_GROUPS, &lamp_groups),
        ];
        let set = DescriptorSet::new(device, &WAVE, &bound)?;
        Ok(Self { set, capacity, answers })
    }
}
