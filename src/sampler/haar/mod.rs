//! Product sampling on a wavelet basis, with the BRDF sampled on the fly.
//!
//! \[Clarberg & Akenine-Möller 2008\], after \[Clarberg et al. 2005\]. [`Tree`] of the environment →
//! nodes of environment × BRDF at each hit (`glsl/haar/multiply_nodes.comp`) → directions by hierarchical
//! warping, beside those of BRDF and environment (`glsl/haar/sample_nodes.comp`). With
//! `--set haar-cache=on` nodes near blocked directions lose weight, as lobes do under `visibility`.

mod buffers;
mod parameters;
mod steps;
pub mod tree;

use std::{collections::BTreeMap, time::Instant};

pub use buffers::NodeSize;
pub use parameters::HaarParameters;
pub use steps::HaarSteps;
use tree::Tree;

use super::{Context, Parameters, Room, knob::Knobs, rays::Unlearned};
use crate::{
    error::Result,
    pass::{PathDemand, Technique},
};

pub(super) struct HaarRoom;

impl Room for HaarRoom {
    fn check(&self, parameters: &Parameters, _depth: u32) -> Result<()> {
        parameters.product.check()
    }

    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = parameters.haar.describe();
        let mut shared = parameters.product.describe();
        shared.extend(parameters.visibility.describe());
        let cache: &[&str] = if parameters.haar.has_cache { &["k", "tau"] } else { &[] };
        let used = [&["brdf-share", "environment-share"], cache].concat();
        named.extend(shared.into_iter().filter(|(key, _)| used.contains(&key.as_str())));
        named
    }

    fn demand(&self, parameters: &Parameters, shadow_rays: u32) -> PathDemand {
        NodeSize::new(parameters, shadow_rays).demand()
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let settings = &runner.settings;
        let start = Instant::now();
        let tree = Tree::new(&scene.environment);
        let tree_ms = start.elapsed().as_secs_f64() * 1e3;
        let (surfaces, shadow_rays) = (settings.surfaces, settings.shadow_rays);
        let steps = HaarSteps::new(parameters, tree.depth, surfaces, shadow_rays);
        let size = NodeSize::new(parameters, shadow_rays);
        let set = Some(size.set(&runner.device, &tree, runner.waves.capacity)?);
        let host_ms = [("environment tree".to_owned(), tree_ms)].into();
        Ok(Box::new(Unlearned { steps, set, host_ms }))
    }
}
