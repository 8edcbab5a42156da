//! glTF 2.0 (`.gltf` with buffers beside it or inline, `.glb`): meshes with the transforms of their
//! nodes, materials by their factors, cameras.
//!
//! Names everything else that a file holds ([`features::GLTF`]) in a warning, or refuses it. Reads
//! the accessors itself and checks every range.

mod accessors;
mod contents;

use std::path::{Path, PathBuf};

use glam::{Mat3, Mat4, Vec3};
use gltf::{
    Document, Glb, Node, Primitive,
    buffer::Source,
    json::{Root, validation::Checked},
    mesh::{Mode, Semantic},
};
use serde_json::Value;

use super::{Mesh, MeshCamera};
use crate::{
    error::{Error, Result},
    files,
    scene::features::{self, Ignored, Support},
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
    let (document, blob, json) = parse(path, &bytes)?;
    drop(bytes);
    let buffers = read_buffers(path, &document, blob)?;
    let mut reader = GltfReader {
        path,
        buffers,
        mesh: Mesh::default(),
        cameras: Vec::new(),
        ignored: Ignored::default(),
    };
    reader.mesh.side_files = document
        .buffers()
        .filter_map(|buffer| match buffer.source() {
            Source::Uri(uri) if !uri.starts_with("data:") => beside(path, uri).ok(),
            _ => None,
        })
        .collect();
    reader.mesh.materials =
        document.materials().map(|material| contents::material(&material, &json)).collect();
    reader.ignore_contents(&document, &json);
    let mut visited = vec![false; document.nodes().count()];
    let mut seen_meshes = vec![false; document.meshes().count()];
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
        reader.read_node(&node, world_from_node, &json);
        if let Some(mesh) = node.mesh() {
            if !std::mem::replace(&mut seen_meshes[mesh.index()], true) {
                reader.ignore_in_mesh(&mesh, &json);
            }
            for world_from_instance in reader.instances(&document, &node, world_from_node, &json)? {
                for primitive in mesh.primitives() {
                    reader.read_primitive(&primitive, world_from_instance)?;
                }
            }
        }
        stack.extend(node.children().map(|child| (child, world_from_node)));
    }
    warnings.extend(reader.ignored.warnings(path));
    let mut mesh = reader.mesh;
    reader.cameras.sort_by_key(|(index, _)| *index);
    mesh.cameras = reader.cameras.into_iter().map(|(_, camera)| camera).collect();
    if mesh.normals.iter().all(|normal| *normal == [0.0; 3]) {
        mesh.normals = Vec::new();
    }
    Ok(mesh)
}

/// Parses and checks a document; returns it with its binary chunk and its JSON as a tree, which
/// holds the extensions.
fn parse(path: &Path, bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>, Value)> {
    let not_gltf =
        |error: gltf::Error| Error::format(path, format!("not a glTF document: {error}"));
    let not_json = |error: serde_json::Error| {
        let message = format!("not a glTF document: {error}");
        Error::parse(path, error.line(), error.column(), message)
    };
    let glb = bytes.starts_with(b"glTF").then(|| Glb::from_slice(bytes).map_err(not_gltf));
    let glb = glb.transpose()?;
    let text = glb.as_ref().map_or(bytes, |glb| &glb.json);
    let mut root: Root = serde_json::from_slice(text).map_err(not_json)?;
    // Parsing checks against the extensions that the crate knows, not those that are known here.
    for extension in std::mem::take(&mut root.extensions_required) {
        let name = format!("`{extension}`");
        let is_known = |feature: &features::Feature| {
            feature.name == name && feature.support != Support::Refused
        };
        if !features::GLTF.iter().any(is_known) {
            let message =
                format!("the file requires the extension `{extension}`, which is not supported");
            return Err(Error::format(path, message));
        }
    }
    check_positions(path, &root)?;
    let document = Document::from_json(root).map_err(not_gltf)?;
    let json = serde_json::from_slice(text).map_err(not_json)?;
    Ok((document, glb.and_then(|glb| glb.bin).map(|bin| bin.into_owned()), json))
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
    /// Cameras of the nodes with their numbers in the file.
    cameras: Vec<(usize, MeshCamera)>,
    ignored: Ignored,
}

impl GltfReader<'_> {
    fn error(&self, message: impl Into<String>) -> Error {
        Error::format(self.path, message)
    }

    fn read_primitive(&mut self, primitive: &Primitive, world_from_node: Mat4) -> Result<()> {
        if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let Some(position_accessor) = primitive.get(&Semantic::Positions) else {
            return Err(self.error(format!("primitive {} has no positions", primitive.index())));
        };
        let positions = self.vectors::<3>(&position_accessor)?;
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
            let normals = self.vectors::<3>(&accessor)?;
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
