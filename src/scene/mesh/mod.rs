//! Mesh file → indexed triangles in object space, with normals if the file has them.
//!
//! The extension tells PLY, OBJ and glTF apart. PLY and OBJ are streamed, glTF is read whole. All
//! keep single precision and leave nothing but the arrays of [`Mesh`] behind.

pub mod gltf;
pub mod obj;
pub mod ply;

use std::path::{Path, PathBuf};

use crate::{
    error::{Error, Result},
    files,
};

/// Triangles in object space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, metres before the object's scale.
    pub positions: Vec<[f32; 3]>,
    /// Vertex normals of any length, zero where there is none; as long as `positions`, or empty if
    /// the mesh has no normals at all.
    pub normals: Vec<[f32; 3]>,
    /// Three vertex indices per triangle, counter-clockwise seen from outside; all in range.
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles of one material, in order from triangle 0; empty if the file has no materials.
    pub runs: Vec<MaterialRun>,
    /// Materials of the file.
    pub materials: Vec<MeshMaterial>,
    /// Files beside the mesh file that were read for it: material libraries, buffers.
    pub side_files: Vec<PathBuf>,
}

/// Start of a run of triangles of one material; it ends where the next begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaterialRun {
    /// First triangle of the run.
    pub first_triangle: usize,
    /// Index into [`Mesh::materials`]; none if the file gives these triangles no material.
    pub material: Option<usize>,
}

/// Material of a mesh file, as far as it is used.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMaterial {
    /// Name in the file; may be empty.
    pub name: String,
    /// Linear Rec.709 colour of the diffuse reflection, 0…1.
    pub base_color: [f32; 3],
}

impl Mesh {
    /// Reads a mesh file; adds what it leaves out to `warnings`.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] or [`Error::Parse`] if its
    /// content is invalid: unknown format, truncation, an index out of range.
    pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Self> {
        match files::extension(path).as_str() {
            "ply" => ply::read(path),
            "obj" => obj::read(path, warnings),
            "gltf" | "glb" => gltf::read(path, warnings),
            found => {
                let found =
                    if found.is_empty() { "no extension".into() } else { format!(".{found}") };
                let expected = "expected a mesh in .ply, .obj, .gltf or .glb";
                Err(Error::format(path, format!("{expected}, found {found}")))
            }
        }
    }

    /// Starts a run of triangles of `material` at the next triangle.
    fn start_run(&mut self, material: Option<usize>) {
        let first_triangle = self.triangles.len();
        match self.runs.last_mut() {
            Some(last) if last.first_triangle == first_triangle => last.material = material,
            Some(last) if last.material == material => {}
            _ => self.runs.push(MaterialRun { first_triangle, material }),
        }
    }
}
