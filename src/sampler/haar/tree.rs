//! Quadtree of the environment's luminance over the equal-area square: twin of `glsl/haar/tree.glsl`.
//!
//! Nodes of a level are numbered in Morton order. A node holds the means of its four children, the same
//! information as its mean and its three Haar coefficients \[Clarberg et al. 2005\].

use glam::{Vec2, vec2};
use rayon::prelude::*;

use crate::{
    math::{
        colour::luminance,
        equal_area::{direction_from_square, square_from_direction},
    },
    scene::EnvironmentMap,
};

/// Least and greatest level of the texels: 64 and 1024 along each side, 22 MB of the device at most.
const DEPTHS: [u32; 2] = [6, 10];
/// Look-ups of the map along each side of a texel.
const LOOKUPS: u32 = 2;
/// Largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Number of the first node of a level, all levels in one row.
pub fn first_of_level(level: u32) -> usize {
    ((1_usize << (2 * level)) - 1) / 3
}

/// Moves bit i of a 16-bit number to bit 2 i.
fn spread_bits(x: u32) -> u32 {
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
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

/// Chooses one of two in proportion to their weights, and rescales `u` for the next choice.
fn warp_axis(first: f32, second: f32, u: &mut f32) -> bool {
    let sum = first + second;
    let share = if sum > 0.0 { first / sum } else { 0.5 };
    let is_second = *u >= share;
    *u = if is_second { (*u - share) / (1.0 - share) } else { *u / share };
    *u = u.min(BELOW_ONE);
    is_second
}

/// Chooses a child in proportion to its weight: the column, then its row.
pub fn warp(weights: [f32; 4], u: &mut Vec2) -> u32 {
    let [a, b, c, d] = weights;
    let is_right = warp_axis(a + c, b + d, &mut u.x);
    let [upper, lower] = if is_right { [b, d] } else { [a, c] };
    u32::from(is_right) | u32::from(warp_axis(upper, lower, &mut u.y)) << 1
}

/// Means of the environment's luminance.
#[derive(Clone, Debug)]
pub struct Tree {
    depth: u32,
    nodes: Vec<[f32; 4]>,
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
                    nodes[node][child] = 0.25 * sum_of_four(nodes[first_child + child]);
                }
            }
        }
        Self { depth, nodes }
    }

    /// Level of the texels.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Means of the children of every node, level by level.
    pub fn nodes(&self) -> &[[f32; 4]] {
        &self.nodes
    }

    /// Means of the children of a node.
    pub fn children(&self, level: u32, node: u32) -> [f32; 4] {
        self.nodes[first_of_level(level) + node as usize]
    }

    /// Number of the texel in a direction.
    pub fn texel_of(&self, direction: glam::Vec3) -> u32 {
        let side = (1_u32 << self.depth) as f32;
        let place = (square_from_direction(direction) * side).min(Vec2::splat(side - 1.0));
        spread_bits(place.x as u32) | spread_bits(place.y as u32) << 1
    }

    /// Luminance of a texel.
    pub fn texel(&self, texel: u32) -> f32 {
        self.children(self.depth - 1, texel >> 2)[(texel & 3) as usize]
    }
}

/// Sum of four numbers in the order of the shader.
fn sum_of_four(values: [f32; 4]) -> f32 {
    let [a, b, c, d] = values;
    a + b + c + d
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

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use glam::Vec3;

    use super::*;
    use crate::scene::environment::CourtParameters;

    #[test]
    fn means_are_those_of_the_map() {
        let parameters = CourtParameters { width: 128, ..CourtParameters::default() };
        let map = EnvironmentMap::court(&parameters, 1.0, 30.0).unwrap();
        let tree = Tree::new(&map);
        assert_eq!((tree.depth(), tree.nodes().len()), (7, first_of_level(7)));
        let total = crate::scene::environment::EnvironmentTables::new(&map).total;
        // The tables sum over u and v, whose Jacobian is 2π² sin θ.
        let expected = f64::from(total) * std::f64::consts::PI / 2.0;
        let mean = f64::from(sum_of_four(tree.children(0, 0))) / 4.0;
        assert!((mean / expected - 1.0).abs() < 2e-3, "{mean}, expected {expected}");
        let direction = Vec3::new(0.3, 0.9, -0.1).normalize();
        let texel = tree.texel_of(direction);
        let place = direction_from_square(place_in_square(7, texel, Vec2::splat(0.5)));
        assert!(place.distance(direction) < 0.05, "{place}");
        assert!(tree.texel(texel) > 0.0);
    }

    #[test]
    fn warping_chooses_in_proportion() {
        let weights = [1.0, 0.0, 2.0, 5.0];
        let mut counts = [0.0; 4];
        for x in 0..64 {
            for y in 0..64 {
                let mut u = (vec2(x as f32, y as f32) + 0.5) / 64.0;
                counts[warp(weights, &mut u) as usize] += 8.0 / 4096.0;
                assert!(u.cmpge(Vec2::ZERO).all() && u.cmplt(Vec2::ONE).all(), "{u}");
            }
        }
        for (count, weight) in counts.iter().zip(weights) {
            assert!((count - weight).abs() < 0.15, "{counts:?}");
        }
        assert_eq!(counts[1], 0.0);
    }
}
