//! Meshes that are in memory once and in the scene many times.

use glam::{DAffine3, DMat4, DVec4, Vec3, Vec4};

use super::transform::Transform;

/// Triangles of repeated meshes that a scene holds in world space, all copies together. Beyond,
/// meshes that repeat become instances. Placed copies are faster to trace (`docs/traversal.md`).
pub const PLACED_TRIANGLES: usize = 1 << 20;

/// Triangles of a mesh below which up to 2²⁴ of its copies are placed: an instance takes as much memory as
/// three triangles, and a ray that enters it about as long as a few nodes.
pub const FEWEST_INSTANCED: usize = 32;

/// Most instances of a scene.
pub const MAX_INSTANCES: usize = 1 << 24;

/// Largest size of the elements of a transform and its inverse; a copy beyond is placed.
const LARGEST_ELEMENT: f64 = 1e6;

/// Decides in the order of a file which copies of meshes are placed and which become instances.
#[derive(Debug, Default)]
pub struct Budget {
    placed_triangles: usize,
}

impl Budget {
    /// True if `copies` further uses of a mesh of so many triangles become instances: if there are too
    /// many to be placed with those before.
    pub fn takes_instances(&mut self, copies: usize, triangles: usize) -> bool {
        let all = self.placed_triangles.saturating_add(copies.saturating_mul(triangles));
        let least = if all > 1 << 24 { 4 } else { FEWEST_INSTANCED };
        let instances = all > PLACED_TRIANGLES && triangles >= least;
        if !instances {
            self.placed_triangles = all;
        }
        instances
    }
}

/// A mesh of [`super::Geometry::prototypes`] in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`super::Geometry::prototypes`].
    pub prototype: u32,
    /// Rows of the affine map from the space of the mesh to the world; the fourth column is the
    /// translation in metres.
    pub world_from_object: [Vec4; 3],
    /// Materials of the instance: its triangles have `first_material + (own & material_mask)`.
    pub first_material: u32,
    /// All bits to keep the materials of the mesh, none to replace them by one.
    pub material_mask: u32,
}

impl Instance {
    /// Places `prototype` with its own materials moved by `first_material`, or all of them replaced
    /// by it. None for a transform too extreme to trace: elements of it or its inverse beyond 10⁶.
    pub fn new(
        prototype: u32,
        transform: &Transform,
        first_material: u32,
        replaces: bool,
    ) -> Option<Self> {
        let material_mask = if replaces { 0 } else { u32::MAX };
        let world_from_object = [Vec4::ZERO; 3];
        Self { prototype, world_from_object, first_material, material_mask }
            .placed(affine(transform))
    }

    /// The same instance with another affine map from the space of the mesh to the world.
    fn placed(self, map: DAffine3) -> Option<Self> {
        let rows = DMat4::from(map).transpose();
        let world_from_object = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.as_vec4());
        let placed = Self { world_from_object, ..self };
        placed.object_from_world().map(|_| placed)
    }

    /// Affine map from the space of the mesh to the world.
    pub fn affine(&self) -> DAffine3 {
        let [x, y, z] = self.world_from_object.map(|row| row.as_dvec4());
        DAffine3::from_mat4(DMat4::from_cols(x, y, z, DVec4::W).transpose())
    }

    /// Inverse of [`Instance::affine`]; none if it is not finite, or either of the two is extreme.
    pub fn object_from_world(&self) -> Option<DAffine3> {
        let forward = self.affine();
        let backward = forward.inverse();
        let largest = |map: &DAffine3| {
            map.matrix3.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max)
        };
        let is_fine = forward.is_finite()
            && backward.is_finite()
            && largest(&forward).max(largest(&backward)) <= LARGEST_ELEMENT;
        is_fine.then_some(backward)
    }

    /// True if triangles turn their winding round.
    pub fn mirrors(&self) -> bool {
        self.affine().matrix3.determinant() < 0.0
    }

    /// Takes a position of the mesh to the world; twin of `map_point` in `instance.glsl`.
    pub fn position(&self, position: Vec3) -> Vec3 {
        Vec3::from(self.world_from_object.map(|row| row.truncate().dot(position) + row.w))
    }

    /// Moves the instance by a further transform.
    pub fn moved(&self, outer: &Transform) -> Option<Self> {
        self.placed(affine(outer) * self.affine())
    }

    /// Corners of a box in the space of the mesh, in the world.
    pub fn corners(&self, [low, high]: [Vec3; 2]) -> [Vec3; 8] {
        std::array::from_fn(|corner| {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            self.position(Vec3::new(pick(0), pick(1), pick(2)))
        })
    }
}

fn affine(transform: &Transform) -> DAffine3 {
    DAffine3::from_mat3_translation(transform.linear.as_dmat3(), transform.translate.as_dvec3())
}

/// Box around positions; none without any.
pub fn bounds(positions: impl IntoIterator<Item = Vec3>) -> Option<[Vec3; 2]> {
    positions.into_iter().fold(None, |bounds, position| match bounds {
        None => Some([position; 2]),
        Some([low, high]) => Some([low.min(position), high.max(position)]),
    })
}
