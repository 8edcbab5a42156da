//! Pictures for other programs: JPEG and Radiance HDR.

use std::path::Path;

use image::{ExtendedColorType, ImageEncoder, ImageError, Rgb, codecs::hdr::HdrEncoder};

use super::RgbImage;
use crate::{error::Result, files::write_atomically};

/// Quality of JPEG files, 1…100: no blocks are seen, at a tenth of the size of PNG.
const JPEG_QUALITY: u8 = 92;

/// Writes display values as JPEG. Fails with [`crate::Error::Io`] and the cause.
pub(crate) fn write_jpeg(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<()> {
    write_atomically(path, |file| {
        image::codecs::jpeg::JpegEncoder::new_with_quality(file, JPEG_QUALITY)
            .write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
            .map_err(io_error)
    })
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
pub(super) fn io_error(error: ImageError) -> std::io::Error {
    match error {
        ImageError::IoError(source) => source,
        other => std::io::Error::other(other.to_string()),
    }
}
