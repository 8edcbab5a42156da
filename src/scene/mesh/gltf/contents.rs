//! Materials, cameras and instances of a glTF file, and all that the file holds besides.

use glam::{Mat4, Quat, Vec3};
use gltf::{
    Document, Material, Node,
    camera::Projection,
    material::AlphaMode,
    mesh::{Mode, Semantic},
};
use serde_json::Value;

use super::GltfReader;
use crate::{
    error::Result,
    scene::{
        features::{self, Feature, Ignored, Support},
        mesh::{MeshCamera, MeshMaterial, MeshSurface, Perspective},
    },
};

/// Factor from which a surface is a metal; Fenestra has no mixture of metal and plastic.
const METAL: f32 = 0.5;

/// Parts of the document with extensions that belong to no material, node or mesh.
const OTHER_PARTS: [&str; 10] = [
    "accessors",
    "animations",
    "bufferViews",
    "buffers",
    "cameras",
    "images",
    "samplers",
    "scenes",
    "skins",
    "textures",
];

/// Label of a part in warnings.
fn label(part: &str, index: usize, name: Option<&str>) -> String {
    name.map_or_else(|| format!("{part} {index}"), |name| format!("{part} `{name}`"))
}

/// Counts an extension, unless it is done.
fn ignore_extension(ignored: &mut Ignored, extension: &str, place: impl FnOnce() -> String) {
    let name = format!("`{extension}`");
    let known: Option<&Feature> = features::GLTF.iter().find(|feature| feature.name == name);
    match known.map(|feature| (feature, feature.support)) {
        Some((_, Support::Done | Support::Mapped)) => {}
        Some((&feature, Support::Ignored)) => ignored.add(feature, place),
        _ => ignored.add_named(features::GLTF_EXTENSION, &format!("extension {name}"), place),
    }
}

/// Calls `found` with every extension in a part of the document, at any depth.
fn for_each_extension(value: &Value, found: &mut impl FnMut(&str)) {
    match value {
        Value::Object(members) => {
            for (key, member) in members {
                if key == "extensions" {
                    member.as_object().into_iter().flatten().for_each(|(name, _)| found(name));
                }
                // Extras are free to hold anything.
                if key != "extras" {
                    for_each_extension(member, found);
                }
            }
        }
        Value::Array(elements) => {
            elements.iter().for_each(|element| for_each_extension(element, found));
        }
        _ => {}
    }
}

/// Maps a material to those that exist, and counts what it holds besides.
pub(super) fn material(material: &Material, json: &Value) -> MeshMaterial {
    let index = material.index().unwrap_or_default();
    let json = &json["materials"][index];
    let mut ignored = Ignored::default();
    let place = || label("material", index, material.name());
    let factors = material.pbr_metallic_roughness();
    let parts = [
        (factors.base_color_texture().is_some(), features::GLTF_BASE_TEXTURE),
        (factors.metallic_roughness_texture().is_some(), features::GLTF_METAL_TEXTURE),
        (material.normal_texture().is_some(), features::GLTF_NORMAL_TEXTURE),
        (material.occlusion_texture().is_some(), features::GLTF_OCCLUSION_TEXTURE),
        (material.emissive_texture().is_some(), features::GLTF_EMISSIVE_TEXTURE),
        (material.emissive_factor() != [0.0; 3], features::GLTF_EMISSIVE),
        (material.alpha_mode() == AlphaMode::Mask, features::GLTF_MASK),
        (material.alpha_mode() == AlphaMode::Blend, features::GLTF_BLEND),
    ];
    for (_, feature) in parts.into_iter().filter(|(is_there, _)| *is_there) {
        ignored.add(feature, place);
    }
    for_each_extension(json, &mut |name| ignore_extension(&mut ignored, name, place));

    let [red, green, blue, _] = factors.base_color_factor();
    let base_color = [red, green, blue].map(|channel| channel.clamp(0.0, 1.0));
    let (metallic, roughness) = (factors.metallic_factor(), factors.roughness_factor());
    let alpha = roughness * roughness;
    let surface = if metallic >= METAL {
        MeshSurface::Conductor { reflectance: base_color, alpha }
    } else {
        let ior = json["extensions"]["KHR_materials_ior"]["ior"].as_f64().unwrap_or(1.5) as f32;
        let diffuse = base_color.map(|channel| channel * (1.0 - metallic.max(0.0)));
        MeshSurface::Plastic { diffuse, alpha, ior }
    };
    MeshMaterial {
        name: material.name().unwrap_or_default().to_owned(),
        base_color,
        surface,
        ignored,
    }
}

impl GltfReader<'_> {
    /// Counts the parts of the document that belong to no node.
    pub(super) fn ignore_contents(&mut self, document: &Document, json: &Value) {
        let ignored = &mut self.ignored;
        for animation in document.animations() {
            let place = || label("animation", animation.index(), animation.name());
            ignored.add(features::GLTF_ANIMATION, place);
        }
        for scene in document.scenes().skip(1) {
            ignored.add(features::GLTF_SCENES, || label("scene", scene.index(), scene.name()));
        }
        for part in OTHER_PARTS {
            for (index, value) in json[part].as_array().into_iter().flatten().enumerate() {
                let place = || format!("{part} {index}");
                for_each_extension(value, &mut |name| ignore_extension(ignored, name, place));
            }
        }
        for (name, _) in json["extensions"].as_object().into_iter().flatten() {
            // Nodes name the lights that they place, primitives their variants.
            if !["KHR_lights_punctual", "KHR_materials_variants"].contains(&name.as_str()) {
                ignore_extension(ignored, name, || "the document".to_owned());
            }
        }
    }

    /// Keeps the camera of a node; counts its lights, skin and other extensions.
    pub(super) fn read_node(&mut self, node: &Node, world_from_node: Mat4, json: &Value) {
        let place = || label("node", node.index(), node.name());
        if let Some(camera) = node.camera() {
            let names = [camera.name(), node.name()].into_iter().flatten().map(str::to_owned);
            let perspective = match camera.projection() {
                Projection::Perspective(lens) => Some(Perspective {
                    vertical_fov_rad: lens.yfov(),
                    aspect_ratio: lens.aspect_ratio(),
                }),
                Projection::Orthographic(_) => None,
            };
            let names = names.collect();
            let found = MeshCamera { names, world_from_camera: world_from_node, perspective };
            self.cameras.push((camera.index(), found));
        }
        if node.skin().is_some() {
            self.ignored.add(features::GLTF_SKIN, place);
        }
        let json = &json["nodes"][node.index()];
        for_each_extension(json, &mut |name| ignore_extension(&mut self.ignored, name, place));
    }

    /// Counts what the primitives of a mesh hold besides triangles.
    pub(super) fn ignore_in_mesh(&mut self, mesh: &gltf::Mesh, json: &Value) {
        let place = || label("mesh", mesh.index(), mesh.name());
        let ignored = &mut self.ignored;
        for primitive in mesh.primitives() {
            if !matches!(
                primitive.mode(),
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
            ) {
                ignored.add(features::GLTF_POINTS, place);
                continue;
            }
            if primitive.morph_targets().next().is_some() {
                ignored.add(features::GLTF_MORPH, place);
            }
            for (semantic, _) in primitive.attributes() {
                match semantic {
                    Semantic::Colors(_) => ignored.add(features::GLTF_COLOR, place),
                    Semantic::TexCoords(1..) => ignored.add(features::GLTF_UV, place),
                    _ => {}
                }
            }
        }
        let json = &json["meshes"][mesh.index()];
        for_each_extension(json, &mut |name| ignore_extension(ignored, name, place));
    }

    /// Placements of a node's mesh: its own, or those of `EXT_mesh_gpu_instancing`.
    pub(super) fn instances(
        &self,
        document: &Document,
        node: &Node,
        world_from_node: Mat4,
        json: &Value,
    ) -> Result<Vec<Mat4>> {
        let instancing = &json["nodes"][node.index()]["extensions"]["EXT_mesh_gpu_instancing"];
        if instancing.is_null() {
            return Ok(vec![world_from_node]);
        }
        let accessor = |name: &str| match &instancing["attributes"][name] {
            Value::Null => Ok(None),
            index => index
                .as_u64()
                .and_then(|index| document.accessors().nth(usize::try_from(index).ok()?))
                .map(Some)
                .ok_or_else(|| {
                    let node = label("node", node.index(), node.name());
                    self.error(format!("{node}: EXT_mesh_gpu_instancing has no accessor {index}"))
                }),
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
            let node = label("node", node.index(), node.name());
            return Err(self.error(format!(
                "{node}: the attributes of EXT_mesh_gpu_instancing differ in length"
            )));
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
