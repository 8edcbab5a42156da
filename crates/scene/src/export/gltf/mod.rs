//! glTF 2.0: one `.gltf` file, and a folder of the same name beside it with the buffer (`meshes.bin`),
//! images as PNG, and the environment (`environment.exr`), which glTF has no place for.
//!
//! Deviations from Fenestra's own picture, each a warning where it applies: plastics and metals of a
//! refractive index follow Schlick's approximation, a lens and the box filter are left out, measured
//! materials become diffuse. Further ones are where the warnings are, in `materials` and `nodes`.
//!
//! Light counts as the reader takes it: candela, lux and `emissiveStrength` are radiant intensity,
//! irradiance and radiance, without the factor 683 lm/W.

mod document;
mod materials;

use std::{f32::consts::FRAC_PI_2, io::Write, path::Path};

use glam::{Mat4, Quat, Vec3};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::{Value, json};

use self::{
    document::{Buffer, Textures},
    materials::Translator,
};
use super::{
    Export,
    folder::{ENVIRONMENT, Folder, identifier},
    left_out,
    parts::{self, Parts},
    subject::Subject,
};
use crate::{
    Camera, FilmSettings, Filter, Lamp, Scene, files,
    lamp::{LampKind, SpotFalloff},
};

/// Characters of a name that a URI writes otherwise (RFC 3986).
const IN_URI: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Translates the materials and lamps for a scene file at `path`, without writing anything.
pub fn export<'a>(scene: &'a Scene, path: &Path) -> Export<'a> {
    let folder = Folder::beside(path, str::to_owned);
    let (mut warnings, mut textures) = (Vec::new(), Textures::default());
    let parts = parts::divide(scene);
    let materials = scene.materials.iter().zip(&parts);
    let materials = materials.map(|(material, parts)| {
        let translator = Translator {
            subject: Subject::new("glTF", material, parts, &mut warnings),
            textures: &mut textures,
            members: json!({}),
        };
        translator.translate()
    });
    let materials: Vec<Value> = materials.collect();
    let size = parts::bounds(&parts).map_or(1.0, |[low, high]| low.distance(high));
    let near = 1e-4 * size.max(1e-6);
    let [camera, node] = camera_nodes(&scene.camera, &scene.film, near, &mut warnings);
    let (mut lights, mut nodes) = (Vec::new(), vec![node]);
    for (index, lamp) in scene.lamps.iter().enumerate() {
        let [light, node] = lamp_nodes(lamp, index, &mut warnings);
        lights.push(light);
        nodes.push(node);
    }
    if !lights.is_empty() {
        textures.extensions.insert("KHR_lights_punctual");
    }
    warnings.extend(left_out(scene, path));
    let rotation_deg = scene.environment.rotation_rad.to_degrees();
    warnings.push(format!(
        "environment: glTF has none; render with `--environment {}/{ENVIRONMENT} \
         --rotate-environment {rotation_deg}`",
        folder.name
    ));
    let path = path.to_owned();
    Export::new(warnings, move || {
        let (meshes, buffer) = meshes(scene, &parts);
        let mut nodes = nodes.clone();
        let placed = meshes.iter().enumerate();
        nodes.extend(placed.map(|(index, mesh)| json!({"name": mesh["name"], "mesh": index})));
        let uri_of = |name: &str| format!("{}/{name}", utf8_percent_encode(&folder.name, IN_URI));
        let version = env!("CARGO_PKG_VERSION");
        let mut document = json!({
            "asset": {"version": "2.0", "generator": format!("Fenestra {version}")},
            "extensionsUsed": textures.extensions,
            "scene": 0,
            "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
            "nodes": nodes,
            "cameras": [camera],
            "meshes": meshes,
            "materials": materials,
            "accessors": buffer.accessors,
            "bufferViews": buffer.views,
            "images": textures.images(uri_of),
            "samplers": textures.samplers,
            "textures": textures.textures,
        });
        if !buffer.bytes.is_empty() {
            let name = "meshes.bin";
            document["buffers"] = json!([{"uri": uri_of(name), "byteLength": buffer.bytes.len()}]);
            files::write_atomically(&folder.path.join(name), |file| file.write_all(&buffer.bytes))?;
        }
        if !lights.is_empty() {
            document["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
        }
        // glTF has no empty lists.
        if let Some(members) = document.as_object_mut() {
            members.retain(|_, value| *value != json!([]));
        }
        textures.write(&folder.path)?;
        // As it is, before its rotation
        let map = &scene.environment;
        let (width, height) = (map.width as usize, map.height as usize);
        folder.write_environment([width, height], |x, y| map.texels[y * width + x])?;
        files::write_json(&path, &document)
    })
}

/// Meshes of all materials, one for each of their parts, and the buffer of their vertices.
fn meshes(scene: &Scene, parts: &[Parts]) -> (Vec<Value>, Buffer) {
    let (mut meshes, mut buffer) = (Vec::new(), Buffer::default());
    for (index, parts) in parts.iter().enumerate() {
        let material = &scene.materials[index];
        let surface = &material.surface;
        for (part, is_flat) in parts.each() {
            let framed = surface.normal.as_ref().map(|used| part.with_frames(used));
            let part = framed.as_ref().unwrap_or(part);
            let mut primitive = buffer.primitive(part, is_flat, surface);
            primitive["material"] = index.into();
            let name = identifier(index, &material.name);
            meshes.push(json!({"name": name, "primitives": [primitive]}));
        }
    }
    (meshes, buffer)
}

/// Returns the camera of a film, and its node; warns of what glTF's has not. `near` is the distance of
/// its near plane, metres.
fn camera_nodes(
    camera: &Camera,
    film: &FilmSettings,
    near: f32,
    warnings: &mut Vec<String>,
) -> [Value; 2] {
    if camera.aperture_radius > 0.0 {
        warnings.push("camera: glTF has no lens; all distances are in focus".to_owned());
    }
    if camera.shift != [0.0; 2] {
        warnings
            .push("camera: glTF shifts no lens; the view axis meets the image's centre".to_owned());
    }
    if camera.mirrored {
        warnings.push("camera: glTF mirrors no picture".to_owned());
    }
    if film.filter == Filter::Box {
        warnings.push("film: glTF has no filter; readers do not take the box".to_owned());
    }
    let [_, up, forward] = camera.axes();
    let axes = [forward.cross(up), up, -forward].map(|axis| axis.extend(0.0));
    let matrix = Mat4::from_cols(axes[0], axes[1], axes[2], camera.position.extend(1.0));
    let lens = json!({"type": "perspective", "name": "camera", "perspective": {
        "yfov": camera.vertical_fov_deg.to_radians(),
        "aspectRatio": f64::from(film.width) / f64::from(film.height), "znear": near}});
    [lens, json!({"name": "camera", "camera": 0, "matrix": matrix.to_cols_array()})]
}

/// Returns a light and its node, which names it as `index`.
fn lamp_nodes(lamp: &Lamp, index: usize, warnings: &mut Vec<String>) -> [Value; 2] {
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
