//! Buffers for the paths in flight.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    error::Result,
    gpu::{Buffer, Commands, DescriptorSet, Device},
    shader::{
        constants::{
            BINDING_CACHE, BINDING_CLOSE_LOBE_TEXELS, BINDING_CLOSE_LOBES, BINDING_HIT_TEXELS,
            BINDING_HITS, BINDING_LOBE_COUNTS, BINDING_LOBE_SUM_TEXELS, BINDING_LOBE_SUMS,
            BINDING_LOBE_TEXELS, BINDING_LOBES, BINDING_PATHS, BINDING_RAY_TEXELS, BINDING_RAYS,
            BINDING_SHADOW_RAY_TEXELS, BINDING_SHADOW_RAYS, BINDING_VISIBILITY, LOBES_PER_SUM,
            SET_WAVE, WORKGROUP_SIZE,
        },
        structs::{Hit, PathState, Ray, ShadowRay},
    },
};

/// Most paths in flight on a software device; more would only fall out of its caches.
const SOFTWARE_PATHS: u32 = 1 << 17;
/// Most paths in flight on a GPU.
const GPU_PATHS: u32 = 1 << 21;
/// Paths of the very first wave, before any timing is known.
const FIRST_PATHS: u32 = 1 << 14;

/// What product sampling needs room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LobeRoom {
    /// Lobes kept per path.
    pub kept_lobes: u32,
    /// Directions in a visibility cache; 0 without one.
    pub cache_capacity: u32,
    /// Pixels that keep their caches; none where caches belong to paths.
    pub film_pixels: Option<u64>,
}

impl LobeRoom {
    /// Words per path that tell which lobes cached directions are close to: `MASK_WORDS` of
    /// `product.glsl` for every place of the cache and for the direction under way.
    fn mask_words(self) -> u64 {
        u64::from(self.kept_lobes.div_ceil(32)) * (u64::from(self.cache_capacity) + 1)
    }
}

/// Rays, hits, shadow rays and path states of one wave.
pub struct WaveBuffers {
    set: DescriptorSet,
    buffers: Vec<Buffer>,
    capacity: u32,
    /// Visibility caches that outlive a wave.
    kept_caches: Option<usize>,
}

impl WaveBuffers {
    /// Room for waves of a film of `padded_pixels` with up to `shadow_rays` rays per hit at a time, and
    /// for the lobes of product sampling.
    pub fn new(
        device: &Arc<Device>,
        padded_pixels: u32,
        shadow_rays: u32,
        lobe_room: Option<LobeRoom>,
    ) -> Result<Self> {
        let capabilities = device.capabilities();
        let most = if capabilities.kind == "software" { SOFTWARE_PATHS } else { GPU_PATHS };
        let widest =
            (size_of::<Hit>() as u64).max(u64::from(shadow_rays) * size_of::<ShadowRay>() as u64);
        let lobes = lobe_room.map_or(0, |room| u64::from(room.kept_lobes));
        let masks = lobe_room.map_or(0, LobeRoom::mask_words);
        let widest = widest.max(8 * lobes).max(4 * masks);
        let by_binding = capabilities.max_storage_buffer_range / widest;
        let by_texels = capabilities.max_texel_buffer_elements / lobes.max(masks).max(1);
        let by_groups = u64::from(capabilities.max_workgroup_count) * u64::from(WORKGROUP_SIZE)
            / u64::from(shadow_rays);
        let by_memory = capabilities.device_memory / 8 / (widest * 3);
        let limit = by_binding.min(by_texels).min(by_groups).min(by_memory).min(u64::from(most));
        // A small film needs no more than a handful of its samples in flight.
        let useful = u64::from(padded_pixels) * 64;
        let capacity = u32::try_from(limit.min(useful)).unwrap_or(most).max(WORKGROUP_SIZE)
            / WORKGROUP_SIZE
            * WORKGROUP_SIZE;

        let rays = u64::from(capacity) * u64::from(shadow_rays);
        let make = |name, count: u64, size: usize| Buffer::new(device, name, count * size as u64);
        let paths = u64::from(capacity);
        let ray_buffer = make("rays", paths, size_of::<Ray>())?;
        let hit_buffer = make("hits", paths, size_of::<Hit>())?;
        let shadow_ray_buffer = make("shadow rays", rays, size_of::<ShadowRay>())?;
        let visibility = make("visibility", rays, size_of::<u32>())?;
        let path_buffer = make("paths", paths, size_of::<PathState>())?;
        let lobe_buffers = lobe_room.map(|room| -> Result<_> {
            let caches = room.film_pixels.unwrap_or(paths);
            let words =
                if room.cache_capacity > 0 { 1 + u64::from(room.cache_capacity) } else { 0 };
            Ok([
                make("product lobes", paths * lobes, 8)?,
                make("lobe counts", paths, 4)?,
                make("lobe sums", paths * lobes.div_ceil(u64::from(LOBES_PER_SUM)), 4)?,
                make("close lobes", paths * masks, 4)?,
                Buffer::zeroed(device, "visibility caches", 4 * caches * words)?,
            ])
        });
        let lobe_buffers = lobe_buffers.transpose()?;
        let mut bound = vec![
            (BINDING_RAYS, &ray_buffer),
            (BINDING_RAY_TEXELS, &ray_buffer),
            (BINDING_HITS, &hit_buffer),
            (BINDING_HIT_TEXELS, &hit_buffer),
            (BINDING_SHADOW_RAYS, &shadow_ray_buffer),
            (BINDING_SHADOW_RAY_TEXELS, &shadow_ray_buffer),
            (BINDING_VISIBILITY, &visibility),
            (BINDING_PATHS, &path_buffer),
        ];
        if let Some([lobes, counts, sums, close, caches]) = &lobe_buffers {
            bound.extend([
                (BINDING_LOBES, lobes),
                (BINDING_LOBE_TEXELS, lobes),
                (BINDING_LOBE_COUNTS, counts),
                (BINDING_LOBE_SUMS, sums),
                (BINDING_LOBE_SUM_TEXELS, sums),
                (BINDING_CLOSE_LOBES, close),
                (BINDING_CLOSE_LOBE_TEXELS, close),
                (BINDING_CACHE, caches),
            ]);
        }
        let set = DescriptorSet::new(device, SET_WAVE, &bound)?;
        let mut buffers = vec![ray_buffer, hit_buffer, shadow_ray_buffer, visibility, path_buffer];
        buffers.extend(lobe_buffers.into_iter().flatten());
        let kept_caches = lobe_room.and_then(|room| room.film_pixels).map(|_| buffers.len() - 1);
        Ok(Self { set, buffers, capacity, kept_caches })
    }

    /// Whether visibility caches outlive a wave.
    pub fn keeps_caches(&self) -> bool {
        self.kept_caches.is_some()
    }

    /// Empties the caches that outlive a wave.
    pub fn clear_caches(&self, device: &Arc<Device>) -> Result<()> {
        let Some(index) = self.kept_caches else { return Ok(()) };
        let mut commands = Commands::begin(device)?;
        commands.fill(&self.buffers[index], 0);
        commands.submit_and_wait()?;
        Ok(())
    }

    /// The buffer of that name, to read it back.
    pub fn buffer(&self, name: &str) -> Option<&Buffer> {
        self.buffers.iter().find(|buffer| buffer.name() == name)
    }

    /// The wave set.
    pub fn set(&self) -> &DescriptorSet {
        &self.set
    }

    /// Most paths of a wave.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Paths of the first wave.
    pub fn first_wave_paths(&self) -> u32 {
        FIRST_PATHS.min(self.capacity)
    }

    /// Bytes by buffer name.
    pub fn buffer_bytes(&self) -> BTreeMap<String, u64> {
        self.buffers.iter().map(|buffer| (buffer.name().to_owned(), buffer.size())).collect()
    }
}
