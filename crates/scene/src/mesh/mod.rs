//! Mesh file → indexed triangles in object space, with normals if the file has them.
//!
//! The extension tells PLY, OBJ and glTF apart. PLY and OBJ are streamed, glTF is read whole. All
//! keep single precision and leave nothing but the arrays of [`Mesh`] behind.

mod coincident;
mod gltf;
mod mtl;
mod obj;
pub(crate) mod ply;
mod tangents;

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use glam::Mat4;

use super::{features::Ignored, instance::Budget, lamp::Lamp};
use crate::{
    error::{Error, Result},
    files,
    material::Material,
    triangulate::triangulate_in_space,
};

/// Name of a part of a file for messages, or its number from 0.
pub(crate) fn label(part: &str, index: usize, name: Option<&str>) -> String {
    name.map_or_else(|| format!("{part} {index}"), |name| format!("{part} `{name}`"))
}

/// Triangles in object space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, metres before the object's scale.
    pub positions: Vec<[f32; 3]>,
    /// Vertex normals of any length, zero where there is none; as long as `positions`, or empty if
    /// the mesh has no normals at all.
    pub normals: Vec<[f32; 3]>,
    /// Two sets of texture coordinates, each as long as `positions` or empty.
    pub uvs: [Vec<[f32; 2]>; 2],
    /// Tangents along u of the set that the normal texture reads, and the sign of the bitangent,
    /// which points up in the image; zero where there is none. As long as `positions` or empty.
    pub tangents: Vec<[f32; 4]>,
    /// Linear Rec.709 colours and opacities, 0…1; as long as `positions` or empty.
    pub colors: Vec<[f32; 4]>,
    /// Three vertex indices per triangle, counter-clockwise seen from outside; all in range.
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles of one material, in order from triangle 0; empty if the file has no materials.
    pub runs: Vec<MaterialRun>,
    /// Starts of the objects that the file names, in rising order; may be empty.
    pub objects: Vec<ObjectStart>,
    /// Materials of the file.
    pub materials: Vec<MeshMaterial>,
    /// Cameras of the file.
    pub cameras: Vec<MeshCamera>,
    /// Lamps of the file.
    pub lamps: Vec<Lamp>,
    /// Names among which `KHR_materials_variants` of a glTF file chooses the materials.
    pub variants: Vec<String>,
    /// Meshes that the file repeats so often that they are not copied; none by [`Mesh::read`].
    pub repeated: Vec<RepeatedMesh>,
    /// Files beside the mesh file that were read for it: material libraries, buffers, images.
    pub side_files: Vec<PathBuf>,
}

/// Mesh that a file places many times.
#[derive(Clone, Debug)]
pub struct RepeatedMesh {
    /// Name in the file.
    pub name: String,
    /// The mesh in its own space, without materials of its own.
    pub mesh: Box<Mesh>,
    /// Index into [`Mesh::materials`] of the whole; none if the file gives no material.
    pub material: Option<usize>,
    /// Where it stands in the space of the file.
    pub places: Vec<Mat4>,
}

/// Start of a run of triangles of one material; it ends where the next begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaterialRun {
    /// First triangle of the run.
    pub first_triangle: usize,
    /// Index into [`Mesh::materials`]; none if the file gives these triangles no material.
    pub material: Option<usize>,
}

/// Start of an object: it has the triangles and instances up to the start of the next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjectStart {
    /// Name; objects that share it are one to a compositor.
    pub name: String,
    /// Number of triangles before it.
    pub first_triangle: usize,
    /// Number of instances before it.
    pub first_instance: usize,
}

/// Starts an object, unless one of that name goes on. One without anything gives way.
pub(crate) fn start_object(objects: &mut Vec<ObjectStart>, start: ObjectStart) {
    let place = |start: &ObjectStart| (start.first_triangle, start.first_instance);
    objects.pop_if(|last| place(last) == place(&start));
    if objects.last().is_none_or(|last| last.name != start.name) {
        objects.push(start);
    }
}

/// Camera of a mesh file.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshCamera {
    /// Names by which it can be called: its own and that of its node.
    pub names: Vec<String>,
    /// The camera looks along −Z, with +Y up.
    pub world_from_camera: Mat4,
    /// Lens; that of a camera from afar for an orthographic one.
    pub perspective: Perspective,
    /// True for a camera that is orthographic in the file.
    pub is_orthographic: bool,
}

impl MeshCamera {
    /// Name for messages; `index` counts the cameras of the file.
    pub fn label(&self, index: usize) -> String {
        self.names.first().map_or_else(|| format!("camera {index}"), |name| format!("`{name}`"))
    }
}

/// Lens of a perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perspective {
    /// Angle between the bottom and top edges of the image, radians.
    pub vertical_fov_rad: f32,
    /// Width of the image over its height, if the file states it.
    pub aspect_ratio: Option<f32>,
}

/// Material of a mesh file, with the parts of it that are left out.
#[derive(Clone, Debug)]
pub struct MeshMaterial {
    /// The material; its name may be empty.
    pub material: Material,
    /// Parts of the material that are left out.
    pub ignored: Ignored,
    /// True if a rasteriser shows only the side from which the triangles are counter-clockwise.
    pub is_culled: bool,
}

/// Tests for a word by which C libraries print what is no number: `-nan(ind)`, `1.#IND`.
fn is_no_number(word: &str) -> bool {
    let word = word.trim_start_matches('-');
    word.starts_with("nan(") || word.starts_with("1.#")
}

/// No corner, which ends a strip of triangles.
const RESTART: u32 = u32::MAX;

/// Triangles of a strip, all of the same side.
fn strip_triangles(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let turned = |(index, corners): (usize, &[u32])| match index % 2 {
        0 => [corners[0], corners[1], corners[2]],
        _ => [corners[1], corners[0], corners[2]],
    };
    corners.windows(3).enumerate().map(turned)
}

impl Mesh {
    /// Reads a mesh file; adds what it leaves out to `warnings`.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] or [`Error::Parse`] if its
    /// content is invalid: unknown format, truncation, an index out of range.
    pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Self> {
        Self::read_at(path, None, None, None, warnings)
    }

    /// As [`Mesh::read`], with the animations of a glTF file at `time` seconds, the materials of a
    /// `variant`, and with a budget, what it repeats in [`Mesh::repeated`].
    pub(crate) fn read_at(
        path: &Path,
        time: Option<f32>,
        variant: Option<&str>,
        budget: Option<Budget>,
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        match files::extension(path).as_str() {
            "ply" => ply::read(path, warnings),
            "obj" => obj::read(path, warnings),
            "gltf" | "glb" => gltf::read(path, time, variant, budget, warnings),
            found => {
                let found =
                    if found.is_empty() { "no extension".into() } else { format!(".{found}") };
                let expected = "expected a mesh in .ply, .obj, .gltf or .glb";
                Err(Error::format(path, format!("{expected}, found {found}")))
            }
        }
    }

    /// Checks the lengths of the arrays of vertices, and that every corner is one of them: files are checked
    /// as they are read, arrays from elsewhere by this.
    ///
    /// # Errors
    /// A message that names the array.
    pub fn check(&self) -> Result<(), String> {
        let vertices = self.positions.len();
        let lengths = [
            ("normals", self.normals.len()),
            ("uvs", self.uvs[0].len()),
            ("second uvs", self.uvs[1].len()),
            ("tangents", self.tangents.len()),
            ("colors", self.colors.len()),
        ];
        if let Some((name, length)) = lengths.iter().find(|(_, n)| *n != 0 && *n != vertices) {
            return Err(format!(
                "{name}: expected one for each of {vertices} positions, found {length}"
            ));
        }
        match self.triangles.as_flattened().iter().find(|corner| **corner as usize >= vertices) {
            Some(corner) => {
                Err(format!("triangles: expected corners below {vertices}, found {corner}"))
            }
            None => Ok(()),
        }
    }

    /// Adds the triangles of strips of corners; [`RESTART`] begins another strip.
    fn push_strips(&mut self, corners: &[u32]) {
        for strip in corners.split(|corner| *corner == RESTART) {
            self.triangles.extend(strip_triangles(strip));
        }
    }

    /// Adds the triangles of a polygon, in the plane of its Newell normal.
    fn push_polygon(&mut self, corners: &[u32]) {
        let positions: Vec<_> =
            corners.iter().map(|&corner| self.positions[corner as usize]).collect();
        let triangles = triangulate_in_space(&positions);
        self.triangles.extend(triangles.iter().map(|triangle| triangle.map(|at| corners[at])));
    }

    /// Turns the mesh inside out.
    pub(crate) fn reverse(&mut self) {
        self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        self.normals.iter_mut().flatten().for_each(|component| *component = -*component);
    }

    /// Parts that the materials in use hold and that are left out, but for those whose name `is_replaced`.
    pub fn ignored_in_materials(&self, is_replaced: impl Fn(&str) -> bool) -> Ignored {
        let mut used = vec![false; self.materials.len()];
        for (triangles, material) in self.material_runs() {
            if let Some(material) = material.filter(|_| !triangles.is_empty()) {
                used[material] = true;
            }
        }
        for repeated in self.repeated.iter().filter_map(|repeated| repeated.material) {
            used[repeated] = true;
        }
        let mut ignored = Ignored::default();
        for (MeshMaterial { material, ignored: own, .. }, is_used) in
            self.materials.iter().zip(used)
        {
            if is_used && !is_replaced(&material.name) {
                ignored.merge(own);
            }
        }
        ignored
    }

    /// Triangles of each run, with its material.
    fn material_runs(&self) -> impl Iterator<Item = (Range<usize>, Option<usize>)> {
        let ends = self.runs.iter().skip(1).map(|run| run.first_triangle);
        let runs = self.runs.iter().zip(ends.chain([self.triangles.len()]));
        runs.map(|(run, end)| (run.first_triangle..end, run.material))
    }

    /// Adds a vertex like another; none if there is no room.
    fn repeat_vertex(&mut self, vertex: u32) -> Option<u32> {
        fn repeat<T: Copy>(all: &mut Vec<T>, vertex: u32) {
            if let Some(&own) = all.get(vertex as usize) {
                all.push(own);
            }
        }
        let copy = u32::try_from(self.positions.len()).ok()?;
        repeat(&mut self.positions, vertex);
        repeat(&mut self.normals, vertex);
        self.uvs.iter_mut().for_each(|uvs| repeat(uvs, vertex));
        repeat(&mut self.tangents, vertex);
        repeat(&mut self.colors, vertex);
        Some(copy)
    }

    /// Gives each triangle corners of its own, with these texture coordinates.
    pub(crate) fn spread(&mut self, uvs: [[f32; 2]; 3]) {
        fn repeat<T: Copy>(all: &mut Vec<T>, corners: &[u32]) {
            if !all.is_empty() {
                *all = corners.iter().map(|&corner| all[corner as usize]).collect();
            }
        }
        let corners = self.triangles.as_flattened();
        repeat(&mut self.positions, corners);
        repeat(&mut self.normals, corners);
        repeat(&mut self.colors, corners);
        self.uvs[0] = uvs.repeat(self.triangles.len());
        for (first, triangle) in (0..).step_by(3).zip(&mut self.triangles) {
            *triangle = [first, first + 1, first + 2];
        }
    }

    fn start_object(&mut self, name: &str) {
        let (name, first_triangle) = (name.to_owned(), self.triangles.len());
        start_object(&mut self.objects, ObjectStart { name, first_triangle, first_instance: 0 });
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
