//! The passes of learned visibility: `sample_guided` in the place of `sample`, and `learn` after
//! `shadow`; `guide_cells` where that layer is asked for.

use std::sync::Arc;

use crate::{
    error::Result,
    gpu::{
        Commands, DescriptorSet, Device, Pipeline,
        constants::{
            CONSTANT_BRDF_CANDIDATES, CONSTANT_CANDIDATES, CONSTANT_MATERIAL_KINDS,
            CONSTANT_PRODUCT_WEIGHTS,
        },
        layout::Wave,
        shaders,
    },
    sampler::Weights,
};

/// The pipelines.
pub struct Guided {
    sample: Pipeline,
    learn: Pipeline,
    cells: Pipeline,
}

impl Guided {
    /// Creates the pipelines for `candidates` per shadow ray, a quarter of them from the BRDF; 1 is
    /// the one-sample model.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn new(
        device: &Arc<Device>,
        candidates: u32,
        weights: Weights,
        material_kinds: u32,
    ) -> Result<Self> {
        let constants = [
            (CONSTANT_CANDIDATES, candidates),
            (CONSTANT_BRDF_CANDIDATES, (candidates / 4).max(1)),
            (CONSTANT_MATERIAL_KINDS, material_kinds),
            (CONSTANT_PRODUCT_WEIGHTS, u32::from(weights == Weights::Product)),
        ];
        let name = "sample_guided";
        Ok(Self {
            sample: Pipeline::new(device, name, shaders::pass(name), &constants)?,
            learn: Pipeline::new(device, "learn", shaders::pass("learn"), &[])?,
            cells: Pipeline::new(device, "guide_cells", shaders::pass("guide_cells"), &[])?,
        })
    }

    /// Records the choice of directions at every hit of `wave`; `sets` are scene, guide and wave.
    pub fn record_sample(&self, commands: &mut Commands, sets: &[&DescriptorSet], wave: &Wave) {
        let paths = wave.pixel_count * wave.sample_count;
        commands.dispatch(&self.sample, sets, bytemuck::bytes_of(wave), paths.max(1));
    }

    /// Records the counting of every shadow ray of `wave`; `sets` are guide and wave.
    pub fn record_learn(&self, commands: &mut Commands, sets: &[&DescriptorSet], wave: &Wave) {
        let rays = wave.pixel_count * wave.sample_count * wave.shadow_ray_count;
        commands.dispatch(&self.learn, sets, bytemuck::bytes_of(wave), rays.max(1));
    }

    /// Records which cells the paths of `wave` find at this vertex, into the film; `sets` are scene,
    /// guide, wave and film.
    pub fn record_cells(&self, commands: &mut Commands, sets: &[&DescriptorSet], wave: &Wave) {
        let push = bytemuck::bytes_of(wave);
        commands.dispatch(&self.cells, sets, push, wave.pixel_count.max(1));
    }
}
