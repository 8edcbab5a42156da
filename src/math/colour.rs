//! Colours in linear Rec.709.

use glam::Vec3;

use crate::shader::constants::LUMINANCE_WEIGHTS;

/// Luminance of a linear Rec.709 colour, in the units of `radiance`.
pub fn luminance(radiance: Vec3) -> f32 {
    radiance.dot(Vec3::from_array(LUMINANCE_WEIGHTS))
}

/// Linear value of a number 0…1 in the encoding of IEC 61966-2-1:1999.
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
