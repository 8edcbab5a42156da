//! A clear sky with a sun, computed from a few parameters.

use glam::Vec3;
use rayon::prelude::*;
use serde::Deserialize;

use super::{EnvironmentMap, check_radiance, check_range, check_width, render, texel_direction};
use crate::math::frame::{lat_long_from_direction, sin_cos_pi};

/// Clear sky with a sun disc above a uniform ground.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SkyParameters {
    /// Width of the map in texels, even, 16…16384; the height is half of it.
    pub width: u32,
    /// Radiance at the zenith.
    pub zenith: [f32; 3],
    /// Radiance at the horizon.
    pub horizon: [f32; 3],
    /// Radiance of the ground; fades into `horizon` over the 2° just below the horizon.
    pub ground: [f32; 3],
    /// Height of the sun's centre above the horizon, degrees, 0…90.
    pub sun_elevation_deg: f32,
    /// Azimuth of the sun, degrees from −Z toward +X.
    pub sun_azimuth_deg: f32,
    /// Angular radius of the sun disc, degrees, above 0 and at most 45.
    pub sun_radius_deg: f32,
    /// Radiance of the sun disc.
    pub sun_radiance: [f32; 3],
}

impl Default for SkyParameters {
    fn default() -> Self {
        Self {
            width: 2048,
            zenith: [0.15, 0.32, 0.75],
            horizon: [0.75, 0.88, 1.0],
            ground: [0.18, 0.16, 0.13],
            sun_elevation_deg: 40.0,
            sun_azimuth_deg: 50.0,
            sun_radius_deg: 0.27,
            sun_radiance: [8.0e4, 7.4e4, 6.2e4],
        }
    }
}

/// Points along each side of a texel that are tested against the sun disc.
const SUN_GRID: usize = 16;

impl EnvironmentMap {
    /// Renders the map of `parameters`, radiance times `scale`.
    ///
    /// The sun's texels hold the power of its disc at any resolution: a texel larger than the disc
    /// is darker than `sun_radiance`.
    ///
    /// # Errors
    /// Returns a message that names the parameter, its value and the allowed range.
    pub fn sky(parameters: &SkyParameters, scale: f32) -> Result<Self, String> {
        let SkyParameters { sun_elevation_deg, sun_azimuth_deg, sun_radius_deg, .. } = *parameters;
        check_width(parameters.width)?;
        check_radiance("zenith", parameters.zenith, scale)?;
        check_radiance("horizon", parameters.horizon, scale)?;
        check_radiance("ground", parameters.ground, scale)?;
        check_radiance("sun_radiance", parameters.sun_radiance, scale)?;
        check_range("sun_elevation_deg", sun_elevation_deg, 0.0, 90.0)?;
        check_range("sun_azimuth_deg", sun_azimuth_deg, -360.0, 360.0)?;
        check_range("sun_radius_deg", sun_radius_deg, 1e-3, 45.0)?;

        let width = parameters.width;
        let (sin_elevation, cos_elevation) = sun_elevation_deg.to_radians().sin_cos();
        let (sin_azimuth, cos_azimuth) = sun_azimuth_deg.to_radians().sin_cos();
        let sun =
            Vec3::new(cos_elevation * sin_azimuth, sin_elevation, -cos_elevation * cos_azimuth);
        let mut texels = render(width, 1, |direction| sky_radiance(parameters, sun, direction));
        let radius = sun_radius_deg.to_radians();
        add_disc(&mut texels, width, sun, radius, parameters.sun_radiance.into());
        Ok(Self::procedural("sky", width, texels, scale))
    }
}

/// Adds a disc of the angular radius `radius` and a radiance to a map that is `width` wide. A texel holds its
/// share of the disc's power, at any resolution.
pub(super) fn add_disc(texels: &mut [Vec3], width: u32, sun: Vec3, radius: f32, radiance: Vec3) {
    let height = width / 2;
    // Find the share of each texel that the disc covers, then the ratio of the disc's solid
    // angle to the solid angle drawn.
    let cos_reach = (radius + 4.0 * std::f32::consts::PI / width as f32).cos();
    let chord_squared = 4.0 * (0.5 * radius).sin().powi(2);
    let covered: Vec<(usize, f32)> = (0..texels.len())
        .into_par_iter()
        .filter_map(|index| {
            let (column, row) = (index % width as usize, index / width as usize);
            let at = |x: f32, y: f32| texel_direction(width, column as f32 + x, row as f32 + y);
            if at(0.5, 0.5).dot(sun) < cos_reach {
                return None;
            }
            let inside = (0..SUN_GRID * SUN_GRID).filter(|sample| {
                let x = ((sample % SUN_GRID) as f32 + 0.5) / SUN_GRID as f32;
                let y = ((sample / SUN_GRID) as f32 + 0.5) / SUN_GRID as f32;
                at(x, y).distance_squared(sun) <= chord_squared
            });
            let share = inside.count() as f32 / (SUN_GRID * SUN_GRID) as f32;
            (share > 0.0).then_some((index, share))
        })
        .collect();
    let covered = if covered.is_empty() {
        let uv = lat_long_from_direction(sun);
        let column = ((uv.x * width as f32) as u32).min(width - 1);
        let row = ((uv.y * height as f32) as u32).min(height - 1);
        vec![((row * width + column) as usize, 1.0)]
    } else {
        covered
    };
    let solid_angle = |index: usize| {
        let row = (index / width as usize) as f32;
        let edge = |row: f32| sin_cos_pi(row / height as f32).y;
        2.0 * std::f32::consts::PI / width as f32 * (edge(row) - edge(row + 1.0))
    };
    let disc = std::f32::consts::PI * chord_squared;
    let drawn: f32 = covered.iter().map(|&(index, share)| share * solid_angle(index)).sum();
    let scaled = radiance * (disc / drawn);
    for (index, share) in covered {
        texels[index] += scaled * share;
    }
}

/// Radiance of sky and ground without the sun disc.
fn sky_radiance(parameters: &SkyParameters, sun: Vec3, direction: Vec3) -> Vec3 {
    let horizon = Vec3::from(parameters.horizon);
    if direction.y < 0.0 {
        let two_degrees = 0.0349;
        return horizon.lerp(parameters.ground.into(), (-direction.y / two_degrees).min(1.0));
    }
    // The air thickens toward the horizon; a glow of about ten degrees surrounds the sun.
    let height = 1.0 - (1.0 - direction.y).powi(3);
    let sky = horizon.lerp(parameters.zenith.into(), height);
    let angle = 2.0 * (0.5 * direction.distance(sun)).min(1.0).asin();
    sky + horizon * (1.5 * (-angle / 0.17).exp())
}
