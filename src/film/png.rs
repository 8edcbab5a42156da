//! PNG previews: linear picture → sRGB bytes.

use std::{io::Write, path::Path};

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::{RgbImage, picture::io_error, tone::Tone};
use crate::{error::Result, files::write_atomically};

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
    let tone = Tone { exposure, ..Tone::default() };
    picture.pixels.iter().map(|pixel| tone.display(*pixel)).collect()
}

/// Writes display values unchanged.
///
/// # Errors
/// [`crate::Error::Io`] with the cause.
///
/// # Panics
/// `pixels` is not `width * height` long.
pub(crate) fn write_rgb8(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<()> {
    assert_eq!(pixels.len(), width as usize * height as usize, "one value per pixel");
    write_atomically(path, |file| encode_rgb8(file, width, height, pixels))
}

/// Encodes display values as PNG.
pub(crate) fn encode_rgb8(
    writer: impl Write,
    width: u32,
    height: u32,
    pixels: &[[u8; 3]],
) -> std::io::Result<()> {
    PngEncoder::new(writer)
        .write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(io_error)
}
