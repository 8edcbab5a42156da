//! Sizes of images, checked before memory is allocated, and values that become halves.

use half::f16;

use crate::{files, memory};

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
