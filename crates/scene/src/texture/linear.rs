//! Texels as linear numbers, and textures made of others.

use std::sync::Arc;

use glam::Vec3;
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
