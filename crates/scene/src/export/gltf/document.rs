//! Parts of a glTF document that others refer to by number: accessors of the buffer, textures, and their
//! images as PNG, whose channels come from up to two textures.

use std::{collections::BTreeSet, path::Path, sync::Arc};

use glam::{Vec3, Vec4};
use image::ExtendedColorType;
use serde_json::{Value, json};

use crate::{
    error::Result,
    export::{
        folder::{SAME_UV, safe_stem},
        images::write_png,
        number_of,
        parts::{Part, Vertex},
    },
    instance::bounds,
    material::Surface,
    math::colour::{luminance, srgb_from_linear},
    texture::{Channels, Interpolation, Texels, TextureUse, Wrap},
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
        let (vertices, has_frames) = (&part.vertices, surface.tangent_uv_set().is_some());
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
        let read = surface.textures().map(|used| used.uv_set).chain(surface.tangent_uv_set());
        let uv_sets = read.map(|set| set as usize + 1).max().unwrap_or(0);
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

/// Channels of an image, and the meaning of its one or two textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Layout {
    /// sRGB colours; opacity in the fourth channel.
    ColorOpacity,
    /// Roughness in green, metallic share in blue, both linear.
    RoughnessMetal,
    /// Components of vectors, linear.
    Vector,
}

/// Image to write. At least one of the textures is there; if both are, they have the same size.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    pub(super) layout: Layout,
    pub(super) uses: [Option<TextureUse>; 2],
    /// Values of both that the file stores as 1; larger ones too.
    pub(super) peaks: [Vec3; 2],
}

impl Sheet {
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let texels = |used: &TextureUse| {
            (Arc::as_ptr(&used.texture), used.channels, used.encoding, used.scale, used.bias)
        };
        let all = |sheet: &Self| sheet.uses.each_ref().map(|used| used.as_ref().map(texels));
        let rest = |sheet: &Self| (sheet.layout, sheet.peaks);
        rest(self) == rest(other) && all(self) == all(other)
    }

    fn sources(&self) -> impl Iterator<Item = &TextureUse> {
        self.uses.iter().flatten()
    }

    pub(super) fn name(&self, index: usize) -> String {
        let name = self.sources().next().map_or("", |used| used.texture.name.as_str());
        format!("t{index:02}_{}.png", safe_stem(name))
    }

    /// Tests whether 8 bits hold the values of all textures as well as they are known.
    fn is_of_bytes(&self) -> bool {
        self.sources().all(|used| {
            let is_number = self.layout == Layout::RoughnessMetal;
            matches!(used.texture.texels, Texels::Bytes(_))
                && (used.scale, used.bias) == ([1.0; 3], [0.0; 3])
                && !(is_number && used.channels == Channels::Color)
        })
    }

    /// Texels, 0 to 1, as the file stores them.
    fn texels(&self) -> Vec<[f32; 4]> {
        let values = |used: &Option<TextureUse>| used.as_ref().map(TextureUse::values);
        let [first, second] = self.uses.each_ref().map(values);
        let count = first.as_ref().or(second.as_ref()).map_or(0, Vec::len);
        let color = |values: &Option<Vec<[f32; 4]>>, index: usize| {
            values.as_ref().map_or(Vec3::ONE, |values| Vec3::from_slice(&values[index][..3]))
        };
        let texel = |index: usize| {
            let first = color(&first, index) / self.peaks[0];
            let second = color(&second, index) / self.peaks[1];
            match self.layout {
                Layout::ColorOpacity => {
                    let encoded = first.clamp(Vec3::ZERO, Vec3::ONE).map(srgb_from_linear);
                    encoded.extend(luminance(second).clamp(0.0, 1.0)).to_array()
                }
                Layout::RoughnessMetal => {
                    let [rough, metal] = [first, second].map(|v| luminance(v).clamp(0.0, 1.0));
                    [1.0, rough, metal, 1.0]
                }
                Layout::Vector => first.clamp(Vec3::ZERO, Vec3::ONE).extend(1.0).to_array(),
            }
        };
        (0..count).map(texel).collect()
    }

    /// Writes the image.
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        let Some(used) = self.sources().next() else { return Ok(()) };
        let size = [used.texture.width, used.texture.height];
        let texels = self.texels();
        let stored = texels.iter().flatten();
        if self.is_of_bytes() {
            let bytes: Vec<u8> = stored.map(|value| (value * 255.0).round() as u8).collect();
            return write_png(path, size, &bytes, ExtendedColorType::Rgba8);
        }
        let shorts: Vec<u16> = stored.map(|value| (value * 65_535.0).round() as u16).collect();
        write_png(path, size, bytemuck::cast_slice(&shorts), ExtendedColorType::Rgba16)
    }
}

/// Largest value of a texture by channel, at least 1.
pub(super) fn peak(used: Option<&TextureUse>) -> Vec3 {
    used.map_or(Vec3::ONE, |used| used.largest().max(Vec3::ONE))
}
