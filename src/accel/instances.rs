//! Upper level of the tree: instances with their boxes and records, as `glsl/include/instance.glsl`
//! reads them.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3, Vec3, Vec3A, Vec4};
use obvhs::aabb::Aabb;

use super::geometry_error;
use crate::{
    error::Result,
    scene::{
        Geometry,
        geometry::MAX_COORDINATE,
        instance::{Instance, bounds},
    },
    shader::constants::INSTANCE_MIRRORS,
};

/// Share of coordinates by which boxes of instances grow: 64 units of roundoff (2⁻²⁴), about twice
/// the bound in `docs/traversal.md`.
const MARGIN: f64 = 1.0 / 262_144.0;

/// An instance on the device: eight `uvec4`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Record {
    /// Rows of the affine map from the world to the space of the mesh.
    pub object_from_world: [[f32; 4]; 3],
    /// Rows of the inverse map.
    pub world_from_object: [[f32; 4]; 3],
    /// Root of the tree of the mesh.
    pub first_node: u32,
    /// First material, see [`Record::material`].
    pub first_material: u32,
    /// All bits, or none to replace all materials by the first.
    pub material_mask: u32,
    /// Bit `INSTANCE_MIRRORS`; above it 0 for placed triangles, else 1 + the place in
    /// [`Geometry::instances`].
    pub flags: u32,
    /// Growth of node boxes per axis in the space of the mesh, per metre of the reach of the instance
    /// and the distance of the ray's origin from that of the world.
    pub margin: [f32; 3],
    /// Bound of the magnitudes that the transform of a vertex adds up, metres.
    pub reach: f32,
}

/// Upper level: the instances in no particular order, with a box in the world for each.
#[derive(Debug, Default)]
pub(super) struct Level {
    /// Each with its mesh, see [`Accel::instance_meshes`](super::Accel::instance_meshes).
    pub(super) records: Vec<(Record, u32)>,
    pub(super) boxes: Vec<Aabb>,
}

impl Level {
    /// Adds the triangles that lie in the world, whose tree has its root at `first_node`.
    pub(super) fn add_placed(&mut self, around: [Vec3; 2], first_node: u32) {
        let identity = [Vec4::X, Vec4::Y, Vec4::Z].map(|row| row.to_array());
        let record = Record {
            object_from_world: identity,
            world_from_object: identity,
            first_node,
            material_mask: u32::MAX,
            // Boxes of placed triangles have their margin.
            ..Record::default()
        };
        self.records.push((record, 0));
        let [low, high] = around.map(Vec3A::from);
        let margin = Vec3A::splat(low.abs().max(high.abs()).max_element() * MARGIN as f32);
        self.boxes.push(Aabb::new(low - margin, high + margin));
    }

    /// Adds an instance of a mesh with bounds `around`. `label` names it in errors.
    pub(super) fn add(
        &mut self,
        label: usize,
        instance: &Instance,
        around: [Vec3; 2],
        first_node: u32,
    ) -> Result<()> {
        let Some(inverse) = instance.object_from_world() else {
            return Err(geometry_error(format!(
                "instance {label}: expected a transform with an inverse and elements of at most 1e6 \
                 in both, found {:?}",
                instance.world_from_object
            )));
        };
        let map = instance.affine();
        let largest = around[0].abs().max(around[1].abs()).as_dvec3();
        let reach = reach(&map, largest);
        if reach > 4.0 * f64::from(MAX_COORDINATE) {
            return Err(geometry_error(format!(
                "instance {label} reaches {reach:e} m; expected at most {MAX_COORDINATE:e} m: scale \
                 or move it"
            )));
        }
        let rows = |map: &DAffine3| {
            let linear = map.matrix3.transpose();
            let row = |row: DVec3, shift: f64| row.extend(shift).as_vec4().to_array();
            let shift = map.translation;
            [row(linear.x_axis, shift.x), row(linear.y_axis, shift.y), row(linear.z_axis, shift.z)]
        };
        let spread = inverse.matrix3.x_axis.abs()
            + inverse.matrix3.y_axis.abs()
            + inverse.matrix3.z_axis.abs();
        let record = Record {
            object_from_world: rows(&inverse),
            world_from_object: instance.world_from_object.map(|row| row.to_array()),
            first_node,
            first_material: instance.first_material,
            material_mask: instance.material_mask,
            flags: (label as u32 + 1) << 1 | if instance.mirrors() { INSTANCE_MIRRORS } else { 0 },
            margin: (MARGIN * spread).as_vec3().to_array(),
            reach: reach as f32,
        };
        self.records.push((record, instance.prototype + 1));
        let margin = Vec3A::splat((MARGIN * reach) as f32);
        let mut aabb = Aabb::empty();
        for corner in instance.corners(around) {
            aabb = aabb.union(&Aabb::from_point(corner.into()));
        }
        self.boxes.push(Aabb::new(aabb.min - margin, aabb.max + margin));
        Ok(())
    }
}

/// Largest sum of magnitudes over the rows of an affine map of points up to `largest`.
fn reach(map: &DAffine3, largest: DVec3) -> f64 {
    let matrix = &map.matrix3;
    let sum = largest.x * matrix.x_axis.abs()
        + largest.y * matrix.y_axis.abs()
        + largest.z * matrix.z_axis.abs();
    (sum + map.translation.abs()).max_element()
}

/// Bounds of the triangles `kept` of a mesh; none without triangles.
pub(super) fn bounds_of(mesh: &Geometry, kept: &[u32]) -> Option<[Vec3; 2]> {
    bounds(kept.iter().flat_map(|&triangle| super::corners(mesh, triangle)))
}

impl Record {
    pub(super) fn point_to_object(&self, point: Vec3) -> Vec3 {
        map_point(&self.object_from_world, point)
    }

    pub(super) fn vector_to_object(&self, vector: Vec3) -> Vec3 {
        Vec3::from(self.object_from_world.map(|[x, y, z, _]| Vec3::new(x, y, z).dot(vector)))
    }

    pub(crate) fn point_to_world(&self, position: Vec3) -> Vec3 {
        map_point(&self.world_from_object, position)
    }

    /// Material of a triangle that has `own` in its mesh.
    pub(crate) fn material(&self, own: u32) -> u32 {
        self.first_material + (own & self.material_mask)
    }

    /// Growth of node boxes for a ray that starts at `origin`.
    pub(super) fn margin_from(&self, origin: Vec3) -> Vec3 {
        Vec3::from(self.margin) * (self.reach + origin.abs().max_element())
    }
}

/// Affine map of a point by its rows; twin of `map_point` in `instance.glsl`.
fn map_point(rows: &[[f32; 4]; 3], point: Vec3) -> Vec3 {
    Vec3::from(rows.map(|[x, y, z, shift]| Vec3::new(x, y, z).dot(point) + shift))
}
