//! Descriptor set 1 of `haar`: tree of the environment, nodes of the product at every hit of a wave.

use std::sync::Arc;

use super::{
    cache_places,
    tree::{Tree, first_of_level, node_centre},
};
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    pass::PathDemand,
    sampler::Parameters,
    shader::rooms::haar,
};

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
        let tree = Buffer::texels_from_slice(device, "environment tree", &tree.nodes)?;
        let centres = Buffer::texels_from_slice(device, "node centres", &centres)?;
        let nodes = Buffer::new(device, "product nodes", paths * self.quads() * 8)?;
        let sums = Buffer::new(device, "node sums", paths * self.sums() * 16)?;
        let cache = Buffer::new(device, "blocked directions", paths * self.cache_words() * 4)?;
        let bound = [
            (haar::HAAR_TREE, &tree),
            (haar::HAAR_CENTRES, &centres),
            (haar::HAAR_NODES, &nodes),
            (haar::HAAR_NODE_TEXELS, &nodes),
            (haar::HAAR_SUMS, &sums),
            (haar::HAAR_SUM_TEXELS, &sums),
            (haar::HAAR_CACHE, &cache),
        ];
        DescriptorSet::new(device, &haar::TABLE, &bound)
    }
}
