//! Lamps and the environment.

use glam::{DVec3, Vec3};

use super::models::{indented, property, rgb};
use crate::{
    EnvironmentMap, Lamp,
    error::Result,
    export::{folder::Folder, triple},
    lamp::{LampKind, SpotFalloff},
};

/// Returns the emitter of a lamp, and warns where it is not Fenestra's.
pub(super) fn lamp(lamp: &Lamp, warnings: &mut Vec<String>) -> String {
    let point = |tag: &str, name: &str, value: Vec3| {
        let [x, y, z] = value.to_array();
        format!("    <{tag} name=\"{name}\" x=\"{x}\" y=\"{y}\" z=\"{z}\"/>\n")
    };
    match lamp.kind {
        LampKind::Point { position, intensity } => {
            emitter("point", &(point("point", "position", position) + &rgb("intensity", intensity)))
        }
        LampKind::Directional { direction, irradiance } => {
            let along = point("vector", "direction", direction);
            emitter("directional", &(along + &rgb("irradiance", irradiance)))
        }
        LampKind::Spot(spot) => {
            if spot.falloff != SpotFalloff::LinearAngle {
                warnings.push(format!(
                    "lamp `{}`: between its two angles Mitsuba's spot falls off in proportion to \
                     the angle, Fenestra's by a smooth curve",
                    lamp.name
                ));
            }
            let DVec3 { x, y, z } = spot.position.as_dvec3() + spot.direction.as_dvec3();
            let [origin, up] = [spot.position, spot.direction.any_orthonormal_vector()].map(triple);
            let place = format!(
                "    <transform name=\"to_world\">\n        <lookat origin=\"{origin}\" \
                 target=\"{x}, {y}, {z}\" up=\"{up}\"/>\n    </transform>\n"
            );
            let angles = [
                property("float", "cutoff_angle", spot.outer_angle_rad.to_degrees()),
                property("float", "beam_width", spot.inner_angle_rad.to_degrees()),
            ];
            emitter("spot", &(place + &rgb("intensity", spot.intensity) + &angles.concat()))
        }
    }
}

fn emitter(kind: &str, content: &str) -> String {
    indented(&format!("<emitter type=\"{kind}\">\n{content}</emitter>\n"))
}

/// Writes the environment into `folder` and returns its emitter; black ones need none.
///
/// Mitsuba's texel columns have centres at (i + ½)/width as Fenestra's, but its rows lie at
/// j/(height − 1), on the poles too. A map of 2·height + 1 rows holds Fenestra's bilinear function
/// exactly: odd rows are the texels, even ones the means of their neighbours. Mitsuba's middle looks
/// along +Z, Fenestra's along −Z: half a turn.
pub(super) fn write_environment(map: &EnvironmentMap, folder: &Folder) -> Result<String> {
    if map.is_black() {
        return Ok(String::new());
    }
    if let Some(radiance) = map.uniform_radiance() {
        return Ok(emitter("constant", &rgb("radiance", radiance)));
    }
    let (width, height) = (map.width as usize, map.height as usize);
    let texel = |column: usize, row: usize| map.texels[row * width + column];
    let file = folder.write_environment([width, 2 * height + 1], |column, row| {
        let [above, below] = [row.saturating_sub(1) / 2, (row / 2).min(height - 1)];
        0.5 * texel(column, above) + 0.5 * texel(column, below)
    })?;
    let turn = f64::from(map.rotation_rad).to_degrees() + 180.0;
    let place = format!(
        "    <transform name=\"to_world\">\n        <rotate y=\"1\" angle=\"{turn}\"/>\n    </transform>\n"
    );
    Ok(emitter("envmap", &(property("string", "filename", file) + &place)))
}
