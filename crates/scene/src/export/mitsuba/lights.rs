//! Lamps and the environment.

use glam::Vec3;

use crate::{
    EnvironmentMap, Lamp,
    error::Result,
    export::{folder::Folder, triple},
    lamp::{LampKind, SpotFalloff},
};

/// Returns the emitter of a lamp, and warns where it is not Fenestra's.
pub(super) fn lamp(lamp: &Lamp, warnings: &mut Vec<String>) -> String {
    let colour =
        |name: &str, value| format!("        <rgb name=\"{name}\" value=\"{}\"/>\n", triple(value));
    let point = |name: &str, value: Vec3| {
        let [x, y, z] = value.to_array();
        format!("<{name} x=\"{x}\" y=\"{y}\" z=\"{z}\"/>")
    };
    let (kind, content) = match lamp.kind {
        LampKind::Point { position, intensity } => {
            let place = point("point name=\"position\"", position);
            ("point", format!("        {place}\n{}", colour("intensity", intensity)))
        }
        LampKind::Directional { direction, irradiance } => {
            let along = point("vector name=\"direction\"", direction);
            ("directional", format!("        {along}\n{}", colour("irradiance", irradiance)))
        }
        LampKind::Spot(spot) => {
            if spot.falloff != SpotFalloff::LinearAngle {
                warnings.push(format!(
                    "lamp `{}`: between its two angles Mitsuba's spot falls off in proportion to \
                     the angle, Fenestra's by a smooth curve",
                    lamp.name
                ));
            }
            let target = spot.position.as_dvec3() + spot.direction.as_dvec3();
            let content = format!(
                "        <transform name=\"to_world\">\n            <lookat origin=\"{}\" \
                 target=\"{}, {}, {}\" up=\"{}\"/>\n        </transform>\n{}        \
                 <float name=\"cutoff_angle\" value=\"{}\"/>\n        \
                 <float name=\"beam_width\" value=\"{}\"/>\n",
                triple(spot.position),
                target.x,
                target.y,
                target.z,
                triple(spot.direction.any_orthonormal_vector()),
                colour("intensity", spot.intensity),
                spot.outer_angle_rad.to_degrees(),
                spot.inner_angle_rad.to_degrees()
            );
            ("spot", content)
        }
    };
    format!("    <emitter type=\"{kind}\">\n{content}    </emitter>\n")
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
        return Ok(format!(
            "    <emitter type=\"constant\">\n        <rgb name=\"radiance\" value=\"{}\"/>\n    \
             </emitter>\n",
            triple(radiance)
        ));
    }
    let (width, height) = (map.width as usize, map.height as usize);
    let texel = |column: usize, row: usize| map.texels[row * width + column];
    let file = folder.write_environment([width, 2 * height + 1], |column, row| {
        let [above, below] = [row.saturating_sub(1) / 2, (row / 2).min(height - 1)];
        0.5 * texel(column, above) + 0.5 * texel(column, below)
    })?;
    Ok(format!(
        "    <emitter type=\"envmap\">\n        <string name=\"filename\" value=\"{}\"/>\n        \
         <transform name=\"to_world\">\n            <rotate y=\"1\" angle=\"{}\"/>\n        \
         </transform>\n    </emitter>\n",
        file,
        f64::from(map.rotation_rad).to_degrees() + 180.0
    ))
}
