//! Triangles in world space.

/// Every triangle of the scene in world space; one mesh used many times is repeated here.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Vertex positions, metres.
    pub positions: Vec<[f32; 3]>,
    /// Unit vertex normals, for shading only; as long as `positions`. A zero vector marks a vertex of
    /// a mesh without normals: its triangles are flat-shaded.
    pub normals: Vec<[f32; 3]>,
    /// Three vertex indices per triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Material index per triangle.
    pub materials: Vec<u32>,
}
