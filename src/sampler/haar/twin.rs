//! Product at one hit on the host: twin of `glsl/haar/nodes.glsl` and `reflectance.glsl`.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::tree::{Tree, place_in_square, warp};
use crate::{
    brdf::twin::brdf_evaluate_and_pdf,
    math::{colour::luminance, equal_area::direction_from_square},
    shader::structs::Material,
};

/// Nodes hold multiples of this unit.
pub const REFLECTANCE_UNIT: f32 = 1.0 / 256.0;
const LARGEST_REFLECTANCE: f32 = 6e4 * REFLECTANCE_UNIT;

/// Angle from the centre of a node of `level` to its corners, about.
pub fn node_radius(level: u32) -> f32 {
    2.506_628 / (1_u32 << level) as f32
}

/// Direction to the centre of a node.
pub fn node_centre(level: u32, node: u32) -> Vec3 {
    direction_from_square(place_in_square(level, node, Vec2::splat(0.5)))
}

/// Luminance of BRDF × cosine of a node, in [`REFLECTANCE_UNIT`], for directions in the shading frame; 0
/// below the horizon. `material` is as the scene has it.
///
/// # Panics
/// The material is of an unknown kind.
pub fn node_reflectance(
    brdf_table: &[u32],
    material: &Material,
    outgoing_local: Vec3,
    centre_local: Vec3,
    level: u32,
) -> f32 {
    let radius = node_radius(level);
    if centre_local.z <= -radius {
        return 0.0;
    }
    let width = 0.5 * radius;
    let alpha = (material.alpha * material.alpha + width * width).sqrt().min(1.0);
    let material = Material { alpha, ..*material };
    let above = centre_local.z + radius;
    let cosine =
        if centre_local.z > radius { centre_local.z } else { above * above / (4.0 * radius) };
    let incident_local = centre_local.truncate().extend(cosine).normalize();
    let (value, _) = brdf_evaluate_and_pdf(brdf_table, &material, outgoing_local, incident_local);
    (luminance(value) * cosine).min(LARGEST_REFLECTANCE) / REFLECTANCE_UNIT
}

/// Product of the environment and the nodes of one hit.
#[derive(Clone, Debug)]
pub struct Product<'a> {
    tree: &'a Tree,
    level: u32,
    /// Mean reflectances of the nodes, in Morton order.
    reflectances: Vec<f32>,
    total: f32,
}

impl<'a> Product<'a> {
    /// Multiplies `reflectances`, one for each node of `level`, with the environment.
    ///
    /// # Panics
    /// There are not 4^`level` of them.
    pub fn new(tree: &'a Tree, level: u32, reflectances: Vec<f32>) -> Self {
        assert_eq!(reflectances.len(), 1 << (2 * level), "one number for each node");
        let mut product = Self { tree, level, reflectances, total: 0.0 };
        product.total = product.sum_below(0, 0);
        product
    }

    /// Sum of the weights of all nodes.
    pub fn total(&self) -> f32 {
        self.total
    }

    /// Sum of the weights of the nodes below a node.
    fn sum_below(&self, level: u32, node: u32) -> f32 {
        let shift = 2 * (self.level - level);
        (node << shift..(node + 1) << shift).map(|node| self.weight(node)).sum()
    }

    fn weight(&self, node: u32) -> f32 {
        let light = self.tree.children(self.level - 1, node >> 2)[(node & 3) as usize];
        self.reflectances[node as usize] * light
    }

    fn density(&self, node: u32, light: f32) -> f32 {
        let nodes = (1_u32 << (2 * self.level)) as f32;
        self.reflectances[node as usize] * light / self.total * (nodes / (4.0 * PI))
    }

    /// Density of a direction per steradian, for a total above 0.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let texel = self.tree.texel_of(direction);
        self.density(texel >> (2 * (self.tree.depth() - self.level)), self.tree.texel(texel))
    }

    /// Samples a direction and its density by hierarchical warping, for a total above 0; `u` in \[0, 1)².
    pub fn sample(&self, mut u: Vec2) -> (Vec3, f32) {
        let mut node = 0;
        for level in 0..self.level {
            let sums = [0, 1, 2, 3].map(|child| self.sum_below(level + 1, 4 * node + child));
            node = 4 * node + warp(sums, &mut u);
        }
        let (product_node, mut light) = (node, 0.0);
        for level in self.level..self.tree.depth() {
            let children = self.tree.children(level, node);
            let child = warp(children, &mut u);
            light = children[child as usize];
            node = 4 * node + child;
        }
        let at = place_in_square(self.tree.depth(), node, u);
        (direction_from_square(at), self.density(product_node, light))
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use glam::vec2;

    use super::*;
    use crate::scene::EnvironmentMap;

    #[test]
    fn the_density_of_a_constant_map_is_that_of_the_nodes() {
        let map = EnvironmentMap::constant(Vec3::ONE, 2.0).unwrap();
        let tree = Tree::new(&map);
        let mut reflectances = vec![0.0; 64];
        reflectances[9] = 3.0;
        reflectances[40] = 1.0;
        let product = Product::new(&tree, 3, reflectances);
        assert!((product.total() / 8.0 - 1.0).abs() < 1e-5);
        let density = product.pdf(node_centre(3, 9));
        assert!((density * 4.0 * PI / 64.0 - 0.75).abs() < 1e-5, "{density}");
        for index in 0..100 {
            let u = vec2(index as f32 / 100.0, (index * 37 % 100) as f32 / 100.0);
            let (direction, density) = product.sample(u);
            let again = product.pdf(direction);
            assert!((density / again - 1.0).abs() < 1e-5, "{u}: {density}, then {again}");
        }
    }
}
