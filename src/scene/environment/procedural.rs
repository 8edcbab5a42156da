//! Environment maps that ship with Fenestra, computed from a few parameters.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::Deserialize;

use super::{EnvironmentMap, MAX_RADIANCE, load::check_placement};
use crate::{
    frame::{direction_from_lat_long, lat_long_from_direction, sin_cos_pi},
    random::random_independent_1d,
};

/// A clear sky with a sun disc above a uniform ground.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SkyParameters {
    /// Width of the map in texels, even, 16…16384; the height is half of it.
    pub width: u32,
    /// Radiance straight up.
    pub zenith: [f32; 3],
    /// Radiance at the horizon.
    pub horizon: [f32; 3],
    /// Radiance of the ground straight down; it fades into `horizon` in the last 2° below it.
    pub ground: [f32; 3],
    /// Height of the sun's centre above the horizon, degrees, 0…90.
    pub sun_elevation_deg: f32,
    /// Direction of the sun, degrees clockwise seen from above, from −Z (the middle of the map)
    /// toward +X.
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

/// A narrow courtyard under a bright strip of sky: plastered facades with rows of windows, some of
/// which glint, an arcade at the ground and paving.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CourtParameters {
    /// Width of the map in texels, even, 16…16384; the height is half of it.
    pub width: u32,
    /// Distance between the long facades (along X), metres.
    pub court_width: f32,
    /// Distance between the short facades (along Z), metres.
    pub court_length: f32,
    /// Height of the facades, metres.
    pub facade_height: f32,
    /// Height of the viewpoint above the paving, metres, below `facade_height`.
    pub eye_height: f32,
    /// Storeys above the arcade, 1…20.
    pub storeys: u32,
    /// Distance between neighbouring windows, metres.
    pub window_spacing: f32,
    /// Share of the windows that mirror bright sky, 0…1.
    pub glint_share: f32,
    /// Radiance of such a window.
    pub glint: [f32; 3],
    /// Radiance of the sky straight up; it is brighter toward −Z.
    pub sky: [f32; 3],
    /// Reflectance of the facades, 0…1; a sooty stone is about 0.15.
    pub facade: [f32; 3],
    /// Chooses which windows glint and the irregularities of plaster and paving.
    pub seed: u32,
}

impl Default for CourtParameters {
    fn default() -> Self {
        Self {
            width: 1024,
            court_width: 18.0,
            court_length: 90.0,
            facade_height: 20.0,
            eye_height: 1.7,
            storeys: 3,
            window_spacing: 4.5,
            glint_share: 0.08,
            glint: [48.0, 40.0, 29.0],
            sky: [9.4, 10.0, 10.9],
            facade: [0.16, 0.14, 0.11],
            seed: 1,
        }
    }
}

impl EnvironmentMap {
    /// The map of [`SkyParameters`], its radiance times `scale`, turned by `rotation_deg`.
    ///
    /// The sun's texels hold the power of its disc whatever the resolution: where the disc is smaller
    /// than a texel, the texel is darker than `sun_radiance`.
    ///
    /// # Errors
    /// A message that names the parameter, its value and what is allowed.
    pub fn sky(parameters: &SkyParameters, scale: f32, rotation_deg: f32) -> Result<Self, String> {
        check_placement(scale, rotation_deg)?;
        let SkyParameters { sun_elevation_deg, sun_azimuth_deg, sun_radius_deg, .. } = *parameters;
        check_width(parameters.width)?;
        check_radiance("zenith", parameters.zenith, scale)?;
        check_radiance("horizon", parameters.horizon, scale)?;
        check_radiance("ground", parameters.ground, scale)?;
        check_radiance("sun_radiance", parameters.sun_radiance, scale)?;
        check_range("sun_elevation_deg", sun_elevation_deg, 0.0, 90.0)?;
        check_range("sun_azimuth_deg", sun_azimuth_deg, -360.0, 360.0)?;
        check_range("sun_radius_deg", sun_radius_deg, 1e-3, 45.0)?;

        let (width, height) = (parameters.width, parameters.width / 2);
        let (sin_elevation, cos_elevation) = sun_elevation_deg.to_radians().sin_cos();
        let (sin_azimuth, cos_azimuth) = sun_azimuth_deg.to_radians().sin_cos();
        let sun =
            Vec3::new(cos_elevation * sin_azimuth, sin_elevation, -cos_elevation * cos_azimuth);
        let mut texels = render(width, 1, |direction| sky_radiance(parameters, sun, direction));

        // Share of every texel that the disc covers, then the share of the disc's solid angle that
        // the texels got.
        let radius = sun_radius_deg.to_radians();
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
        let sun_radiance = Vec3::from(parameters.sun_radiance) * (disc / drawn);
        for (index, share) in covered {
            texels[index] += sun_radiance * share;
        }
        Ok(Self::procedural("sky", width, texels, scale, rotation_deg))
    }

    /// The map of [`CourtParameters`], its radiance times `scale`, turned by `rotation_deg`.
    ///
    /// # Errors
    /// A message that names the parameter, its value and what is allowed.
    pub fn court(
        parameters: &CourtParameters,
        scale: f32,
        rotation_deg: f32,
    ) -> Result<Self, String> {
        check_placement(scale, rotation_deg)?;
        check_width(parameters.width)?;
        check_radiance("glint", parameters.glint, scale)?;
        check_radiance("sky", parameters.sky, scale)?;
        for reflectance in parameters.facade {
            check_range("facade", reflectance, 0.0, 1.0)?;
        }
        check_range("court_width", parameters.court_width, 1.0, 1e4)?;
        check_range("court_length", parameters.court_length, 1.0, 1e4)?;
        check_range("facade_height", parameters.facade_height, 1.0, 1e4)?;
        check_range("eye_height", parameters.eye_height, 0.01, 0.99 * parameters.facade_height)?;
        check_range("storeys", parameters.storeys as f32, 1.0, 20.0)?;
        check_range("window_spacing", parameters.window_spacing, 0.5, parameters.court_width)?;
        check_range("glint_share", parameters.glint_share, 0.0, 1.0)?;
        let texels = render(parameters.width, 3, |direction| court_radiance(parameters, direction));
        Ok(Self::procedural("court", parameters.width, texels, scale, rotation_deg))
    }

    fn procedural(
        source: &str,
        width: u32,
        mut texels: Vec<Vec3>,
        scale: f32,
        rotation_deg: f32,
    ) -> Self {
        texels.par_iter_mut().for_each(|texel| *texel *= scale);
        Self {
            width,
            height: width / 2,
            texels,
            rotation_rad: rotation_deg.rem_euclid(360.0).to_radians(),
            source: source.into(),
        }
    }
}

/// Points along each side of a texel at which the sun disc is tested.
const SUN_GRID: usize = 16;

fn check_width(width: u32) -> Result<(), String> {
    if !(16..=16384).contains(&width) || width % 2 == 1 {
        return Err(format!("width = {width}; expected an even number of texels, 16…16384"));
    }
    Ok(())
}

fn check_range(name: &str, value: f32, least: f32, most: f32) -> Result<(), String> {
    if !(least..=most).contains(&value) {
        return Err(format!("{name} = {value}; expected {least}…{most}"));
    }
    Ok(())
}

fn check_radiance(name: &str, radiance: [f32; 3], scale: f32) -> Result<(), String> {
    // Room for the factors by which the formulas brighten parts of the map.
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

/// Means of `radiance` over `grid`² directions per texel.
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

/// Sky and ground of [`SkyParameters`] without the sun disc.
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

/// A number in [0, 1) for a place, as irregularity.
fn irregularity(parameters: &CourtParameters, kind: u32, x: i32, y: i32) -> f32 {
    random_independent_1d(x as u32, y as u32, kind, parameters.seed)
}

/// What the middle of the court sees: the nearest of paving, facades and sky.
fn court_radiance(parameters: &CourtParameters, direction: Vec3) -> Vec3 {
    let (half_width, half_length) = (0.5 * parameters.court_width, 0.5 * parameters.court_length);
    let to_long_facade = half_width / direction.x.abs();
    let to_short_facade = half_length / direction.z.abs();
    let to_facade = to_long_facade.min(to_short_facade);
    if direction.y < 0.0 && parameters.eye_height < to_facade * -direction.y {
        let distance = parameters.eye_height / -direction.y;
        return paving_radiance(parameters, direction.x * distance, direction.z * distance);
    }
    let height = parameters.eye_height + to_facade * direction.y;
    let (along, side) = if to_long_facade < to_short_facade {
        (direction.z * to_facade, if direction.x < 0.0 { 0 } else { 1 })
    } else {
        (direction.x * to_facade, if direction.z < 0.0 { 2 } else { 3 })
    };
    let gateway_half_width = parameters.court_width / 6.0;
    let gateway_height = 0.45 * parameters.facade_height;
    let through_gateway =
        side == 2 && inside_arch(along, height, gateway_half_width, gateway_height);
    if height > parameters.facade_height || through_gateway {
        // Overcast: darker toward the horizon, brighter toward the gateway.
        let overcast = (1.0 + 2.0 * direction.y.max(0.0)) / 3.0;
        return Vec3::from(parameters.sky) * (0.4 + 0.6 * overcast) * (1.0 - 0.3 * direction.z);
    }
    facade_radiance(parameters, side, along, height)
}

/// Whether a point lies under a round arch that stands on the ground around `along` = 0.
fn inside_arch(along: f32, height: f32, half_width: f32, arch_height: f32) -> bool {
    let spring = (arch_height - half_width).max(0.0);
    let rise = (height - spring).max(0.0) * half_width / (arch_height - spring);
    along * along + rise * rise < half_width * half_width
}

/// Radiance of reflected sky for a surface that gets the share `sky_share` of an open sky's
/// irradiance, with a little light from the opposite walls.
fn lit(parameters: &CourtParameters, sky_share: f32) -> Vec3 {
    Vec3::from(parameters.facade) * Vec3::from(parameters.sky) * (0.85 * sky_share + 0.05)
}

/// Slabs with joints, lit by the strip of sky between the long facades.
fn paving_radiance(parameters: &CourtParameters, x: f32, z: f32) -> Vec3 {
    let half_width = 0.5 * parameters.court_width;
    let to_edge = |distance: f32| distance / distance.hypot(parameters.facade_height);
    let sky_share = 0.5 * (to_edge(half_width - x) + to_edge(half_width + x));
    // Half a course off, so that no joint runs through the point below the viewer.
    let z = z + 0.35;
    let course = (z / 0.7).floor();
    let offset = irregularity(parameters, 0, course as i32, 0);
    let slab = (x / 1.1 + offset).floor();
    let shade = 0.75 + 0.35 * irregularity(parameters, 1, slab as i32, course as i32);
    let joint = (x / 1.1 + offset - slab < 0.03) || (z / 0.7 - course < 0.045);
    lit(parameters, sky_share) * shade * if joint { 0.55 } else { 0.8 }
}

/// Arcade, storeys of windows between cornices, eaves.
fn facade_radiance(parameters: &CourtParameters, side: i32, along: f32, height: f32) -> Vec3 {
    // Sky above the opposite roof, for an infinitely long court.
    let depth = parameters.facade_height - height;
    let sky_share = 0.5 * (1.0 - depth / depth.hypot(parameters.court_width));
    let plaster = lit(parameters, sky_share);

    // The arcade is 1.5 storeys high, the frieze under the eaves half of one.
    let storey_height = parameters.facade_height / (parameters.storeys as f32 + 2.0);
    let arcade_height = 1.5 * storey_height;
    let bay = (along / parameters.window_spacing).round();
    let from_axis = along - bay * parameters.window_spacing;
    if height < arcade_height {
        let open =
            inside_arch(from_axis, height, 0.4 * parameters.window_spacing, 0.85 * arcade_height);
        return if open { plaster * 0.12 } else { plaster * 1.05 };
    }
    let from_eaves = depth / storey_height;
    if from_eaves < 0.5 {
        return plaster * if from_eaves < 0.2 { 0.25 } else { 0.9 };
    }
    let storeys_up = (height - arcade_height) / storey_height;
    let storey = storeys_up.floor();
    let in_storey = storeys_up - storey;
    if in_storey < 0.08 {
        return plaster * 1.25;
    }
    if in_storey > 0.96 {
        return plaster * 0.6;
    }
    // Windows: a light surround, two by three panes, the lintel above.
    let across = from_axis.abs() / parameters.window_spacing;
    let up = (in_storey - 0.25) / 0.5;
    if across < 0.15 && (0.0..1.0).contains(&up) {
        let mullion = across < 0.012 || (3.0 * up).fract() < 0.06;
        let window = bay as i32 + 1024 * side;
        let glints = irregularity(parameters, 2, window, storey as i32) < parameters.glint_share;
        return match (mullion, glints) {
            (true, _) => plaster * 0.7,
            (false, true) => parameters.glint.into(),
            (false, false) => {
                let reflection = irregularity(parameters, 3, window, storey as i32);
                plaster * 0.15
                    + Vec3::from(parameters.sky) * (0.004 + 0.05 * reflection * reflection)
            }
        };
    }
    if across < 0.2 && (-0.08..1.12).contains(&up) {
        return plaster * if up > 1.0 { 1.4 } else { 1.2 };
    }
    let stone = irregularity(
        parameters,
        4,
        (along / 0.9).floor() as i32 + 4096 * side,
        (height / 0.45).floor() as i32,
    );
    plaster * (0.9 + 0.2 * stone)
}
