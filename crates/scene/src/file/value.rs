//! Values that take several forms: numbers for all axes or for each, and textures in place of numbers
//! and colours.

use std::{fmt, marker::PhantomData, path::PathBuf};

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
        struct NumberOrVisitor<const N: usize>;

        impl<'de, const N: usize> Visitor<'de> for NumberOrVisitor<N>
        where
            [f32; N]: Deserialize<'de>,
        {
            type Value = NumberOr<N>;

            fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                let count = if N == 2 { "two" } else { "three" };
                write!(formatter, "a number or an array of {count} numbers")
            }

            fn visit_f64<E>(self, number: f64) -> Result<Self::Value, E> {
                Ok(NumberOr([number as f32; N]))
            }

            fn visit_i64<E>(self, number: i64) -> Result<Self::Value, E> {
                Ok(NumberOr([number as f32; N]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<Self::Value, A::Error> {
                <[f32; N]>::deserialize(value::SeqAccessDeserializer::new(sequence)).map(NumberOr)
            }
        }

        deserializer.deserialize_any(NumberOrVisitor)
    }
}

/// Image in place of a number or colour.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TextureEntry {
    /// PNG, JPEG, WebP, TGA, HDR or EXR image.
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

/// Values that a [`Textured`] may have everywhere.
trait Plain: Sized {
    /// Forms in a message.
    const EXPECTED: &str;

    /// Value of a number, if one number is enough.
    fn from_number(_: f64) -> Option<Self> {
        None
    }

    /// Value of an array of three numbers, if it takes one.
    fn from_array(_: [f32; 3]) -> Option<Self> {
        None
    }
}

impl Plain for f32 {
    const EXPECTED: &str = "a number or a table with `texture`";

    fn from_number(number: f64) -> Option<Self> {
        Some(number as Self)
    }
}

impl Plain for [f32; 3] {
    const EXPECTED: &str = "an array of three numbers or a table with `texture`";

    fn from_array(array: [f32; 3]) -> Option<Self> {
        Some(array)
    }
}

struct TexturedVisitor<T>(PhantomData<T>);

impl<'de, T: Plain> Visitor<'de> for TexturedVisitor<T> {
    type Value = Textured<T>;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(T::EXPECTED)
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Self::Value, E> {
        let value = T::from_number(number);
        value
            .map(Textured::Uniform)
            .ok_or_else(|| E::invalid_type(Unexpected::Float(number), &self))
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Self::Value, E> {
        let value = T::from_number(number as f64);
        value
            .map(Textured::Uniform)
            .ok_or_else(|| E::invalid_type(Unexpected::Signed(number), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<Self::Value, A::Error> {
        let array = <[f32; 3]>::deserialize(value::SeqAccessDeserializer::new(sequence))?;
        T::from_array(array)
            .map(Textured::Uniform)
            .ok_or_else(|| de::Error::invalid_type(Unexpected::Seq, &self))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let entry = TextureEntry::deserialize(value::MapAccessDeserializer::new(map))?;
        Ok(Textured::Texture(Box::new(entry)))
    }
}

impl<'de, T: Plain> Deserialize<'de> for Textured<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TexturedVisitor(PhantomData))
    }
}
