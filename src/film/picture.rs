//! Pictures for other programs: linear picture → display values → PNG and JPEG, and Radiance HDR.

use std::{
    io::{self, Write},
    path::Path,
};

use image::{
    ExtendedColorType, ImageEncoder, ImageError, Rgb,
    codecs::{hdr::HdrEncoder, jpeg::JpegEncoder, png::PngEncoder},
};

use super::{RgbImage, Tone};
use crate::{error::Result, files::write_atomically};

/// Quality of JPEG files, 1…100: no blocks are seen, at a tenth of the size of PNG.
const JPEG_QUALITY: u8 = 92;

/// Writes the picture as PNG, scaled by 2^`exposure` (in stops), clamped, with the sRGB curve. No other
/// tone curve applies, so two previews of one exposure can be compared.
///
/// # Errors
/// [`crate::Error::Io`] with the cause.
pub fn write_preview(path: &Path, picture: &RgbImage, exposure: f32) -> Result<()> {
    write_png(path, picture.width, &preview(picture, exposure))
}

/// Display values of a preview, as [`write_preview`] writes them.
pub(crate) fn preview(picture: &RgbImage, exposure: f32) -> Vec<[u8; 3]> {
    Tone { exposure, ..Tone::default() }.shown(picture)
}

/// Writes rows of display values as PNG. Fails with [`crate::Error::Io`] and the cause. Panics if `pixels`
/// are not whole rows.
pub(crate) fn write_png(path: &Path, width: u32, pixels: &[[u8; 3]]) -> Result<()> {
    write_atomically(path, |file| encode_png(file, width, pixels))
}

/// Encodes rows of display values as PNG.
pub(crate) fn encode_png(writer: impl Write, width: u32, pixels: &[[u8; 3]]) -> io::Result<()> {
    encode(PngEncoder::new(writer), width, pixels)
}

/// Writes rows of display values as JPEG. Fails with [`crate::Error::Io`] and the cause.
pub(crate) fn write_jpeg(path: &Path, width: u32, pixels: &[[u8; 3]]) -> Result<()> {
    write_atomically(path, |file| {
        encode(JpegEncoder::new_with_quality(file, JPEG_QUALITY), width, pixels)
    })
}

fn encode(encoder: impl ImageEncoder, width: u32, pixels: &[[u8; 3]]) -> io::Result<()> {
    let height = pixels.len().checked_div(width as usize).unwrap_or(0);
    assert_eq!(pixels.len(), width as usize * height, "whole rows");
    encoder
        .write_image(pixels.as_flattened(), width, height as u32, ExtendedColorType::Rgb8)
        .map_err(io_error)
}

/// Writes linear values as Radiance HDR, whose three channels share one exponent: values lose what is
/// below 1/256 of the largest of their pixel. Fails with [`crate::Error::Io`] and the cause.
pub(crate) fn write_hdr(path: &Path, picture: &RgbImage) -> Result<()> {
    let pixels: Vec<Rgb<f32>> = picture.pixels.iter().map(|pixel| Rgb(*pixel)).collect();
    write_atomically(path, |file| {
        let (width, height) = (picture.width as usize, picture.height as usize);
        HdrEncoder::new(file).encode(&pixels, width, height).map_err(io_error)
    })
}

/// Returns the input or output error of a failed encoder.
fn io_error(error: ImageError) -> io::Error {
    match error {
        ImageError::IoError(source) => source,
        other => io::Error::other(other.to_string()),
    }
}
