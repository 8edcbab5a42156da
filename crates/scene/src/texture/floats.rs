//! Radiance and portable float maps → [`RgbImage`].

use std::io::Cursor;

use image::{ImageDecoder, ImageError, codecs::hdr::HdrDecoder};

use crate::{
    files,
    picture::{REC_709, RgbImage},
};

/// Largest compression of a Radiance file: a run of 255 texels of four bytes in four bytes.
const RADIANCE_LARGEST_RATIO: u64 = 255;

/// First bytes of a portable float map, of three channels or of one.
pub(crate) const PFM_SIGNATURES: [&[u8]; 2] = [b"PF", b"Pf"];
/// First bytes of a Radiance file, of whichever program: `#?RADIANCE`, `#?RGBE`.
pub(crate) const RADIANCE_SIGNATURE: &[u8] = b"#?";

/// Largest difference of a chromaticity from that of Rec.709 that no warning names: that of the white of
/// Radiance, which is of equal energy.
const ALIKE: f32 = 0.025;

/// Warns of the chromaticities of red, green, blue and white where they are not those of Rec.709.
pub(super) fn warn_of_primaries(name: &str, found: [[f32; 2]; 4], warnings: &mut Vec<String>) {
    let own = [REC_709.red, REC_709.green, REC_709.blue, REC_709.white];
    let own = own.map(|point| [point.x(), point.y()]);
    let pairs = found.as_flattened().iter().zip(own.as_flattened());
    if pairs.map(|(found, own)| (found - own).abs()).any(|apart| apart > ALIKE) {
        warnings
            .push(format!("{name}: its colours are of other primaries, and are taken for Rec.709"));
    }
}

/// Reads a Radiance file; `check_size` is asked before memory is allocated. Warns, with `name`, of what
/// the header says of its values.
pub(crate) fn radiance(
    name: &str,
    bytes: &[u8],
    check_size: impl Fn([u64; 2]) -> Result<(), String>,
    warnings: &mut Vec<String>,
) -> Result<RgbImage, String> {
    let message = |error: ImageError| format!("not a readable Radiance file: {error}");
    let decoder = HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(message)?;
    let header = decoder.metadata();
    // Other renderers take the values as they stand too.
    if header.exposure.is_some_and(|exposure| exposure != 1.0)
        || header.color_correction.is_some_and(|factors| factors != (1.0, 1.0, 1.0))
    {
        warnings.push(format!("{name}: its values are not divided by `EXPOSURE` and `COLORCORR`"));
    }
    let primaries = header.custom_attributes.iter().find(|(key, _)| key == "PRIMARIES");
    if let Some((_, text)) = primaries {
        let numbers: Vec<f32> =
            text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        if let [[red, green, blue, white]] = numbers.as_chunks().0.as_chunks().0 {
            warn_of_primaries(name, [*red, *green, *blue, *white], warnings);
        }
    }
    let (width, height) = decoder.dimensions();
    let size = [width, height].map(u64::from);
    check_size(size)?;
    files::check_promise(size, 4, bytes.len() as u64, RADIANCE_LARGEST_RATIO)
        .map_err(|message| format!("not a readable Radiance file: {message}"))?;
    let mut pixels = vec![[0.0_f32; 3]; width as usize * height as usize];
    decoder.read_image(bytemuck::cast_slice_mut(&mut pixels)).map_err(message)?;
    Ok(RgbImage { width, height, pixels })
}

/// Reads a portable float map: `PF` or `Pf`, width, height, scale (negative for little-endian),
/// then rows of floats from the bottom up. Ignores the magnitude of the scale, as most readers do.
pub(crate) fn pfm(
    bytes: &[u8],
    check_size: impl Fn([u64; 2]) -> Result<(), String>,
) -> Result<RgbImage, String> {
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
    let component_count = match token("magic number")? {
        "PF" => 3,
        "Pf" => 1,
        magic => return Err(format!("not a PFM file: expected PF or Pf, found {magic:?}")),
    };
    let mut size = |what: &str| {
        let text = token(what)?;
        text.parse::<u32>().map_err(|_| format!("PFM {what}: expected an integer, found {text:?}"))
    };
    let (width, height) = (size("width")?, size("height")?);
    check_size([width, height].map(u64::from))?;
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
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for row in data[..expected].chunks_exact(row_bytes).rev() {
        pixels.extend(row.chunks_exact(component_count * 4).map(|texel| match texel.len() {
            4 => [float(texel); 3],
            _ => [float(texel), float(&texel[4..]), float(&texel[8..])],
        }));
    }
    Ok(RgbImage { width, height, pixels })
}
