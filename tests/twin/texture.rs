//! Values of textures and attributes of triangles: twin of `glsl/include/texture.glsl`, which has the
//! comments on how and why, in the same order and with the same names.

use fenestra::{
    accel::attributes::TriangleAttributes,
    math::{colour::srgb_to_linear, octahedron},
    scene::texture::{Interpolation, Wrap, lookup::Grid},
    shader::{
        constants::{
            ATTRIBUTE_COLOR, ATTRIBUTE_FIRST_UVS, ATTRIBUTE_SECOND_UVS, ATTRIBUTE_TANGENT,
            FLAT_NORMAL, LUMINANCE_WEIGHTS, NO_TEXTURE, SURFACE_VERTEX_COLOR, TEXTURE_BYTES,
            TEXTURE_CHANNEL_SHIFT, TEXTURE_FORMAT_MASK, TEXTURE_MIRROR, TEXTURE_NEAREST,
            TEXTURE_REPEAT, TEXTURE_SECOND_UVS, TEXTURE_SHORTS, TEXTURE_SRGB, TEXTURE_WRAP_U_SHIFT,
            TEXTURE_WRAP_V_SHIFT,
        },
        structs::{MaterialSurface, TextureUse},
    },
};
use glam::{Vec2, Vec3, Vec4, vec2};
use half::f16;

/// Linear colour and opacity of a texel; `words` are those of all textures.
fn texture_texel(words: &[u32], used: &TextureUse, [x, y]: [u32; 2]) -> Vec4 {
    let index = (y * used.width + x) as usize;
    let format = used.flags & TEXTURE_FORMAT_MASK;
    let first = used.first_word as usize;
    let texel = if format == TEXTURE_BYTES {
        Vec4::from(words[first + index].to_le_bytes().map(f32::from)) / 255.0
    } else {
        let (low, high) = (words[first + 2 * index], words[first + 2 * index + 1]);
        let shorts = [low, low >> 16, high, high >> 16].map(|word| word as u16);
        if format == TEXTURE_SHORTS {
            Vec4::from(shorts.map(f32::from)) / 65_535.0
        } else {
            Vec4::from(shorts.map(|short| f16::from_bits(short).to_f32()))
        }
    };
    if used.flags & TEXTURE_SRGB != 0 {
        let [red, green, blue, alpha] = texel.to_array();
        let color = [red, green, blue].map(srgb_to_linear);
        return Vec3::from(color).extend(alpha);
    }
    texel
}

/// Linear colour and opacity of an image at image coordinates. Centres of texels lie at +0.5.
fn texture_lookup(words: &[u32], used: &TextureUse, image: Vec2) -> Vec4 {
    let wrap = |shift: u32| match (used.flags >> shift) & 3 {
        TEXTURE_REPEAT => Wrap::Repeat,
        TEXTURE_MIRROR => Wrap::Mirror,
        _ => Wrap::Clamp,
    };
    let is_nearest = used.flags & TEXTURE_NEAREST != 0;
    let grid = Grid {
        size: [used.width, used.height],
        wrap: [wrap(TEXTURE_WRAP_U_SHIFT), wrap(TEXTURE_WRAP_V_SHIFT)],
        interpolation: if is_nearest { Interpolation::Nearest } else { Interpolation::Bilinear },
    };
    grid.value(image, |at| texture_texel(words, used, at))
}

/// Image coordinates of a point of the surface with texture coordinates `uv0` and `uv1`.
pub fn image_coordinates(used: &TextureUse, uv0: Vec2, uv1: Vec2) -> Vec2 {
    let uv = if used.flags & TEXTURE_SECOND_UVS != 0 { uv1 } else { uv0 };
    let row = |row: [f32; 3]| Vec3::from(row).dot(uv.extend(1.0));
    vec2(row(used.image_u), row(used.image_v))
}

/// Factor that a texture gives a property: scaled colour, and opacity as it is in the image. One
/// without a texture.
pub fn texture_value(
    words: &[u32],
    uses: &[TextureUse],
    use_index: u32,
    uv0: Vec2,
    uv1: Vec2,
) -> Vec4 {
    if use_index == NO_TEXTURE {
        return Vec4::ONE;
    }
    let used = &uses[use_index as usize];
    let texel = texture_lookup(words, used, image_coordinates(used, uv0, uv1));
    let channel = used.flags >> TEXTURE_CHANNEL_SHIFT;
    let color =
        if channel == 0 { texel.truncate() } else { Vec3::splat(texel[channel as usize - 1]) };
    (color * Vec3::from(used.scale) + Vec3::from(used.bias)).extend(texel.w)
}

/// The same for a property that is one number: the luminance.
fn texture_number(words: &[u32], uses: &[TextureUse], use_index: u32, uv0: Vec2, uv1: Vec2) -> f32 {
    texture_value(words, uses, use_index, uv0, uv1).truncate().dot(LUMINANCE_WEIGHTS.into())
}

/// Share of light that a surface stops at a point, 0 to 1; `alpha` is the vertices' opacity there.
pub fn surface_opacity(
    words: &[u32],
    uses: &[TextureUse],
    surface: &MaterialSurface,
    [uv0, uv1]: [Vec2; 2],
    alpha: f32,
) -> f32 {
    let mut opacity =
        surface.opacity_factor * texture_number(words, uses, surface.opacity, uv0, uv1);
    if surface.flags & SURFACE_VERTEX_COLOR != 0 {
        opacity *= alpha;
    }
    if surface.opacity_cutoff >= 0.0 {
        return if opacity >= surface.opacity_cutoff { 1.0 } else { 0.0 };
    }
    opacity.clamp(0.0, 1.0)
}

/// Tangent that the mesh brings, made a unit vector at right angles to the normal; 0 for none.
pub fn stored_tangent(tangent: Vec4, normal: Vec3) -> Vec4 {
    let stored = tangent.truncate() - tangent.truncate().dot(normal) * normal;
    let squared = stored.length_squared();
    if squared > 1e-8 {
        let sign = if tangent.w < 0.0 { -1.0 } else { 1.0 };
        return (stored / squared.sqrt()).extend(sign);
    }
    Vec4::ZERO
}

/// Unit shading normal after a normal map whose value is `texel`, 0 to 1. `shading_normal` and the
/// result are on the same side: the front for a `side` of 1, the back for −1. `tangent` is that of the
/// front; 0 leaves the normal as it is.
pub fn mapped_normal(
    texel: Vec3,
    normal_scale: f32,
    tangent: Vec4,
    shading_normal: Vec3,
    side: f32,
) -> Vec3 {
    if tangent.w == 0.0 {
        return shading_normal;
    }
    let normal = side * shading_normal;
    let local = 2.0 * texel - 1.0;
    let bitangent = tangent.w * normal.cross(tangent.truncate());
    let mapped = normal_scale * local.x * tangent.truncate()
        + normal_scale * local.y * bitangent
        + local.z * normal;
    let squared = mapped.length_squared();
    if squared > 1e-12 { side * mapped / squared.sqrt() } else { shading_normal }
}

/// Attributes of a point of a triangle, as in the shader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attributes {
    /// First set of texture coordinates; 0 where there is none.
    pub uv0: Vec2,
    /// Second set.
    pub uv1: Vec2,
    /// Tangent of any length along u of the first set, and sign of the bitangent; 0 for none.
    pub tangent: Vec4,
    /// Linear colour and opacity; 1 where there is none.
    pub color: Vec4,
}

fn corner_attribute(
    attributes: &TriangleAttributes,
    triangle: u32,
    corner: u32,
    bit: u32,
) -> [u32; 2] {
    let place = 2 * (attributes.bits & (bit - 1)).count_ones();
    let stride = 2 * attributes.bits.count_ones();
    let word = ((3 * triangle + corner) * stride + place) as usize;
    [attributes.words[word], attributes.words[word + 1]]
}

/// Texture coordinates `ATTRIBUTE_FIRST_UVS` or `ATTRIBUTE_SECOND_UVS` at a corner (0 to 2).
pub fn corner_uv(attributes: &TriangleAttributes, triangle: u32, corner: u32, bit: u32) -> Vec2 {
    if attributes.bits & bit == 0 {
        return Vec2::ZERO;
    }
    corner_attribute(attributes, triangle, corner, bit).map(f32::from_bits).into()
}

/// Attributes at the point of a triangle in BVH order with these barycentric coordinates.
pub fn triangle_attributes(
    stored: &TriangleAttributes,
    triangle: u32,
    weights: Vec3,
) -> Attributes {
    let uv = |bit| {
        let [a, b, c] = [0, 1, 2].map(|corner| corner_uv(stored, triangle, corner, bit));
        weights.x * a + weights.y * b + weights.z * c
    };
    let (uv0, uv1) = (uv(ATTRIBUTE_FIRST_UVS), uv(ATTRIBUTE_SECOND_UVS));
    let mut attributes = Attributes { uv0, uv1, tangent: Vec4::ZERO, color: Vec4::ONE };
    if stored.bits & ATTRIBUTE_TANGENT != 0 {
        let [a, b, c] =
            [0, 1, 2].map(|corner| corner_attribute(stored, triangle, corner, ATTRIBUTE_TANGENT));
        if ![a[0], b[0], c[0]].contains(&FLAT_NORMAL) {
            let tangent = weights.x * octahedron::unpack(a[0])
                + weights.y * octahedron::unpack(b[0])
                + weights.z * octahedron::unpack(c[0]);
            attributes.tangent = tangent.extend(f32::from_bits(a[1]));
        }
    }
    if stored.bits & ATTRIBUTE_COLOR != 0 {
        let color = |corner| {
            let [low, high] = corner_attribute(stored, triangle, corner, ATTRIBUTE_COLOR);
            let shorts = [low, low >> 16, high, high >> 16].map(|word| word as u16);
            Vec4::from(shorts.map(f32::from)) / 65_535.0
        };
        attributes.color = weights.x * color(0) + weights.y * color(1) + weights.z * color(2);
    }
    attributes
}
