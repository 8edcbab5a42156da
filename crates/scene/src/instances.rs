//! Geometry with instances: prototypes, extent, and the same scene placed flat.

use glam::{DVec3, Vec3};

use super::{
    Geometry,
    geometry::{Dropped, extend},
    instance::{Instance, bounds},
    mesh::Mesh,
    transform::Transform,
};

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
    pub fn flattened(mut self) -> Option<Self> {
        let of = |instance: &Instance| {
            self.prototypes[instance.prototype as usize].positions.len() as u64
        };
        let vertices = self.positions.len() as u64 + self.instances.iter().map(of).sum::<u64>();
        u32::try_from(vertices.max(self.triangle_count())).ok()?;
        self.objects.clear();
        let prototypes = std::mem::take(&mut self.prototypes);
        for instance in std::mem::take(&mut self.instances) {
            self.place_instance(&instance, &prototypes[instance.prototype as usize]);
        }
        Some(self)
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
            extend(uvs, own, first, count, [0.0; 2], |&uv| uv);
        }
        let tangent = |&[x, y, z, sign]: &[f32; 4]| {
            let sign = if mirrors { -sign } else { sign };
            unit(map * Vec3::new(x, y, z).as_dvec3()).extend(sign).to_array()
        };
        extend(&mut self.tangents, &mesh.tangents, first, count, [0.0; 4], tangent);
        extend(&mut self.colors, &mesh.colors, first, count, [1.0; 4], |&c| c);
        let first = first as u32;
        self.triangles.extend(mesh.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|corner| first + corner);
            if mirrors { [a, c, b] } else { [a, b, c] }
        }));
        let material = |own: &u32| instance.first_material + (own & instance.material_mask);
        self.materials.extend(mesh.materials.iter().map(material));
    }
}
