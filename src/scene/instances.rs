//! Meshes that are in memory once and in the scene many times.

use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};

use super::{Geometry, geometry::Dropped, mesh::Mesh, transform::Transform};

/// Triangles of repeated meshes that a scene holds in world space, all copies together. Beyond,
/// meshes that repeat become instances. Placed copies are faster to trace (`docs/traversal.md`).
pub const PLACED_TRIANGLES: usize = 1 << 20;

/// Triangles of a mesh below which its copies are always placed: an instance takes as much memory as
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
        let instances = all > PLACED_TRIANGLES && triangles >= FEWEST_INSTANCED;
        if !instances {
            self.placed_triangles = all;
        }
        instances
    }
}

/// A mesh of [`Geometry::prototypes`], for its instances.
#[derive(Clone, Copy, Debug)]
pub struct Prototype {
    /// Index of the mesh.
    pub index: u32,
    /// Box around its triangles in its own space; none without any.
    pub around: Option<[Vec3; 2]>,
}

impl Prototype {
    /// Corners in the world of the box of an instance.
    pub fn corners(&self, instance: &Instance) -> impl Iterator<Item = Vec3> {
        self.around.map(|around| instance.corners(around)).into_iter().flatten()
    }
}

/// A mesh of [`Geometry::prototypes`] in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`Geometry::prototypes`].
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
        let linear = transform.linear.transpose();
        let row = |row: Vec3, shift: f32| row.extend(shift);
        let instance = Self {
            prototype,
            world_from_object: [
                row(linear.x_axis, transform.translate.x),
                row(linear.y_axis, transform.translate.y),
                row(linear.z_axis, transform.translate.z),
            ],
            first_material,
            material_mask: if replaces { 0 } else { u32::MAX },
        };
        instance.object_from_world().map(|_| instance)
    }

    /// Affine map from the space of the mesh to the world.
    pub fn affine(&self) -> DAffine3 {
        let [x, y, z] = self.world_from_object.map(|row| row.as_dvec4());
        let linear = DMat3::from_cols(x.truncate(), y.truncate(), z.truncate()).transpose();
        DAffine3 { matrix3: linear, translation: DVec3::new(x.w, y.w, z.w) }
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
        let outer =
            DAffine3 { matrix3: outer.linear.as_dmat3(), translation: outer.translate.as_dvec3() };
        let whole = outer * self.affine();
        let linear = whole.matrix3.transpose();
        let shift = whole.translation;
        let row = |row: DVec3, shift: f64| row.extend(shift).as_vec4();
        let moved = Self {
            world_from_object: [
                row(linear.x_axis, shift.x),
                row(linear.y_axis, shift.y),
                row(linear.z_axis, shift.z),
            ],
            ..*self
        };
        moved.object_from_world().map(|_| moved)
    }

    /// Corners of a box in the space of the mesh, in the world.
    pub fn corners(&self, [low, high]: [Vec3; 2]) -> [Vec3; 8] {
        std::array::from_fn(|corner| {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            self.position(Vec3::new(pick(0), pick(1), pick(2)))
        })
    }
}

/// Box around positions; none without any.
pub fn bounds(positions: impl IntoIterator<Item = Vec3>) -> Option<[Vec3; 2]> {
    positions.into_iter().fold(None, |bounds, position| match bounds {
        None => Some([position; 2]),
        Some([low, high]) => Some([low.min(position), high.max(position)]),
    })
}

impl Geometry {
    /// Adds a mesh in its own space for instances to place; `material_of` gives the material of each
    /// triangle.
    pub fn add_prototype(
        &mut self,
        mesh: &Mesh,
        material_of: impl Fn(usize) -> u32,
    ) -> (Prototype, Dropped) {
        let mut prototype = Self::default();
        let stay = Transform::new([1.0; 3], [0.0; 3], [0.0; 3]);
        let dropped = prototype.append(mesh, &stay, material_of);
        let around = bounds(prototype.used_positions());
        self.prototypes.push(prototype);
        let index = self.prototypes.len() as u32 - 1;
        (Prototype { index, around }, dropped)
    }

    /// The prototypes with their boxes.
    pub fn prototypes(&self) -> Vec<Prototype> {
        let prototypes = (0..).zip(&self.prototypes);
        let around = |mesh: &Self| bounds(mesh.used_positions());
        prototypes.map(|(index, mesh)| Prototype { index, around: around(mesh) }).collect()
    }

    /// Positions in the world that no triangle goes beyond: those of placed vertices, and of the
    /// corners of the boxes of instances.
    pub fn extent(&self) -> impl Iterator<Item = Vec3> {
        let placed = self.positions.iter().map(|&position| Vec3::from_array(position));
        placed.chain(self.instance_corners())
    }

    /// As [`Geometry::extent`], without the vertices that no triangle uses.
    pub fn used_extent(&self) -> impl Iterator<Item = Vec3> {
        self.used_positions().chain(self.instance_corners())
    }

    fn used_positions(&self) -> impl Iterator<Item = Vec3> {
        let corners = self.triangles.iter().flatten();
        corners.map(|&corner| Vec3::from_array(self.positions[corner as usize]))
    }

    fn instance_corners(&self) -> impl Iterator<Item = Vec3> {
        let prototypes = self.prototypes();
        self.instances.iter().flat_map(move |instance| {
            let corners = prototypes[instance.prototype as usize].corners(instance);
            corners.collect::<Vec<_>>()
        })
    }

    /// Triangles in the scene, those of instances each time.
    pub fn triangle_count(&self) -> u64 {
        let of = |instance: &Instance| {
            self.prototypes[instance.prototype as usize].triangles.len() as u64
        };
        self.triangles.len() as u64 + self.instances.iter().map(of).sum::<u64>()
    }

    /// Material of every triangle in the scene, those of instances each time.
    pub fn materials_in_use(&self) -> impl Iterator<Item = u32> {
        let instanced = self.instances.iter().flat_map(|instance| {
            let own = &self.prototypes[instance.prototype as usize].materials;
            own.iter().map(|own| instance.first_material + (own & instance.material_mask))
        });
        self.materials.iter().copied().chain(instanced)
    }

    /// The same scene with every instance placed: for exports, and for comparison. None if 32-bit
    /// indices cannot address the vertices.
    pub fn flattened(&self) -> Option<Self> {
        let of = |instance: &Instance| {
            self.prototypes[instance.prototype as usize].positions.len() as u64
        };
        let vertices = self.positions.len() as u64 + self.instances.iter().map(of).sum::<u64>();
        u32::try_from(vertices.max(self.triangle_count())).ok()?;
        let mut flat = Self {
            positions: self.positions.clone(),
            normals: self.normals.clone(),
            uvs: self.uvs.clone(),
            tangents: self.tangents.clone(),
            colors: self.colors.clone(),
            triangles: self.triangles.clone(),
            materials: self.materials.clone(),
            ..Self::default()
        };
        for instance in &self.instances {
            flat.place_instance(instance, &self.prototypes[instance.prototype as usize]);
        }
        Some(flat)
    }

    /// Adds the triangles of an instance of `mesh` in the world.
    pub(super) fn place_instance(&mut self, instance: &Instance, mesh: &Self) {
        let first = self.positions.len();
        let mirrors = instance.mirrors();
        let map = instance.affine().matrix3;
        let turn = map.inverse().transpose();
        let at = |&position: &[f32; 3]| instance.position(position.into()).to_array();
        self.positions.extend(mesh.positions.iter().map(at));
        let unit = |vector: DVec3| vector.normalize_or_zero().as_vec3();
        let normal =
            |&normal: &[f32; 3]| unit(turn * Vec3::from_array(normal).as_dvec3()).to_array();
        self.normals.extend(mesh.normals.iter().map(normal));
        let count = self.positions.len();
        for (uvs, own) in self.uvs.iter_mut().zip(&mesh.uvs) {
            super::geometry::extend(uvs, own, first, count, [0.0; 2], |&uv| uv);
        }
        let tangent = |&[x, y, z, sign]: &[f32; 4]| {
            let sign = if mirrors { -sign } else { sign };
            unit(map * Vec3::new(x, y, z).as_dvec3()).extend(sign).to_array()
        };
        super::geometry::extend(
            &mut self.tangents,
            &mesh.tangents,
            first,
            count,
            [0.0; 4],
            tangent,
        );
        super::geometry::extend(&mut self.colors, &mesh.colors, first, count, [1.0; 4], |&c| c);
        let first = first as u32;
        self.triangles.extend(mesh.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|corner| first + corner);
            if mirrors { [a, c, b] } else { [a, b, c] }
        }));
        let material = |own: &u32| instance.first_material + (own & instance.material_mask);
        self.materials.extend(mesh.materials.iter().map(material));
    }
}
