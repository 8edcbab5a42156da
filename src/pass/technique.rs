//! What a sampler brings to a render: its passes as data, its descriptor set, and what it learns.

use std::{any::Any, collections::BTreeMap};

use super::{kernel::Kernel, runner::Runner};
use crate::{
    error::Result, film::statistics::CandidateCost, gpu::DescriptorSet, shader::structs::Wave,
};

/// Shadow rays per hit in one group: bounds the work of an invocation and the size of the buffers.
pub const SHADOW_RAYS_PER_GROUP: u32 = 8;

/// The passes that a technique adds to a wave. Holds no device object, so that tests read the order of
/// passes without a GPU. Every `wave` states vertex and shadow rays of the place in the order.
pub trait Steps {
    /// Shadow rays per hit in one group of dispatches.
    fn rays_per_group(&self) -> u32 {
        SHADOW_RAYS_PER_GROUP
    }

    /// Shadow rays at a vertex, of `most` at the first one.
    fn shadow_rays_at(&self, _vertex: u32, most: u32) -> u32 {
        most
    }

    /// Passes before the first group of shadow rays of a vertex.
    fn prepare(&self, _wave: &Wave) -> Vec<Kernel> {
        Vec::new()
    }

    /// Passes that choose the directions of a group of shadow rays.
    fn sample(&self, wave: &Wave) -> Vec<Kernel>;

    /// Passes after the shadow rays of a group.
    fn after_shadow_rays(&self, _wave: &Wave) -> Vec<Kernel> {
        Vec::new()
    }

    /// Passes after the last group of a vertex.
    fn finish(&self, _wave: &Wave) -> Vec<Kernel> {
        Vec::new()
    }

    /// The pass that continues the paths, where that is not the BRDF's own sampling.
    fn bounce(&self, _wave: &Wave) -> Option<Kernel> {
        None
    }
}

/// How far a progressive render has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Index of the first sample of every pixel.
    pub first_sample: u32,
    /// Samples per pixel in the film.
    pub sample_count: u32,
    /// Seed of the random numbers.
    pub seed: u32,
}

impl Progress {
    /// Index of the next sample.
    pub fn next_sample(&self) -> u32 {
        self.first_sample.wrapping_add(self.sample_count)
    }
}

/// Figures that a technique adds to statistics and metadata.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Host milliseconds by stage.
    pub host_ms: BTreeMap<String, f64>,
    /// Device memory by buffer, bytes.
    pub buffer_bytes: BTreeMap<String, u64>,
    /// Hash of each fit by what was fitted.
    pub fit_hashes: BTreeMap<String, String>,
    /// Candidates that each shadow ray is chosen from, where that is a choice.
    pub candidates: Option<u32>,
    /// Measurements that led to this choice.
    pub candidate_costs: Vec<CandidateCost>,
}

/// Memory that a technique takes for every path in flight; limits the size of a wave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PathDemand {
    /// Bytes of the widest buffer.
    pub bytes: u64,
    /// Texels of the texel buffer with most of them.
    pub texels: u64,
}

/// A sampler at work in one render.
pub trait Technique: Any {
    /// The passes it adds to a wave now.
    fn steps(&self) -> &dyn Steps;

    /// What [`Technique::steps`] may yet become, for warming up.
    fn other_steps(&self) -> Vec<Box<dyn Steps>> {
        Vec::new()
    }

    /// Its buffers: descriptor set 1.
    fn set(&self) -> Option<&DescriptorSet> {
        None
    }

    /// Completes the push constants of a wave of the picture.
    fn complete(&self, wave: Wave, _progress: &Progress) -> Wave {
        wave
    }

    /// Learns before the next sample what is due. Returns how many samples may follow until there is
    /// more to learn, which depends on their number alone and not on how they are grouped.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the device fails.
    fn learn(&mut self, _runner: &mut Runner, _progress: &Progress) -> Result<u32> {
        Ok(u32::MAX)
    }

    /// Forgets everything learned.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the device fails.
    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        Ok(())
    }

    /// Refuses to continue a film of `samples` samples per pixel, if sums alone do not allow it.
    ///
    /// # Errors
    /// [`crate::Error::Usage`].
    fn check_resume(&self, _samples: u32, _progress: &Progress) -> Result<()> {
        Ok(())
    }

    /// Figures for statistics and metadata.
    fn report(&self) -> Report {
        Report::default()
    }
}
