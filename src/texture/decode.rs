//! Image files → [`Texture`]: PNG, JPEG, TGA, Radiance `.hdr` and OpenEXR.

use std::{io::Cursor, path::Path};

use half::f16;
use image::{DynamicImage, ImageFormat, ImageReader};

use super::{Texels, Texture};
use crate::{
    error::{Error, Result},
    files,
};

impl Texture {
    /// Reads an image file; its content tells the format, and the extension where it does not.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is no image.
    pub fn load(path: &Path) -> Result<Self> {
        let format = ImageFormat::from_extension(files::extension(path));
        decode(&path.display().to_string(), &files::read(path)?, format)
            .map_err(|message| Error::format(path, message))
    }

    /// Decodes an image inside another file; `name` says where it is.
    ///
    /// # Errors
    /// A message for bytes that are no image.
    pub fn decode(name: &str, bytes: &[u8]) -> Result<Self, String> {
        decode(name, bytes, None)
    }
}

fn decode(name: &str, bytes: &[u8], format: Option<ImageFormat>) -> Result<Texture, String> {
    let guessed = image::guess_format(bytes).ok().or(format);
    let format =
        guessed.ok_or("expected a PNG, JPEG, TGA, HDR or EXR image, found another file")?;
    let image = ImageReader::with_format(Cursor::new(bytes), format)
        .decode()
        .map_err(|error| format!("not a readable image: {error}"))?;
    let is_bytes = matches!(
        image,
        DynamicImage::ImageLuma8(_)
            | DynamicImage::ImageLumaA8(_)
            | DynamicImage::ImageRgb8(_)
            | DynamicImage::ImageRgba8(_)
    );
    let texels = if is_bytes {
        Texels::Bytes(image.to_rgba8().pixels().map(|pixel| pixel.0).collect())
    } else {
        Texels::Halves(
            image.to_rgba32f().pixels().map(|pixel| pixel.0.map(f16::from_f32)).collect(),
        )
    };
    Ok(Texture { name: name.to_owned(), width: image.width(), height: image.height(), texels })
}
