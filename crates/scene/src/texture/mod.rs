//! Images on surfaces: texels, and how a material reads them.

mod cache;
mod decode;
pub(crate) mod exr;
pub(crate) mod floats;
pub(crate) mod linear;
pub mod lookup;

use std::sync::Arc;

use serde::Deserialize;

pub use cache::TextureCache;
pub use decode::MAX_TEXTURE_SIDE;

/// Image whose texels vary a property of a material over a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// File, or place in a file, for messages.
    pub name: String,
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// Rows of texels from the upper left corner.
    pub texels: Texels,
}

/// Texels of a [`Texture`]: red, green, blue and opacity.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// 8 bits per channel, 255 for one; [`TextureUse::encoding`] tells how to read the colours.
    Bytes(Vec<[u8; 4]>),
    /// 16 bits per channel, 65,535 for one; [`TextureUse::encoding`] tells how to read the colours.
    Shorts(Vec<[u16; 4]>),
    /// Linear values in half precision.
    Halves(Vec<[half::f16; 4]>),
}

/// Meaning of the colours of [`Texels::Bytes`] and [`Texels::Shorts`]; opacity is always linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// IEC 61966-2-1.
    #[default]
    Srgb,
    /// Proportional to the value.
    Linear,
}

/// Continuation of a texture beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// Repeats the image.
    #[default]
    Repeat,
    /// Repeats the image, every second time mirrored.
    Mirror,
    /// Repeats the texels of the edge.
    Clamp,
}

/// Values between the centres of texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Bilinear.
    #[default]
    Bilinear,
    /// Value of the nearest texel.
    Nearest,
}

/// Channels that a property reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum Channels {
    /// Red, green and blue; their luminance for a property that is one number.
    #[default]
    #[serde(skip)]
    Color,
    /// Red for all.
    #[serde(rename = "r")]
    Red,
    /// Green for all.
    #[serde(rename = "g")]
    Green,
    /// Blue for all.
    #[serde(rename = "b")]
    Blue,
    /// Opacity for all.
    #[serde(rename = "a")]
    Alpha,
}

/// Texture as a property of a material reads it: value = scale · texel + bias, by channel.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureUse {
    /// The image, shared by all its uses.
    pub texture: Arc<Texture>,
    /// Channels to read.
    pub channels: Channels,
    /// Meaning of colours of 8 or 16 bits.
    pub encoding: Encoding,
    /// Set of texture coordinates, 0 or 1.
    pub uv_set: u32,
    /// Image coordinates from those of the mesh: the rows of a matrix for (u, v, 1). Image
    /// coordinates are (0, 0) at the upper left corner of the image and (1, 1) at the lower right.
    pub image_from_uv: [[f32; 3]; 2],
    /// Continuation along u and v.
    pub wrap: [Wrap; 2],
    /// Interpolation between texels.
    pub interpolation: Interpolation,
    /// Factor.
    pub scale: [f32; 3],
    /// Added after the factor.
    pub bias: [f32; 3],
}

impl TextureUse {
    /// Reads the colours of `texture` by the first set of coordinates, whose (0, 0) is the upper left
    /// corner, as in glTF.
    pub fn new(texture: Arc<Texture>) -> Self {
        Self {
            texture,
            channels: Channels::default(),
            encoding: Encoding::default(),
            uv_set: 0,
            image_from_uv: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            wrap: [Wrap::default(); 2],
            interpolation: Interpolation::default(),
            scale: [1.0; 3],
            bias: [0.0; 3],
        }
    }

    /// As [`TextureUse::new`] for coordinates whose (0, 0) is the lower left corner, as in OBJ and
    /// pbrt.
    pub fn from_lower_left(texture: Arc<Texture>) -> Self {
        let image_from_uv = [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]];
        Self { image_from_uv, ..Self::new(texture) }
    }
}
