//! Colours in linear Rec.709.

use glam::Vec3;

use crate::shader::constants::LUMINANCE_WEIGHTS;

/// Luminance of a linear Rec.709 colour, in the units of `radiance`.
pub fn luminance(radiance: Vec3) -> f32 {
    radiance.dot(Vec3::from_array(LUMINANCE_WEIGHTS))
}
