//! Images of textures, as PNG where the texels go unchanged, else as OpenEXR with the factors of the
//! material in the texels: formats whose textures have none share it.

use std::{
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{Vec2, Vec3};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use rayon::prelude::*;

use super::{
    folder::{SAME_UV, safe_stem},
    number_of,
};
use crate::{
    coat::base_below_coat,
    error::Result,
    files,
    math::colour::luminance,
    picture::Image,
    texture::{Channels, Encoding, Interpolation, Texels, Texture, TextureUse},
};

/// Most enlargement of an image that is cut off at an opacity, and its longest side after that.
const MAX_ENLARGEMENT: u32 = 8;
const MAX_ENLARGED_SIDE: u32 = 4096;

/// Values that the texels of an exported image hold, from those of the use of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Recipe {
    /// Colours times a factor.
    Color(Vec3),
    /// Colours times a factor, as the base below a coat of this refractive index that shows them.
    Base(Vec3, f32),
    /// Radiance: colours times a factor, never in 8 or 16 bits.
    Radiance(Vec3),
    /// One number times a factor.
    Number(f32),
    /// Square of one number times a factor.
    Squared(f32),
    /// Normals of another length, with factors of the components along the tangent and the bitangent.
    Normal(Vec2),
    /// 1 where `factor` times the number is at least `cutoff`, else 0.
    Cut { factor: f32, cutoff: f32 },
}

#[derive(Clone, Debug, PartialEq)]
struct Picture {
    used: TextureUse,
    recipe: Recipe,
}

/// Images of a scene, and files that go unchanged, each once.
#[derive(Debug, Default)]
pub(super) struct Pictures {
    list: Vec<Picture>,
    copies: Vec<PathBuf>,
}

/// Name and look-up of an exported image.
#[derive(Debug, PartialEq)]
pub(super) struct Bitmap {
    /// File in the folder of the scene.
    pub(super) name: String,
    /// True for linear values.
    pub(super) is_raw: bool,
    pub(super) is_nearest: bool,
}

impl Pictures {
    /// Adds an image; returns that of an equal one if there is one.
    pub(super) fn add(&mut self, used: &TextureUse, recipe: Recipe) -> Bitmap {
        // Coordinates and wrap modes belong to the look-up, but an enlarged image depends on the latter.
        let picture = Picture {
            used: TextureUse { image_from_uv: SAME_UV, uv_set: 0, ..used.clone() },
            recipe,
        };
        let is_same = |one: &Picture, other: &Picture| {
            Arc::ptr_eq(&one.used.texture, &other.used.texture) && one == other
        };
        let index = number_of(&mut self.list, picture, is_same);
        self.list[index].bitmap(index)
    }

    /// Adds a file that goes unchanged; returns its name in the folder of the scene.
    pub(super) fn copy(&mut self, path: &Path) -> String {
        let index = number_of(&mut self.copies, path.to_owned(), PathBuf::eq);
        copied_name(index, path)
    }

    /// Writes all images and copies into a folder.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        for (index, path) in self.copies.iter().enumerate() {
            let bytes = files::read(path)?;
            let target = folder.join(copied_name(index, path));
            files::write_atomically(&target, |file| file.write_all(&bytes))?;
        }
        self.list.iter().enumerate().try_for_each(|(index, picture)| {
            let path = folder.join(picture.bitmap(index).name);
            match picture.stored() {
                Some((bytes, color)) => {
                    let Texture { width, height, .. } = *picture.used.texture;
                    write_png(&path, [width, height], &bytes, color)
                }
                None => picture.write_exr(&path),
            }
        })
    }
}

/// Name of a copied file, an RGL measurement.
fn copied_name(index: usize, path: &Path) -> String {
    format!("f{index:02}_{}.bsdf", safe_stem(path))
}

impl Picture {
    fn bitmap(&self, index: usize) -> Bitmap {
        let is_stored = self.is_stored();
        let extension = if is_stored { "png" } else { "exr" };
        Bitmap {
            name: format!("t{index:02}_{}.{extension}", safe_stem(&self.used.texture.name)),
            is_raw: !is_stored
                || self.used.encoding == Encoding::Linear
                || self.used.channels == Channels::Alpha,
            is_nearest: self.used.interpolation == Interpolation::Nearest
                || matches!(self.recipe, Recipe::Cut { .. }),
        }
    }

    /// Tests whether the image holds nothing but channels of the texture as they are.
    fn is_stored(&self) -> bool {
        let is_one = match self.recipe {
            Recipe::Color(factor) => factor == Vec3::ONE,
            // The number of three channels is their luminance.
            Recipe::Number(factor) => factor == 1.0 && self.used.channels != Channels::Color,
            Recipe::Normal(factor) => factor == Vec2::ONE,
            Recipe::Base(..) | Recipe::Radiance(_) | Recipe::Squared(_) | Recipe::Cut { .. } => {
                false
            }
        };
        is_one
            && self.used.scale == [1.0; 3]
            && self.used.bias == [0.0; 3]
            && !matches!(self.used.texture.texels, Texels::Halves(_))
    }

    /// Texels without a change, of 8 or 16 bits.
    fn stored(&self) -> Option<(Vec<u8>, ExtendedColorType)> {
        if !self.is_stored() {
            return None;
        }
        let channels = match self.used.channels {
            Channels::Color => [0, 1, 2],
            Channels::Red => [0; 3],
            Channels::Green => [1; 3],
            Channels::Blue => [2; 3],
            Channels::Alpha => [3; 3],
        };
        match &self.used.texture.texels {
            Texels::Bytes(texels) => {
                let all = texels.iter().flat_map(|texel| channels.map(|channel| texel[channel]));
                Some((all.collect(), ExtendedColorType::Rgb8))
            }
            Texels::Shorts(texels) => {
                let all = texels.iter().flat_map(|texel| channels.map(|channel| texel[channel]));
                Some((all.flat_map(u16::to_ne_bytes).collect(), ExtendedColorType::Rgb16))
            }
            Texels::Halves(_) => None,
        }
    }

    /// Texels of the image for each of the texture, along both axes.
    fn enlargement(&self) -> u32 {
        let is_blurred = self.used.interpolation == Interpolation::Bilinear;
        if !is_blurred || !matches!(self.recipe, Recipe::Cut { .. }) {
            return 1;
        }
        let longest = self.used.texture.width.max(self.used.texture.height);
        (MAX_ENLARGED_SIDE / longest).clamp(1, MAX_ENLARGEMENT)
    }

    fn write_exr(&self, path: &Path) -> Result<()> {
        let enlargement = self.enlargement();
        let [width, height] =
            [self.used.texture.width, self.used.texture.height].map(|side| side * enlargement);
        let interpolation =
            if enlargement == 1 { Interpolation::Nearest } else { Interpolation::Bilinear };
        let used = TextureUse { interpolation, ..self.used.clone() };
        let of = self.value();
        let texel = |number: usize| {
            let (x, y) = (number as u32 % width, number as u32 / width);
            let image =
                Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let value = used.value(image).truncate();
            of(value).to_array()
        };
        let count = width as usize * height as usize;
        let texels: Vec<[f32; 3]> = (0..count).into_par_iter().map(texel).collect();
        Image::of_rgb(width, height, &texels).write_exr(path)
    }

    /// Function from values of the texture to those of the image.
    fn value(&self) -> impl Fn(Vec3) -> Vec3 + Sync {
        let recipe = self.recipe;
        let base = base_below_coat(if let Recipe::Base(_, ior) = recipe { ior } else { 1.0 });
        move |value| match recipe {
            Recipe::Color(factor) | Recipe::Radiance(factor) => value * factor,
            Recipe::Base(factor, _) => (value * factor).map(&base),
            Recipe::Number(factor) => Vec3::splat(factor * luminance(value)),
            Recipe::Squared(factor) => Vec3::splat(factor * luminance(value).powi(2)),
            Recipe::Normal(factor) => {
                // The length of a normal does not count. Texels stay within 0…1.
                let factor = factor.extend(1.0) / factor.abs().max_element().max(1.0);
                0.5 + 0.5 * factor * (2.0 * value - 1.0)
            }
            Recipe::Cut { factor, cutoff } => {
                Vec3::splat(if factor * luminance(value) >= cutoff { 1.0 } else { 0.0 })
            }
        }
    }
}

/// Writes an image of 8 bits or of 16, in the order of this machine, per channel.
pub(super) fn write_png(
    path: &Path,
    [width, height]: [u32; 2],
    bytes: &[u8],
    color: ExtendedColorType,
) -> Result<()> {
    files::write_atomically(path, |file| {
        let written = PngEncoder::new(file).write_image(bytes, width, height, color);
        written.map_err(std::io::Error::other)
    })
}
