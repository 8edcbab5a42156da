//! Triangles of the scene.

use std::path::Path;

use glam::Vec3;

use super::{
    instance::Instance,
    mesh::{Mesh, ObjectStart, start_object},
    transform::Transform,
};

/// Largest magnitude of a coordinate, metres; products of four coordinates stay finite in `f32`.
pub const MAX_COORDINATE: f32 = 1e9;

/// All triangles of the scene in world space, and meshes that instances place there. Large meshes that
/// are used many times are in memory once ([`super::instance`]).
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Vertex positions, metres.
    pub positions: Vec<[f32; 3]>,
    /// Unit vertex normals, for shading only; as long as `positions`. A zero vector marks a vertex
    /// without a normal: its triangles are flat-shaded.
    pub normals: Vec<[f32; 3]>,
    /// Two sets of texture coordinates; each as long as `positions`, or empty.
    pub uvs: [Vec<[f32; 2]>; 2],
    /// Unit tangents along u of the first set, and the sign of the bitangent; as long as
    /// `positions`, or empty. A zero vector marks a vertex without: the triangle's coordinates give
    /// its tangent.
    pub tangents: Vec<[f32; 4]>,
    /// Linear Rec.709 colours and opacities of vertices, 0…1; as long as `positions`, or empty.
    pub colors: Vec<[f32; 4]>,
    /// Three vertex indices per triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Material index per triangle.
    pub materials: Vec<u32>,
    /// Starts of objects, in rising order; triangles and instances before the first have no name.
    pub objects: Vec<ObjectStart>,
    /// Meshes in their own space, each in memory once. They emit no light and have no instances.
    pub prototypes: Vec<Geometry>,
    /// Uses of the prototypes.
    pub instances: Vec<Instance>,
}

/// Counts of what [`Geometry::append`] leaves out of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Triangles without area, or too small to compute the direction of their normal.
    pub degenerate: usize,
    /// Triangles with an infinite or NaN corner.
    pub non_finite: usize,
    /// Infinite or NaN vertex normals; their triangles are flat-shaded.
    pub normals: usize,
}

impl Dropped {
    /// Adds the counts of another mesh.
    pub fn add(&mut self, other: Self) {
        self.degenerate += other.degenerate;
        self.non_finite += other.non_finite;
        self.normals += other.normals;
    }

    /// One warning for each count; `of` is the number of triangles of the mesh.
    pub fn warnings(&self, label: &str, of: usize) -> Vec<String> {
        [
            (self.degenerate, format!("triangles of zero area of {of}")),
            (self.non_finite, format!("triangles with infinite or NaN corners of {of}")),
            (self.normals, "infinite or NaN normals (shaded flat there)".to_owned()),
        ]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{label}: dropped {count} {what}"))
        .collect()
    }
}

/// Counts of what several meshes of a file lose, with the first of them.
#[derive(Debug, Default)]
pub(crate) struct DroppedOfMany {
    sum: Dropped,
    /// Triangles of the meshes that lose some.
    of: usize,
    meshes: usize,
    first: String,
}

impl DroppedOfMany {
    /// Adds what a mesh of `of` triangles loses; `place` is asked for the first time only.
    pub(crate) fn add(&mut self, dropped: Dropped, of: usize, place: impl FnOnce() -> String) {
        if dropped == Dropped::default() {
            return;
        }
        if self.meshes == 0 {
            self.first = place();
        }
        self.sum.add(dropped);
        self.of += of;
        self.meshes += 1;
    }

    /// One warning for each count.
    pub(crate) fn warnings(&self, path: &Path) -> Vec<String> {
        let others = match self.meshes {
            0 | 1 => String::new(),
            meshes => format!(" and {} others", meshes - 1),
        };
        self.sum.warnings(&format!("{}: {}{others}", path.display(), self.first), self.of)
    }
}

/// Checks that no position lies too far out for traversal. Fails with a message that names the largest
/// coordinate.
pub(crate) fn check_extent(positions: impl IntoIterator<Item = Vec3>) -> Result<(), String> {
    let distances = positions.into_iter().map(|position| position.abs().max_element());
    let farthest = distances.fold(0.0, f32::max);
    if farthest <= MAX_COORDINATE {
        return Ok(());
    }
    let expected = format!("expected at most {MAX_COORDINATE:e} m: scale or move the object");
    Err(format!("a vertex has the coordinate {farthest:e}; {expected}"))
}

impl Geometry {
    /// Counts vertices and triangles with as many further ones, which 32-bit indices must address. Fails with
    /// a message of both numbers.
    pub(crate) fn counts(&self, vertices: usize, triangles: usize) -> Result<[usize; 2], String> {
        let (vertices, triangles) =
            (self.positions.len() + vertices, self.triangles.len() + triangles);
        u32::try_from(vertices.max(triangles)).map(|_| [vertices, triangles]).map_err(|_| {
            let most = u32::MAX;
            format!("{vertices} vertices and {triangles} triangles, at most {most} can be used")
        })
    }

    /// Starts an object: it has the triangles and instances that are added from now on.
    pub fn start_object(&mut self, name: &str) {
        let (name, first_triangle) = (name.to_owned(), self.triangles.len());
        let first_instance = self.instances.len();
        start_object(&mut self.objects, ObjectStart { name, first_triangle, first_instance });
    }

    /// Places a mesh in the world, with the objects that it names; `material_of` gives the material of
    /// each triangle of the mesh.
    ///
    /// Keeps every vertex, so that indices stay valid. A vertex whose position is not finite moves
    /// to the object's origin, and no triangle uses it.
    ///
    /// # Panics
    /// Panics if 32-bit indices cannot address all vertices, or if a mesh has normals but not one
    /// per vertex.
    pub fn append(
        &mut self,
        mesh: &Mesh,
        transform: &Transform,
        material_of: impl Fn(usize) -> u32,
    ) -> Dropped {
        let mut dropped = Dropped::default();
        let first = self.positions.len();
        assert!(
            u32::try_from(first + mesh.positions.len()).is_ok(),
            "vertices are counted before they are appended"
        );
        self.positions.extend(mesh.positions.iter().map(|&position| transform.position(position)));
        if mesh.normals.is_empty() {
            self.normals.resize(self.positions.len(), [0.0; 3]);
        } else {
            assert_eq!(mesh.normals.len(), mesh.positions.len(), "one normal per vertex");
            self.normals.extend(mesh.normals.iter().map(|&normal| {
                dropped.normals += usize::from(!is_finite(normal));
                transform.normal(normal)
            }));
        }
        let count = self.positions.len();
        for (uvs, own) in self.uvs.iter_mut().zip(&mesh.uvs) {
            extend(uvs, own, first, count, [0.0; 2], |&uv| finite_or(uv, [0.0; 2]));
        }
        let tangent = |&tangent: &[f32; 4]| transform.tangent(tangent);
        extend(&mut self.tangents, &mesh.tangents, first, count, [0.0; 4], tangent);
        extend(&mut self.colors, &mesh.colors, first, count, [1.0; 4], |&color| {
            finite_or(color, [1.0; 4]).map(|channel| channel.clamp(0.0, 1.0))
        });
        let mut objects = mesh.objects.iter().peekable();
        for (index, &triangle) in mesh.triangles.iter().enumerate() {
            while let Some(object) = objects.next_if(|start| start.first_triangle <= index) {
                self.start_object(&object.name);
            }
            let [a, b, c] = triangle.map(|corner| first as u32 + corner);
            let corners = [a, b, c].map(|corner| self.positions[corner as usize]);
            if !corners.iter().all(|corner| is_finite(*corner)) {
                dropped.non_finite += 1;
            } else if !has_normal(corners) {
                dropped.degenerate += 1;
            } else {
                self.triangles.push(if transform.mirrors { [a, c, b] } else { [a, b, c] });
                self.materials.push(material_of(index));
            }
        }
        for position in &mut self.positions[first..] {
            if !is_finite(*position) {
                *position = transform.translate.to_array();
            }
        }
        dropped
    }
}

/// Appends an attribute of vertices to an array that stays empty until a mesh has the attribute.
pub(crate) fn extend<T: Clone>(
    all: &mut Vec<T>,
    own: &[T],
    first_vertex: usize,
    count: usize,
    absent: T,
    place: impl Fn(&T) -> T,
) {
    if !own.is_empty() {
        all.resize(first_vertex, absent.clone());
        all.extend(own.iter().map(place));
    }
    if !all.is_empty() {
        all.resize(count, absent);
    }
}

fn finite_or<const N: usize>(vector: [f32; N], otherwise: [f32; N]) -> [f32; N] {
    if is_finite(vector) { vector } else { otherwise }
}

fn is_finite<const N: usize>(vector: [f32; N]) -> bool {
    vector.iter().all(|component| component.is_finite())
}

/// Tests whether single precision resolves the direction of a triangle's normal.
fn has_normal(corners: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::from_array);
    let squared = (b - a).cross(c - a).length_squared();
    squared.is_finite() && squared >= f32::MIN_POSITIVE
}
