//! Quadtree of the environment's luminance over the equal-area square: read by `glsl/haar/tree.glsl`.
//!
//! Nodes of a level are numbered in Morton order. A node holds the means of its four children, the same
//! information as its mean and its three Haar coefficients \[Clarberg et al. 2005\].

use glam::{Vec2, Vec3, vec2};
use rayon::prelude::*;

use crate::{
    math::{colour::luminance, equal_area::direction_from_square},
    scene::EnvironmentMap,
};

/// Least and greatest level of the texels: 64 and 1024 along each side, 22 MB of the device at most.
const DEPTHS: [u32; 2] = [6, 10];
/// Look-ups of the map along each side of a texel.
const LOOKUPS: u32 = 2;

/// Number of the first node of a level, all levels in one row.
pub fn first_of_level(level: u32) -> usize {
    ((1_usize << (2 * level)) - 1) / 3
}

fn gather_bits(x: u32) -> u32 {
    let x = x & 0x5555_5555;
    let x = (x | x >> 1) & 0x3333_3333;
    let x = (x | x >> 2) & 0x0f0f_0f0f;
    let x = (x | x >> 4) & 0x00ff_00ff;
    (x | x >> 8) & 0x0000_ffff
}

/// Place of a node in the square, `u` within it.
pub fn place_in_square(level: u32, node: u32, u: Vec2) -> Vec2 {
    let corner = vec2(gather_bits(node) as f32, gather_bits(node >> 1) as f32);
    (corner + u) / (1_u32 << level) as f32
}

/// Direction to the centre of a node.
pub fn node_centre(level: u32, node: u32) -> Vec3 {
    direction_from_square(place_in_square(level, node, Vec2::splat(0.5)))
}

/// Means of the environment's luminance.
#[derive(Clone, Debug)]
pub struct Tree {
    /// Level of the texels.
    pub depth: u32,
    /// Means of the children of every node, level by level.
    pub nodes: Vec<[f32; 4]>,
}

impl Tree {
    /// Averages `map`, with about as many texels as it has.
    pub fn new(map: &EnvironmentMap) -> Self {
        // A lat-long map has π/2 times as many texels as its densest rows need.
        let texels = 0.64 * f64::from(map.width) * f64::from(map.height);
        let depth = (0.5 * texels.max(1.0).log2()).ceil() as u32;
        let depth = depth.clamp(DEPTHS[0], DEPTHS[1]);
        let mut nodes = vec![[0.0; 4]; first_of_level(depth)];
        let finest = first_of_level(depth - 1);
        nodes[finest..].par_iter_mut().enumerate().for_each(|(node, children)| {
            for (child, mean) in children.iter_mut().enumerate() {
                *mean = texel_mean(map, depth, 4 * node as u32 + child as u32);
            }
        });
        for level in (0..depth - 1).rev() {
            let below = first_of_level(level + 1);
            for node in first_of_level(level)..below {
                let first_child = below + 4 * (node - first_of_level(level));
                for child in 0..4 {
                    // The order of the shader.
                    let [a, b, c, d] = nodes[first_child + child];
                    nodes[node][child] = 0.25 * (a + b + c + d);
                }
            }
        }
        Self { depth, nodes }
    }
}

/// Mean luminance of a texel.
fn texel_mean(map: &EnvironmentMap, depth: u32, texel: u32) -> f32 {
    let lookup = |index: u32| {
        let u = vec2((index % LOOKUPS) as f32 + 0.5, (index / LOOKUPS) as f32 + 0.5);
        let at = place_in_square(depth, texel, u / LOOKUPS as f32);
        luminance(map.radiance(direction_from_square(at)))
    };
    (0..LOOKUPS * LOOKUPS).map(lookup).sum::<f32>() / (LOOKUPS * LOOKUPS) as f32
}
