//! Values of textures and attributes of triangles from the words that shaders read: twin of
//! `glsl/include/texture.glsl`, which has the comments on how and why, in the same order and with the same
//! names.

use glam::{Vec2, Vec3, Vec4, vec2};
use half::f16;

use crate::{
    math::colour::{luminance, srgb_to_linear},
    shader::{
        constants::{
            ATTRIBUTE_COLOR, NO_TEXTURE, SURFACE_VERTEX_COLOR, TEXTURE_BYTES,
            TEXTURE_CHANNEL_SHIFT, TEXTURE_FORMAT_MASK, TEXTURE_MIRROR, TEXTURE_NEAREST,
            TEXTURE_REPEAT, TEXTURE_SECOND_UVS, TEXTURE_SHORTS, TEXTURE_SRGB, TEXTURE_WRAP_U_SHIFT,
            TEXTURE_WRAP_V_SHIFT,
        },
        structs::{MaterialSurface, TextureUse},
    },
    texture::{Interpolation, Wrap, lookup::Grid},
};

/// Words of textures or attributes, wherever they lie.
pub trait Words {
    /// Word `index`.
    fn word(&self, index: usize) -> u32;
}

impl<W: AsRef<[u32]> + ?Sized> Words for W {
    fn word(&self, index: usize) -> u32 {
        self.as_ref()[index]
    }
}

/// Linear colour and opacity of a texel; `words` are those of all textures.
fn texture_texel<W: Words + ?Sized>(words: &W, used: &TextureUse, [x, y]: [u32; 2]) -> Vec4 {
    let index = (y * used.width + x) as usize;
    let format = used.flags & TEXTURE_FORMAT_MASK;
    let first = used.first_word as usize;
    let texel = if format == TEXTURE_BYTES {
        Vec4::from(words.word(first + index).to_le_bytes().map(f32::from)) / 255.0
    } else {
        let shorts = shorts([words.word(first + 2 * index), words.word(first + 2 * index + 1)]);
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

fn shorts([low, high]: [u32; 2]) -> [u16; 4] {
    [low, low >> 16, high, high >> 16].map(|word| word as u16)
}

/// Linear colour and opacity of an image at image coordinates. Centres of texels lie at +0.5.
fn texture_lookup<W: Words + ?Sized>(words: &W, used: &TextureUse, image: Vec2) -> Vec4 {
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
pub fn texture_value<W: Words + ?Sized>(
    words: &W,
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

/// Attributes of triangles: which there are, and their words.
#[derive(Debug)]
pub struct AttributeWords<'a, W: ?Sized> {
    /// Bits `ATTRIBUTE_…`.
    pub bits: u32,
    /// Two words for each attribute of each corner of each triangle.
    pub words: &'a W,
}

impl<W: Words + ?Sized> AttributeWords<'_, W> {
    /// Two words of attribute `bit` at a corner (0 to 2) of a triangle that has it.
    pub fn corner_attribute(&self, triangle: u32, corner: u32, bit: u32) -> [u32; 2] {
        let place = 2 * (self.bits & (bit - 1)).count_ones() as usize;
        let stride = 2 * self.bits.count_ones() as usize;
        let word = (3 * triangle as usize + corner as usize) * stride + place;
        [self.words.word(word), self.words.word(word + 1)]
    }

    /// Texture coordinates `ATTRIBUTE_FIRST_UVS` or `ATTRIBUTE_SECOND_UVS` at a corner; 0 where there are
    /// none.
    pub fn corner_uv(&self, triangle: u32, corner: u32, bit: u32) -> Vec2 {
        if self.bits & bit == 0 {
            return Vec2::ZERO;
        }
        self.corner_attribute(triangle, corner, bit).map(f32::from_bits).into()
    }

    /// The same at the point of a triangle in BVH order with these barycentric coordinates.
    pub fn interpolated_uv(&self, triangle: u32, weights: Vec3, bit: u32) -> Vec2 {
        let [a, b, c] = [0, 1, 2].map(|corner| self.corner_uv(triangle, corner, bit));
        weights.x * a + weights.y * b + weights.z * c
    }

    /// Linear colour and opacity there; 1 where there is none.
    pub fn color(&self, triangle: u32, weights: Vec3) -> Vec4 {
        if self.bits & ATTRIBUTE_COLOR == 0 {
            return Vec4::ONE;
        }
        let [a, b, c] = [0, 1, 2].map(|corner| {
            let words = self.corner_attribute(triangle, corner, ATTRIBUTE_COLOR);
            Vec4::from(shorts(words).map(f32::from)) / 65_535.0
        });
        weights.x * a + weights.y * b + weights.z * c
    }
}

/// Factor of the main colour at a point; `vertex` is the vertices' colour there.
pub fn surface_color<W: Words + ?Sized>(
    words: &W,
    uses: &[TextureUse],
    surface: &MaterialSurface,
    [uv0, uv1]: [Vec2; 2],
    vertex: Vec3,
) -> Vec3 {
    let color = texture_value(words, uses, surface.color, uv0, uv1).truncate();
    if surface.flags & SURFACE_VERTEX_COLOR != 0 { color * vertex } else { color }
}

/// Share of light that a surface stops at a point, 0 to 1; `alpha` is the vertices' opacity there.
pub fn surface_opacity<W: Words + ?Sized>(
    words: &W,
    uses: &[TextureUse],
    surface: &MaterialSurface,
    [uv0, uv1]: [Vec2; 2],
    alpha: f32,
) -> f32 {
    let value = texture_value(words, uses, surface.opacity, uv0, uv1);
    let mut opacity = surface.opacity_factor * luminance(value.truncate());
    if surface.flags & SURFACE_VERTEX_COLOR != 0 {
        opacity *= alpha;
    }
    if surface.opacity_cutoff >= 0.0 {
        return if opacity >= surface.opacity_cutoff { 1.0 } else { 0.0 };
    }
    opacity.clamp(0.0, 1.0)
}
