//! PLY \[Turk 1994\]: ascii and binary in both byte orders.
//!
//! The header may name elements and properties in any order and of any type. The reader uses
//! `x y z`, `nx ny nz`, texture coordinates and colours of `vertex`, and of `face` or `tristrips` the list
//! `vertex_indices` (or `vertex_index`), and the texture coordinates of corners in the list `texcoord`. It
//! triangulates polygons with more than three corners in the plane of their Newell normal.

mod header;

use std::{
    collections::HashMap,
    io::{BufRead, BufReader, ErrorKind, Read},
    path::Path,
};

use header::{Element, Encoding, Property, Scalar};

use super::{Mesh, RESTART, is_no_number};
use crate::{
    error::{Error, Result},
    features::{self, Ignored},
    files,
    math::colour::srgb_to_linear,
    memory,
};

/// Names of texture coordinates; (0, 0) is the lower left corner.
const UV_NAMES: [[&str; 2]; 6] = [
    ["u", "v"],
    ["s", "t"],
    ["texture_u", "texture_v"],
    ["texture_s", "texture_t"],
    ["s0", "t0"],
    ["tu", "tv"],
];

/// Names of colours, and of their opacity.
const COLOR_NAMES: [[&str; 4]; 4] = [
    ["red", "green", "blue", "alpha"],
    ["r", "g", "b", "a"],
    ["diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"],
    // Mitsuba writes its attribute `vertex_color` so.
    ["color_0", "color_1", "color_2", "color_3"],
];

/// Bytes of a vertex (position, normal, coordinates) or of the triangles of a face.
const ELEMENT_BYTES: u64 = 32;

/// Reads a PLY file, or one compressed by gzip if its extension is `gz`; warns of what it leaves out. Fails
/// with [`Error::Io`], or [`Error::Format`] that names the element and what was expected and found.
pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Mesh> {
    let (reader, file_bytes) = files::open_unpacked(path)?;
    let mut source = Source {
        path,
        reader,
        encoding: Encoding::Ascii,
        bytes_read: 0,
        line: 1,
        ignored: Ignored::default(),
    };
    let elements = source.read_header()?;
    let mut mesh = Mesh::default();
    let vertex_count = vertex_count(path, &elements)?;
    let body_bytes = file_bytes.saturating_sub(source.bytes_read);
    for element in &elements {
        let least = element.least_bytes(source.encoding);
        // An ascii file without a final newline is one byte shorter.
        if least > body_bytes + 1 {
            let Element { name, count, .. } = element;
            let message = format!(
                "truncated: {count} elements `{name}` need at least {least} bytes, the file has \
                 {body_bytes} after its header"
            );
            return Err(Error::format(path, message));
        }
    }
    let count = elements.iter().map(|element| element.count).fold(0, u64::saturating_add);
    memory::check(path.display(), count.saturating_mul(ELEMENT_BYTES)).map_err(Error::memory)?;
    let mut polygons = Polygons::default();
    for element in &elements {
        match element.name.as_str() {
            "vertex" => source.read_vertices(element, &mut mesh)?,
            "face" | "tristrips" => {
                source.read_faces(element, vertex_count, &mut mesh, &mut polygons)?;
            }
            _ => {
                for index in 0..element.count {
                    for property in &element.properties {
                        source.skip(property, Place { element, index })?;
                    }
                }
            }
        }
    }
    let mut start = 0;
    for end in polygons.ends {
        mesh.push_polygon(&polygons.corners[start..end]);
        start = end;
    }
    warnings.extend(source.ignored.warnings(path));
    Ok(mesh)
}

fn vertex_count(path: &Path, elements: &[Element]) -> Result<u32> {
    let count = |name: &str| elements.iter().filter(|element| element.name == name).count();
    let (vertices, faces, strips) = (count("vertex"), count("face"), count("tristrips"));
    if vertices != 1 {
        let expected = format!("expected one element `vertex`, found {vertices}");
        return Err(Error::format(path, expected));
    }
    if faces > 1 || strips > 1 || faces + strips == 0 {
        let expected = format!("expected one element `face` or `tristrips`, found {faces}");
        return Err(Error::format(path, expected));
    }
    let count = elements.iter().find(|element| element.name == "vertex").map_or(0, |v| v.count);
    u32::try_from(count).map_err(|_| {
        Error::format(path, format!("{count} vertices, at most {} can be used", u32::MAX))
    })
}

/// Corners of the faces with more than three, kept until all positions are known.
#[derive(Debug, Default)]
struct Polygons {
    corners: Vec<u32>,
    ends: Vec<usize>,
}

/// Vertices with the texture coordinates of the corners that use them.
#[derive(Debug, Default)]
struct Seams {
    /// True for vertices of the file that have coordinates.
    taken: Vec<bool>,
    vertices: HashMap<(u32, [u32; 2]), u32>,
}

impl Seams {
    /// Vertex like that of a corner with its coordinates: itself, or another where a seam parts them. Corners
    /// of vertices that are not read yet keep none.
    fn vertex(&mut self, mesh: &mut Mesh, corner: u32, uv: [f32; 2]) -> u32 {
        if self.taken.is_empty() {
            self.taken = vec![false; mesh.positions.len()];
            mesh.uvs[0].resize(mesh.positions.len(), [0.0; 2]);
        }
        let Some(taken) = self.taken.get_mut(corner as usize) else { return corner };
        let is_taken = std::mem::replace(taken, true);
        let key = (corner, uv.map(f32::to_bits));
        *self.vertices.entry(key).or_insert_with(|| {
            let vertex = if is_taken { mesh.repeat_vertex(corner) } else { None };
            let vertex = vertex.unwrap_or(corner);
            mesh.uvs[0][vertex as usize] = uv;
            vertex
        })
    }
}

/// Reader with its position in the file.
struct Source<'a> {
    path: &'a Path,
    reader: BufReader<Box<dyn Read>>,
    encoding: Encoding,
    bytes_read: u64,
    /// Line of an ascii file, from 1.
    line: usize,
    ignored: Ignored,
}

impl Source<'_> {
    fn error(&self, message: impl Into<String>) -> Error {
        match self.encoding {
            Encoding::Ascii => Error::parse(self.path, self.line, 1, message),
            _ => Error::format(self.path, message),
        }
    }

    fn read_vertices(&mut self, element: &Element, mesh: &mut Mesh) -> Result<()> {
        let column = |name: &str| {
            element
                .properties
                .iter()
                .position(|property| property.name == name && property.list_count.is_none())
        };
        let positions = [column("x"), column("y"), column("z")];
        if positions.contains(&None) {
            let message = "expected the properties `x`, `y` and `z` of element `vertex`";
            return Err(Error::format(self.path, message));
        }
        let normals = [column("nx"), column("ny"), column("nz")];
        let has_normals = !normals.contains(&None);
        let uvs = UV_NAMES.map(|[u, v]| Some([column(u)?, column(v)?]));
        let uvs = uvs.into_iter().flatten().next();
        let colors =
            COLOR_NAMES.map(|[r, g, b, a]| Some(([column(r)?, column(g)?, column(b)?], column(a))));
        let colors = colors.into_iter().flatten().next();
        let room = |is_there: bool| if is_there { element.count as usize } else { 0 };
        mesh.positions.reserve_exact(room(true));
        mesh.colors.reserve_exact(room(colors.is_some()));
        mesh.normals.reserve_exact(room(has_normals));
        mesh.uvs[0].reserve_exact(room(uvs.is_some()));
        let mut row = vec![0.0_f64; element.properties.len()];
        for index in 0..element.count {
            for (property, value) in element.properties.iter().zip(&mut row) {
                let place = Place { element, index };
                match property.list_count {
                    Some(_) => self.skip(property, place)?,
                    None => *value = self.scalar(property.value, place)?,
                }
            }
            let vector = |columns: [Option<usize>; 3]| {
                columns.map(|column| column.map_or(0.0, |column| row[column] as f32))
            };
            mesh.positions.push(vector(positions));
            if has_normals {
                mesh.normals.push(vector(normals));
            }
            if let Some((columns, opacity)) = colors {
                let number = |column: usize, decode: fn(f32) -> f32| {
                    let largest = element.properties[column].value.largest();
                    largest.map_or(row[column] as f32, |most| decode((row[column] / most) as f32))
                };
                let [r, g, b] = columns.map(|column| number(column, srgb_to_linear));
                let opacity = opacity.map_or(1.0, |column| number(column, |share| share));
                mesh.colors.push([r, g, b, opacity]);
            }
            if let Some(columns) = uvs {
                mesh.uvs[0].push(columns.map(|column| row[column] as f32));
            }
        }
        Ok(())
    }

    fn read_faces(
        &mut self,
        element: &Element,
        vertex_count: u32,
        mesh: &mut Mesh,
        polygons: &mut Polygons,
    ) -> Result<()> {
        let is_indices =
            |property: &Property| matches!(&*property.name, "vertex_indices" | "vertex_index");
        if element.count > 0
            && !element.properties.iter().any(|p| is_indices(p) && p.list_count.is_some())
        {
            let message = format!(
                "expected the list property `vertex_indices` of element `{}`",
                element.name
            );
            return Err(Error::format(self.path, message));
        }
        for property in &element.properties {
            let is_color = COLOR_NAMES.iter().flatten().any(|name| *name == property.name);
            // Corners can have coordinates of their own where the vertices are known.
            let is_lost = property.name == "texcoord" && mesh.positions.is_empty();
            if is_color || is_lost || property.name == "texnumber" {
                let name = format!("`{}` of {}s", property.name, element.name);
                self.ignored.add_named(features::PLY_FACE, &name, || "the header".to_owned());
            }
        }
        let is_strip = element.name == "tristrips";
        mesh.triangles.reserve_exact(element.count as usize);
        let (mut corners, mut uvs) = (Vec::new(), Vec::new());
        let mut seams = Seams::default();
        for index in 0..element.count {
            for property in &element.properties {
                let place = Place { element, index };
                match property.list_count {
                    Some(count_type) if is_indices(property) => {
                        let count = self.list_count(count_type, place)?;
                        corners.clear();
                        for _ in 0..count {
                            let corner = self.scalar(property.value, place)?;
                            if is_strip && corner == -1.0 {
                                corners.push(RESTART);
                                continue;
                            }
                            if !(corner >= 0.0 && corner < f64::from(vertex_count)) {
                                return Err(self.error(format!(
                                    "face {index} of {}: vertex index {corner} is out of range, \
                                     the file has {vertex_count} vertices",
                                    element.count
                                )));
                            }
                            corners.push(corner as u32);
                        }
                    }
                    Some(count_type) if property.name == "texcoord" => {
                        uvs.clear();
                        for _ in 0..self.list_count(count_type, place)? {
                            uvs.push(self.scalar(property.value, place)? as f32);
                        }
                    }
                    _ => self.skip(property, place)?,
                }
            }
            if !is_strip && uvs.len() == 2 * corners.len() {
                for (corner, uv) in corners.iter_mut().zip(uvs.as_chunks().0) {
                    *corner = seams.vertex(mesh, *corner, *uv);
                }
            }
            match corners.as_slice() {
                strips if is_strip => mesh.push_strips(strips),
                &[a, b, c] => mesh.triangles.push([a, b, c]),
                [] | [_] | [_, _] => {}
                polygon => {
                    polygons.corners.extend_from_slice(polygon);
                    polygons.ends.push(polygons.corners.len());
                }
            }
        }
        Ok(())
    }

    fn skip(&mut self, property: &Property, place: Place) -> Result<()> {
        let count = property.list_count.map_or(Ok(1), |count| self.list_count(count, place))?;
        (0..count).try_for_each(|_| self.scalar(property.value, place).map(drop))
    }

    fn list_count(&mut self, count_type: Scalar, place: Place) -> Result<u64> {
        let count = self.scalar(count_type, place)?;
        if count >= 0.0 && count.fract() == 0.0 {
            Ok(count as u64)
        } else {
            Err(self.error(format!("{place}: {count} is not the length of a list")))
        }
    }

    fn scalar(&mut self, scalar: Scalar, place: Place) -> Result<f64> {
        if self.encoding == Encoding::Ascii {
            return self.ascii_scalar(place);
        }
        let byte_count = scalar.byte_count;
        let mut bytes = [0_u8; 8];
        match self.reader.read_exact(&mut bytes[..byte_count]) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                return Err(self.error(format!("truncated: the file ends in {place}")));
            }
            Err(error) => return Err(Error::io(self.path, "read", error)),
        }
        if self.encoding == Encoding::BinaryBigEndian {
            bytes[..byte_count].reverse();
        }
        Ok(scalar.value(bytes))
    }

    fn ascii_scalar(&mut self, place: Place) -> Result<f64> {
        // A double needs at most 24 characters; a word longer than this array is refused.
        let mut word = [0_u8; 64];
        let mut length = 0;
        loop {
            let buffer =
                self.reader.fill_buf().map_err(|source| Error::io(self.path, "read", source))?;
            let Some(&byte) = buffer.first() else { break };
            if byte.is_ascii_whitespace() && length > 0 {
                break;
            }
            self.reader.consume(1);
            self.line += usize::from(byte == b'\n');
            if !byte.is_ascii_whitespace() {
                if length == word.len() {
                    return Err(
                        self.error(format!("{place}: expected a number, found a long word"))
                    );
                }
                word[length] = byte;
                length += 1;
            }
        }
        if length == 0 {
            return Err(self.error(format!("truncated: the file ends in {place}")));
        }
        let word = String::from_utf8_lossy(&word[..length]);
        let number = word.parse().ok().or(is_no_number(&word).then_some(f64::NAN));
        number.ok_or_else(|| self.error(format!("{place}: expected a number, found `{word}`")))
    }
}

/// Element of the file, for messages.
#[derive(Clone, Copy)]
struct Place<'a> {
    element: &'a Element,
    index: u64,
}

impl std::fmt::Display for Place<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(formatter, "{} {} of {}", self.element.name, self.index, self.element.count)
    }
}
