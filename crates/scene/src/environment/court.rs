//! A courtyard or street under a strip of bright sky, computed from a few parameters.

use glam::Vec3;
use serde::Deserialize;

use super::{EnvironmentMap, check_radiance, check_range, check_width, render};
use crate::math::random::random_independent_1d;

/// Narrow courtyard under a bright strip of sky: plastered facades with rows of windows, some of
/// them glinting, an arcade at the ground and paving.
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
    /// Radiance of a glinting window.
    pub glint: [f32; 3],
    /// Radiance of the sky at the zenith; it brightens toward −Z.
    pub sky: [f32; 3],
    /// Reflectance of the facades, 0…1.
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
    /// Renders the map of `parameters`, radiance times `scale`.
    ///
    /// # Errors
    /// Returns a message that names the parameter, its value and the allowed range.
    pub fn court(parameters: &CourtParameters, scale: f32) -> Result<Self, String> {
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
        Ok(Self::procedural("court", parameters.width, texels, scale))
    }
}

/// Random number in [0, 1) per place, for irregularities.
fn irregularity(parameters: &CourtParameters, kind: u32, x: i32, y: i32) -> f32 {
    random_independent_1d(x as u32, y as u32, kind, parameters.seed)
}

/// Radiance at the middle of the court: the nearest of paving, facades and sky.
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

/// Tests whether a point lies under a round arch that stands on the ground around `along` = 0.
fn inside_arch(along: f32, height: f32, half_width: f32, arch_height: f32) -> bool {
    let spring = (arch_height - half_width).max(0.0);
    let rise = (height - spring).max(0.0) * half_width / (arch_height - spring);
    along * along + rise * rise < half_width * half_width
}

/// Radiance that a surface reflects when it receives the share `sky_share` of an open sky's
/// irradiance and a little light from the opposite walls.
fn lit(parameters: &CourtParameters, sky_share: f32) -> Vec3 {
    Vec3::from(parameters.facade) * Vec3::from(parameters.sky) * (0.85 * sky_share + 0.05)
}

/// Radiance of slabs with joints, lit by the strip of sky between the long facades.
fn paving_radiance(parameters: &CourtParameters, x: f32, z: f32) -> Vec3 {
    let half_width = 0.5 * parameters.court_width;
    let to_edge = |distance: f32| distance / distance.hypot(parameters.facade_height);
    let sky_share = 0.5 * (to_edge(half_width - x) + to_edge(half_width + x));
    // Shift by half a course, so that no joint runs through the point below the viewer.
    let z = z + 0.35;
    let course = (z / 0.7).floor();
    let offset = irregularity(parameters, 0, course as i32, 0);
    let slab = (x / 1.1 + offset).floor();
    let shade = 0.75 + 0.35 * irregularity(parameters, 1, slab as i32, course as i32);
    let joint = (x / 1.1 + offset - slab < 0.03) || (z / 0.7 - course < 0.045);
    lit(parameters, sky_share) * shade * if joint { 0.55 } else { 0.8 }
}

/// Radiance of a facade: arcade, storeys of windows between cornices, eaves.
fn facade_radiance(parameters: &CourtParameters, side: i32, along: f32, height: f32) -> Vec3 {
    // Share of the sky above the opposite roof, for an infinitely long court.
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
    // Windows: a light surround, two by three panes, a lintel above.
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
