//! Look-ups in the environment's tree and the product at one hit: twin of `tree.glsl`, `nodes.glsl` and
//! `reflectance.glsl` in `glsl/haar`.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::f32::consts::PI;

use fenestra::{
    brdf::brdf_evaluate,
    math::{
        colour::luminance,
        equal_area::{direction_from_square, square_from_direction},
    },
    sampler::haar::tree::{Tree, first_of_level, node_centre, place_in_square},
    scene::environment::{CourtParameters, EnvironmentMap, EnvironmentTables},
    shader::structs::Material,
};
use glam::{Vec2, Vec3, vec2};

/// Largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Moves bit i of a 16-bit number to bit 2 i.
fn spread_bits(x: u32) -> u32 {
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
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

/// Means of the children of a node.
fn children(tree: &Tree, level: u32, node: u32) -> [f32; 4] {
    tree.nodes[first_of_level(level) + node as usize]
}

/// Number of the texel in a direction.
fn texel_of(tree: &Tree, direction: Vec3) -> u32 {
    let side = (1_u32 << tree.depth) as f32;
    let place = (square_from_direction(direction) * side).min(Vec2::splat(side - 1.0));
    spread_bits(place.x as u32) | spread_bits(place.y as u32) << 1
}

/// Luminance of a texel.
fn texel(tree: &Tree, texel: u32) -> f32 {
    children(tree, tree.depth - 1, texel >> 2)[(texel & 3) as usize]
}

/// Nodes hold multiples of this unit.
pub const REFLECTANCE_UNIT: f32 = 1.0 / 256.0;
const LARGEST_REFLECTANCE: f32 = 6e4 * REFLECTANCE_UNIT;

/// Angle from the centre of a node of `level` to its corners, about.
pub fn node_radius(level: u32) -> f32 {
    2.506_628 / (1_u32 << level) as f32
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
    let value = brdf_evaluate(brdf_table, &material, outgoing_local, incident_local);
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
        let light = children(self.tree, self.level - 1, node >> 2)[(node & 3) as usize];
        self.reflectances[node as usize] * light
    }

    fn density(&self, node: u32, light: f32) -> f32 {
        let nodes = (1_u32 << (2 * self.level)) as f32;
        self.reflectances[node as usize] * light / self.total * (nodes / (4.0 * PI))
    }

    /// Density of a direction per steradian, for a total above 0.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let at = texel_of(self.tree, direction);
        self.density(at >> (2 * (self.tree.depth - self.level)), texel(self.tree, at))
    }

    /// Samples a direction and its density by hierarchical warping, for a total above 0; `u` in \[0, 1)².
    pub fn sample(&self, mut u: Vec2) -> (Vec3, f32) {
        let mut node = 0;
        for level in 0..self.level {
            let sums = [0, 1, 2, 3].map(|child| self.sum_below(level + 1, 4 * node + child));
            node = 4 * node + warp(sums, &mut u);
        }
        let (product_node, mut light) = (node, 0.0);
        for level in self.level..self.tree.depth {
            let children = children(self.tree, level, node);
            let child = warp(children, &mut u);
            light = children[child as usize];
            node = 4 * node + child;
        }
        let at = place_in_square(self.tree.depth, node, u);
        (direction_from_square(at), self.density(product_node, light))
    }
}

#[test]
fn means_are_those_of_the_map() {
    let parameters = CourtParameters { width: 128, ..CourtParameters::default() };
    let map = EnvironmentMap::court(&parameters, 1.0).unwrap().turned(30.0);
    let tree = Tree::new(&map);
    assert_eq!((tree.depth, tree.nodes.len()), (7, first_of_level(7)));
    let total = EnvironmentTables::new(&map).total;
    // The tables sum over u and v, whose Jacobian is 2π² sin θ.
    let expected = f64::from(total) * f64::from(PI) / 2.0;
    let mean = f64::from(children(&tree, 0, 0).iter().sum::<f32>()) / 4.0;
    assert!((mean / expected - 1.0).abs() < 2e-3, "{mean}, expected {expected}");
    let direction = Vec3::new(0.3, 0.9, -0.1).normalize();
    let found = texel_of(&tree, direction);
    let place = direction_from_square(place_in_square(7, found, Vec2::splat(0.5)));
    assert!(place.distance(direction) < 0.05, "{place}");
    assert!(texel(&tree, found) > 0.0);
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
