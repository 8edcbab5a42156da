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
mod images;
mod materials;
mod nodes;

use std::{io::Write, path::Path};

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
use crate::{Scene, files};

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
    let [camera, node] = nodes::camera(&scene.camera, &scene.film, near, &mut warnings);
    let (mut lights, mut nodes) = (Vec::new(), vec![node]);
    for (index, lamp) in scene.lamps.iter().enumerate() {
        let [light, node] = nodes::lamp(lamp, index, &mut warnings);
        lights.push(light);
        nodes.push(node);
    }
    if !lights.is_empty() {
        textures.extensions.insert("KHR_lights_punctual");
    }
    warnings.extend(left_out(scene));
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
