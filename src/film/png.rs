//! PNG previews: linear picture → sRGB bytes.

use std::{io::Write, path::Path};

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::exr::RgbImage;
use crate::error::Result;
use crate::files::write_atomically;

/// sRGB transfer function (IEC 61966-2-1): linear 0…1 → display 0…1.
pub fn srgb_from_linear(value: f32) -> f32 {
    if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

/// Converts a linear value to a byte: clamps to 0…1, applies the sRGB curve, rounds. NaN becomes 0.
pub fn display_from_linear(value: f32) -> u8 {
    // `as` saturates and turns NaN into 0.
    (srgb_from_linear(value.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

/// Writes the picture scaled by 2^`exposure` (in stops), clamped, with the sRGB curve. No other
/// tone curve applies, so two previews of one exposure can be compared.
///
/// # Errors
/// [`crate::Error::Io`] with the cause.
pub fn write_preview(path: &Path, picture: &RgbImage, exposure: f32) -> Result<()> {
    write_rgb8(path, picture.width, picture.height, &preview(picture, exposure))
}

/// Display values of a preview, as [`write_preview`] writes them.
pub fn preview(picture: &RgbImage, exposure: f32) -> Vec<[u8; 3]> {
    let scale = exposure.exp2();
    let display = |pixel: &[f32; 3]| pixel.map(|value| display_from_linear(value * scale));
    picture.pixels.iter().map(display).collect()
}

/// Writes display values unchanged.
///
/// # Errors
/// [`crate::Error::Io`] with the cause.
///
/// # Panics
/// `pixels` is not `width * height` long.
pub fn write_rgb8(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<()> {
    assert_eq!(pixels.len(), width as usize * height as usize, "one value per pixel");
    write_atomically(path, |file| encode_rgb8(file, width, height, pixels))
}

/// Encodes display values as PNG.
pub fn encode_rgb8(
    writer: impl Write,
    width: u32,
    height: u32,
    pixels: &[[u8; 3]],
) -> std::io::Result<()> {
    PngEncoder::new(writer)
        .write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(|error| match error {
            image::ImageError::IoError(source) => source,
            other => std::io::Error::other(other.to_string()),
        })
}
