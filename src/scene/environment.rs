//! Lat-long environment map and its orientation convention.

use glam::Vec3;

/// Lat-long radiance image after cleaning, scaling and before rotation.
///
/// Row 0 is +Y; the image centre looks along −Z; right of the centre is toward +X.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Radiance, row by row, `width * height` texels; finite and not negative, `scale` applied.
    pub texels: Vec<Vec3>,
    /// Turn of the map about +Y, radians, counter-clockwise seen from above.
    pub rotation_rad: f32,
    /// Where the map came from, for messages and metadata: a path, or `constant`, `court`, `sky`.
    pub source: String,
}
