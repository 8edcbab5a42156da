//! Nodes of the camera and of lamps (`KHR_lights_punctual`).

use std::f32::consts::FRAC_PI_2;

use glam::{Mat4, Quat, Vec3};
use serde_json::{Value, json};

use crate::{
    Camera, FilmSettings, Filter, Lamp,
    lamp::{LampKind, SpotFalloff},
};

/// Returns the camera of a film, and its node; warns of what glTF's has not. `near` is the distance of
/// its near plane, metres.
pub(super) fn camera(
    camera: &Camera,
    film: &FilmSettings,
    near: f32,
    warnings: &mut Vec<String>,
) -> [Value; 2] {
    if camera.aperture_radius > 0.0 {
        warnings.push("camera: glTF has no lens; all distances are in focus".to_owned());
    }
    if film.filter == Filter::Box {
        warnings.push("film: glTF has no filter; readers do not take the box".to_owned());
    }
    let forward = (camera.look_at - camera.position).normalize_or(Vec3::NEG_Z);
    let right = forward.cross(camera.up).try_normalize();
    let right = right.unwrap_or_else(|| forward.any_orthonormal_vector());
    let axes = [right, right.cross(forward), -forward].map(|axis| axis.extend(0.0));
    let matrix = Mat4::from_cols(axes[0], axes[1], axes[2], camera.position.extend(1.0));
    let lens = json!({"type": "perspective", "name": "camera", "perspective": {
        "yfov": camera.vertical_fov_deg.to_radians(),
        "aspectRatio": f64::from(film.width) / f64::from(film.height), "znear": near}});
    [lens, json!({"name": "camera", "camera": 0, "matrix": matrix.to_cols_array()})]
}

/// Returns a light and its node, which names it as `index`.
pub(super) fn lamp(lamp: &Lamp, index: usize, warnings: &mut Vec<String>) -> [Value; 2] {
    let (kind, place, direction, color) = match lamp.kind {
        LampKind::Point { position, intensity } => ("point", position, Vec3::NEG_Z, intensity),
        LampKind::Directional { direction, irradiance } => {
            ("directional", Vec3::ZERO, direction, irradiance)
        }
        LampKind::Spot(spot) => ("spot", spot.position, spot.direction, spot.intensity),
    };
    let intensity = color.max_element();
    let color = if intensity > 0.0 { color / intensity } else { Vec3::ONE };
    let mut light = json!({"type": kind, "color": color.to_array(), "intensity": intensity});
    if !lamp.name.is_empty() {
        light["name"] = lamp.name.clone().into();
    }
    if let LampKind::Spot(spot) = lamp.kind {
        if spot.falloff != SpotFalloff::SquaredCosine {
            warnings.push(format!(
                "lamp `{}`: between its two angles glTF's spot falls off by t², with t linear in the \
                 cosine, Fenestra's by another curve",
                lamp.name
            ));
        }
        if spot.outer_angle_rad > FRAC_PI_2 {
            warnings.push(format!(
                "lamp `{}`: glTF's spots reach to 90°, this one to {:.1}°",
                lamp.name,
                spot.outer_angle_rad.to_degrees()
            ));
        }
        let outer = spot.outer_angle_rad.min(FRAC_PI_2);
        let inner = spot.inner_angle_rad.min(0.999 * outer);
        light["spot"] = json!({"innerConeAngle": inner, "outerConeAngle": outer});
    }
    let turn = Quat::from_rotation_arc(Vec3::NEG_Z, direction.normalize_or(Vec3::NEG_Z));
    let node = json!({"translation": place.to_array(), "rotation": turn.to_array(),
        "extensions": {"KHR_lights_punctual": {"light": index}}});
    [light, node]
}
