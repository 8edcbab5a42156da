//! Product sampling on a wavelet basis, with the BRDF sampled on the fly.
//!
//! \[Clarberg & Akenine-Möller 2008\], after \[Clarberg et al. 2005\]. [`Tree`] of the environment →
//! nodes of environment × BRDF at each hit (`glsl/haar/multiply_nodes.comp`) → directions by hierarchical
//! warping, beside those of BRDF and environment (`glsl/haar/sample_nodes.comp`). With
//! `--set haar-cache=on` nodes near blocked directions lose weight, as lobes do under `visibility`.

pub mod tree;

use std::{collections::BTreeMap, sync::Arc, time::Instant};

use tree::{Tree, first_of_level, node_centre};

use super::{
    Context, Parameters, Room,
    knob::{Knobs, ON_OR_OFF, parameters},
    rays::Unlearned,
};
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    pass::{Domain, Kernel, PathDemand, SHADOW_RAYS_PER_GROUP, Steps, Surfaces, Technique},
    shader::{
        rooms::haar::{self, CONSTANT_HAAR_DEPTH, CONSTANT_HAAR_LEVEL},
        rooms::product::{CONSTANT_BRDF_SHARE, CONSTANT_ENVIRONMENT_SHARE},
        rooms::visibility::{
            CONSTANT_CACHE_CAPACITY, CONSTANT_THRESHOLD_SCALE, CONSTANT_VISIBILITY_EXPONENT,
        },
        structs::Wave,
    },
};

parameters! {
    /// Parameters of `haar` beside shares and visibility weights, which are those of `product` and
    /// `visibility`.
    pub struct HaarParameters {
        /// `haar-level`: base-2 logarithm of the product's nodes along each side of the square.
        "haar-level" level: u32 = 3, 3..=5;
        /// `haar-cache`: on if nodes near blocked directions lose weight at the same hit.
        "haar-cache" has_cache: bool = false, ON_OR_OFF;
    }
}

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

/// Storage for the nodes of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeSize {
    /// Base-2 logarithm of the nodes along each side of the square.
    pub level: u32,
    /// Directions in a cache; 0 without one.
    pub cache_places: u32,
}

impl NodeSize {
    /// Returns the size at `shadow_rays` rays per hit.
    pub fn new(parameters: &Parameters, shadow_rays: u32) -> Self {
        Self { level: parameters.haar.level, cache_places: cache_places(parameters, shadow_rays) }
    }

    /// Groups of four nodes.
    fn quads(self) -> u64 {
        1 << (2 * (self.level - 1))
    }

    /// Coarse nodes whose children are summed.
    fn sums(self) -> u64 {
        first_of_level(self.level - 2) as u64
    }

    fn cache_words(self) -> u64 {
        if self.cache_places > 0 { 1 + u64::from(self.cache_places) } else { 0 }
    }

    /// Memory per path in flight.
    pub fn demand(self) -> PathDemand {
        let bytes = (8 * self.quads()).max(16 * self.sums()).max(4 * self.cache_words());
        let texels = self.quads().max(self.sums());
        PathDemand { bytes, texels, ..PathDemand::default() }
    }

    /// Uploads the tree, and allocates the nodes of `paths` paths: descriptor set 1. Fails if the device
    /// does or its limits are exceeded.
    pub fn set(self, device: &Arc<Device>, tree: &Tree, paths: u32) -> Result<DescriptorSet> {
        let paths = u64::from(paths);
        let centres: Vec<[f32; 4]> = (0..1 << (2 * self.level))
            .map(|node| node_centre(self.level, node).extend(0.0).to_array())
            .collect();
        let texels = |name, texels: &[_]| Buffer::texels_from_slice(device, name, texels);
        let make = |name, bytes: u64| Buffer::new(device, name, paths * bytes);
        let bound = [
            (haar::HAAR_TREE, texels("environment tree", &tree.nodes)?),
            (haar::HAAR_CENTRES, texels("node centres", &centres)?),
            (haar::HAAR_NODES, make("product nodes", self.quads() * 8)?),
            (haar::HAAR_SUMS, make("node sums", self.sums() * 16)?),
            (haar::HAAR_CACHE, make("blocked directions", self.cache_words() * 4)?),
        ];
        DescriptorSet::new(device, &haar::TABLE, &bound)
    }
}

/// Steps of `haar`: `multiply_nodes` once per hit, `sample_nodes` per group of rays, and with a cache
/// `lower_nodes` after each single ray.
#[derive(Clone, Debug, PartialEq)]
pub struct HaarSteps {
    parameters: Parameters,
    depth: u32,
    surfaces: Surfaces,
    shadow_rays: u32,
}

impl HaarSteps {
    /// Returns the steps at `shadow_rays` rays per hit, with the environment's texels at level `depth`.
    pub fn new(parameters: &Parameters, depth: u32, surfaces: Surfaces, shadow_rays: u32) -> Self {
        Self { parameters: *parameters, depth, surfaces, shadow_rays }
    }

    fn kernel(&self, shader: &'static str, constants: &[(u32, u32)]) -> Kernel {
        let own = [
            (CONSTANT_HAAR_LEVEL, self.parameters.haar.level),
            (CONSTANT_HAAR_DEPTH, self.depth),
            (CONSTANT_CACHE_CAPACITY, cache_places(&self.parameters, self.shadow_rays)),
        ];
        Kernel::new(shader, Domain::Paths, &[&own[..], constants].concat())
    }
}

/// Directions that the cache of a hit has room for: those of all rays before the last; 0 without a cache.
fn cache_places(parameters: &Parameters, shadow_rays: u32) -> u32 {
    if parameters.haar.has_cache { shadow_rays.saturating_sub(1).max(1) } else { 0 }
}

impl Steps for HaarSteps {
    /// One with a cache, since each shadow ray teaches the next.
    fn rays_per_group(&self) -> u32 {
        if self.parameters.haar.has_cache { 1 } else { SHADOW_RAYS_PER_GROUP }
    }

    fn prepare(&self, _wave: &Wave) -> Vec<Kernel> {
        vec![self.kernel("multiply_nodes", &self.surfaces.constants())]
    }

    fn sample(&self, _wave: &Wave) -> Vec<Kernel> {
        let shares = self.parameters.product;
        let own = [
            (CONSTANT_BRDF_SHARE, shares.brdf_share.to_bits()),
            (CONSTANT_ENVIRONMENT_SHARE, shares.environment_share.to_bits()),
        ];
        vec![self.kernel("sample_nodes", &[&own[..], &self.surfaces.constants()].concat())]
    }

    fn after_shadow_rays(&self, wave: &Wave) -> Vec<Kernel> {
        let is_last = wave.first_shadow_ray + wave.shadow_ray_count >= wave.total_shadow_rays;
        if !self.parameters.haar.has_cache || is_last {
            return Vec::new();
        }
        let visibility = self.parameters.visibility;
        let own = [
            (CONSTANT_THRESHOLD_SCALE, visibility.threshold_scale.to_bits()),
            (CONSTANT_VISIBILITY_EXPONENT, visibility.exponent.to_bits()),
        ];
        vec![self.kernel("lower_nodes", &own)]
    }
}
