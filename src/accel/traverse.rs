//! Traversal on the host over the arrays of [`Accel`]: the Rust twin of `bvh.glsl`, with the same
//! names and order of operations. On a device that does not fuse multiplications and additions,
//! both find the same triangle at the same distance to the bit.

use glam::{UVec2, Vec3};

use super::{Accel, Node, instances::Record};
use crate::{
    math::frame::{Frame, frame_from_normal},
    shader::constants::{BVH_STACK_ENTRIES, NO_INSTANCE},
};

/// Closest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// Triangle in BVH order.
    pub triangle: u32,
    /// Instance in the order of the upper level; `NO_INSTANCE` in a tree of one level.
    pub instance: u32,
    /// Distance along the ray, metres.
    pub distance: f32,
}

/// Initial distance, before a ray has met anything.
pub(crate) const FAR_AWAY: f32 = 3.0e38;

/// Offset of ray origins from their surface, as a share of the scene's size.
const RAY_OFFSET_SHARE: f32 = 3.814_697_3e-6;

impl Accel {
    /// Finds the first triangle that the ray meets; `direction` is a unit vector.
    pub fn closest(&self, origin: Vec3, direction: Vec3) -> Option<Intersection> {
        self.closest_before(origin, direction, FAR_AWAY)
    }

    /// As [`Accel::closest`], before so many metres.
    pub(crate) fn closest_before(
        &self,
        origin: Vec3,
        direction: Vec3,
        farthest: f32,
    ) -> Option<Intersection> {
        let mut ray = Traversal::start(self, origin, direction, false);
        ray.distance = farthest;
        while ray.step() {}
        ray.hit()
    }

    /// True if the ray meets any triangle; `direction` is a unit vector.
    pub fn is_occluded(&self, origin: Vec3, direction: Vec3) -> bool {
        let mut ray = Traversal::start(self, origin, direction, true);
        while ray.step() {}
        ray.hit().is_some()
    }

    /// Offset of ray origins from their surface, metres.
    pub fn ray_offset(&self) -> f32 {
        let root = &self.nodes[0];
        let corner = node_corner(root);
        let size = corner.abs().max((corner + 255.0 * node_spacing(root)).abs());
        RAY_OFFSET_SHARE * size.max_element()
    }

    /// Origin of a ray that leaves a surface, offset by more than the error of positions and of the
    /// triangle test.
    pub fn offset_ray_origin(
        &self,
        position: Vec3,
        geometric_normal: Vec3,
        direction: Vec3,
    ) -> Vec3 {
        moved_off_surface(position, geometric_normal, direction, self.ray_offset())
    }
}

/// Moves `position` by `offset` to the side of the surface that `direction` leads to.
pub(crate) fn moved_off_surface(
    position: Vec3,
    geometric_normal: Vec3,
    direction: Vec3,
    offset: f32,
) -> Vec3 {
    position
        + (if geometric_normal.dot(direction) < 0.0 { -offset } else { offset }) * geometric_normal
}

/// Position of a vertex in the world.
pub fn placed(instance: Option<&Record>, position: [f32; 3]) -> Vec3 {
    let position = Vec3::from_array(position);
    instance.map_or(position, |instance| instance.point_to_world(position))
}

/// Twice the signed areas of the three sub-triangles around a ray, given the vertices in its frame.
/// \[Woop et al. 2013\], with an orthonormal frame for the shear.
pub fn edge_functions([a, b, c]: [Vec3; 3]) -> Vec3 {
    Vec3::new(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x)
}

/// Sum of the vertices' distances along the ray, weighted by `areas`.
pub fn depth(areas: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    areas.x * a.z + areas.y * b.z + areas.z * c.z
}

fn node_corner(node: &Node) -> Vec3 {
    Vec3::new(f32::from_bits(node[0]), f32::from_bits(node[1]), f32::from_bits(node[2]))
}

/// Distance between neighbouring quantised planes of a node's children, per axis.
fn node_spacing(node: &Node) -> Vec3 {
    Vec3::new(
        f32::from_bits((node[3] & 0xff) << 23),
        f32::from_bits((node[3] & 0xff00) << 15),
        f32::from_bits((node[3] & 0x00ff_0000) << 7),
    )
}

/// 1 / x, finite even for x = 0.
fn inverse(x: f32) -> f32 {
    if x.abs() > 1e-18 {
        1.0 / x
    } else if x < 0.0 {
        -1e18
    } else {
        1e18
    }
}

struct Traversal<'a> {
    accel: &'a Accel,
    any_hit: bool,
    origin: Vec3,
    direction: Vec3,
    frame: Frame,
    node_origin: Vec3,
    node_direction: Vec3,
    node_margin: Vec3,
    instance: u32,
    hit_instance: u32,
    stack_base: usize,
    inverse_direction: Vec3,
    octant4: u32,
    distance: f32,
    triangle: Option<u32>,
    nodes_waiting: UVec2,
    triangles_waiting: UVec2,
    triangles_next: UVec2,
    stack: [UVec2; BVH_STACK_ENTRIES as usize],
    stack_size: usize,
}

impl<'a> Traversal<'a> {
    /// Starts a ray. The closest hit visits the nearest children first, any hit the farthest.
    fn start(accel: &'a Accel, origin: Vec3, direction: Vec3, any_hit: bool) -> Self {
        let mut ray = Self {
            accel,
            any_hit,
            origin,
            direction,
            frame: frame_from_normal(direction),
            node_origin: origin,
            node_direction: direction,
            node_margin: Vec3::ZERO,
            instance: NO_INSTANCE,
            hit_instance: NO_INSTANCE,
            stack_base: 0,
            inverse_direction: Vec3::ZERO,
            octant4: 0,
            distance: FAR_AWAY,
            triangle: None,
            nodes_waiting: UVec2::new(0, 0x8000_0000),
            triangles_waiting: UVec2::ZERO,
            triangles_next: UVec2::ZERO,
            stack: [UVec2::ZERO; BVH_STACK_ENTRIES as usize],
            stack_size: 0,
        };
        ray.see(direction);
        ray
    }

    /// Sets the direction that nodes see.
    fn see(&mut self, direction: Vec3) {
        let octant = |x: f32, bits| if (x < 0.0) == self.any_hit { bits } else { 0 };
        self.inverse_direction =
            Vec3::new(inverse(direction.x), inverse(direction.y), inverse(direction.z));
        self.octant4 = octant(direction.x, 0x0404_0404)
            | octant(direction.y, 0x0202_0202)
            | octant(direction.z, 0x0101_0101);
    }

    fn hit(&self) -> Option<Intersection> {
        let (instance, distance) = (self.hit_instance, self.distance);
        self.triangle.map(|triangle| Intersection { triangle, instance, distance })
    }

    fn leave_instance(&mut self) {
        self.instance = NO_INSTANCE;
        self.node_origin = self.origin;
        self.node_direction = self.direction;
        self.node_margin = Vec3::ZERO;
        self.see(self.direction);
    }

    fn enter_instance(&mut self, index: u32) {
        let instance = &self.accel.instances[index as usize];
        self.instance = index;
        self.node_origin = instance.point_to_object(self.origin);
        self.node_direction = instance.vector_to_object(self.direction);
        self.node_margin = instance.margin_from(self.origin);
        self.see(self.node_direction);
        self.stack_base = self.stack_size;
        self.nodes_waiting = UVec2::new(instance.first_node, 0x8000_0000);
    }

    fn push(&mut self, group: UVec2) {
        self.stack[self.stack_size] = group;
        self.stack_size += 1;
    }

    /// Moves between the levels of the tree as far as a step needs.
    fn change_level(&mut self) {
        let is_idle = self.nodes_waiting.y <= 0x00ff_ffff && self.triangles_waiting.y == 0;
        if self.instance != NO_INSTANCE {
            if !is_idle || self.stack_size > self.stack_base {
                return;
            }
            self.leave_instance();
        }
        if is_idle && self.stack_size > 0 {
            self.stack_size -= 1;
            let group = self.stack[self.stack_size];
            if group.y > 0x00ff_ffff {
                self.nodes_waiting = group;
            } else {
                self.triangles_waiting = group;
            }
        }
        if self.triangles_waiting.y != 0 {
            let bit = 31 - self.triangles_waiting.y.leading_zeros();
            let instance = self.triangles_waiting.x + bit;
            self.triangles_waiting.y &= !(1 << bit);
            if self.nodes_waiting.y > 0x00ff_ffff {
                self.push(self.nodes_waiting);
            }
            if self.triangles_waiting.y != 0 {
                self.push(self.triangles_waiting);
            }
            self.triangles_waiting.y = 0;
            self.enter_instance(instance);
        }
    }

    /// Visits at most one node and one triangle. Returns false when the ray is finished.
    fn step(&mut self) -> bool {
        let is_instanced = self.accel.is_instanced();
        if is_instanced {
            self.change_level();
        }
        let in_instance = self.instance != NO_INSTANCE;
        let base = if in_instance { self.stack_base } else { 0 };
        if self.nodes_waiting.y <= 0x00ff_ffff && self.stack_size > base {
            self.stack_size -= 1;
            self.nodes_waiting = self.stack[self.stack_size];
        }
        if self.nodes_waiting.y > 0x00ff_ffff && self.triangles_next.y == 0 {
            self.visit_node();
        }
        if self.triangles_waiting.y != 0 && (!is_instanced || in_instance) {
            self.test_triangle();
        }
        if self.triangles_waiting.y == 0 {
            self.triangles_waiting = self.triangles_next;
            self.triangles_next.y = 0;
        }
        self.triangles_waiting.y != 0 || self.nodes_waiting.y > 0x00ff_ffff || self.stack_size > 0
    }

    fn visit_node(&mut self) {
        let hits = self.nodes_waiting.y;
        let bit = 31 - hits.leading_zeros();
        self.nodes_waiting.y &= !(1 << bit);
        if self.nodes_waiting.y > 0x00ff_ffff {
            self.push(self.nodes_waiting);
        }
        let slot = (bit - 24) ^ (self.octant4 & 0xff);
        let index = self.nodes_waiting.x + (hits & !(u32::MAX << slot)).count_ones();
        let node = &self.accel.nodes[index as usize];

        let scale = node_spacing(node) * self.inverse_direction;
        let bias = (node_corner(node) - self.node_origin) * self.inverse_direction;
        let margin = self.node_margin * self.inverse_direction.abs();
        let (near_bias, far_bias) = (bias - margin, bias + margin);
        let mut found = 0;
        for child in 0..8 {
            let half = child / 4;
            let byte = |word: usize| (node[word + half] >> (8 * (child % 4))) & 0xff;
            let mut near = Vec3::ZERO;
            let mut far = Vec3::ZERO;
            for axis in 0..3 {
                let (lower, upper) = (byte(8 + 4 * axis), byte(10 + 4 * axis));
                let (enter, leave) =
                    if self.node_direction[axis] < 0.0 { (upper, lower) } else { (lower, upper) };
                near[axis] = enter as f32;
                far[axis] = leave as f32;
            }
            let enter = near * scale + near_bias;
            let leave = far * scale + far_bias;
            let first = enter.max_element().max(0.0);
            let last = leave.min_element().min(self.distance);
            if first <= last {
                let meta = byte(6);
                let is_inner = meta & 0x18 == 0x18;
                let octant = if is_inner { self.octant4 & 0xff } else { 0 };
                found |= (meta >> 5) << ((meta ^ octant) & 0x1f);
            }
        }
        self.nodes_waiting = UVec2::new(node[4], (found & 0xff00_0000) | (node[3] >> 24));
        let triangles = UVec2::new(node[5], found & 0x00ff_ffff);
        if self.triangles_waiting.y == 0 {
            self.triangles_waiting = triangles;
        } else {
            self.triangles_next = triangles;
        }
    }

    fn test_triangle(&mut self) {
        let bit = 31 - self.triangles_waiting.y.leading_zeros();
        self.triangles_waiting.y &= !(1 << bit);
        let triangle = self.triangles_waiting.x + bit;
        let instance = self.accel.instances.get(self.instance as usize);
        let local = self
            .accel
            .triangle(triangle)
            .vertices
            .map(|vertex| self.frame.to_local(placed(instance, vertex.position) - self.origin));
        let areas = edge_functions(local);
        let area = areas.x + areas.y + areas.z;
        let distance = depth(areas, local) / area;
        let inside = areas.min_element() >= 0.0 || areas.max_element() <= 0.0;
        if inside && area != 0.0 && distance > 0.0 && distance < self.distance {
            self.distance = distance;
            self.triangle = Some(triangle);
            self.hit_instance = self.instance;
            if self.any_hit {
                self.nodes_waiting.y = 0;
                self.triangles_waiting.y = 0;
                self.triangles_next.y = 0;
                self.stack_size = 0;
            }
        }
    }
}
