//! Environment maps from files: Radiance `.hdr`, OpenEXR, PFM, and images of fewer bits.

use std::path::Path;

use glam::Vec3;
use rayon::prelude::*;

use super::{EnvironmentMap, MAX_RADIANCE};
use crate::{
    error::{Error, Result},
    files, memory,
    picture::RgbImage,
    texture::{
        Encoding, Texture, exr,
        floats::{self, PFM_SIGNATURES, RADIANCE_SIGNATURE},
    },
};

/// Most texels of a map: 16384×8192.
const MAX_TEXELS: u64 = 1 << 27;
/// Most texels along a side: samplers keep places in 16 bits.
const MAX_SIDE: u64 = 1 << 15;

/// Bytes of a texel: its radiance, and its share of the sampling tables.
const TEXEL_BYTES: u64 = 48;

impl EnvironmentMap {
    /// Reads a lat-long map: `.hdr`, `.exr`, `.pfm`, or an image of sRGB. Its content tells the format, and
    /// the extension where it does not.
    ///
    /// Multiplies radiance by `scale`. Sets texels with a negative, infinite or NaN component to 0 and
    /// counts them in a warning. Warns of a ratio other than 2:1.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is truncated, of another
    /// format, of an absurd size or without the channels R, G, B or Y.
    pub fn load(path: &Path, scale: f32, warnings: &mut Vec<String>) -> Result<Self> {
        check_scale(scale).map_err(|message| Error::format(path, message))?;
        let map = Self::read(path, scale, warnings)?;
        map.check_ratio(warnings);
        Ok(map)
    }

    /// As [`EnvironmentMap::load`], from an image in memory; `name` serves messages.
    ///
    /// # Errors
    /// A message for an absurd size, or pixels that do not fill it.
    pub fn of_image(
        name: &str,
        image: &RgbImage,
        scale: f32,
        warnings: &mut Vec<String>,
    ) -> Result<Self, String> {
        check_scale(scale)?;
        let RgbImage { width, height, ref pixels } = *image;
        check_size(width.into(), height.into())?;
        if pixels.len() != width as usize * height as usize {
            return Err(format!("{width}×{height} texels, found {} pixels", pixels.len()));
        }
        let map = Self::cleaned(name.to_owned(), image.clone(), scale, warnings);
        map.check_ratio(warnings);
        Ok(map)
    }

    /// Warns of a ratio other than 2:1.
    fn check_ratio(&self, warnings: &mut Vec<String>) {
        if self.width != 2 * self.height {
            warnings.push(format!(
                "{}: {}×{} texels; a lat-long map is expected to be twice as wide as high and is \
                 stretched to the whole sphere",
                self.source, self.width, self.height
            ));
        }
    }

    /// As [`EnvironmentMap::load`], for an image of any ratio and mapping.
    pub(crate) fn read(path: &Path, scale: f32, warnings: &mut Vec<String>) -> Result<Self> {
        let bytes = files::read(path)?;
        let check = |[width, height]: [u64; 2]| check_size(width, height);
        let (extension, name) = (files::extension(path), path.display().to_string());
        let begins = |signature: &[u8]| bytes.starts_with(signature);
        let image = if begins(exr::SIGNATURE) {
            read_exr(&name, &bytes, warnings)
        } else if begins(RADIANCE_SIGNATURE) {
            floats::radiance(&name, &bytes, check, warnings)
        } else if PFM_SIGNATURES.into_iter().any(begins) {
            floats::pfm(&bytes, check)
        } else {
            match extension.as_str() {
                "exr" => read_exr(&name, &bytes, warnings),
                "hdr" | "pic" | "rgbe" => floats::radiance(&name, &bytes, check, warnings),
                "pfm" => floats::pfm(&bytes, check),
                _ => read_encoded(&name, &bytes, warnings),
            }
        };
        let image = image.map_err(|message| Error::format(path, message))?;
        Ok(Self::cleaned(name, image, scale, warnings))
    }

    /// Applies `scale`, and sets texels that are not radiance to 0 with a warning.
    fn cleaned(source: String, image: RgbImage, scale: f32, warnings: &mut Vec<String>) -> Self {
        let RgbImage { width, height, pixels } = image;
        let mut texels: Vec<Vec3> = bytemuck::cast_vec(pixels);
        let invalid = texels
            .par_iter_mut()
            .map(|texel| {
                let scaled = *texel * scale;
                let valid = texel.is_finite()
                    && texel.min_element() >= 0.0
                    && scaled.max_element() <= MAX_RADIANCE;
                *texel = if valid { scaled } else { Vec3::ZERO };
                usize::from(!valid)
            })
            .sum::<usize>();
        if invalid > 0 {
            warnings.push(format!(
                "{source}: {invalid} of {} texels are negative, infinite (above {MAX_RADIANCE:e}) or \
                 NaN and were set to 0",
                texels.len()
            ));
        }
        Self { width, height, texels, rotation_rad: 0.0, source }
    }
}

/// Rejects a scale that is negative or not finite.
fn check_scale(scale: f32) -> Result<(), String> {
    if !(scale.is_finite() && scale >= 0.0) {
        return Err(format!("scale = {scale}; expected a finite number, 0 or more"));
    }
    Ok(())
}

fn check_size(width: u64, height: u64) -> Result<(), String> {
    let longest = width.max(height);
    if width == 0 || height == 0 || longest > MAX_SIDE || width * height > MAX_TEXELS {
        return Err(format!(
            "{width}×{height} texels; expected at least 1×1, at most {MAX_SIDE} along a side and \
             {MAX_TEXELS} in all"
        ));
    }
    let bytes = width.saturating_mul(height).saturating_mul(TEXEL_BYTES);
    memory::check(format_args!("a map of {width}×{height} texels"), bytes)
        .map_err(|shortage| shortage.to_string())
}

fn read_exr(name: &str, bytes: &[u8], warnings: &mut Vec<String>) -> Result<RgbImage, String> {
    let check = |size: [u64; 2], pixel_bytes: u64| {
        check_size(size[0], size[1])?;
        files::check_promise(size, pixel_bytes, bytes.len() as u64, files::EXR_LARGEST_RATIO)
            .map_err(|message| format!("not a readable OpenEXR file: {message}"))
    };
    let pixel = |(): &mut (), [r, g, b, _]: [f32; 4]| [r, g, b];
    exr::decode(name, bytes, check, pixel, warnings).map(|([width, height], pixels, ())| RgbImage {
        width,
        height,
        pixels,
    })
}

fn read_encoded(name: &str, bytes: &[u8], warnings: &mut Vec<String>) -> Result<RgbImage, String> {
    let image = Texture::decode(name, bytes, warnings)?;
    let texels = image.linear_texels(Encoding::Srgb).into_iter();
    let pixels = texels.map(|[red, green, blue, _]| [red, green, blue]).collect();
    Ok(RgbImage { width: image.width, height: image.height, pixels })
}
