//! Parts of a glTF document that others refer to by number: accessors of the buffer, textures.

use std::{collections::BTreeSet, path::Path};

use glam::{Vec3, Vec4};
use serde_json::{Value, json};

use super::images::Sheet;
use crate::{
    error::Result,
    export::{
        number_of,
        parts::{Part, Vertex},
        ply::SAME_UV,
    },
    instance::bounds,
    material::Surface,
    texture::{Interpolation, TextureUse, Wrap},
};

/// Component types and targets of OpenGL.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const NEAREST: u32 = 9728;
const LINEAR: u32 = 9729;

#[derive(Debug, Default)]
pub(super) struct Textures {
    sheets: Vec<Sheet>,
    pub(super) samplers: Vec<Value>,
    pub(super) textures: Vec<Value>,
    /// Names of the extensions that the document uses.
    pub(super) extensions: BTreeSet<&'static str>,
}

impl Textures {
    /// Adds an image that is looked up as `used`, or finds the same again. Returns the object that
    /// refers to it, and false if its transformation is not one of glTF.
    pub(super) fn add(&mut self, sheet: Sheet, used: &TextureUse) -> (Value, bool) {
        let source = number_of(&mut self.sheets, sheet, Sheet::is_same);
        let wrap = used.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 10497,
            Wrap::Mirror => 33648,
            Wrap::Clamp => 33071,
        });
        let filter = if used.interpolation == Interpolation::Nearest { NEAREST } else { LINEAR };
        let sampler =
            json!({"wrapS": wrap[0], "wrapT": wrap[1], "magFilter": filter, "minFilter": filter});
        let sampler = number_of(&mut self.samplers, sampler, Value::eq);
        let texture = json!({"source": source, "sampler": sampler});
        let index = number_of(&mut self.textures, texture, Value::eq);
        let mut info = json!({"index": index});
        if used.uv_set != 0 {
            info["texCoord"] = used.uv_set.into();
        }
        let (transform, is_exact) = transform(used.image_from_uv);
        if let Some(transform) = transform {
            self.extensions.insert("KHR_texture_transform");
            info["extensions"]["KHR_texture_transform"] = transform;
        }
        (info, is_exact)
    }

    /// Images; `uri_of` gives the URI of a file.
    pub(super) fn images(&self, uri_of: impl Fn(&str) -> String) -> Vec<Value> {
        let image = |(index, sheet): (usize, &Sheet)| json!({"uri": uri_of(&sheet.name(index))});
        self.sheets.iter().enumerate().map(image).collect()
    }

    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let mut sheets = self.sheets.iter().enumerate();
        sheets.try_for_each(|(index, sheet)| sheet.write(&folder.join(sheet.name(index))))
    }
}

/// `KHR_texture_transform` of a matrix, none if it changes nothing, and false for one that shears: it
/// scales first, then turns, then shifts.
fn transform([[a, b, u], [c, d, v]]: [[f32; 3]; 2]) -> (Option<Value>, bool) {
    if [[a, b, u], [c, d, v]] == SAME_UV {
        return (None, true);
    }
    // The first column is (cos, −sin) · scale_u, the second (sin, cos) · scale_v.
    let scale_u = a.hypot(c);
    let (sine, cosine) = if scale_u > 0.0 {
        (-c / scale_u, a / scale_u)
    } else {
        let length = b.hypot(d).max(f32::MIN_POSITIVE);
        (b / length, d / length)
    };
    let scale_v = b * sine + d * cosine;
    let shear = b * cosine - d * sine;
    // A turn by half of it is a mirror of both axes, which needs no angle.
    let (scale_u, scale_v, rotation) = if sine == 0.0 && cosine < 0.0 {
        (-scale_u, -scale_v, 0.0)
    } else {
        (scale_u, scale_v, sine.atan2(cosine))
    };
    let value = json!({"offset": [u, v], "rotation": rotation, "scale": [scale_u, scale_v]});
    (Some(value), shear.abs() <= 1e-5 * scale_v.abs().max(scale_u))
}

#[derive(Debug, Default)]
pub(super) struct Buffer {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
}

impl Buffer {
    /// Adds the triangles of a part, with what `surface` reads of its vertices, and returns a primitive
    /// without material.
    pub(super) fn primitive(&mut self, part: &Part, is_flat: bool, surface: &Surface) -> Value {
        let (vertices, has_frames) = (&part.vertices, surface.normal.is_some());
        let around = bounds(vertices.iter().map(|vertex| vertex.position)).unwrap_or_default();
        let index = self.vectors(vertices, |vertex| vertex.position.to_array());
        for (name, corner) in ["min", "max"].into_iter().zip(around) {
            self.accessors[index][name] = json!(corner.to_array());
        }
        let mut members = json!({"POSITION": index});
        if !is_flat || has_frames {
            let normal = |vertex: &Vertex| vertex.normal.normalize_or_zero().to_array();
            members["NORMAL"] = self.vectors(vertices, normal).into();
        }
        if has_frames {
            let tangent = |vertex: &Vertex| {
                let along = vertex.tangent.truncate().normalize_or(Vec3::X);
                along.extend(if vertex.tangent.w < 0.0 { -1.0 } else { 1.0 }).to_array()
            };
            members["TANGENT"] = self.vectors(vertices, tangent).into();
        }
        let uv_sets = surface.textures().map(|used| used.uv_set as usize + 1).max().unwrap_or(0);
        for set in 0..uv_sets {
            let index = self.vectors(vertices, |vertex| vertex.uvs[set].to_array());
            members[format!("TEXCOORD_{set}")] = index.into();
        }
        if surface.vertex_color && vertices.iter().any(|vertex| vertex.color != Vec4::ONE) {
            members["COLOR_0"] = self.vectors(vertices, |vertex| vertex.color.to_array()).into();
        }
        let start = self.bytes.len();
        for index in part.triangles.iter().flatten() {
            self.bytes.extend(index.to_le_bytes());
        }
        let count = 3 * part.triangles.len();
        let indices = self.accessor(start, ELEMENT_ARRAY_BUFFER, UNSIGNED_INT, "SCALAR", count);
        json!({"attributes": members, "indices": indices})
    }

    fn vectors<const N: usize>(
        &mut self,
        vertices: &[Vertex],
        of: impl Fn(&Vertex) -> [f32; N],
    ) -> usize {
        let start = self.bytes.len();
        for vertex in vertices {
            self.bytes.extend(of(vertex).iter().flat_map(|number| number.to_le_bytes()));
        }
        self.accessor(start, ARRAY_BUFFER, FLOAT, &format!("VEC{N}"), vertices.len())
    }

    /// Adds an accessor of the bytes from `start` on.
    fn accessor(
        &mut self,
        start: usize,
        target: u32,
        component: u32,
        kind: &str,
        count: usize,
    ) -> usize {
        self.views.push(json!({
            "buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start, "target": target
        }));
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": component, "count": count,
            "type": kind
        }));
        self.accessors.len() - 1
    }
}
