//! Closest hit of every ray of a wave: rays → hits (`glsl/trace.comp`).

use std::sync::Arc;

use super::geometry::{GeometryBuffers, Schedule};
use crate::{
    error::Result,
    gpu::{Commands, DescriptorSet, Device, Pipeline},
    shader::{spirv, structs::Wave},
};

/// The pass.
pub struct Trace {
    pipeline: Pipeline,
    schedule: Schedule,
}

impl Trace {
    /// Compiles the pass for `geometry`; [`Schedule::SINGLE`] suits camera rays,
    /// [`Schedule::incoherent`] bounce rays.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn new(
        device: &Arc<Device>,
        geometry: &GeometryBuffers,
        schedule: Schedule,
    ) -> Result<Self> {
        let constants = geometry.constants(schedule);
        let pipeline = Pipeline::new(device, "trace", spirv::pass("trace"), &constants)?;
        Ok(Self { pipeline, schedule })
    }

    /// Records the pass over every path of `wave`.
    ///
    /// `sets`: the scene with [`GeometryBuffers::bindings`]; the wave with the ray buffer at
    /// `BINDING_RAY_TEXELS` and the hit buffer at `BINDING_HITS`; the film with the counters.
    pub fn record(&self, commands: &mut Commands, sets: &[&DescriptorSet], wave: &Wave) {
        let rays = wave.pixel_count * wave.sample_count;
        let invocations = self.schedule.invocations(rays);
        commands.dispatch(&self.pipeline, sets, bytemuck::bytes_of(wave), invocations);
    }
}
