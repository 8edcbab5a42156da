//! Whether the environment is visible along every shadow ray of a wave (`glsl/shadow.comp`).

use std::sync::Arc;

use super::geometry::{GeometryBuffers, Schedule};
use crate::{
    error::Result,
    gpu::{Commands, DescriptorSet, Device, Pipeline},
    shader::{spirv, structs::Wave},
};

/// The pass.
pub struct Shadow {
    pipeline: Pipeline,
    schedule: Schedule,
}

impl Shadow {
    /// Compiles the pass for `geometry`; [`Schedule::incoherent`] suits shadow rays.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn new(
        device: &Arc<Device>,
        geometry: &GeometryBuffers,
        schedule: Schedule,
    ) -> Result<Self> {
        let constants = geometry.constants(schedule);
        let pipeline = Pipeline::new(device, "shadow", spirv::pass("shadow"), &constants)?;
        Ok(Self { pipeline, schedule })
    }

    /// Records the pass over the shadow rays of every path of `wave`; ray
    /// `direction_index · path_count + path_index` starts at hit `path_index`.
    ///
    /// `sets`: the scene with [`GeometryBuffers::bindings`]; the wave with the hit buffer at
    /// `BINDING_HIT_TEXELS`, the shadow rays at `BINDING_SHADOW_RAY_TEXELS` and the visibility buffer
    /// at `BINDING_VISIBILITY`; the film with the counters.
    pub fn record(&self, commands: &mut Commands, sets: &[&DescriptorSet], wave: &Wave) {
        let rays = wave.pixel_count * wave.sample_count * wave.shadow_ray_count;
        let invocations = self.schedule.invocations(rays);
        commands.dispatch(&self.pipeline, sets, bytemuck::bytes_of(wave), invocations);
    }
}
