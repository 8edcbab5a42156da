//! Texels as linear numbers, what they tell of an image, and images made of others, texel by texel where
//! these lie on a surface in the same way.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use half::f16;
use rayon::prelude::*;

use super::{Channels, Encoding, Texels, Texture, TextureUse};
use crate::math::colour::srgb_to_linear;

impl Texture {
    /// Linear colour and opacity of a texel; 8 and 16 bits are in `encoding`.
    pub fn linear_texel(&self, encoding: Encoding, index: usize) -> [f32; 4] {
        let decode = |value: f32| match encoding {
            Encoding::Srgb => srgb_to_linear(value),
            Encoding::Linear => value,
        };
        let unpack = |[r, g, b, a]: [f32; 4]| [decode(r), decode(g), decode(b), a];
        match &self.texels {
            Texels::Bytes(texels) => unpack(texels[index].map(|value| f32::from(value) / 255.0)),
            Texels::Shorts(texels) => {
                unpack(texels[index].map(|value| f32::from(value) / 65_535.0))
            }
            Texels::Halves(texels) => texels[index].map(f16::to_f32),
        }
    }

    /// Linear colour and opacity of every texel; 8 and 16 bits are in `encoding`.
    pub fn linear_texels(&self, encoding: Encoding) -> Vec<[f32; 4]> {
        let count = self.width as usize * self.height as usize;
        (0..count).into_par_iter().map(|index| self.linear_texel(encoding, index)).collect()
    }
}

impl TextureUse {
    /// Value that a property reads from a linear texel, by channel, and opacity.
    pub(crate) fn read(&self, [r, g, b, a]: [f32; 4]) -> [f32; 4] {
        let color = match self.channels {
            Channels::Color => [r, g, b],
            Channels::Red => [r; 3],
            Channels::Green => [g; 3],
            Channels::Blue => [b; 3],
            Channels::Alpha => [a; 3],
        };
        let [r, g, b] = std::array::from_fn(|channel| {
            color[channel] * self.scale[channel] + self.bias[channel]
        });
        [r, g, b, a]
    }

    /// Values of every texel as a property reads them, by channel, and opacity.
    pub fn values(&self) -> Vec<[f32; 4]> {
        let texels = self.texture.linear_texels(self.encoding);
        texels.into_par_iter().map(|texel| self.read(texel)).collect()
    }

    /// Makes a texture whose texels are `of` those of this one, by channel; opacity stays. Between
    /// texels it interpolates the new values.
    pub fn mapped(&self, of: impl Fn(f32) -> f32 + Sync) -> Self {
        self.with_texels(|[r, g, b, a]| [of(r), of(g), of(b), a])
    }

    /// As [`TextureUse::mapped`], with all channels and the opacity made of all.
    pub(crate) fn with_texels(&self, of: impl Fn([f32; 4]) -> [f32; 4] + Sync) -> Self {
        let texel = |value: [f32; 4]| of(value).map(f16::from_f32);
        let texels = Texels::Halves(self.values().into_par_iter().map(texel).collect());
        self.clone().showing(Arc::new(Texture { texels, ..Texture::clone(&self.texture) }))
    }

    /// Lays an image of linear values in the place of the own one.
    pub(crate) fn showing(self, texture: Arc<Texture>) -> Self {
        let (channels, encoding) = (Channels::Color, Encoding::Linear);
        Self { texture, channels, encoding, scale: [1.0; 3], bias: [0.0; 3], ..self }
    }

    /// Returns factor · value + shift.
    pub(crate) fn affine(mut self, factor: Vec3, shift: Vec3) -> Self {
        self.scale = (Vec3::from(self.scale) * factor).to_array();
        self.bias = (Vec3::from(self.bias) * factor + shift).to_array();
        self
    }

    /// Largest value of each channel, or a bound that is at most 1.
    pub(crate) fn largest(&self) -> Vec3 {
        let color = |texel| Vec4::from(texel).truncate();
        let bound = color(self.read([0.0; 4])).max(color(self.read([1.0; 4])));
        let is_float = matches!(self.texture.texels, Texels::Halves(_));
        if !is_float && bound.max_element() <= 1.0 {
            return bound;
        }
        self.values().into_iter().map(color).reduce(Vec3::max).unwrap_or(bound)
    }

    /// Mean value over the image, by channel. Where a surface shows the image in part or more than
    /// once, the mean over the surface differs: good for choosing, not for weighing.
    pub fn mean(&self) -> [f32; 3] {
        let values = self.values();
        let sum = values.iter().fold([0.0_f64; 3], |sum, value| {
            std::array::from_fn(|channel| sum[channel] + f64::from(value[channel]))
        });
        sum.map(|total| (total / values.len().max(1) as f64) as f32)
    }
}

/// Images of a metallic-roughness material.
pub(crate) struct Converted {
    pub base_color: TextureUse,
    pub roughness: TextureUse,
    pub metallic: TextureUse,
}

/// Grid of the largest of some images.
pub(crate) struct Texelwise {
    width: u32,
    height: u32,
    /// The first of them, on whose coordinates all lie.
    first: Option<TextureUse>,
}

/// Tests whether two textures lie on a surface in the same way.
pub(crate) fn lie_alike(one: &TextureUse, other: &TextureUse) -> bool {
    (one.uv_set, one.image_from_uv, one.wrap) == (other.uv_set, other.image_from_uv, other.wrap)
}

impl Texelwise {
    /// Grid for images that lie alike.
    pub(crate) fn of(uses: &[Option<&TextureUse>]) -> Self {
        let sizes = uses.iter().flatten().map(|used| (used.texture.width, used.texture.height));
        let larger = |a: (u32, u32), b: (u32, u32)| (a.0.max(b.0), a.1.max(b.1));
        let (width, height) = sizes.reduce(larger).unwrap_or((1, 1));
        Self { width, height, first: uses.iter().flatten().next().copied().cloned() }
    }

    /// Value of an image at a texel of the grid, and its opacity.
    pub(crate) fn texel(&self, used: &TextureUse, index: usize) -> Vec4 {
        if (used.texture.width, used.texture.height) == (self.width, self.height) {
            return used.read(used.texture.linear_texel(used.encoding, index)).into();
        }
        let size = Vec2::new(self.width as f32, self.height as f32);
        let (x, y) = (index % self.width as usize, index / self.width as usize);
        used.value((Vec2::new(x as f32, y as f32) + 0.5) / size)
    }

    fn indices(&self) -> impl IndexedParallelIterator<Item = usize> {
        (0..self.width as usize * self.height as usize).into_par_iter()
    }

    fn image(&self, what: &str, texels: Texels) -> TextureUse {
        let (width, height) = (self.width, self.height);
        let name = self.first.as_ref().map_or("", |first| &first.texture.name);
        let name = format!("{name}, {what}");
        let texture = Arc::new(Texture { name, width, height, texels });
        let place = self.first.clone().unwrap_or_else(|| TextureUse::new(Arc::clone(&texture)));
        place.showing(texture)
    }

    /// Image of the colours that `of` gives for texels.
    pub(crate) fn color(&self, of: impl Fn(usize) -> Vec3 + Sync) -> TextureUse {
        let texel = |index| of(index).extend(1.0).to_array().map(f16::from_f32);
        self.image("with others", Texels::Halves(self.indices().map(texel).collect()))
    }

    /// Images of the base colour with its opacity, the roughness and the share of metal that `of` gives for
    /// texels.
    pub(crate) fn material(&self, of: impl Fn(usize) -> (Vec4, f32, f32) + Sync) -> Converted {
        let byte = |share: f32| (255.0 * share).round() as u8;
        let texel = |index: usize| {
            let (base, roughness, metallic) = of(index);
            let base = base.to_array().map(f16::from_f32);
            (base, [0, byte(roughness), byte(metallic), u8::MAX])
        };
        let (base, packed) = self.indices().map(texel).unzip();
        let packed = self.image("as metallic-roughness", Texels::Bytes(packed));
        Converted {
            base_color: self.image("as metallic-roughness", Texels::Halves(base)),
            roughness: TextureUse { channels: Channels::Green, ..packed.clone() },
            metallic: TextureUse { channels: Channels::Blue, ..packed },
        }
    }
}

/// Texels that tell of an image whether it holds normals.
const TEXELS_LOOKED_AT: usize = 4096;

/// Tests whether any texel lets light through.
pub(crate) fn has_alpha(texture: &Texture) -> bool {
    match &texture.texels {
        Texels::Bytes(texels) => texels.iter().any(|texel| texel[3] < u8::MAX),
        Texels::Shorts(texels) => texels.iter().any(|texel| texel[3] < u16::MAX),
        Texels::Halves(texels) => texels.iter().any(|texel| texel[3].to_f32() < 1.0),
    }
}

/// Opacity of a colour image, if any texel lets light through.
pub(crate) fn opacity_of(color: &TextureUse) -> Option<TextureUse> {
    let (channels, encoding) = (Channels::Alpha, Encoding::Linear);
    has_alpha(&color.texture).then(|| TextureUse { channels, encoding, ..color.clone() })
}

/// Tests for texels that are vectors of about unit length, along +z on the mean, as those of normal maps.
pub(crate) fn holds_normals(texture: &Texture) -> bool {
    let count = texture.width as usize * texture.height as usize;
    let step = count.div_ceil(TEXELS_LOOKED_AT);
    let normals = (0..count).step_by(step).map(|texel| {
        let texel = Vec4::from(texture.linear_texel(Encoding::Linear, texel)).truncate();
        let normal = 2.0 * texel - 1.0;
        normal.extend((normal.length() - 1.0).abs())
    });
    let mean = normals.sum::<Vec4>() / count.div_ceil(step) as f32;
    mean.x.abs().max(mean.y.abs()) < 0.25 && mean.z > 0.5 && mean.w < 0.2
}
