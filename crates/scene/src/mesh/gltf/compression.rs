//! Meshes and buffer views that extensions compress → those of a document without: Draco's by the crate
//! `draco-core`, meshoptimizer's by `meshopt-rs`.

use std::path::Path;

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointIndex};
use gltf::{
    Document,
    json::{
        Buffer, Index, Root,
        accessor::UNSIGNED_INT,
        buffer::View,
        mesh::Mode,
        validation::{Checked, USize64},
    },
};
use meshopt_rs::{
    index::{buffer::decode_index_buffer, sequence::decode_index_sequence},
    vertex::{
        buffer::decode_vertex_buffer,
        filter::{
            decode_filter_exp, decode_filter_oct_8, decode_filter_oct_16, decode_filter_quat,
        },
    },
};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::index;
use crate::{
    error::{Error, Result},
    memory,
};

const DRACO: &str = "KHR_draco_mesh_compression";
/// Most bytes of an accessor without values.
const MAX_ZERO_BYTES: u64 = 1 << 28;
const MESHOPT: &str = "EXT_meshopt_compression";

/// Tests for a buffer that holds what readers without the extension find in compressed views.
pub(super) fn is_fallback(buffer: &Value) -> bool {
    buffer["extensions"][MESHOPT]["fallback"] == true
}

/// Appends what the compressed parts of a document hold to its buffers, and returns the document that finds
/// it there. Fails for data that cannot be decoded or is not what the document says, and for want of memory.
pub(super) fn expand(
    path: &Path,
    document: Document,
    json: &Value,
    buffers: &mut Vec<Vec<u8>>,
) -> Result<Root> {
    let error =
        |place: String| move |message: String| Error::format(path, format!("{place}: {message}"));
    let mut expansion = Expansion { root: document.into_json(), buffers };
    for (index, view) in members(&json["bufferViews"]) {
        let packed = &view["extensions"][MESHOPT];
        if !packed.is_null() {
            let place = format!("buffer view {index}, `{MESHOPT}`");
            expansion.expand_view(index, packed).map_err(error(place))?;
        }
    }
    for (mesh, json) in members(&json["meshes"]) {
        for (index, primitive) in members(&json["primitives"]) {
            if !primitive["extensions"][DRACO].is_null() {
                let place = format!("mesh {mesh}, primitive {index}, `{DRACO}`");
                expansion.expand_primitive([mesh, index], primitive).map_err(error(place))?;
            }
        }
    }
    expansion.fill_with_zeros().map_err(error("accessors".to_owned()))?;
    Ok(expansion.root)
}

/// Elements of an array with their places.
fn members(json: &Value) -> impl Iterator<Item = (usize, &Value)> {
    json.as_array().into_iter().flatten().enumerate()
}

/// Part of a document.
fn part<T: DeserializeOwned>(json: Value) -> Result<T, String> {
    serde_json::from_value(json).map_err(|error| error.to_string())
}

/// A number that must be there.
fn count(json: &Value, key: &str) -> Result<usize, String> {
    index(&json[key]).ok_or_else(|| format!("expected a number `{key}`, found {}", json[key]))
}

/// Bytes from `offset` of a buffer.
fn range(
    buffers: &[Vec<u8>],
    buffer: usize,
    offset: usize,
    length: usize,
) -> Result<&[u8], String> {
    let end = offset.checked_add(length);
    let bytes = buffers.get(buffer).and_then(|bytes| bytes.get(offset..end?));
    bytes.ok_or_else(|| {
        format!("truncated: needs {length} bytes from byte {offset} of buffer {buffer}")
    })
}

struct Expansion<'a> {
    root: Root,
    buffers: &'a mut Vec<Vec<u8>>,
}

impl Expansion<'_> {
    fn push(&mut self, bytes: Vec<u8>) -> Result<Index<Buffer>, String> {
        let buffer = part(json!({"byteLength": bytes.len()}))?;
        self.buffers.push(bytes);
        Ok(self.root.push(buffer))
    }

    /// Adds a buffer of `bytes` and a view of all of it.
    fn push_view(&mut self, bytes: Vec<u8>) -> Result<Index<View>, String> {
        let length = bytes.len();
        let buffer = self.push(bytes)?.value();
        Ok(self.root.push(part(json!({"buffer": buffer, "byteLength": length}))?))
    }

    /// Gives accessors of neither a view nor sparse values the zeros that they stand for.
    fn fill_with_zeros(&mut self) -> Result<(), String> {
        for at in 0..self.root.accessors.len() {
            let accessor = &self.root.accessors[at];
            let (Checked::Valid(kind), Checked::Valid(dimensions)) =
                (accessor.component_type, accessor.type_)
            else {
                continue;
            };
            let (count, size) = (accessor.count.0, kind.0.size() * dimensions.multiplicity());
            let is_used = accessor.buffer_view.is_some() || accessor.sparse.is_some();
            if !is_used && count.saturating_mul(size as u64) <= MAX_ZERO_BYTES {
                let view = self.push_view(vec![0; count as usize * size])?;
                self.root.accessors[at].buffer_view = Some(view);
            }
        }
        Ok(())
    }

    /// Replaces what a buffer view shows by what its extension holds.
    fn expand_view(&mut self, index: usize, packed: &Value) -> Result<(), String> {
        let bytes = unpacked(packed, self.buffers)?;
        let byte_length = USize64::from(bytes.len());
        let buffer = self.push(bytes)?;
        let view = &mut self.root.buffer_views[index];
        (view.buffer, view.byte_offset, view.byte_length) = (buffer, None, byte_length);
        Ok(())
    }

    /// Decodes the mesh of a primitive, and gives its accessors the decoded values.
    fn expand_primitive(
        &mut self,
        [mesh_index, index]: [usize; 2],
        primitive: &Value,
    ) -> Result<(), String> {
        let packed = &primitive["extensions"][DRACO];
        let view = count(packed, "bufferView")?;
        let view = self.root.buffer_views.get(view).ok_or("it names no buffer view")?;
        let offset = view.byte_offset.map_or(0, |offset| offset.0 as usize);
        let length = view.byte_length.0 as usize;
        let bytes = range(self.buffers, view.buffer.value(), offset, length)?;
        let limits = DecodeLimits::default().with_max_decoded_bytes(memory::limit());
        let mut mesh = Mesh::new();
        MeshDecoder::new()
            .decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh)
            .map_err(|error| error.to_string())?;
        for (name, id) in packed["attributes"].as_object().into_iter().flatten() {
            let id = id.as_u64().and_then(|id| u32::try_from(id).ok());
            let attribute = id.and_then(|id| mesh.attribute_by_unique_id(id));
            let attribute = attribute.ok_or_else(|| format!("it holds no {name}"))?;
            let at = count(&primitive["attributes"], name)?;
            let accessor = self.root.accessors.get(at);
            let accessor = accessor.ok_or_else(|| format!("{name} names no accessor"))?;
            let (Checked::Valid(kind), Checked::Valid(dimensions)) =
                (accessor.component_type, accessor.type_)
            else {
                return Err(format!("accessor {at} has no type"));
            };
            let expected = (mesh.num_points(), kind.0.size() * dimensions.multiplicity());
            let stated = accessor.count.0 as usize;
            let size = usize::try_from(attribute.byte_stride()).unwrap_or(0);
            if expected != (stated, size) {
                let (points, bytes) = expected;
                return Err(format!(
                    "it holds {points} {name} of {size} bytes, accessor {at} has {stated} of {bytes}"
                ));
            }
            let values = attribute.buffer().data();
            let mut bytes = Vec::with_capacity(stated * size);
            for point in 0..stated {
                let place = attribute.mapped_index(PointIndex(point as u32)).0 as usize * size;
                let value = values.get(place..place + size);
                bytes.extend(value.ok_or_else(|| format!("its {name} are truncated"))?);
            }
            let view = self.push_view(bytes)?;
            let accessor = &mut self.root.accessors[at];
            (accessor.buffer_view, accessor.byte_offset) = (Some(view), None);
        }
        let corners = mesh.faces().iter().flatten().flat_map(|corner| corner.0.to_le_bytes());
        let indices = part(json!({
            "bufferView": self.push_view(corners.collect())?.value(),
            "componentType": UNSIGNED_INT,
            "count": 3 * mesh.num_faces(),
            "type": "SCALAR",
        }))?;
        let primitive = &mut self.root.meshes[mesh_index].primitives[index];
        primitive.mode = Checked::Valid(Mode::Triangles);
        let own = primitive.indices.map(|own| own.value());
        match own.and_then(|own| self.root.accessors.get_mut(own)) {
            Some(own) => *own = indices,
            None => primitive.indices = Some(Index::push(&mut self.root.accessors, indices)),
        }
        Ok(())
    }
}

/// Bytes that a view packed by meshoptimizer stands for.
fn unpacked(packed: &Value, buffers: &[Vec<u8>]) -> Result<Vec<u8>, String> {
    let offset = if packed["byteOffset"].is_null() { 0 } else { count(packed, "byteOffset")? };
    let bytes = range(buffers, count(packed, "buffer")?, offset, count(packed, "byteLength")?)?;
    let (stride, elements) = (count(packed, "byteStride")?, count(packed, "count")?);
    memory::check_count("the mesh", elements, stride.max(4)).map_err(|error| error.to_string())?;
    let mode = packed["mode"].as_str().unwrap_or_default();
    let found = match (mode, stride) {
        ("ATTRIBUTES", _) => attributes(bytes, elements, stride)?,
        ("TRIANGLES" | "INDICES", 2 | 4) => {
            let mut indices = vec![0_u32; elements];
            if mode == "INDICES" {
                decode_index_sequence(&mut indices, bytes).map_err(undecodable)?;
            } else if elements.is_multiple_of(3) {
                decode_index_buffer(&mut indices, bytes).map_err(undecodable)?;
            } else {
                return Err(format!("{elements} corners of triangles"));
            }
            indices.iter().flat_map(|index| index.to_le_bytes()[..stride].to_vec()).collect()
        }
        _ => return Err(format!("expected no mode `{mode}` of {stride} bytes")),
    };
    let filter = packed["filter"].as_str().unwrap_or("NONE");
    Ok(match (filter, stride) {
        ("NONE", _) => found,
        ("OCTAHEDRAL", 4) => filtered::<[u8; 4]>(&found, decode_filter_oct_8),
        ("OCTAHEDRAL", 8) => filtered::<[u16; 4]>(&found, decode_filter_oct_16),
        ("QUATERNION", 8) => filtered::<[u16; 4]>(&found, decode_filter_quat),
        ("EXPONENTIAL", _) if stride.is_multiple_of(4) => {
            filtered::<u32>(&found, decode_filter_exp)
        }
        _ => return Err(format!("expected no filter `{filter}` of {stride} bytes")),
    })
}

fn undecodable(error: impl std::fmt::Debug) -> String {
    format!("cannot be decoded: {error:?}")
}

fn filtered<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
    bytes: &[u8],
    filter: impl Fn(&mut [T]),
) -> Vec<u8> {
    let mut elements: Vec<T> = bytemuck::pod_collect_to_vec(bytes);
    filter(&mut elements);
    bytemuck::cast_slice(&elements).to_vec()
}

/// Decodes elements of `stride` bytes, which the crate takes as a type.
fn attributes(bytes: &[u8], elements: usize, stride: usize) -> Result<Vec<u8>, String> {
    fn of<const N: usize>(bytes: &[u8], elements: usize) -> Result<Vec<u8>, String> {
        let mut found = vec![[0_u8; N]; elements];
        decode_vertex_buffer(&mut found, bytes).map_err(undecodable)?;
        Ok(found.into_flattened())
    }
    macro_rules! by_stride {
        ($($size:literal)*) => {
            match stride {
                $($size => of::<$size>(bytes, elements),)*
                _ => Err(format!("expected a multiple of 4 up to 256 bytes, found {stride}")),
            }
        };
    }
    by_stride!(4 8 12 16 20 24 28 32 36 40 44 48 52 56 60 64 68 72 76 80 84 88 92 96 100 104 108 112
        116 120 124 128 132 136 140 144 148 152 156 160 164 168 172 176 180 184 188 192 196 200 204
        208 212 216 220 224 228 232 236 240 244 248 252 256)
}
