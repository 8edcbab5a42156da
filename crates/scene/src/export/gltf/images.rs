//! Images of textures as PNG: the channels that glTF packs into one come from up to two textures.

use std::{path::Path, sync::Arc};

use glam::Vec3;
use image::ExtendedColorType;

use crate::{
    error::Result,
    export::{folder::safe_stem, images::write_png},
    math::colour::{luminance, srgb_from_linear},
    texture::{Channels, Texels, TextureUse},
};

/// Channels of an image, and the meaning of its one or two textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Layout {
    /// sRGB colours over these largest values; opacity in the fourth channel.
    ColorOpacity(Vec3),
    /// Roughness in green, metallic share in blue, both linear.
    RoughnessMetal,
    /// Components of normals, linear.
    Normal,
}

/// Image to write. At least one of the textures is there; if both are, they have the same size.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    pub(super) layout: Layout,
    pub(super) uses: [Option<TextureUse>; 2],
}

impl Sheet {
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let texels = |used: &TextureUse| {
            (Arc::as_ptr(&used.texture), used.channels, used.encoding, used.scale, used.bias)
        };
        let all = |sheet: &Self| sheet.uses.each_ref().map(|used| used.as_ref().map(texels));
        self.layout == other.layout && all(self) == all(other)
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
            let (first, second) = (color(&first, index), color(&second, index));
            match self.layout {
                Layout::ColorOpacity(peak) => {
                    let encoded = (first / peak).clamp(Vec3::ZERO, Vec3::ONE).map(srgb_from_linear);
                    encoded.extend(luminance(second).clamp(0.0, 1.0)).to_array()
                }
                Layout::RoughnessMetal => {
                    let [rough, metal] = [first, second].map(|v| luminance(v).clamp(0.0, 1.0));
                    [1.0, rough, metal, 1.0]
                }
                Layout::Normal => first.clamp(Vec3::ZERO, Vec3::ONE).extend(1.0).to_array(),
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
    let values = used.map(TextureUse::values).unwrap_or_default();
    values.iter().fold(Vec3::ONE, |peak, value| peak.max(Vec3::from_slice(&value[..3])))
}
