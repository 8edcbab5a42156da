//! The passes of learned visibility: `sample_guided` in the place of `sample`, and `learn` after
//! `shadow`; `guide_cells` where that layer is asked for.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    error::Result,
    gpu::{
        Commands, DescriptorSet, Device, Pipeline,
        constants::{
            CONSTANT_BRDF_CANDIDATES, CONSTANT_CANDIDATES, CONSTANT_MATERIAL_KINDS,
            CONSTANT_PRODUCT_WEIGHTS, GUIDE_SAMPLES_THAT_ALL_TEACH, GUIDE_TEACHING_STEP,
        },
        layout::Wave,
        shaders,
    },
    sampler::Weights,
};

/// The pipelines.
pub struct Guided {
    device: Arc<Device>,
    weights: Weights,
    material_kinds: u32,
    /// By the number of candidates.
    sample: BTreeMap<u32, Pipeline>,
    /// The number in use.
    candidates: u32,
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
        let mut guided = Self {
            device: Arc::clone(device),
            weights,
            material_kinds,
            sample: BTreeMap::new(),
            candidates,
            learn: Pipeline::new(device, "learn", shaders::pass("learn"), &[])?,
            cells: Pipeline::new(device, "guide_cells", shaders::pass("guide_cells"), &[])?,
        };
        guided.use_candidates(candidates)?;
        Ok(guided)
    }

    /// Chooses shadow rays from `candidates` from now on. Returns whether the pipeline had to be
    /// created.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn use_candidates(&mut self, candidates: u32) -> Result<bool> {
        let is_new = !self.sample.contains_key(&candidates);
        if is_new {
            let constants = [
                (CONSTANT_CANDIDATES, candidates),
                (CONSTANT_BRDF_CANDIDATES, (candidates / 4).max(1)),
                (CONSTANT_MATERIAL_KINDS, self.material_kinds),
                (CONSTANT_PRODUCT_WEIGHTS, u32::from(self.weights == Weights::Product)),
            ];
            let name = "sample_guided";
            let pipeline = Pipeline::new(&self.device, name, shaders::pass(name), &constants)?;
            self.sample.insert(candidates, pipeline);
        }
        self.candidates = candidates;
        Ok(is_new)
    }

    /// Drops the pipelines for other numbers of candidates than the one in use.
    pub fn drop_others(&mut self) {
        self.sample.retain(|candidates, _| *candidates == self.candidates);
    }

    /// Records the choice of directions at every hit of `wave`; `sets` are scene, guide and wave.
    pub fn record_sample(&self, commands: &mut Commands, sets: &[&DescriptorSet], wave: &Wave) {
        let paths = wave.pixel_count * wave.sample_count;
        let pipeline = &self.sample[&self.candidates];
        commands.dispatch(pipeline, sets, bytemuck::bytes_of(wave), paths.max(1));
    }

    /// Records the counting of the shadow rays of `wave`, if any of its samples teaches; `sets` are guide
    /// and wave.
    pub fn record_learn(&self, commands: &mut Commands, sets: &[&DescriptorSet], wave: &Wave) {
        let first = wave.first_sample.wrapping_sub(wave.epoch_start);
        let next = if first < GUIDE_SAMPLES_THAT_ALL_TEACH {
            first
        } else {
            first.next_multiple_of(GUIDE_TEACHING_STEP)
        };
        if next - first >= wave.sample_count.max(1) {
            return;
        }
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
