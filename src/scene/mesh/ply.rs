//! PLY (Turk, "The PLY polygon file format", 1994): ascii and binary in both byte orders.
//!
//! The header may name elements and properties in any order and of any type; used are `x y z` and
//! `nx ny nz` of `vertex` and the list `vertex_indices` (or `vertex_index`) of `face`. Polygons with
//! more than three corners are triangulated in the plane of their Newell normal.

use std::{
    fs::File,
    io::{BufRead, BufReader, ErrorKind, Read},
    path::Path,
};

use super::Mesh;
use crate::{
    error::{Error, Result},
    scene::triangulate::triangulate_in_space,
};

/// A header longer than this is taken for another kind of file.
const MAX_HEADER_LINE_BYTES: u64 = 65_536;

/// Reads a PLY file.
///
/// # Errors
///
/// [`Error::Io`], or [`Error::Format`] that names the element and what was expected and found.
pub fn read(path: &Path) -> Result<Mesh> {
    let file = File::open(path).map_err(|source| Error::io(path, "read", source))?;
    let file_bytes = file.metadata().map_err(|source| Error::io(path, "read", source))?.len();
    read_from(path, BufReader::with_capacity(1 << 16, file), file_bytes)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    BinaryLittleEndian,
    BinaryBigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Float32,
    Float64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::Int8,
            "uchar" | "uint8" => Self::Uint8,
            "short" | "int16" => Self::Int16,
            "ushort" | "uint16" => Self::Uint16,
            "int" | "int32" => Self::Int32,
            "uint" | "uint32" => Self::Uint32,
            "float" | "float32" => Self::Float32,
            "double" | "float64" => Self::Float64,
            _ => return None,
        })
    }

    fn byte_count(self) -> usize {
        match self {
            Self::Int8 | Self::Uint8 => 1,
            Self::Int16 | Self::Uint16 => 2,
            Self::Int32 | Self::Uint32 | Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    /// Value of little-endian bytes; every type fits a double exactly.
    fn value(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::Int8 => f64::from(i8::from_le_bytes([a])),
            Self::Uint8 => f64::from(a),
            Self::Int16 => f64::from(i16::from_le_bytes([a, b])),
            Self::Uint16 => f64::from(u16::from_le_bytes([a, b])),
            Self::Int32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::Uint32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::Float32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::Float64 => f64::from_le_bytes(bytes),
        }
    }
}

#[derive(Clone, Debug)]
struct Property {
    name: String,
    value: Scalar,
    /// Type of the count where the property is a list.
    list_count: Option<Scalar>,
}

#[derive(Clone, Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

impl Element {
    /// Bytes the element needs at least, in the shortest form of each property.
    fn least_bytes(&self, encoding: Encoding) -> u64 {
        let of_property = |property: &Property| match encoding {
            Encoding::Ascii => 2,
            _ => property.list_count.unwrap_or(property.value).byte_count() as u64,
        };
        self.properties.iter().map(of_property).sum::<u64>().saturating_mul(self.count)
    }
}

fn read_from<R: BufRead>(path: &Path, reader: R, file_bytes: u64) -> Result<Mesh> {
    let mut source = Source { path, reader, encoding: Encoding::Ascii, bytes_read: 0, line: 1 };
    let elements = source.read_header()?;
    let mut mesh = Mesh::default();
    let vertex_count = vertex_count(path, &elements)?;
    let body_bytes = file_bytes.saturating_sub(source.bytes_read);
    for element in &elements {
        let least = element.least_bytes(source.encoding);
        // One byte less is right where an ascii file ends without a new line.
        if least > body_bytes + 1 {
            return Err(Error::format(
                path,
                format!(
                    "truncated: {} elements `{}` need at least {least} bytes, the file has \
                     {body_bytes} after its header",
                    element.count, element.name
                ),
            ));
        }
    }
    let mut polygons = Polygons::default();
    for element in &elements {
        match element.name.as_str() {
            "vertex" => source.read_vertices(element, &mut mesh)?,
            "face" => source.read_faces(element, vertex_count, &mut mesh, &mut polygons)?,
            "tristrips" if element.count > 0 => {
                return Err(Error::format(
                    path,
                    "triangle strips (element `tristrips`) are not supported; write the mesh with \
                     faces",
                ));
            }
            _ => source.skip(element)?,
        }
    }
    polygons.triangulate_into(&mut mesh);
    Ok(mesh)
}

fn vertex_count(path: &Path, elements: &[Element]) -> Result<u32> {
    for name in ["vertex", "face"] {
        let found = elements.iter().filter(|element| element.name == name).count();
        if found != 1 {
            let expected = format!("expected one element `{name}`, found {found}");
            return Err(Error::format(path, expected));
        }
    }
    let count = elements.iter().find(|element| element.name == "vertex").map_or(0, |v| v.count);
    u32::try_from(count).map_err(|_| {
        Error::format(path, format!("{count} vertices, at most {} can be used", u32::MAX))
    })
}

/// Corners of the faces with more than three, until all positions are known.
#[derive(Debug, Default)]
struct Polygons {
    corners: Vec<u32>,
    ends: Vec<usize>,
}

impl Polygons {
    fn triangulate_into(self, mesh: &mut Mesh) {
        let mut start = 0;
        for end in self.ends {
            let corners = &self.corners[start..end];
            start = end;
            let positions: Vec<_> =
                corners.iter().map(|&corner| mesh.positions[corner as usize]).collect();
            let triangles = triangulate_in_space(&positions);
            mesh.triangles
                .extend(triangles.iter().map(|triangle| triangle.map(|index| corners[index])));
        }
    }
}

/// The file from where it has been read to.
struct Source<'a, R> {
    path: &'a Path,
    reader: R,
    encoding: Encoding,
    bytes_read: u64,
    /// Line of an ascii file, from 1.
    line: usize,
}

impl<R: BufRead> Source<'_, R> {
    fn error(&self, message: impl Into<String>) -> Error {
        match self.encoding {
            Encoding::Ascii => Error::Parse {
                path: self.path.to_path_buf(),
                line: self.line,
                column: 1,
                message: message.into(),
            },
            _ => Error::format(self.path, message),
        }
    }

    fn header_line(&mut self) -> Result<String> {
        let mut bytes = Vec::new();
        self.reader
            .by_ref()
            .take(MAX_HEADER_LINE_BYTES)
            .read_until(b'\n', &mut bytes)
            .map_err(|source| Error::io(self.path, "read", source))?;
        if bytes.is_empty() {
            return Err(self.error("truncated: the file ends before `end_header`"));
        }
        self.bytes_read += bytes.len() as u64;
        Ok(String::from_utf8_lossy(&bytes).trim().to_owned())
    }

    fn read_header(&mut self) -> Result<Vec<Element>> {
        let magic = self.header_line()?;
        if magic != "ply" {
            let start: String = magic.chars().take(16).collect();
            return Err(
                self.error(format!("expected a PLY file that starts with `ply`, found `{start}`"))
            );
        }
        let mut elements: Vec<Element> = Vec::new();
        let mut encoding = None;
        loop {
            self.line += 1;
            let text = self.header_line()?;
            let words: Vec<&str> = text.split_whitespace().collect();
            match words.as_slice() {
                ["format", name, version] => {
                    encoding = Some(match *name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::BinaryLittleEndian,
                        "binary_big_endian" => Encoding::BinaryBigEndian,
                        _ => {
                            return Err(self.error(format!(
                                "expected format ascii, binary_little_endian or binary_big_endian, \
                                 found `{name} {version}`"
                            )));
                        }
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| {
                        self.error(format!("expected the number of `{name}`, found `{count}`"))
                    })?;
                    elements.push(Element {
                        name: (*name).to_owned(),
                        count,
                        properties: Vec::new(),
                    });
                }
                ["property", kind @ .., name] => {
                    let property = self.property(kind, name)?;
                    let Some(element) = elements.last_mut() else {
                        return Err(self.error(format!("property `{name}` before any element")));
                    };
                    element.properties.push(property);
                }
                ["comment" | "obj_info", ..] | [] => {}
                ["end_header"] => break,
                _ => return Err(self.error(format!("cannot read the header line `{text}`"))),
            }
        }
        self.line += 1;
        self.encoding = encoding.ok_or_else(|| self.error("the header has no line `format`"))?;
        Ok(elements)
    }

    fn property(&self, kind: &[&str], name: &str) -> Result<Property> {
        let scalar = |word: &str| {
            Scalar::parse(word).ok_or_else(|| {
                self.error(format!("property `{name}` has the unknown type `{word}`"))
            })
        };
        let (value, list_count) = match kind {
            [value] => (scalar(value)?, None),
            ["list", count, value] => (scalar(value)?, Some(scalar(count)?)),
            _ => return Err(self.error(format!("cannot read the type of property `{name}`"))),
        };
        Ok(Property { name: name.to_owned(), value, list_count })
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
            return Err(Error::format(
                self.path,
                "expected the properties `x`, `y` and `z` of element `vertex`",
            ));
        }
        let normals = [column("nx"), column("ny"), column("nz")];
        let has_normals = !normals.contains(&None);
        mesh.positions.reserve_exact(element.count as usize);
        if has_normals {
            mesh.normals.reserve_exact(element.count as usize);
        }
        let mut row = vec![0.0_f64; element.properties.len()];
        for index in 0..element.count {
            for (property, value) in element.properties.iter().zip(&mut row) {
                let place = Place { element, index };
                if let Some(count) = property.list_count {
                    self.skip_list(count, property, place)?;
                } else {
                    *value = self.scalar(property.value, place)?;
                }
            }
            let vector = |columns: [Option<usize>; 3]| {
                columns.map(|column| column.map_or(0.0, |column| row[column] as f32))
            };
            mesh.positions.push(vector(positions));
            if has_normals {
                mesh.normals.push(vector(normals));
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
            return Err(Error::format(
                self.path,
                "expected the list property `vertex_indices` of element `face`",
            ));
        }
        mesh.triangles.reserve_exact(element.count as usize);
        let mut corners = Vec::new();
        for index in 0..element.count {
            for property in &element.properties {
                let place = Place { element, index };
                match property.list_count {
                    Some(count_type) if is_indices(property) => {
                        let count = self.list_count(count_type, place)?;
                        corners.clear();
                        for _ in 0..count {
                            let corner = self.scalar(property.value, place)?;
                            if !(corner >= 0.0 && corner < f64::from(vertex_count)) {
                                return Err(self.error(format!(
                                    "face {index} of {}: vertex index {corner} is out of range, \
                                     the file has {vertex_count} vertices",
                                    element.count
                                )));
                            }
                            corners.push(corner as u32);
                        }
                        match corners.as_slice() {
                            &[a, b, c] => mesh.triangles.push([a, b, c]),
                            [] | [_] | [_, _] => {}
                            polygon => {
                                polygons.corners.extend_from_slice(polygon);
                                polygons.ends.push(polygons.corners.len());
                            }
                        }
                    }
                    Some(count) => self.skip_list(count, property, place)?,
                    None => {
                        self.scalar(property.value, place)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn skip(&mut self, element: &Element) -> Result<()> {
        for index in 0..element.count {
            for property in &element.properties {
                let place = Place { element, index };
                if let Some(count) = property.list_count {
                    self.skip_list(count, property, place)?;
                } else {
                    self.scalar(property.value, place)?;
                }
            }
        }
        Ok(())
    }

    fn skip_list(&mut self, count: Scalar, property: &Property, place: Place) -> Result<()> {
        for _ in 0..self.list_count(count, place)? {
            self.scalar(property.value, place)?;
        }
        Ok(())
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
        let byte_count = scalar.byte_count();
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
        // The longest number a double needs has 24 characters; more digits are cut off by the limit.
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
        word.parse().map_err(|_| self.error(format!("{place}: expected a number, found `{word}`")))
    }
}

/// An element of the file, for messages.
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
