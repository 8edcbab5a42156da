//! Small glTF documents.
#![allow(dead_code, reason = "two test programs use a part each")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::io::Cursor;

use base64::prelude::{BASE64_STANDARD, Engine};
use image::{ImageFormat, RgbaImage};

/// A triangle of one unit in a buffer of 36 bytes, then a shift by (0, 0, 7) and its index 1.
const BUFFER: &str =
    "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAOBAAQ==";

/// Formats a document with the triangle as accessor 0 and mesh 0; `rest` adds further members.
pub fn gltf(nodes: &str, materials: &str, primitive: &str, rest: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}],
        "materials": [{materials}],
        "meshes": [{{"name": "sail", "primitives": [{{"attributes": {{"POSITION": 0}}{primitive}}}]}}],
        "accessors": [
          {{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [0, 0, 0], "max": [1, 1, 0]}},
          {{"bufferView": 1, "componentType": 5126, "count": 1, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}},
                        {{"buffer": 0, "byteOffset": 36, "byteLength": 12}},
                        {{"buffer": 0, "byteOffset": 48, "byteLength": 1}}],
        "buffers": [{{"byteLength": 49, "uri": "{BUFFER}"}}]{rest}}}"#
    )
}

/// One attribute of a mesh: name, component type, element type, normalized, bytes.
pub struct Attribute<'a>(pub &'a str, pub u32, pub &'a str, pub bool, pub Vec<u8>);

impl<'a> Attribute<'a> {
    pub fn floats(name: &'a str, kind: &'a str, numbers: &[f32]) -> Self {
        Self(name, 5126, kind, false, floats(numbers))
    }
}

/// Little-endian bytes of floats.
pub fn floats(floats: &[f32]) -> Vec<u8> {
    floats.iter().flat_map(|float| float.to_le_bytes()).collect()
}

/// Formats a document with one node and one mesh of unconnected triangles that has these
/// attributes, all of `count` elements that lie one behind the other.
pub fn gltf_of(attributes: &[Attribute], count: usize, materials: &str, rest: &str) -> String {
    let (mut names, mut accessors, mut views) = (Vec::new(), Vec::new(), Vec::new());
    let mut bytes = Vec::new();
    for (index, Attribute(name, component, kind, normalized, data)) in attributes.iter().enumerate()
    {
        names.push(format!("\"{name}\": {index}"));
        let bounds = if *name == "POSITION" {
            ", \"min\": [-1e9, -1e9, -1e9], \"max\": [1e9, 1e9, 1e9]"
        } else {
            ""
        };
        accessors.push(format!(
            r#"{{"bufferView": {index}, "componentType": {component}, "normalized": {normalized},
                "count": {count}, "type": "{kind}"{bounds}}}"#
        ));
        let (offset, length) = (bytes.len(), data.len());
        views.push(format!(r#"{{"buffer": 0, "byteOffset": {offset}, "byteLength": {length}}}"#));
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    let material = if materials.is_empty() { "" } else { ", \"material\": 0" };
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "materials": [{materials}],
        "meshes": [{{"primitives": [{{"attributes": {{{}}}{material}}}]}}],
        "accessors": [{}], "bufferViews": [{}],
        "buffers": [{{"byteLength": {}, "uri": "data:;base64,{}"}}]{rest}}}"#,
        names.join(", "),
        accessors.join(", "),
        views.join(", "),
        bytes.len(),
        base64(&bytes)
    )
}

/// Encodes bytes in base64.
pub fn base64(bytes: &[u8]) -> String {
    BASE64_STANDARD.encode(bytes)
}

/// Encodes a PNG of 2×1 texels.
pub fn png(texels: [[u8; 4]; 2]) -> Vec<u8> {
    let image = RgbaImage::from_raw(2, 1, texels.concat()).unwrap();
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}
