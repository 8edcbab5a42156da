//! Image files → [`Texture`]: PNG, JPEG, WebP, TGA, BMP, PNM, Radiance `.hdr`, OpenEXR and PFM.
//!
//! The uses of a texture say how its colours are encoded. Statements of the file about that, as PNG's
//! `gAMA`, `cHRM` and `iCCP`, count for nothing, as glTF 2.0 demands (section 3.9.2); an image that is
//! turned by Exif metadata stays as it is stored.

use std::{io::Cursor, path::Path};

use half::f16;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::{
    Texels, Texture, exr,
    floats::{self, PFM_SIGNATURES, RADIANCE_SIGNATURE},
};
use crate::{
    error::{Error, Result},
    files, memory,
    picture::RgbImage,
};

/// Most bytes that a decoder may allocate: the largest image in floats of 32 bits.
const MAX_DECODER_BYTES: u64 = 16 * (MAX_TEXTURE_SIDE as u64).pow(2);
/// Most bytes that colour profiles and texts of a PNG file may grow by; the limit of its decoder counts
/// nothing else.
const MAX_INFLATION: u64 = 1 << 22;

impl Texture {
    /// Reads an image file; its content tells the format, and the extension where it does not. Warns if
    /// values of an HDR or EXR image are negative or not a number, which become 0, or above the largest
    /// half, which become that.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is no image, is damaged, or
    /// has more than [`MAX_TEXTURE_SIDE`] texels a side.
    pub fn load(path: &Path, warnings: &mut Vec<String>) -> Result<Self> {
        let format = ImageFormat::from_extension(files::extension(path));
        decode(&path.display().to_string(), &files::read(path)?, format, warnings)
            .map_err(|message| Error::format(path, message))
    }

    /// As [`Texture::load`] for an image inside another file; `name` says where it is.
    ///
    /// # Errors
    /// A message for bytes that are no image, or a damaged or too large one.
    pub fn decode(name: &str, bytes: &[u8], warnings: &mut Vec<String>) -> Result<Self, String> {
        decode(name, bytes, None, warnings)
    }

    /// Takes linear values from memory; repairs and warns as [`Texture::load`] does.
    ///
    /// # Errors
    /// A message for more than [`MAX_TEXTURE_SIDE`] texels a side, or pixels that do not fill the image.
    pub fn of_image(
        name: &str,
        image: &RgbImage,
        warnings: &mut Vec<String>,
    ) -> Result<Self, String> {
        let RgbImage { width, height, ref pixels } = *image;
        let bytes = size_of_val(pixels.as_slice());
        check_size([width, height].map(u64::from), 12, bytes, 1)?;
        let mut repairs = Repairs::default();
        let texels = pixels.iter().map(|[r, g, b]| repairs.texel([*r, *g, *b, 1.0])).collect();
        repairs.warn(name, warnings);
        Ok(Self { name: name.to_owned(), width, height, texels: Texels::Halves(texels) })
    }
}

fn decode(
    name: &str,
    bytes: &[u8],
    format: Option<ImageFormat>,
    warnings: &mut Vec<String>,
) -> Result<Texture, String> {
    let check = |size| check_size(size, 4, bytes.len(), u64::MAX);
    if PFM_SIGNATURES.iter().any(|signature| bytes.starts_with(signature)) {
        return Texture::of_image(name, &floats::pfm(bytes, check)?, warnings);
    }
    let is_radiance = bytes.starts_with(RADIANCE_SIGNATURE);
    let guessed = match image::guess_format(bytes) {
        _ if is_radiance => Some(ImageFormat::Hdr),
        guessed => guessed.ok().or(format),
    };
    let ratio = match guessed {
        Some(ImageFormat::Hdr) => {
            return Texture::of_image(
                name,
                &floats::radiance(name, bytes, check, warnings)?,
                warnings,
            );
        }
        Some(ImageFormat::OpenExr) => {
            let check = |size: [u64; 2], texel_bytes: u64| {
                check_size(size, texel_bytes, bytes.len(), files::EXR_LARGEST_RATIO)
            };
            let ([width, height], texels, repairs) =
                exr::decode(name, bytes, check, Repairs::texel, warnings)?;
            repairs.warn(name, warnings);
            let texels = Texels::Halves(texels);
            return Ok(Texture { name: name.to_owned(), width, height, texels });
        }
        // Deflate, times the growth of one bit of a palette to four bytes.
        Some(ImageFormat::Png) => files::DEFLATE_LARGEST_RATIO * 32,
        // One bit for a block of 64 texels.
        Some(ImageFormat::Jpeg) => 64 * 32,
        // A run of 128 texels of four bytes in two bytes.
        Some(ImageFormat::Tga) => 256,
        // A run of 255 texels in two bytes.
        Some(ImageFormat::Bmp) => 512,
        // One bit for a texel.
        Some(ImageFormat::Pnm) => 8,
        // An image of one colour takes no more bytes if it is larger.
        Some(ImageFormat::WebP) => u64::MAX,
        _ => {
            return Err(
                "expected a PNG, JPEG, WebP, TGA, BMP, PNM, HDR, EXR or PFM image, found another file"
                    .to_owned()
            );
        }
    };
    let unreadable = |error: image::ImageError| format!("not a readable image: {error}");
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(match guessed {
        Some(ImageFormat::Png) => bytes.len() as u64 + MAX_INFLATION,
        _ => MAX_DECODER_BYTES,
    });
    let mut reader = ImageReader::new(Cursor::new(bytes));
    reader.limits(limits);
    if let Some(format) = guessed {
        reader.set_format(format);
    }
    let decoder = reader.into_decoder().map_err(unreadable)?;
    let (width, height) = decoder.dimensions();
    let texel_bytes = u64::from(decoder.color_type().bytes_per_pixel());
    check_size([width, height].map(u64::from), texel_bytes, bytes.len(), ratio)?;
    let image = DynamicImage::from_decoder(decoder).map_err(unreadable)?;
    let color = image.color();
    let texels = match color.bytes_per_pixel() / color.channel_count() {
        1 => Texels::Bytes(fours(image.into_rgba8().into_raw())),
        _ => Texels::Shorts(fours(image.into_rgba16().into_raw())),
    };
    Ok(Texture { name: name.to_owned(), width, height, texels })
}

/// Groups channels to texels, without a copy where the allocation allows it.
fn fours<T: bytemuck::Pod>(channels: Vec<T>) -> Vec<[T; 4]>
where
    [T; 4]: bytemuck::Pod,
{
    bytemuck::allocation::try_cast_vec(channels)
        .unwrap_or_else(|(_, channels)| channels.as_chunks::<4>().0.to_vec())
}

/// Longest side of a texture, texels.
pub const MAX_TEXTURE_SIDE: u32 = 16_384;

/// Bytes of a texel while it is decoded: four halves, and four channels of the decoder beside them.
const DECODED_BYTES: u64 = 16;

/// Checks the size that a header states, before memory is allocated for it. `ratio` is the largest
/// compression of the format.
pub(super) fn check_size(
    size: [u64; 2],
    texel_bytes: u64,
    file_bytes: usize,
    ratio: u64,
) -> Result<(), String> {
    let [width, height] = size;
    if !size.iter().all(|side| (1..=u64::from(MAX_TEXTURE_SIDE)).contains(side)) {
        return Err(format!(
            "expected an image of 1 to {MAX_TEXTURE_SIDE} texels a side, found {width}×{height}: \
             make it smaller"
        ));
    }
    files::check_promise(size, texel_bytes, file_bytes as u64, ratio)
        .map_err(|message| format!("not a readable image: {message}"))?;
    let bytes = width.saturating_mul(height).saturating_mul(DECODED_BYTES);
    memory::check(format_args!("an image of {width}×{height} texels"), bytes)
        .map_err(|shortage| shortage.to_string())
}

/// Counts of values of an image that no half can hold or no surface can have.
#[derive(Default)]
pub(super) struct Repairs {
    invalid: usize,
    clamped: usize,
}

impl Repairs {
    /// Converts a texel: values that are negative or not a number become 0, those above the largest
    /// half become that, and opacity is brought to 0…1.
    pub(super) fn texel(&mut self, [red, green, blue, alpha]: [f32; 4]) -> [f16; 4] {
        let mut value = |value: f32, most: f32| {
            if value.is_nan() || value < 0.0 {
                self.invalid += 1;
                return f16::ZERO;
            }
            self.clamped += usize::from(value > most);
            f16::from_f32(value.min(most))
        };
        let most = f16::MAX.to_f32();
        [value(red, most), value(green, most), value(blue, most), value(alpha, 1.0)]
    }

    /// One warning for each kind of repair.
    pub(super) fn warn(&self, name: &str, warnings: &mut Vec<String>) {
        let Self { invalid, clamped } = self;
        if *invalid > 0 {
            warnings.push(format!(
                "{name}: {invalid} values are negative or not a number and were set to 0"
            ));
        }
        if *clamped > 0 {
            warnings.push(format!(
                "{name}: {clamped} values are above {}, or opacities above 1, and were set to that",
                f16::MAX
            ));
        }
    }
}
