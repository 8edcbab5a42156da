//! Lat-long environment map: orientation, lookup and sources.
//!
//! File or parameters → [`EnvironmentMap`] → [`EnvironmentTables`] → device buffers. Row 0 of the
//! image is +Y, its centre looks along −Z, right of the centre is toward +X:
//! u = 0.5 + atan2(x, −z)/2π, v = atan2(√(x² + z²), y)/π (`docs/environment_convention.svg`).
//! Radiance is bilinear between texel centres, wrapping in u and clamped in v; camera, shading and
//! sampling all see that one function.

mod court;
mod daylight;
mod load;
mod sky;
mod table;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::math::frame::{direction_from_lat_long, lat_long_from_direction};

pub use court::CourtParameters;
pub use daylight::DaylightParameters;
pub(crate) use daylight::{Daylight, Moment, SUN_RADIUS_DEG};
pub use sky::SkyParameters;
pub use table::{EnvironmentTables, mean_sine};

/// Largest radiance of a texel after scaling. Larger values count as infinite, because their
/// squares summed over a million samples would leave single precision.
pub const MAX_RADIANCE: f32 = 1e16;

/// Lat-long radiance image, cleaned and scaled but not rotated.
///
/// Row 0 is +Y; the image centre looks along −Z; right of the centre is toward +X.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Radiance row by row, `width * height` texels; finite, not negative, `scale` applied.
    pub texels: Vec<Vec3>,
    /// Rotation of the map about +Y, radians, counter-clockwise seen from above.
    pub rotation_rad: f32,
    /// Source of the map, for messages and metadata: a path, or `constant`, `court`, `sky`, `daylight`.
    pub source: String,
}

impl EnvironmentMap {
    /// Radiance in every direction, if it is the same in all.
    pub fn uniform_radiance(&self) -> Option<Vec3> {
        let first = *self.texels.first()?;
        self.texels.par_iter().all(|texel| *texel == first).then_some(first)
    }

    /// True if no light comes from anywhere.
    pub fn is_black(&self) -> bool {
        self.texels.par_iter().all(|texel| *texel == Vec3::ZERO)
    }

    /// Map of `radiance` times `scale` in every direction.
    ///
    /// # Errors
    /// Returns a message if the product is negative, infinite (above [`MAX_RADIANCE`]) or NaN.
    pub fn constant(radiance: Vec3, scale: f32) -> Result<Self, String> {
        let scaled = (radiance * scale).to_array();
        if !scaled.iter().all(|value| (0.0..=MAX_RADIANCE).contains(value)) {
            return Err(format!(
                "constant = {radiance} with scale = {scale}; expected numbers from 0 to \
                 {MAX_RADIANCE:e}"
            ));
        }
        // Use rows so low that the sampling density, which follows sin θ only from row to row, is
        // nearly uniform.
        Ok(Self::procedural("constant", 64, vec![radiance; 64 * 32], scale))
    }

    /// The same map with another rotation about +Y, degrees, counter-clockwise seen from above.
    pub fn turned(self, rotation_deg: f32) -> Self {
        Self { rotation_rad: rotation_deg.rem_euclid(360.0).to_radians(), ..self }
    }

    /// Rotates a direction from the world into the frame of the map.
    fn map_from_world(&self, direction: Vec3) -> Vec3 {
        let (s, c) = self.rotation_rad.sin_cos();
        Vec3::new(c * direction.x - s * direction.z, direction.y, s * direction.x + c * direction.z)
    }

    /// Finds the cell that contains a unit direction: its column, its row, and the position inside
    /// it. Twin of `environment_locate`.
    ///
    /// Row `j` of cells lies between texel rows `j - 1` and `j`, so that the first and last rows are
    /// half cells. Column `i` lies between texel columns `i` and `i + 1`, wrapping.
    pub fn locate(&self, direction: Vec3) -> (u32, u32, Vec2) {
        let uv = lat_long_from_direction(self.map_from_world(direction));
        let x = uv.x * self.width as f32 - 0.5;
        let y = uv.y * self.height as f32 + 0.5;
        let column = if x < 0.0 { self.width - 1 } else { (x.floor() as u32).min(self.width - 1) };
        let row = (y.floor() as u32).min(self.height);
        (column, row, Vec2::new(x - x.floor(), y - y.floor()))
    }

    /// Radiance from a unit direction: bilinear between texel centres, wrapping in u, clamped in v.
    /// Twin of `environment_radiance`.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let (column, row, position) = self.locate(direction);
        let next_column = if column + 1 == self.width { 0 } else { column + 1 };
        let along = |row: u32| {
            let texel = |column| self.texels[row as usize * self.width as usize + column as usize];
            texel(column).lerp(texel(next_column), position.x)
        };
        along(row.saturating_sub(1)).lerp(along(row.min(self.height - 1)), position.y)
    }

    /// Builds the map named `source` from its texels before scaling.
    fn procedural(source: &str, width: u32, mut texels: Vec<Vec3>, scale: f32) -> Self {
        texels.par_iter_mut().for_each(|texel| *texel *= scale);
        Self { width, height: width / 2, texels, rotation_rad: 0.0, source: source.into() }
    }
}

/// Rejects an impossible width of a procedural map.
fn check_width(width: u32) -> Result<(), String> {
    if !(16..=16384).contains(&width) || width % 2 == 1 {
        return Err(format!("width = {width}; expected an even number of texels, 16…16384"));
    }
    Ok(())
}

/// Rejects a parameter outside `least`…`most`.
fn check_range(name: &str, value: f32, least: f32, most: f32) -> Result<(), String> {
    if !(least..=most).contains(&value) {
        return Err(format!("{name} = {value}; expected {least}…{most}"));
    }
    Ok(())
}

/// Rejects a radiance that is negative, NaN, or too large after scaling.
fn check_radiance(name: &str, radiance: [f32; 3], scale: f32) -> Result<(), String> {
    // Leave room for the factors by which the formulas brighten parts of the map.
    let most = 0.01 * MAX_RADIANCE;
    if radiance
        .iter()
        .any(|value| !(0.0..=most).contains(value) || !(0.0..=most).contains(&(value * scale)))
    {
        return Err(format!(
            "{name} = {radiance:?} with scale = {scale}; expected numbers from 0 to {most:e}"
        ));
    }
    Ok(())
}

/// Direction at texel coordinates (column, row) of a map `width` wide.
fn texel_direction(width: u32, column: f32, row: f32) -> Vec3 {
    direction_from_lat_long(Vec2::new(column / width as f32, row / (width / 2) as f32))
}

/// Averages `radiance` over `grid`² directions per texel.
fn render(width: u32, grid: usize, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Vec<Vec3> {
    let mut texels = vec![Vec3::ZERO; (width * (width / 2)) as usize];
    texels.par_chunks_mut(width as usize).enumerate().for_each(|(row, texels)| {
        for (column, texel) in texels.iter_mut().enumerate() {
            let sum: Vec3 = (0..grid * grid)
                .map(|sample| {
                    let x = ((sample % grid) as f32 + 0.5) / grid as f32;
                    let y = ((sample / grid) as f32 + 0.5) / grid as f32;
                    radiance(texel_direction(width, column as f32 + x, row as f32 + y))
                })
                .sum();
            *texel = sum / (grid * grid) as f32;
        }
    });
    texels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::frame::lat_long_from_direction;

    /// The mean of u·v is the product of their means if samples fill the square, and not on its diagonal.
    #[test]
    fn samples_fill_their_texel() {
        let texels = render(2, 2, |direction| {
            let Vec2 { x, y } = lat_long_from_direction(direction);
            Vec3::new(x, y, x * y)
        });
        assert!(texels[0].abs_diff_eq(Vec3::new(0.25, 0.5, 0.125), 1e-5), "{}", texels[0]);
    }
}
