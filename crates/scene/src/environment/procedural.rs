//! Parameter checks and antialiased rendering that the procedural maps share.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::{EnvironmentMap, MAX_RADIANCE};
use crate::math::frame::direction_from_lat_long;

impl EnvironmentMap {
    /// Builds the map named `source` from its texels before scaling.
    pub(super) fn procedural(source: &str, width: u32, mut texels: Vec<Vec3>, scale: f32) -> Self {
        texels.par_iter_mut().for_each(|texel| *texel *= scale);
        Self { width, height: width / 2, texels, rotation_rad: 0.0, source: source.into() }
    }
}

/// Rejects an impossible width of a procedural map.
pub(super) fn check_width(width: u32) -> Result<(), String> {
    if !(16..=16384).contains(&width) || width % 2 == 1 {
        return Err(format!("width = {width}; expected an even number of texels, 16…16384"));
    }
    Ok(())
}

/// Rejects a parameter outside `least`…`most`.
pub(super) fn check_range(name: &str, value: f32, least: f32, most: f32) -> Result<(), String> {
    if !(least..=most).contains(&value) {
        return Err(format!("{name} = {value}; expected {least}…{most}"));
    }
    Ok(())
}

/// Rejects a radiance that is negative, NaN, or too large after scaling.
pub(super) fn check_radiance(name: &str, radiance: [f32; 3], scale: f32) -> Result<(), String> {
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
pub(super) fn texel_direction(width: u32, column: f32, row: f32) -> Vec3 {
    direction_from_lat_long(Vec2::new(column / width as f32, row / (width / 2) as f32))
}

/// Averages `radiance` over `grid`² directions per texel.
pub(super) fn render(width: u32, grid: usize, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Vec<Vec3> {
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
