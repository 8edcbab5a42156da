//! Colours in linear Rec.709.

use glam::Vec3;

/// Weights of linear Rec.709 in luminance.
pub const LUMINANCE_WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Luminance of a linear Rec.709 colour, in the units of `radiance`.
pub fn luminance(radiance: Vec3) -> f32 {
    radiance.dot(Vec3::from_array(LUMINANCE_WEIGHTS))
}

/// sRGB transfer function (IEC 61966-2-1): linear 0…1 → display 0…1.
pub fn srgb_from_linear(value: f32) -> f32 {
    if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

/// Converts a linear value to a byte: clamps to 0…1, applies the sRGB curve, rounds. NaN becomes 0.
pub fn display_from_linear(value: f32) -> u8 {
    // `as` saturates and turns NaN into 0.
    (srgb_from_linear(value.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

/// Linear value of a number 0 to 1 in the encoding of \[IEC 61966-2-1:1999\].
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
