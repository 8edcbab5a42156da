//! The passes that a sampler adds to a wave, as data, and the buffers that they read.

use super::kernel::Kernel;
use crate::{
    gpu::DescriptorSet,
    shader::{
        constants::{CONSTANT_ROULETTE_THROUGHPUT, CONSTANT_ROULETTE_VERTEX},
        structs::Wave,
    },
};

/// Shadow rays per hit in one group: bounds the work of an invocation and the size of the buffers.
pub(crate) const SHADOW_RAYS_PER_GROUP: u32 = 8;

/// The passes that a technique adds to a wave. Holds no device object, so that tests read the order
/// of passes without a GPU. Every `wave` states vertex and shadow rays of the place in the order.
pub trait Steps {
    /// Shadow rays per hit in one group of dispatches.
    fn rays_per_group(&self) -> u32 {
        SHADOW_RAYS_PER_GROUP
    }

    /// Shadow rays at a vertex, of `most` at the first one.
    fn shadow_rays_at(&self, _vertex: u32, most: u32) -> u32 {
        most
    }

    /// True if the pixels of a cohort share paths, where the renderer has cohorts.
    fn shares_paths(&self) -> bool {
        true
    }

    /// True if the passes walk the lists of living paths; otherwise all passes walk all paths.
    fn walks_lists(&self) -> bool {
        false
    }

    /// Most that a vertex of a path adds to a counter, but for its shadow rays.
    fn counts(&self) -> u32 {
        1
    }

    /// Passes before the first group of shadow rays of a vertex.
    fn prepare(&self, _wave: &Wave) -> Vec<Kernel> {
        Vec::new()
    }

    /// True if the passes of [`Steps::sample`] trace the shadow rays that they choose.
    fn traces(&self) -> bool {
        false
    }

    /// Passes that choose the directions of a group of shadow rays.
    fn sample(&self, wave: &Wave) -> Vec<Kernel>;

    /// Passes after the shadow rays of a group.
    fn after_shadow_rays(&self, _wave: &Wave) -> Vec<Kernel> {
        Vec::new()
    }

    /// Passes after the last group of a vertex, for a film with the extra buffers `AOV_…`.
    fn finish(&self, _wave: &Wave, _aovs: u32) -> Vec<Kernel> {
        Vec::new()
    }

    /// Specialization of the pass `gather` from this vertex on, if bounce rays that leave it and escape are
    /// samples of the environment beside its shadow rays. A vertex after one with `Some` has the same.
    fn escape(&self, _vertex: u32) -> Option<Vec<(u32, u32)>> {
        None
    }

    /// Where paths end by chance, if not as the settings say.
    fn roulette(&self) -> Option<Roulette> {
        None
    }

    /// The pass that continues the paths, where that is not the BRDF's own sampling.
    fn bounce(&self, _wave: &Wave) -> Option<Kernel> {
        None
    }
}

/// Memory that a render takes for every path in flight; limits the size of a wave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PathDemand {
    /// Bytes of the widest buffer.
    pub bytes: u64,
    /// Texels of the texel buffer with most of them.
    pub texels: u64,
    /// True if paths keep what the layers of surfaces show.
    pub has_features: bool,
    /// Groups of lights that they keep apart.
    pub light_groups: u32,
}

/// The passes of a sampler in one render, as the runner sees them.
pub trait Passes {
    /// Passes that the sampler adds to a wave now.
    fn steps(&self) -> &dyn Steps;

    /// Later forms of [`Passes::steps`], to warm up.
    fn other_steps(&self) -> Vec<Box<dyn Steps>> {
        Vec::new()
    }

    /// Buffers of the sampler: descriptor set 1.
    fn set(&self) -> Option<&DescriptorSet> {
        None
    }
}

/// Where and how russian roulette ends paths that carry little, and weighs those that survive (Arvo & Kirk
/// 1990, "Particle transport and image synthesis"). The pixels of a block of 8×8 draw the same number, so
/// that invocations which run together end together; each survives with its own probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roulette {
    /// First vertex, from 0 on, that a path may fail to reach.
    pub vertex: u32,
    /// A path survives with its largest throughput of any channel over this, if that is below 1; with 0
    /// all do.
    pub throughput: f32,
}

impl Default for Roulette {
    fn default() -> Self {
        Self { vertex: 2, throughput: 0.1 }
    }
}

impl Roulette {
    /// No roulette.
    pub const NEVER: Self = Self { vertex: u32::MAX, throughput: 1.0 };

    /// Specialization of the passes that continue paths.
    pub(crate) fn constants(&self) -> [(u32, u32); 2] {
        let vertex = if self.throughput > 0.0 { self.vertex } else { u32::MAX };
        [
            (CONSTANT_ROULETTE_VERTEX, vertex),
            (CONSTANT_ROULETTE_THROUGHPUT, self.throughput.to_bits()),
        ]
    }
}
