//! Wavefront OBJ: positions, texture coordinates, normals, faces of every group, and the materials of
//! its MTL libraries. Names everything else that the files hold ([`features::OBJ`],
//! [`features::MTL`]) in a warning.
//!
//! Deviation: parsed here and not by a crate, so that every message names the line and the index, and a
//! large file needs no more memory than its mesh.

use std::{
    collections::HashMap,
    io::BufRead,
    path::{Path, PathBuf},
};

use super::{
    Mesh, MeshMaterial, is_no_number,
    mtl::{Library, LibraryMaterial, statement},
};
use glam::Vec3;

use crate::{
    beside::Folder,
    error::{Error, Result},
    features::{self, Ignored},
    files,
    material::{Material, MaterialKind},
    math::colour::srgb_to_linear,
    memory,
    texture::TextureCache,
};

/// Ends a chain of vertices; also the normal or texture coordinates of a corner that has none.
const NONE: u32 = u32::MAX;

/// Keywords of what faces number, and their names.
const VERTICES: [(&str, &str); 3] =
    [("v", "position"), ("vt", "texture coordinate"), ("vn", "normal")];

/// Most vertices of a chain; further vertices of its position are found by hash.
const LONGEST_CHAIN: usize = 16;

/// Channels of a vertex without a colour, among others with; it becomes white.
const NO_COLOR: f32 = f32::NAN;

/// Reads an OBJ file and the material libraries beside it; a missing library is a warning. Fails with
/// [`Error::Io`], or [`Error::Parse`] with the line.
pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Mesh> {
    let (file, bytes) = files::open_unpacked(path)?;
    // The arrays of a mesh take about as much as its text.
    memory::check(path.display(), bytes).map_err(Error::memory)?;
    let mut reader = ObjReader { path: path.to_path_buf(), ..ObjReader::default() };
    let warnings_before = warnings.len();
    reader.read_lines(file, warnings)?;
    if reader.looks_ahead {
        // Faces may stand above their vertices, which are known the second time.
        warnings.truncate(warnings_before);
        reader = ObjReader {
            path: reader.path,
            knows_vertices: true,
            chains: vec![NONE; reader.positions.len()],
            positions: reader.positions,
            colors: reader.colors,
            uvs: reader.uvs,
            normals: reader.normals,
            ..ObjReader::default()
        };
        reader.read_lines(files::open_unpacked(path)?.0, warnings)?;
    }
    let (mut mesh, ignored) = reader.finish(warnings);
    warnings.extend(ignored.warnings(path));
    mesh.part_coincident(path, warnings);
    Ok(mesh)
}

/// Passes every line with its number from 1 to `use_line`; a trailing backslash continues a line that is no
/// comment. Lines end as on Unix, Windows or old Macs.
fn for_each_line(
    path: &Path,
    mut reader: impl BufRead,
    mut use_line: impl FnMut(usize, &str) -> Result<()>,
) -> Result<()> {
    let (mut bytes, mut statement) = (Vec::new(), Vec::new());
    let (mut line, mut first_line) = (0, 1);
    loop {
        bytes.clear();
        let read = reader.read_until(b'\n', &mut bytes);
        if read.map_err(|source| Error::io(path, "read", source))? == 0 {
            return use_line(first_line, &files::decoded(&statement));
        }
        if line == 0 && (bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff")) {
            return Err(Error::parse(path, 1, 1, "expected UTF-8, found UTF-16: save it as UTF-8"));
        }
        let ended = bytes.trim_ascii_end();
        for part in ended.split(|byte| *byte == b'\r') {
            line += 1;
            match part.strip_suffix(b"\\").filter(|_| !part.starts_with(b"#")) {
                Some(part) => {
                    statement.extend_from_slice(part);
                    statement.push(b' ');
                    continue;
                }
                None if statement.is_empty() => use_line(line, &files::decoded(part))?,
                None => {
                    statement.extend_from_slice(part);
                    use_line(first_line, &files::decoded(&statement))?;
                    statement.clear();
                }
            }
            first_line = line + 1;
        }
    }
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
    /// True once a face names what stands below it, or nowhere; it is left out.
    looks_ahead: bool,
    /// True if positions, texture coordinates and normals are those of the whole file.
    knows_vertices: bool,
    /// Numbers of these so far.
    counts: [usize; 3],
    positions: Vec<[f32; 3]>,
    /// Colours of positions as they stand.
    colors: Vec<[f32; 3]>,
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
    /// Names by that index, and the lines of their first use.
    material_names: Vec<(String, usize)>,
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

    fn read_lines(&mut self, file: impl BufRead, warnings: &mut Vec<String>) -> Result<()> {
        for_each_line(&self.path.clone(), file, |line, text| {
            self.line = line;
            self.read_line(text, warnings)
        })
    }

    fn read_line(&mut self, text: &str, warnings: &mut Vec<String>) -> Result<()> {
        let (keyword, rest) = statement(text);
        if let Some(kind) = VERTICES.iter().position(|(own, _)| *own == keyword) {
            self.counts[kind] += 1;
            if self.knows_vertices {
                return Ok(());
            }
        }
        match keyword {
            "v" => {
                let position = self.vector(rest, 3)?;
                if rest.split_ascii_whitespace().nth(5).is_some() {
                    let [_, _, _, r, g, b] = self.vector(rest, 3)?;
                    self.colors.resize(self.positions.len(), [NO_COLOR; 3]);
                    self.colors.push([r, g, b]);
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
            "f" | "fo" => self.read_face(rest)?,
            "usemtl" => {
                let next = self.material_names.len();
                let material = *self.material_indices.entry(rest.to_owned()).or_insert(next);
                if material == next {
                    self.material_names.push((rest.to_owned(), self.line));
                }
                self.mesh.start_run(Some(material));
            }
            "mtllib" => self.read_library(rest, warnings)?,
            "" => {}
            "o" | "g" => self.mesh.start_object(rest),
            "s" if matches!(rest, "off" | "0") => {}
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
            let number = word.parse().ok().or(is_no_number(word).then_some(f32::NAN));
            *component =
                number.ok_or_else(|| self.error(format!("expected {expected}, found `{word}`")))?;
        }
        Ok(vector)
    }

    fn read_face(&mut self, words: &str) -> Result<()> {
        let words = words.split_ascii_whitespace();
        let corners = words.map(|word| self.corner(word)).collect::<Result<Vec<u32>>>();
        if corners.is_err() && !self.knows_vertices {
            self.looks_ahead = true;
            return Ok(());
        }
        let corners = corners?;
        match corners[..] {
            [] | [_] | [_, _] => self.ignore(features::OBJ_FACE, features::OBJ_FACE.name),
            [a, b, c] => self.mesh.triangles.push([a, b, c]),
            _ => self.mesh.push_polygon(&corners),
        }
        Ok(())
    }

    /// Vertex of `position`, `position/uv`, `position/uv/normal` or `position//normal`, added if new.
    fn corner(&mut self, word: &str) -> Result<u32> {
        let mut parts = word.split('/');
        let position = parts.next().unwrap_or_default();
        let position = self.index(position, 0)?;
        let uv = self.attribute(parts.next().unwrap_or_default(), 1);
        let normal = self.attribute(parts.next().unwrap_or_default(), 2);
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
        if let Some([r, g, b]) = self.colors.get(position as usize) {
            self.mesh.colors.resize(self.mesh.positions.len(), [NO_COLOR; 4]);
            self.mesh.colors.push([*r, *g, *b, 1.0]);
        }
        self.mesh.positions.push(self.positions[position as usize]);
        Ok(vertex)
    }

    /// Index of an attribute that a corner may have; none for one that the file does not have.
    fn attribute(&mut self, word: &str, kind: usize) -> u32 {
        if word.is_empty() {
            return NONE;
        }
        self.index(word, kind).unwrap_or_else(|_| {
            let what = VERTICES[kind].1;
            self.ignore(features::OBJ_INDEX, &format!("indices of {what}s that are not there"));
            self.looks_ahead = true;
            NONE
        })
    }

    /// Converts to an index from 0 of one of [`VERTICES`]; the file counts from 1, or backwards from −1, the
    /// latest.
    fn index(&self, word: &str, kind: usize) -> Result<u32> {
        let what = VERTICES[kind].1;
        let stated: i64 = word
            .parse()
            .map_err(|_| self.error(format!("expected the index of a {what}, found `{word}`")))?;
        let count = [self.positions.len(), self.uvs.len(), self.normals.len()][kind];
        let before = self.counts[kind] as i64;
        let index = if stated < 0 { stated + before } else { stated - 1 };
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

    /// Material by its name; white if no library describes it.
    fn material(&mut self, name: &str, line: usize, warnings: &mut Vec<String>) -> MeshMaterial {
        if let Some(found) = self.library.get(name) {
            return found.finish(&mut self.images, warnings);
        }
        let mut ignored = Ignored::default();
        ignored.add(features::OBJ_UNDESCRIBED, || format!("`{name}`, line {line}"));
        let kind = MaterialKind::Diffuse { reflectance: Vec3::ONE };
        MeshMaterial { material: Material::new(name, kind), ignored, is_culled: false }
    }

    /// Reads MTL libraries; one line may name several files.
    fn read_library(&mut self, names: &str, warnings: &mut Vec<String>) -> Result<()> {
        let folder = Folder::of(&self.path);
        let names = names.trim_matches('"');
        let find = |name: &str| folder.found_within(Path::new(""), name);
        let names = match find(names) {
            Ok(whole) if whole.is_file() => vec![names],
            _ => names.split_ascii_whitespace().collect(),
        };
        for name in names {
            let path = find(name);
            if path.as_ref().is_ok_and(|path| self.mesh.side_files.contains(path)) {
                continue;
            }
            let found = path.and_then(|path| {
                let (file, _) = files::open_unpacked(&path).map_err(|error| error.to_string())?;
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
            for_each_line(&path, file, |line, text| {
                library.read_line(line, text);
                Ok(())
            })?;
            let read = library.materials.into_iter().map(|found| (found.name.clone(), found));
            self.library.extend(read);
        }
        Ok(())
    }

    fn finish(mut self, warnings: &mut Vec<String>) -> (Mesh, Ignored) {
        for (name, line) in std::mem::take(&mut self.material_names) {
            let material = self.material(&name, line, warnings);
            self.mesh.materials.push(material);
        }
        if !self.mesh.colors.is_empty() {
            self.mesh.colors.resize(self.mesh.positions.len(), [NO_COLOR; 4]);
            let channels = || self.mesh.colors.iter().flatten();
            let most = if channels().any(|channel| *channel > 1.0) { 255.0 } else { 1.0 };
            for color in &mut self.mesh.colors {
                let [r, g, b] = [0, 1, 2].map(|at| srgb_to_linear(color[at] / most));
                *color = if color[0].is_nan() { [1.0; 4] } else { [r, g, b, 1.0] };
            }
        }
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
