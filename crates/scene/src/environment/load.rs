//! Environment maps from files: Radiance `.hdr`, OpenEXR, PFM.

use std::{io::Cursor, path::Path};

use glam::Vec3;
use image::{ImageDecoder, codecs::hdr::HdrDecoder};
use rayon::prelude::*;

use super::{EnvironmentMap, MAX_RADIANCE};
use crate::{
    error::{Error, Result},
    files, memory,
    picture::RgbImage,
    texture::exr,
};

/// Most texels of a map: 16384×8192.
const MAX_TEXELS: u64 = 1 << 27;

/// Bytes of a texel: its radiance, and its share of the sampling tables.
const TEXEL_BYTES: u64 = 48;

/// Largest compression of a Radiance file: a run of 255 texels of four bytes in four bytes.
const HDR_LARGEST_RATIO: u64 = 255;

/// Width, height, and radiance as stored in the file, top row first.
type Image = ([u32; 2], Vec<Vec3>);

impl EnvironmentMap {
    /// Reads a lat-long map in the format of its extension: `.hdr`, `.exr` or `.pfm`.
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
        let texels = pixels.iter().map(|pixel| Vec3::from(*pixel)).collect();
        let map = Self::cleaned(name.to_owned(), ([width, height], texels), scale, warnings);
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
        let read = match files::extension(path).as_str() {
            "hdr" => read_hdr,
            "exr" => read_exr,
            "pfm" => read_pfm,
            _ => {
                let message = "unknown kind of environment map; expected .hdr, .exr or .pfm";
                return Err(Error::format(path, message));
            }
        };
        let image = read(&files::read(path)?).map_err(|message| Error::format(path, message))?;
        Ok(Self::cleaned(path.display().to_string(), image, scale, warnings))
    }

    /// Applies `scale`, and sets texels that are not radiance to 0 with a warning.
    fn cleaned(source: String, image: Image, scale: f32, warnings: &mut Vec<String>) -> Self {
        let ([width, height], mut texels) = image;
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
    if width == 0 || height == 0 || width.saturating_mul(height) > MAX_TEXELS {
        return Err(format!(
            "{width}×{height} texels; expected at least 1×1 and at most {MAX_TEXELS} in all"
        ));
    }
    let bytes = width.saturating_mul(height).saturating_mul(TEXEL_BYTES);
    memory::check(format_args!("a map of {width}×{height} texels"), bytes)
        .map_err(|shortage| shortage.to_string())
}

fn read_hdr(bytes: &[u8]) -> Result<Image, String> {
    let message = |error: image::ImageError| format!("not a readable Radiance file: {error}");
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(message)?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into())?;
    files::check_promise([width, height].map(u64::from), 4, bytes.len() as u64, HDR_LARGEST_RATIO)
        .map_err(|message| format!("not a readable Radiance file: {message}"))?;
    let mut components = vec![0_f32; width as usize * height as usize * 3];
    decoder.read_image(bytemuck::cast_slice_mut(&mut components)).map_err(message)?;
    Ok(([width, height], bytemuck::cast_vec(components)))
}

fn read_exr(bytes: &[u8]) -> Result<Image, String> {
    let check = |size: [u64; 2], pixel_bytes: u64| {
        check_size(size[0], size[1])?;
        files::check_promise(size, pixel_bytes, bytes.len() as u64, files::EXR_LARGEST_RATIO)
            .map_err(|message| format!("not a readable OpenEXR file: {message}"))
    };
    let texel = |(): &mut (), [r, g, b, _]: [f32; 4]| Vec3::new(r, g, b);
    exr::decode(bytes, check, texel).map(|(size, texels, ())| (size, texels))
}

/// Reads a portable float map: `PF` or `Pf`, width, height, scale (negative for little-endian),
/// then rows of floats from the bottom up. Ignores the magnitude of the scale, as most readers do.
fn read_pfm(bytes: &[u8]) -> Result<Image, String> {
    let mut position = 0;
    let mut token = |what: &str| -> Result<&str, String> {
        let start = position
            + bytes[position..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        let length =
            bytes[start..].iter().take(32).take_while(|byte| byte.is_ascii_graphic()).count();
        let text = std::str::from_utf8(&bytes[start..start + length]).unwrap_or_default();
        position = start + length;
        if text.is_empty() { Err(format!("PFM header ends before the {what}")) } else { Ok(text) }
    };
    let magic = token("magic number")?;
    let component_count = match magic {
        "PF" => 3,
        "Pf" => 1,
        _ => return Err(format!("not a PFM file: expected PF or Pf, found {magic:?}")),
    };
    let mut size = |what: &str| {
        let text = token(what)?;
        text.parse::<u32>().map_err(|_| format!("PFM {what}: expected an integer, found {text:?}"))
    };
    let (width, height) = (size("width")?, size("height")?);
    check_size(width.into(), height.into())?;
    let text = token("scale")?;
    let scale: f32 = text
        .parse()
        .ok()
        .filter(|scale: &f32| scale.is_finite() && *scale != 0.0)
        .ok_or_else(|| format!("PFM scale: expected a number other than 0, found {text:?}"))?;
    let data = bytes.get(position + 1..).unwrap_or_default();
    let row_bytes = width as usize * component_count * 4;
    let expected = row_bytes * height as usize;
    if data.len() < expected {
        return Err(format!(
            "truncated: {width}×{height} texels of {component_count} floats need {expected} bytes, \
             found {}",
            data.len()
        ));
    }
    let float = |bytes: &[u8]| {
        let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
        if scale < 0.0 { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }
    };
    let mut texels = Vec::with_capacity(width as usize * height as usize);
    for row in data[..expected].chunks_exact(row_bytes).rev() {
        texels.extend(row.chunks_exact(component_count * 4).map(|texel| match texel.len() {
            4 => Vec3::splat(float(texel)),
            _ => Vec3::new(float(texel), float(&texel[4..]), float(&texel[8..])),
        }));
    }
    Ok(([width, height], texels))
}
