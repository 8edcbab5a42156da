//! Tangents that normal maps or stretched highlights need and the file does not give: MikkTSpace.
//!
//! \[Mikkelsen 2008\], by the crate `bevy_mikktspace`; glTF 2.0, section 3.7.2.1, asks for it.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::Vec3;

use super::Mesh;

impl Mesh {
    /// Gives tangents to the triangles whose material reads them, unless they have some.
    /// `up` is the sign of v upwards in an image: −1 for coordinates from the upper left corner.
    ///
    /// A vertex is repeated where its triangles need different tangents.
    pub(super) fn complete_tangents(&mut self, up: f32) {
        for uv_set in 0..self.uvs.len() {
            let faces = self.faces_without_tangents(uv_set as u32);
            if faces.is_empty() || self.uvs[uv_set].is_empty() {
                continue;
            }
            let tangents = vec![[0.0; 4]; 3 * faces.len()];
            let mut surface = Surface { mesh: self, uv_set, faces, tangents };
            // The error has no values yet.
            if generate_tangents(&mut surface).is_err() {
                continue;
            }
            let Surface { faces, tangents, .. } = surface;
            self.assign_tangents(&faces, &tangents, up);
        }
    }

    /// Triangles that need tangents along u of a set of texture coordinates.
    fn faces_without_tangents(&self, uv_set: u32) -> Vec<usize> {
        let mut faces = Vec::new();
        for (triangles, material) in self.material_runs() {
            let surface = material.map(|material| &self.materials[material].material.surface);
            if surface.and_then(|surface| surface.tangent_uv_set()) == Some(uv_set) {
                faces.extend(triangles.filter(|&face| {
                    let has_none = |&vertex: &u32| {
                        self.tangents.get(vertex as usize).is_none_or(|t| t[..3] == [0.0; 3])
                    };
                    self.triangles[face].iter().all(has_none)
                }));
            }
        }
        faces
    }

    /// Stores a tangent for each corner of `faces`.
    fn assign_tangents(&mut self, faces: &[usize], tangents: &[[f32; 4]], up: f32) {
        self.tangents.resize(self.positions.len(), [0.0; 4]);
        let mut copies = HashMap::new();
        for (corner, &[x, y, z, sign]) in tangents.iter().enumerate() {
            let place = (faces[corner / 3], corner % 3);
            let vertex = self.triangles[place.0][place.1];
            let tangent = [x, y, z, sign * up];
            let found = self.tangents[vertex as usize];
            if found[..3] == [0.0; 3] {
                self.tangents[vertex as usize] = tangent;
            } else if found != tangent {
                let key = (vertex, tangent.map(f32::to_bits));
                let copy = *copies.entry(key).or_insert_with(|| {
                    let Some(copy) = self.repeat_vertex(vertex) else { return vertex };
                    self.tangents[copy as usize] = tangent;
                    copy
                });
                self.triangles[place.0][place.1] = copy;
            }
        }
    }
}

/// Triangles of a mesh for which tangents are found.
struct Surface<'a> {
    mesh: &'a Mesh,
    uv_set: usize,
    faces: Vec<usize>,
    /// Tangent and sign of the bitangent along v, for each corner of `faces`.
    tangents: Vec<[f32; 4]>,
}

impl Surface<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[self.faces[face]][corner] as usize
    }
}

impl Geometry for Surface<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)]
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        let stored = self.mesh.normals.get(self.vertex(face, corner));
        let stored = stored.map(|normal| Vec3::from_array(*normal).normalize_or_zero());
        let normal = stored.filter(|normal| *normal != Vec3::ZERO).unwrap_or_else(|| {
            let [a, b, c] = [0, 1, 2].map(|corner| Vec3::from_array(self.position(face, corner)));
            (b - a).cross(c - a).normalize_or_zero()
        });
        normal.to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.mesh.uvs[self.uv_set][self.vertex(face, corner)]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        // A face without area has no tangent of its own and may have no neighbour.
        let Some(space) = space else { return };
        let tangent = space.tangent_encoded();
        if tangent.iter().all(|component| component.is_finite()) {
            self.tangents[3 * face + corner] = tangent;
        }
    }
}
