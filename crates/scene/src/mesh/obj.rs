//! Wavefront OBJ: positions, texture coordinates, normals, faces of every group, and the materials of
//! its MTL libraries. Names everything else that the files hold ([`features::OBJ`],
//! [`features::MTL`]) in a warning.
//!
//! Deviation: parsed here and not by a crate, so that every message names the line and the index, and a
//! large file needs no more memory than its mesh.

use std::{
    collections::HashMap,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
};

use super::{
    Mesh, MeshMaterial,
    mtl::{Library, LibraryMaterial},
};
use glam::Vec3;

use crate::{
    beside::Folder,
    error::{Error, Result},
    features::{self, Ignored},
    files,
    material::{Material, MaterialKind},
    memory,
    texture::TextureCache,
};

/// Ends a chain of vertices; also the normal or texture coordinates of a corner that has none.
const NONE: u32 = u32::MAX;

/// Most vertices of a chain; further vertices of its position are found by hash.
const LONGEST_CHAIN: usize = 16;

/// Reads an OBJ file and the material libraries beside it; a missing library is a warning.
///
/// # Errors
/// [`Error::Io`], or [`Error::Parse`] with the line.
pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Mesh> {
    let file = files::open_regular(path)?;
    // The arrays of a mesh take about as much as its text.
    memory::check(path.display(), file.metadata().map_or(0, |metadata| metadata.len()))
        .map_err(Error::memory)?;
    let mut reader = ObjReader { path: path.to_path_buf(), ..ObjReader::default() };
    for_each_line(path, BufReader::with_capacity(1 << 16, file), |line, text| {
        reader.line = line;
        reader.read_line(text, warnings)
    })?;
    let (mut mesh, ignored) = reader.finish();
    warnings.extend(ignored.warnings(path));
    mesh.part_coincident(path, warnings);
    Ok(mesh)
}

/// Passes every line with its number from 1 to `use_line`; a trailing backslash continues the line.
fn for_each_line(
    path: &Path,
    mut reader: impl BufRead,
    mut use_line: impl FnMut(usize, &str) -> Result<()>,
) -> Result<()> {
    let mut bytes = Vec::new();
    let mut first_line = 1;
    for next_line in 2.. {
        let read = reader
            .read_until(b'\n', &mut bytes)
            .map_err(|source| Error::io(path, "read", source))?;
        while matches!(bytes.last(), Some(b'\n' | b'\r')) {
            bytes.pop();
        }
        match bytes.last_mut() {
            Some(last) if read > 0 && *last == b'\\' => *last = b' ',
            None if read == 0 => break,
            _ => {
                use_line(first_line, &String::from_utf8_lossy(&bytes))?;
                bytes.clear();
                first_line = next_line;
            }
        }
    }
    Ok(())
}

/// Position, texture coordinates and normal that a face uses together, linked to the next of the same
/// position.
#[derive(Clone, Copy)]
struct Vertex {
    uv: u32,
    normal: u32,
    next: u32,
}

#[derive(Default)]
struct ObjReader {
    path: PathBuf,
    line: usize,
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// As long as `mesh.positions`.
    vertices: Vec<Vertex>,
    /// Head of the chain of `vertices` at each position; as long as `positions`.
    chains: Vec<u32>,
    /// Vertex of a position, texture coordinates and normal where the position's chain is full.
    crowded: HashMap<(u32, u32, u32), u32>,
    mesh: Mesh,
    /// Index into `mesh.materials` by name.
    material_indices: HashMap<String, usize>,
    /// The last material of each name in the libraries.
    library: HashMap<String, LibraryMaterial>,
    images: TextureCache,
    ignored: Ignored,
    first_smoothing: Option<usize>,
}

impl ObjReader {
    fn error(&self, message: impl Into<String>) -> Error {
        Error::parse(&self.path, self.line, 1, message)
    }

    fn read_line(&mut self, text: &str, warnings: &mut Vec<String>) -> Result<()> {
        let text = text.split('#').next().unwrap_or_default().trim();
        let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        match keyword {
            "v" => {
                let position = self.vector(rest, 3)?;
                if rest.split_ascii_whitespace().nth(5).is_some() {
                    self.ignore(features::OBJ_COLOR, features::OBJ_COLOR.name);
                }
                self.positions.push(position);
                self.chains.push(NONE);
            }
            "vn" => {
                let normal = self.vector(rest, 3)?;
                self.normals.push(normal);
            }
            "vt" => {
                let [u, v] = self.vector(rest, 1)?;
                self.uvs.push([u, v]);
            }
            "f" => self.read_face(rest)?,
            "usemtl" => {
                let material = self.material_index(rest.trim(), warnings);
                self.mesh.start_run(Some(material));
            }
            "mtllib" => self.read_library(rest.trim(), warnings)?,
            "" => {}
            "o" | "g" => self.mesh.start_object(rest.trim()),
            "s" if matches!(rest.trim(), "off" | "0") => {}
            "s" => self.first_smoothing = self.first_smoothing.or(Some(self.line)),
            "p" | "l" => self.ignore(features::OBJ_POINTS, features::OBJ_POINTS.name),
            _ => self.ignore(features::OBJ_STATEMENT, &format!("`{keyword}`")),
        }
        Ok(())
    }

    fn ignore(&mut self, feature: features::Feature, name: &str) {
        self.ignored.add_named(feature, name, || format!("line {}", self.line));
    }

    /// Reads a vector of which at least `least` components must be there; the others are 0.
    fn vector<const N: usize>(&self, words: &str, least: usize) -> Result<[f32; N]> {
        let mut words = words.split_ascii_whitespace();
        let mut vector = [0.0; N];
        for (index, component) in vector.iter_mut().enumerate() {
            let word = match words.next() {
                None if index >= least => break,
                word => word.unwrap_or_default(),
            };
            let expected = if least == 3 { "three numbers" } else { "one number or two" };
            *component = word
                .parse()
                .map_err(|_| self.error(format!("expected {expected}, found `{word}`")))?;
        }
        Ok(vector)
    }

    fn read_face(&mut self, words: &str) -> Result<()> {
        let words = words.split_ascii_whitespace();
        let corners: Vec<u32> = words.map(|word| self.corner(word)).collect::<Result<_>>()?;
        match corners[..] {
            [] | [_] | [_, _] => {
                let count = corners.len();
                let message = format!("a face needs three corners or more, found {count}");
                return Err(self.error(message));
            }
            [a, b, c] => self.mesh.triangles.push([a, b, c]),
            _ => self.mesh.push_polygon(&corners),
        }
        Ok(())
    }

    /// Vertex of `position`, `position/uv`, `position/uv/normal` or `position//normal`, added if new.
    fn corner(&mut self, word: &str) -> Result<u32> {
        let mut parts = word.split('/');
        let position = parts.next().unwrap_or_default();
        let position = self.index(position, self.positions.len(), "position")?;
        let mut index = |count, what| match parts.next() {
            Some(word) if !word.is_empty() => self.index(word, count, what),
            _ => Ok(NONE),
        };
        let uv = index(self.uvs.len(), "texture coordinate")?;
        let normal = index(self.normals.len(), "normal")?;
        let mut vertex = self.chains[position as usize];
        let mut chain_length = 0;
        while vertex != NONE {
            let found = self.vertices[vertex as usize];
            if (found.uv, found.normal) == (uv, normal) {
                return Ok(vertex);
            }
            vertex = found.next;
            chain_length += 1;
        }
        let is_crowded = chain_length == LONGEST_CHAIN;
        if is_crowded && let Some(&vertex) = self.crowded.get(&(position, uv, normal)) {
            return Ok(vertex);
        }
        let vertex = u32::try_from(self.vertices.len())
            .ok()
            .filter(|&vertex| vertex != NONE)
            .ok_or_else(|| self.error("more than 4,294,967,294 vertices"))?;
        let next = if is_crowded {
            self.crowded.insert((position, uv, normal), vertex);
            NONE
        } else {
            std::mem::replace(&mut self.chains[position as usize], vertex)
        };
        self.vertices.push(Vertex { uv, normal, next });
        self.mesh.positions.push(self.positions[position as usize]);
        Ok(vertex)
    }

    /// Converts to an index from 0; the file counts from 1, or backwards from −1, the latest.
    fn index(&self, word: &str, count: usize, what: &str) -> Result<u32> {
        let stated: i64 = word
            .parse()
            .map_err(|_| self.error(format!("expected the index of a {what}, found `{word}`")))?;
        let index = if stated < 0 { stated + count as i64 } else { stated - 1 };
        if (0..count as i64).contains(&index)
            && let Ok(index) = u32::try_from(index)
            && index != NONE
        {
            Ok(index)
        } else {
            let face = self.mesh.triangles.len();
            Err(self.error(format!(
                "face after {face} triangles: {what} index {stated} is out of range, there are \
                 {count} {what}s so far"
            )))
        }
    }

    /// Finds or adds a material by name; one that no library describes is white.
    fn material_index(&mut self, name: &str, warnings: &mut Vec<String>) -> usize {
        if let Some(&index) = self.material_indices.get(name) {
            return index;
        }
        let material = if let Some(found) = self.library.get(name) {
            found.finish(&mut self.images, warnings)
        } else {
            let mut ignored = Ignored::default();
            ignored.add(features::OBJ_UNDESCRIBED, || format!("`{name}`, line {}", self.line));
            let kind = MaterialKind::Diffuse { reflectance: Vec3::ONE };
            MeshMaterial { material: Material::new(name, kind), ignored, is_culled: false }
        };
        let index = self.mesh.materials.len();
        self.mesh.materials.push(material);
        self.material_indices.insert(name.to_owned(), index);
        index
    }

    /// Reads MTL libraries; one line may name several files.
    fn read_library(&mut self, names: &str, warnings: &mut Vec<String>) -> Result<()> {
        let folder = Folder::of(&self.path);
        let names = match folder.file(names) {
            Ok(whole) if whole.is_file() => vec![names],
            _ => names.split_ascii_whitespace().collect(),
        };
        for name in names {
            let path = folder.file(name);
            if path.as_ref().is_ok_and(|path| self.mesh.side_files.contains(path)) {
                continue;
            }
            let found = path.and_then(|path| {
                let file = files::open_regular(&path).map_err(|error| error.to_string())?;
                Ok((path, file))
            });
            let (path, file) = match found {
                Ok(found) => found,
                Err(message) => {
                    warnings.push(format!(
                        "{}:{}: cannot read the material library `{name}` ({message}); its \
                         materials are white",
                        self.path.display(),
                        self.line,
                    ));
                    continue;
                }
            };
            self.mesh.side_files.push(path.clone());
            let mut library = Library::new(&folder, &path);
            for_each_line(&path, BufReader::new(file), |line, text| library.read_line(line, text))?;
            let read = library.materials.into_iter().map(|found| (found.name.clone(), found));
            self.library.extend(read);
        }
        Ok(())
    }

    fn finish(mut self) -> (Mesh, Ignored) {
        if let Some(line) = self.first_smoothing
            && self.vertices.iter().any(|vertex| vertex.normal == NONE)
        {
            self.ignored.add(features::OBJ_SMOOTHING, || format!("line {line}"));
        }
        if self.vertices.iter().any(|vertex| vertex.uv != NONE) {
            let uv_of =
                |vertex: &Vertex| self.uvs.get(vertex.uv as usize).copied().unwrap_or_default();
            self.mesh.uvs[0] = self.vertices.iter().map(uv_of).collect();
        }
        if self.vertices.iter().any(|vertex| vertex.normal != NONE) {
            let normal_of = |vertex: &Vertex| {
                self.normals.get(vertex.normal as usize).copied().unwrap_or_default()
            };
            self.mesh.normals = self.vertices.iter().map(normal_of).collect();
        }
        if self.mesh.runs.first().is_some_and(|first| first.first_triangle > 0) {
            let unnamed = super::MaterialRun { first_triangle: 0, material: None };
            self.mesh.runs.insert(0, unnamed);
        }
        self.mesh.side_files.extend(self.images.files());
        self.mesh.complete_tangents(1.0);
        (self.mesh, self.ignored)
    }
}
