//! Colours in linear Rec.709.

use glam::Vec3;

/// Luminance of a linear Rec.709 colour, in the units of `radiance`.
pub fn luminance(radiance: Vec3) -> f32 {
    radiance.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}
