//! Values that take several forms: numbers for all axes or for each, and textures in place of numbers
//! and colours.

use std::{fmt, path::PathBuf};

use serde::{
    Deserialize, Deserializer,
    de::{self, MapAccess, SeqAccess, Unexpected, Visitor, value},
};

use crate::texture::{Channels, Interpolation, Wrap};

/// One number for all axes, or one per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NumberOr<const N: usize>(pub [f32; N]);

/// One number for all of x, y and z, or of red, green and blue, or one for each.
pub(crate) type NumberOrVector = NumberOr<3>;

impl<const N: usize> Default for NumberOr<N> {
    fn default() -> Self {
        Self([1.0; N])
    }
}

impl<'de, const N: usize> Deserialize<'de> for NumberOr<N>
where
    [f32; N]: Deserialize<'de>,
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = if N == 2 {
            "a number or an array of two numbers"
        } else {
            "a number or an array of three numbers"
        };
        deserializer.deserialize_any(Forms {
            expected,
            of_number: |number| Some(Self([number as f32; N])),
            of_array: |numbers| Some(Self(numbers)),
            of_texture: None,
        })
    }
}

/// Image in place of a number or colour.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TextureEntry {
    /// PNG, JPEG, WebP, TGA, BMP, PNM, HDR, EXR or PFM image.
    pub texture: PathBuf,
    /// Repetitions of the image per unit of the texture coordinates, along u and v or both.
    #[serde(default)]
    pub scale: NumberOr<2>,
    /// Texture coordinates of the lower left corner of the image.
    #[serde(default)]
    pub offset: [f32; 2],
    /// Turns the image about this corner, degrees, counter-clockwise.
    #[serde(default)]
    pub rotate_deg: f32,
    /// Continuation beyond the edges of the image.
    #[serde(default)]
    pub wrap: Wrap,
    /// Values between the centres of texels.
    #[serde(default)]
    pub interpolation: Interpolation,
    /// Channel that is read; all three colours without, and their luminance for a number.
    pub channel: Option<Channels>,
    /// True for values as they are stored, false for colours in sRGB. Default: false for colours,
    /// true for numbers and normals; HDR and EXR images are always linear.
    pub linear: Option<bool>,
    /// Factor of the texels: one number, or one for each of red, green and blue. Default: 1.
    pub factor: Option<NumberOrVector>,
    /// Factor of the slopes of a normal map; in `normal` only, which has no `factor`. Default: 1.
    pub strength: Option<f32>,
}

/// A value that is the same everywhere, or a texture.
#[derive(Clone, Debug)]
pub(crate) enum Textured<T> {
    /// Same everywhere.
    Uniform(T),
    Texture(Box<TextureEntry>),
}

impl<T> Textured<T> {
    pub(crate) fn texture(&self) -> Option<&TextureEntry> {
        match self {
            Self::Uniform(_) => None,
            Self::Texture(entry) => Some(entry),
        }
    }
}

/// Reader of a value that may be a number, an array of numbers or a texture.
struct Forms<T, const N: usize> {
    /// Forms that are taken, for messages.
    expected: &'static str,
    of_number: fn(f64) -> Option<T>,
    of_array: fn([f32; N]) -> Option<T>,
    of_texture: Option<fn(Box<TextureEntry>) -> T>,
}

impl<'de, T, const N: usize> Visitor<'de> for Forms<T, N>
where
    [f32; N]: Deserialize<'de>,
{
    type Value = T;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(self.expected)
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<T, E> {
        let refused = || E::invalid_type(Unexpected::Float(number), &self);
        (self.of_number)(number).ok_or_else(refused)
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<T, E> {
        let refused = || E::invalid_type(Unexpected::Signed(number), &self);
        (self.of_number)(number as f64).ok_or_else(refused)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<T, A::Error> {
        let array = <[f32; N]>::deserialize(value::SeqAccessDeserializer::new(sequence))?;
        (self.of_array)(array).ok_or_else(|| de::Error::invalid_type(Unexpected::Seq, &self))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        let Some(of_texture) = self.of_texture else {
            return Err(de::Error::invalid_type(Unexpected::Map, &self));
        };
        let entry = TextureEntry::deserialize(value::MapAccessDeserializer::new(map))?;
        Ok(of_texture(Box::new(entry)))
    }
}

impl<'de> Deserialize<'de> for Textured<f32> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Forms::<_, 3> {
            expected: "a number or a table with `texture`",
            of_number: |number| Some(Self::Uniform(number as f32)),
            of_array: |_| None,
            of_texture: Some(Self::Texture),
        })
    }
}

impl<'de> Deserialize<'de> for Textured<[f32; 3]> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Forms {
            expected: "an array of three numbers or a table with `texture`",
            of_number: |_| None,
            of_array: |array| Some(Self::Uniform(array)),
            of_texture: Some(Self::Texture),
        })
    }
}
