//! Triangles of a scene by material: the one place where exports read its geometry.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};

use crate::{
    Geometry, Scene, instance,
    material::Surface,
    texture::{TextureUse, lookup::gradient_tangent},
};

/// Vertex in world space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// Position, metres.
    pub(super) position: Vec3,
    /// Unit normal; 0 without.
    pub(super) normal: Vec3,
    /// Two sets of texture coordinates; 0 without.
    pub(super) uvs: [Vec2; 2],
    /// Unit tangent and the sign of the bitangent; 0 without.
    pub(super) tangent: Vec4,
    /// Colour and opacity; 1 without.
    pub(super) color: Vec4,
}

/// Triangles of one material that are all smooth or all flat, with the vertices they use.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    pub(super) vertices: Vec<Vertex>,
    /// Three indices into `vertices` per triangle.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Triangles of one material: those with normals at all corners, and the flat ones.
#[derive(Clone, Debug, Default)]
pub(super) struct Parts([Part; 2]);

/// Facts about the triangles of a material that its translation depends on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Triangles {
    /// Some vertices have colours that the surface shows.
    pub(super) has_colors: bool,
    /// Some vertices have opacities that the surface shows and that are not 1.
    pub(super) has_transparency: bool,
    pub(super) has_tangents: bool,
    /// Triangles whose bitangent is the normal × the tangent, and those with the opposite.
    pub(super) bitangents: [usize; 2],
}

/// Divides the triangles of a scene by material. Normals of vertices that point to the back of a triangle are
/// turned: in other renderers they decide on the front.
pub(super) fn divide(scene: &Scene) -> Vec<Parts> {
    let Geometry { triangles, materials, .. } = &scene.geometry;
    let mut all = vec![Parts::default(); scene.materials.len()];
    let mut places = vec![[HashMap::new(), HashMap::new()]; all.len()];
    for (triangle, &material) in triangles.iter().zip(materials) {
        let mut corners = triangle.map(|at| vertex(&scene.geometry, at as usize));
        let is_flat = corners.iter().any(|corner| corner.normal == Vec3::ZERO);
        let shading: Vec3 = corners.iter().map(|corner| corner.normal).sum();
        let is_opposed = face(corners).dot(shading) < 0.0;
        if is_opposed {
            corners.iter_mut().for_each(|corner| corner.normal *= -1.0);
        }
        let part = &mut all[material as usize].0[usize::from(is_flat)];
        let places = &mut places[material as usize][usize::from(is_flat)];
        let indices = [0, 1, 2].map(|corner| {
            *places.entry((triangle[corner], is_opposed)).or_insert_with(|| {
                part.vertices.push(corners[corner]);
                part.vertices.len() as u32 - 1
            })
        });
        part.triangles.push(indices);
    }
    all
}

fn vertex(geometry: &Geometry, at: usize) -> Vertex {
    let Geometry { positions, normals, uvs, tangents, colors, .. } = geometry;
    let uv = |set: usize| uvs[set].get(at).copied().unwrap_or_default().into();
    Vertex {
        position: positions[at].into(),
        normal: normals[at].into(),
        uvs: [uv(0), uv(1)],
        tangent: tangents.get(at).copied().unwrap_or_default().into(),
        color: colors.get(at).copied().unwrap_or([1.0; 4]).into(),
    }
}

impl Parts {
    /// The parts that have triangles, and true for the flat one.
    pub(super) fn each(&self) -> impl Iterator<Item = (&Part, bool)> {
        self.0.iter().zip([false, true]).filter(|(part, _)| !part.triangles.is_empty())
    }

    pub(super) fn describe(&self, surface: &Surface) -> Triangles {
        let mut facts = Triangles::default();
        for (part, _) in self.each() {
            for vertex in &part.vertices {
                facts.has_colors |= surface.vertex_color && vertex.color != Vec4::ONE;
                facts.has_transparency |= surface.vertex_color && vertex.color.w < 1.0;
                facts.has_tangents |= vertex.tangent.truncate() != Vec3::ZERO;
            }
            for &triangle in &part.triangles {
                let corners = triangle.map(|at| part.vertices[at as usize]);
                if let Some(used) = &surface.normal {
                    let sign = tangent(corners, used).w;
                    facts.bitangents[usize::from(sign < 0.0)] += usize::from(sign != 0.0);
                }
            }
        }
        facts
    }
}

impl Part {
    /// Gives each vertex the normal of its triangle, and the tangent that this has by the coordinates of
    /// a normal map, unless it has its own. Vertices are repeated where triangles differ.
    pub(super) fn with_frames(&self, used: &TextureUse) -> Self {
        let mut places = vec![None; self.vertices.len()];
        let (mut vertices, mut triangles) = (Vec::new(), self.triangles.clone());
        let mut add = |vertex: Vertex| {
            vertices.push(vertex);
            vertices.len() as u32 - 1
        };
        for triangle in &mut triangles {
            let corners = triangle.map(|at| self.vertices[at as usize]);
            let is_framed = corners.iter().all(|corner| {
                corner.normal != Vec3::ZERO && corner.tangent.truncate() != Vec3::ZERO
            });
            let (flat, along) = (face(corners).normalize_or_zero(), tangent(corners, used));
            let is_flat = corners.iter().any(|corner| corner.normal == Vec3::ZERO);
            for (corner, index) in corners.iter().zip(triangle) {
                *index = if is_framed {
                    *places[*index as usize].get_or_insert_with(|| add(*corner))
                } else {
                    let normal = if is_flat { flat } else { corner.normal };
                    add(Vertex { normal, tangent: along, ..*corner })
                };
            }
        }
        Self { vertices, triangles }
    }

    /// The same triangles seen from behind, so far behind their front, metres.
    pub(super) fn turned(&self, distance: f32) -> Self {
        let mut sums = vec![Vec3::ZERO; self.vertices.len()];
        for &triangle in &self.triangles {
            let normal = face(triangle.map(|at| self.vertices[at as usize])).normalize_or_zero();
            triangle.iter().for_each(|&at| sums[at as usize] += normal);
        }
        let vertices = self.vertices.iter().zip(sums).map(|(vertex, sum)| Vertex {
            position: vertex.position - distance * sum.normalize_or_zero(),
            normal: -vertex.normal,
            ..*vertex
        });
        let triangles = self.triangles.iter().map(|&[a, b, c]| [a, c, b]);
        Self { vertices: vertices.collect(), triangles: triangles.collect() }
    }
}

/// Twice the area of a triangle along its normal.
fn face(corners: [Vertex; 3]) -> Vec3 {
    let [a, b, c] = corners.map(|corner| corner.position);
    (b - a).cross(c - a)
}

/// Tangent of a triangle and the sign of its bitangent: that of its first vertex, else by the
/// coordinates of an image; 0 if these do not tell.
fn tangent(corners: [Vertex; 3], used: &TextureUse) -> Vec4 {
    if corners[0].tangent.truncate() != Vec3::ZERO {
        return corners[0].tangent;
    }
    let [row_u, row_v] = used.image_from_uv.map(Vec3::from);
    let [a, b, c] = corners.map(|corner| {
        let uv = corner.uvs[used.uv_set as usize & 1].extend(1.0);
        Vec2::new(row_u.dot(uv), row_v.dot(uv))
    });
    let [first, second, third] = corners.map(|corner| corner.position);
    let normal = face(corners).normalize_or_zero();
    gradient_tangent([second - first, third - first], [b - a, c - a], normal)
}

/// Corners of the box around all vertices, metres; none without any.
pub(super) fn bounds(parts: &[Parts]) -> Option<[Vec3; 2]> {
    let parts = parts.iter().flat_map(Parts::each);
    let positions = parts.flat_map(|(part, _)| part.vertices.iter().map(|vertex| vertex.position));
    instance::bounds(positions)
}
