//! glTF 2.0 (`.gltf` with buffers beside it or inline, `.glb`): meshes with the transforms of their
//! nodes, and base colours.
//!
//! Ignores cameras, lights, textures, skins and morph targets. Rejects required extensions and
//! sparse accessors by name. Reads the accessors itself and checks every range.

use std::path::{Path, PathBuf};

use glam::{Mat3, Mat4, Vec3};
use gltf::{
    Document, Gltf, Node, Primitive,
    accessor::{Accessor, DataType, Dimensions},
    buffer::Source,
    json::{Root, validation::Checked},
    mesh::{Mode, Semantic},
};

use super::{Mesh, MeshMaterial};
use crate::{
    error::{Error, Result},
    files,
};

/// Reads a glTF file and its buffers; `warnings` counts primitives that are not triangles.
///
/// # Errors
/// [`Error::Io`] for a file that cannot be read, [`Error::Parse`] for bad JSON, [`Error::Format`]
/// for any other fault.
pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Mesh> {
    let bytes = files::read(path)?;
    if let (Some(b"glTF"), Some(&[a, b, c, d])) = (bytes.get(..4), bytes.get(8..12)) {
        let stated = u32::from_le_bytes([a, b, c, d]) as usize;
        if stated > bytes.len() {
            let message =
                format!("truncated: the header states {stated} bytes, found {}", bytes.len());
            return Err(Error::format(path, message));
        }
    }
    let malformed = |error| {
        let message = format!("not a glTF document: {error}");
        match error {
            gltf::Error::Deserialize(error) => {
                Error::parse(path, error.line(), error.column(), message)
            }
            _ => Error::format(path, message),
        }
    };
    let Gltf { document, blob } = Gltf::from_slice_without_validation(&bytes).map_err(malformed)?;
    drop(bytes);
    let root = document.into_json();
    check_positions(path, &root)?;
    let document = Document::from_json(root).map_err(malformed)?;
    if let Some(extension) = document.extensions_required().next() {
        let message =
            format!("the file requires the extension `{extension}`, which is not supported");
        return Err(Error::format(path, message));
    }
    let buffers = read_buffers(path, &document, blob)?;
    let mut reader = GltfReader { path, buffers, mesh: Mesh::default(), skipped: 0 };
    reader.mesh.side_files = document
        .buffers()
        .filter_map(|buffer| match buffer.source() {
            Source::Uri(uri) if !uri.starts_with("data:") => beside(path, uri).ok(),
            _ => None,
        })
        .collect();
    reader.mesh.materials = document
        .materials()
        .map(|material| {
            let [red, green, blue, _] = material.pbr_metallic_roughness().base_color_factor();
            let base_color = [red, green, blue].map(|channel| channel.clamp(0.0, 1.0));
            MeshMaterial { name: material.name().unwrap_or_default().to_owned(), base_color }
        })
        .collect();
    let mut visited = vec![false; document.nodes().count()];
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let Some(scene) = scene else {
        return Err(Error::format(path, "expected a scene with nodes, found none"));
    };
    // Use a stack, not recursion: nodes may nest deeper than the call stack.
    let mut stack: Vec<(Node, Mat4)> = scene.nodes().map(|node| (node, Mat4::IDENTITY)).collect();
    stack.reverse();
    while let Some((node, world_from_parent)) = stack.pop() {
        if std::mem::replace(&mut visited[node.index()], true) {
            let message = format!("node {} has more than one parent", node.index());
            return Err(Error::format(path, message));
        }
        let parent_from_node = Mat4::from_cols_array_2d(&node.transform().matrix());
        let world_from_node = world_from_parent * parent_from_node;
        for primitive in node.mesh().iter().flat_map(|mesh| mesh.primitives()) {
            reader.read_primitive(&primitive, world_from_node)?;
        }
        stack.extend(node.children().map(|child| (child, world_from_node)));
    }
    if reader.skipped > 0 {
        warnings.push(format!(
            "{}: left out {} primitives that are points or lines",
            path.display(),
            reader.skipped
        ));
    }
    let mut mesh = reader.mesh;
    if mesh.normals.iter().all(|normal| *normal == [0.0; 3]) {
        mesh.normals = Vec::new();
    }
    Ok(mesh)
}

fn read_buffers(
    path: &Path,
    document: &Document,
    mut blob: Option<Vec<u8>>,
) -> Result<Vec<Vec<u8>>> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let index = buffer.index();
        let bytes = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| {
                Error::format(path, format!("buffer {index} is in a chunk that the file lacks"))
            })?,
            Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => data
                    .split_once(";base64,")
                    .and_then(|(_, text)| decode_base64(text))
                    .ok_or_else(|| {
                        Error::format(path, format!("buffer {index} is not base64 data"))
                    })?,
                None => files::read(&beside(path, uri)?)?,
            },
        };
        if bytes.len() < buffer.length() {
            let message = format!(
                "truncated: buffer {index} should have {} bytes, found {}",
                buffer.length(),
                bytes.len()
            );
            return Err(Error::format(path, message));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// Checks that the accessor of every primitive's positions exists, on which the validation by the
/// `gltf` crate relies.
fn check_positions(path: &Path, root: &Root) -> Result<()> {
    for primitive in root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        let position = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        if let Some(accessor) = position.map(|index| index.value())
            && accessor >= root.accessors.len()
        {
            return Err(Error::format(
                path,
                format!(
                    "not a glTF document: a primitive's POSITION names accessor {accessor}, the \
                     file has {}",
                    root.accessors.len()
                ),
            ));
        }
    }
    Ok(())
}

/// Path of a buffer file that is named by a relative URI.
fn beside(path: &Path, uri: &str) -> Result<PathBuf> {
    let name = decode_percent(uri).ok_or_else(|| {
        Error::format(path, format!("cannot read the name of the buffer file `{uri}`"))
    })?;
    Ok(path.parent().unwrap_or(Path::new("")).join(name))
}

/// Decodes the percent encoding of a relative URI.
fn decode_percent(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        rest = tail;
        if *first == b'%' {
            let digits = std::str::from_utf8(tail.get(..2)?).ok()?;
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &tail[2..];
        } else {
            bytes.push(*first);
        }
    }
    String::from_utf8(bytes).ok()
}

/// Decodes standard base64 (RFC 4648 section 4), with or without padding.
fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let digits = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(digits.len() * 3 / 4);
    for group in digits.chunks(4) {
        if group.len() == 1 {
            return None;
        }
        let mut bits = 0_u32;
        for digit in group {
            let value = match digit {
                b'A'..=b'Z' => digit - b'A',
                b'a'..=b'z' => digit - b'a' + 26,
                b'0'..=b'9' => digit - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(value);
        }
        bits <<= 6 * (4 - group.len());
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    Some(bytes)
}

struct GltfReader<'a> {
    path: &'a Path,
    buffers: Vec<Vec<u8>>,
    mesh: Mesh,
    skipped: usize,
}

impl GltfReader<'_> {
    fn error(&self, message: impl Into<String>) -> Error {
        Error::format(self.path, message)
    }

    fn read_primitive(&mut self, primitive: &Primitive, world_from_node: Mat4) -> Result<()> {
        if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.skipped += 1;
            return Ok(());
        }
        let Some(position_accessor) = primitive.get(&Semantic::Positions) else {
            return Err(self.error(format!("primitive {} has no positions", primitive.index())));
        };
        let positions = self.vectors(&position_accessor)?;
        let linear = Mat3::from_mat4(world_from_node);
        let mirrors = linear.determinant() < 0.0;
        let first_vertex = self.mesh.positions.len();
        if u32::try_from(first_vertex + positions.len()).is_err() {
            return Err(self.error("more than 4,294,967,295 vertices"));
        }
        let to_world = |position: &[f32; 3]| {
            world_from_node.transform_point3(Vec3::from_array(*position)).to_array()
        };
        self.mesh.positions.extend(positions.iter().map(to_world));
        if let Some(accessor) = primitive.get(&Semantic::Normals) {
            let normals = self.vectors(&accessor)?;
            if normals.len() != positions.len() {
                return Err(self.error(format!(
                    "primitive {} has {} positions and {} normals",
                    primitive.index(),
                    positions.len(),
                    normals.len()
                )));
            }
            // A node scaled to nothing has no inverse; its normals become zero.
            let turn = linear.inverse().transpose();
            let to_world = |normal: &[f32; 3]| {
                (turn * Vec3::from_array(*normal)).normalize_or_zero().to_array()
            };
            self.mesh.normals.extend(normals.iter().map(to_world));
        } else {
            self.mesh.normals.resize(self.mesh.positions.len(), [0.0; 3]);
        }
        let indices = match primitive.indices() {
            Some(accessor) => self.indices(&accessor, positions.len())?,
            None => (0..positions.len() as u32).collect(),
        };
        self.mesh.start_run(primitive.material().index());
        let first_vertex = first_vertex as u32;
        let mut push = |[a, b, c]: [u32; 3]| {
            let triangle = if mirrors { [a, c, b] } else { [a, b, c] };
            self.mesh.triangles.push(triangle.map(|index| first_vertex + index));
        };
        match primitive.mode() {
            Mode::TriangleStrip => {
                for (index, corners) in indices.windows(3).enumerate() {
                    let turn = index % 2;
                    push([corners[turn], corners[1 - turn], corners[2]]);
                }
            }
            Mode::TriangleFan => {
                for corners in indices.get(1..).unwrap_or_default().windows(2) {
                    push([indices[0], corners[0], corners[1]]);
                }
            }
            _ => indices
                .chunks_exact(3)
                .for_each(|corners| push([corners[0], corners[1], corners[2]])),
        }
        Ok(())
    }

    fn vectors(&self, accessor: &Accessor) -> Result<Vec<[f32; 3]>> {
        if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return Err(self.error(format!(
                "accessor {}: expected vectors of three floats, found {:?} of {:?}",
                accessor.index(),
                accessor.dimensions(),
                accessor.data_type()
            )));
        }
        let component = |bytes: &[u8], at: usize| {
            f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        self.elements(accessor, |bytes| [0, 4, 8].map(|at| component(bytes, at)))
    }

    fn indices(&self, accessor: &Accessor, vertex_count: usize) -> Result<Vec<u32>> {
        let kind = (accessor.data_type(), accessor.dimensions());
        let indices: Vec<u32> = match kind {
            (DataType::U8, Dimensions::Scalar) => {
                self.elements(accessor, |bytes| u32::from(bytes[0]))?
            }
            (DataType::U16, Dimensions::Scalar) => self
                .elements(accessor, |bytes| u32::from(u16::from_le_bytes([bytes[0], bytes[1]])))?,
            (DataType::U32, Dimensions::Scalar) => self.elements(accessor, |bytes| {
                u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
            })?,
            (data_type, dimensions) => {
                return Err(self.error(format!(
                    "accessor {}: expected unsigned indices, found {dimensions:?} of {data_type:?}",
                    accessor.index()
                )));
            }
        };
        match indices.iter().position(|&index| index as usize >= vertex_count) {
            Some(element) => Err(self.error(format!(
                "accessor {}, element {element} (triangle {}): vertex index {} is out of range, \
                 the primitive has {vertex_count} vertices",
                accessor.index(),
                element / 3,
                indices[element]
            ))),
            None => Ok(indices),
        }
    }

    /// Reads the elements of an accessor, each from its `accessor.size()` bytes.
    fn elements<T>(&self, accessor: &Accessor, element: impl Fn(&[u8]) -> T) -> Result<Vec<T>> {
        let index = accessor.index();
        if accessor.sparse().is_some() {
            return Err(self.error(format!("accessor {index} is sparse, which is not supported")));
        }
        let Some(view) = accessor.view() else {
            return Err(self.error(format!("accessor {index} has no buffer view")));
        };
        let (count, size) = (accessor.count(), accessor.size());
        let stride = view.stride().unwrap_or(size);
        let needed = count
            .checked_sub(1)
            .map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size))
            .and_then(|bytes| bytes.checked_add(accessor.offset()));
        let buffer = &self.buffers[view.buffer().index()];
        let bytes = view
            .offset()
            .checked_add(view.length())
            .and_then(|end| buffer.get(view.offset()..end))
            .ok_or_else(|| {
                self.error(format!(
                    "truncated: buffer view {} needs {} bytes from byte {}, its buffer has {}",
                    view.index(),
                    view.length(),
                    view.offset(),
                    buffer.len()
                ))
            })?;
        if needed.is_none_or(|needed| needed > bytes.len()) || (stride < size) {
            return Err(self.error(format!(
                "accessor {index}: {count} elements of {size} bytes every {stride} from byte {} do \
                 not fit into the {} bytes of buffer view {}",
                accessor.offset(),
                bytes.len(),
                view.index()
            )));
        }
        let start = |at: usize| accessor.offset() + at * stride;
        Ok((0..count).map(|at| element(&bytes[start(at)..start(at) + size])).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent_codes_are_undone() {
        // RFC 4648 section 10.
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9vYmFy", "foobar")] {
            assert_eq!(decode_base64(text).as_deref(), Some(bytes.as_bytes()));
        }
        assert_eq!(decode_base64("Zm9v*A=="), None);
        assert_eq!(decode_base64("A"), None);
        assert_eq!(decode_percent("a%20b.bin").as_deref(), Some("a b.bin"));
        assert_eq!(decode_percent("a%2"), None);
    }
}
