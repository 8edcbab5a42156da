//! The passes of learned visibility: `sample_guided` in the place of `sample`, and `learn` after
//! `shadow`; `bounce_guided` in the place of `bounce`, and `learn_arrivals` after the choice of shadow rays
//! where its rays arrived; `guide_cells` where that layer is asked for.

use std::{collections::BTreeMap, sync::Arc};

use super::PassSettings;
use crate::{
    error::Result,
    gpu::{Commands, DescriptorSet, Device, Pipeline},
    sampler::Weights,
    shader::{
        constants::{
            CONSTANT_BOUNCE_CANDIDATES, CONSTANT_BRDF_CANDIDATES, CONSTANT_CANDIDATES,
            CONSTANT_MATERIAL_KINDS, CONSTANT_PRODUCT_WEIGHTS, CONSTANT_ROULETTE_VERTEX,
            GUIDE_SAMPLES_THAT_ALL_TEACH, GUIDE_TEACHING_STEP,
        },
        spirv,
        structs::Wave,
    },
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
    /// Where bounces are guided.
    bounces: Option<Bounces>,
}

struct Bounces {
    bounce: Pipeline,
    learn_arrivals: Pipeline,
}

impl Guided {
    /// Creates the pipelines for `candidates` per shadow ray, a quarter of them from the BRDF; 1 is
    /// the one-sample model.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn new(device: &Arc<Device>, candidates: u32, settings: &PassSettings) -> Result<Self> {
        let PassSettings { parameters, material_kinds, roulette_vertex, .. } = *settings;
        let create = |name: &str, constants: &[(u32, u32)]| {
            Pipeline::new(device, name, spirv::pass(name), constants)
        };
        let bounces = || -> Result<Bounces> {
            let constants = [
                (CONSTANT_BOUNCE_CANDIDATES, parameters.bounce_candidates),
                (CONSTANT_ROULETTE_VERTEX, roulette_vertex),
                (CONSTANT_MATERIAL_KINDS, material_kinds),
            ];
            Ok(Bounces {
                bounce: create("bounce_guided", &constants)?,
                learn_arrivals: create("learn_arrivals", &[])?,
            })
        };
        let mut guided = Self {
            device: Arc::clone(device),
            weights: parameters.weights,
            material_kinds,
            sample: BTreeMap::new(),
            candidates,
            learn: create("learn", &[])?,
            cells: create("guide_cells", &[])?,
            bounces: parameters.guides_bounces(settings.depth).then(bounces).transpose()?,
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
            let pipeline = Pipeline::new(&self.device, name, spirv::pass(name), &constants)?;
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
        if !teaches(wave) {
            return;
        }
        let rays = wave.pixel_count * wave.sample_count * wave.shadow_ray_count;
        commands.dispatch(&self.learn, sets, bytemuck::bytes_of(wave), rays.max(1));
    }

    /// Records the next direction of every path of `wave` where bounces are guided; `sets` are scene, guide
    /// and wave. Returns whether they are.
    pub fn record_bounce(
        &self,
        commands: &mut Commands,
        sets: &[&DescriptorSet],
        wave: &Wave,
    ) -> bool {
        let paths = wave.pixel_count * wave.sample_count;
        if let Some(Bounces { bounce, .. }) = &self.bounces {
            commands.dispatch(bounce, sets, bytemuck::bytes_of(wave), paths.max(1));
        }
        self.bounces.is_some()
    }

    /// Records the counting of the bounce rays that arrived at this vertex, if any sample of `wave`
    /// teaches and bounces are guided; `set` is the guide.
    pub fn record_arrivals(&self, commands: &mut Commands, set: &DescriptorSet, wave: &Wave) {
        if let Some(Bounces { learn_arrivals, .. }) = &self.bounces
            && teaches(wave)
        {
            let paths = wave.pixel_count * wave.sample_count;
            commands.dispatch(learn_arrivals, &[set], bytemuck::bytes_of(wave), paths.max(1));
        }
    }

    /// Records which cells the paths of `wave` find at this vertex, into the film; `sets` are scene,
    /// guide, wave and film.
    pub fn record_cells(&self, commands: &mut Commands, sets: &[&DescriptorSet], wave: &Wave) {
        let push = bytemuck::bytes_of(wave);
        commands.dispatch(&self.cells, sets, push, wave.pixel_count.max(1));
    }
}

/// Whether any sample of `wave` teaches.
fn teaches(wave: &Wave) -> bool {
    let first = wave.first_sample.wrapping_sub(wave.epoch_start);
    let next = if first < GUIDE_SAMPLES_THAT_ALL_TEACH {
        first
    } else {
        first.next_multiple_of(GUIDE_TEACHING_STEP)
    };
    next - first < wave.sample_count.max(1)
}
