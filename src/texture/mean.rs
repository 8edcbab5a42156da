//! Mean of a texture over its image.

use super::{Channels, Encoding, Texels, TextureUse, lookup::srgb_to_linear};
use crate::math::colour::luminance;

impl TextureUse {
    /// Mean value over the image, by channel. Where a surface shows the image in part or more than
    /// once, the mean over the surface differs: good for choosing, not for weighing.
    pub fn mean(&self) -> [f32; 3] {
        let mut sum = [0.0_f64; 4];
        let mut add = |texel: [f32; 4]| {
            for (total, channel) in sum.iter_mut().zip(texel) {
                *total += f64::from(channel);
            }
        };
        let count = match &self.texture.texels {
            Texels::Bytes(texels) => {
                let decode = |byte: u8| match self.encoding {
                    Encoding::Srgb => srgb_to_linear(f32::from(byte) / 255.0),
                    Encoding::Linear => f32::from(byte) / 255.0,
                };
                for &[r, g, b, a] in texels {
                    add([decode(r), decode(g), decode(b), f32::from(a) / 255.0]);
                }
                texels.len()
            }
            Texels::Shorts(texels) => {
                let decode = |short: u16| match self.encoding {
                    Encoding::Srgb => srgb_to_linear(f32::from(short) / 65535.0),
                    Encoding::Linear => f32::from(short) / 65535.0,
                };
                for &[r, g, b, a] in texels {
                    add([decode(r), decode(g), decode(b), f32::from(a) / 65535.0]);
                }
                texels.len()
            }
            Texels::Halves(texels) => {
                texels.iter().for_each(|texel| add(texel.map(half::f16::to_f32)));
                texels.len()
            }
        };
        let [r, g, b, a] = sum.map(|total| (total / count.max(1) as f64) as f32);
        let color = match self.channels {
            Channels::Color => [r, g, b],
            Channels::Red => [r; 3],
            Channels::Green => [g; 3],
            Channels::Blue => [b; 3],
            Channels::Alpha => [a; 3],
        };
        std::array::from_fn(|channel| color[channel] * self.scale[channel] + self.bias[channel])
    }

    /// Luminance of [`TextureUse::mean`].
    pub fn mean_luminance(&self) -> f32 {
        luminance(self.mean().into())
    }
}
