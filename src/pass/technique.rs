//! Contribution of a sampler to a render: its passes as data, its descriptor set, and its learning.

use std::{any::Any, collections::BTreeMap};

use super::{kernel::Kernel, runner::Runner};
use crate::{
    error::Result, film::statistics::CandidateCost, gpu::DescriptorSet, shader::structs::Wave,
};

/// Shadow rays per hit in one group: bounds the work of an invocation and the size of the buffers.
pub const SHADOW_RAYS_PER_GROUP: u32 = 8;

/// Passes that a technique adds to a wave. Holds no device objects, so that tests read the order of
/// passes without a GPU. Each `wave` states the vertex and the shadow rays at its place in the order.
pub trait Steps {
    /// Shadow rays per hit in one group of dispatches.
    fn rays_per_group(&self) -> u32 {
        SHADOW_RAYS_PER_GROUP
    }

    /// Shadow rays at a vertex, given `most` at the first one.
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

    /// The pass that continues the paths, unless the BRDF's own sampling does.
    fn bounce(&self, _wave: &Wave) -> Option<Kernel> {
        None
    }
}

/// Progress of a progressive render.
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
    /// Candidates per shadow ray, for techniques that choose their number.
    pub candidates: Option<u32>,
    /// Measurements behind this choice.
    pub candidate_costs: Vec<CandidateCost>,
}

/// Memory per path in flight; limits the size of a wave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PathDemand {
    /// Bytes of the widest buffer.
    pub bytes: u64,
    /// Texels of the largest texel buffer.
    pub texels: u64,
}

/// A sampler at work in one render.
pub trait Technique: Any {
    /// Passes that it adds to a wave now.
    fn steps(&self) -> &dyn Steps;

    /// Steps that [`Technique::steps`] may turn into, for warming up.
    fn other_steps(&self) -> Vec<Box<dyn Steps>> {
        Vec::new()
    }

    /// Descriptor set 1.
    fn set(&self) -> Option<&DescriptorSet> {
        None
    }

    /// Completes the push constants of a wave of the picture.
    fn complete(&self, wave: Wave, _progress: &Progress) -> Wave {
        wave
    }

    /// Learns what is due before the next sample. Returns how many samples may follow before it has to
    /// learn again, which depends on their number, not on their grouping. Fails if the device does.
    fn learn(&mut self, _runner: &mut Runner, _progress: &Progress) -> Result<u32> {
        Ok(u32::MAX)
    }

    /// Forgets everything learned. Fails if the device does.
    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        Ok(())
    }

    /// Returns [`crate::Error::Usage`] if sums alone cannot continue a film of so many `samples`.
    fn check_resume(&self, _samples: u32, _progress: &Progress) -> Result<()> {
        Ok(())
    }

    /// Returns figures for statistics and metadata.
    fn report(&self) -> Report {
        Report::default()
    }
}
