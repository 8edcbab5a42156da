//! Values of textures on the host: twin of `glsl/include/texture.glsl`, which has the comments on how
//! and why, in the same order and with the same names.

use glam::{Vec2, Vec3, Vec4, vec2};
use half::f16;

use crate::{
    math::colour::srgb_to_linear,
    shader::{
        constants::{
            LUMINANCE_WEIGHTS, NO_TEXTURE, SURFACE_VERTEX_COLOR, TEXTURE_BYTES,
            TEXTURE_CHANNEL_SHIFT, TEXTURE_FORMAT_MASK, TEXTURE_MIRROR, TEXTURE_NEAREST,
            TEXTURE_REPEAT, TEXTURE_SECOND_UVS, TEXTURE_SHORTS, TEXTURE_SRGB, TEXTURE_WRAP_U_SHIFT,
            TEXTURE_WRAP_V_SHIFT,
        },
        structs::{MaterialSurface, TextureUse},
    },
    texture::{Interpolation, Wrap, lookup::Grid},
};

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
pub(crate) fn texture_lookup(words: &[u32], used: &TextureUse, image: Vec2) -> Vec4 {
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
pub(crate) fn texture_number(
    words: &[u32],
    uses: &[TextureUse],
    use_index: u32,
    uv0: Vec2,
    uv1: Vec2,
) -> f32 {
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
