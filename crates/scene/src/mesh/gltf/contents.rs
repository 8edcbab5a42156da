//! Cameras and instances of a glTF file, and all that the file holds besides.

use glam::{Mat4, Quat, Vec3};
use gltf::{
    Node,
    camera::Projection,
    mesh::{Mode, Semantic},
};
use serde_json::Value;

use super::{GltfReader, index};
use crate::{
    error::Result,
    features::{self, Ignored},
    import::FAR,
    mesh::{MeshCamera, Perspective, label},
};

/// Parts of the document with extensions that belong to no material, node or mesh.
const OTHER_PARTS: &str =
    "accessors animations bufferViews buffers cameras images samplers scenes skins textures";

/// Factors whose default is 0, without which an extension changes nothing.
const FACTORS: [(&str, &str); 2] = [
    ("KHR_materials_dispersion", "dispersion"),
    ("KHR_materials_iridescence", "iridescenceFactor"),
];

/// Tests for an extension of strength 0, as exporters write it.
fn is_idle(name: &str, extension: &Value) -> bool {
    let factor = FACTORS.iter().find(|(own, _)| *own == name).map(|(_, key)| &extension[key]);
    factor.is_some_and(|factor| match factor {
        Value::Array(channels) => channels.iter().all(|channel| channel.as_f64() == Some(0.0)),
        factor => factor.as_f64().unwrap_or(0.0) == 0.0,
    })
}

/// Counts an extension, unless it is done.
fn ignore_extension(ignored: &mut Ignored, extension: &str, place: impl FnOnce() -> String) {
    if features::GLTF_EXTENSIONS.contains(&extension) {
        return;
    }
    let name = format!("`{extension}`");
    match features::GLTF.iter().find(|feature| feature.name == name) {
        Some(&feature) => ignored.add(feature, place),
        None => ignored.add_named(features::GLTF_EXTENSION, &format!("extension {name}"), place),
    }
}

/// Counts the extensions in a part of the document, at any depth.
pub(super) fn ignore_extensions(ignored: &mut Ignored, part: &Value, place: &impl Fn() -> String) {
    match part {
        Value::Object(members) => {
            for (key, member) in members {
                if key == "extensions" {
                    let extensions = member.as_object().into_iter().flatten();
                    extensions
                        .filter(|(name, extension)| !is_idle(name, extension))
                        .for_each(|(name, _)| ignore_extension(ignored, name, place));
                }
                // Extras are free to hold anything.
                if key != "extras" {
                    ignore_extensions(ignored, member, place);
                }
            }
        }
        Value::Array(elements) => {
            elements.iter().for_each(|element| ignore_extensions(ignored, element, place));
        }
        _ => {}
    }
}

impl GltfReader<'_> {
    /// Counts the parts of the document that belong to no node.
    pub(super) fn ignore_contents(&mut self, stands_still: bool) {
        let Self { document, json, ignored, .. } = self;
        for animation in document.animations().filter(|_| stands_still) {
            let place = || label("animation", animation.index(), animation.name());
            ignored.add(features::GLTF_ANIMATION, place);
        }
        let shown = document.default_scene().map_or(0, |scene| scene.index());
        for scene in document.scenes().filter(|scene| scene.index() != shown) {
            ignored.add(features::GLTF_SCENES, || label("scene", scene.index(), scene.name()));
        }
        for part in OTHER_PARTS.split(' ') {
            for (index, value) in json[part].as_array().into_iter().flatten().enumerate() {
                ignore_extensions(ignored, value, &|| format!("{part} {index}"));
            }
        }
        for (name, _) in json["extensions"].as_object().into_iter().flatten() {
            // Nodes name the lights that they place, primitives their variants.
            if !["KHR_lights_punctual", "KHR_materials_variants"].contains(&name.as_str()) {
                ignore_extension(ignored, name, || "the document".to_owned());
            }
        }
    }

    /// Keeps the camera of a node; counts its other extensions.
    pub(super) fn read_node(&mut self, node: &Node, world_from_node: Mat4) {
        if let Some(camera) = node.camera() {
            let names = [camera.name(), node.name()].into_iter().flatten().map(str::to_owned);
            let far = FAR as f32;
            let (fov, aspect_ratio, back) = match camera.projection() {
                Projection::Perspective(lens) => (lens.yfov(), lens.aspect_ratio(), None),
                Projection::Orthographic(lens) => {
                    let height = 2.0 * lens.ymag().abs();
                    let ratio = lens.xmag() / lens.ymag();
                    (2.0 * (0.5 / far).atan(), Some(ratio), Some(far * height))
                }
            };
            let moved_back = Mat4::from_translation(Vec3::Z * back.unwrap_or(0.0));
            let found = MeshCamera {
                names: names.collect(),
                world_from_camera: world_from_node * moved_back,
                perspective: Perspective { vertical_fov_rad: fov, aspect_ratio },
                is_orthographic: back.is_some(),
            };
            self.cameras.push((camera.index(), found));
        }
        let place = || label("node", node.index(), node.name());
        ignore_extensions(&mut self.ignored, &self.json["nodes"][node.index()], &place);
    }

    /// Counts what the primitives of a mesh hold besides triangles.
    pub(super) fn ignore_in_mesh(&mut self, mesh: &gltf::Mesh) {
        let place = || label("mesh", mesh.index(), mesh.name());
        let (ignored, json) = (&mut self.ignored, &self.json["meshes"][mesh.index()]);
        for primitive in mesh.primitives() {
            if !matches!(
                primitive.mode(),
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
            ) {
                ignored.add(features::GLTF_POINTS, place);
                continue;
            }
            for (semantic, _) in primitive.attributes() {
                match semantic {
                    Semantic::Colors(1..) => ignored.add(features::GLTF_COLORS, place),
                    Semantic::TexCoords(2..) => ignored.add(features::GLTF_UV, place),
                    _ => {}
                }
            }
            let targets = json["primitives"][primitive.index()]["targets"].as_array();
            let moved = targets.into_iter().flatten().filter_map(Value::as_object).flatten();
            for (name, _) in moved {
                if name.starts_with("COLOR_") || name.starts_with("TEXCOORD_") {
                    ignored.add(features::GLTF_MORPH_COLORS, place);
                }
            }
        }
        ignore_extensions(ignored, json, &place);
    }

    /// Placements of a node's mesh: its own, or those of `EXT_mesh_gpu_instancing`.
    pub(super) fn instances(&self, node: &Node, world_from_node: Mat4) -> Result<Vec<Mat4>> {
        let instancing = &self.json["nodes"][node.index()]["extensions"]["EXT_mesh_gpu_instancing"];
        if instancing.is_null() {
            return Ok(vec![world_from_node]);
        }
        let error = |message: String| {
            let node = label("node", node.index(), node.name());
            self.error(format!("{node}: {message}"))
        };
        let accessor = |name: &str| match &instancing["attributes"][name] {
            Value::Null => Ok(None),
            found => {
                let accessor = index(found).and_then(|at| self.document.accessors().nth(at));
                let message = || format!("EXT_mesh_gpu_instancing has no accessor {found}");
                accessor.map(Some).ok_or_else(|| error(message()))
            }
        };
        let vectors = |name| accessor(name)?.map(|found| self.vectors::<3>(&found)).transpose();
        let (shifts, scales) = (vectors("TRANSLATION")?, vectors("SCALE")?);
        let rotations = accessor("ROTATION")?.map(|found| self.vectors::<4>(&found)).transpose()?;
        let lengths = [
            shifts.as_ref().map(Vec::len),
            scales.as_ref().map(Vec::len),
            rotations.as_ref().map(Vec::len),
        ];
        let count = lengths.into_iter().flatten().max().unwrap_or(1);
        if lengths.into_iter().flatten().any(|length| length != count) {
            let message = "the attributes of EXT_mesh_gpu_instancing differ in length";
            return Err(error(message.to_owned()));
        }
        let instance = |index: usize| {
            let shift = shifts.as_ref().map_or(Vec3::ZERO, |shifts| shifts[index].into());
            let scale = scales.as_ref().map_or(Vec3::ONE, |scales| scales[index].into());
            let rotation = rotations
                .as_ref()
                .map_or(Quat::IDENTITY, |rotations| Quat::from_array(rotations[index]).normalize());
            world_from_node * Mat4::from_scale_rotation_translation(scale, rotation, shift)
        };
        Ok((0..count).map(instance).collect())
    }
}
