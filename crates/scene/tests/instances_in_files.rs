//! Meshes that files repeat: few uses are placed, many become instances, and those that both files end
//! with have their triangles at the same places. Every format that repeats meshes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fmt::Write, path::Path};

use fenestra_scene::{
    Geometry, Scene,
    instance::{Budget, PLACED_TRIANGLES},
};
use glam::Vec3;

use crate::support::{
    folder::Folder,
    gltf::{base64, floats, png},
};

/// Edges of squares of the repeated mesh, each of two triangles.
const SQUARES: u32 = 24;
const TRIANGLES: usize = 2 * (SQUARES * SQUARES) as usize;
/// Uses that are placed.
const FEW: usize = 6;
/// Uses of which all become instances, or those that come last in a Mitsuba file.
const MANY: usize = PLACED_TRIANGLES / TRIANGLES + 2;
/// Distance of two uses along x, metres; a use is smaller.
const SPACING: f32 = 8.0;

/// A sheet of 1 m × 1 m with bumps: positions and triangles.
fn sheet() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let side = SQUARES + 1;
    let at = |index: u32| index as f32 / SQUARES as f32;
    let positions = (0..side * side)
        .map(|index| {
            let (x, y) = (at(index % side), at(index / side));
            [x, y, 0.1 * (7.0 * x + 3.0 * y * y).sin()]
        })
        .collect();
    let triangles = (0..SQUARES * SQUARES)
        .flat_map(|square| {
            let first = square / SQUARES * side + square % SQUARES;
            [[first, first + 1, first + side], [first + 1, first + side + 1, first + side]]
        })
        .collect();
    (positions, triangles)
}

fn write_ply(folder: &Folder) {
    let (positions, triangles) = sheet();
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty \
         float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        positions.len(),
        triangles.len()
    );
    for [x, y, z] in positions {
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    for [a, b, c] in triangles {
        writeln!(text, "3 {a} {b} {c}").unwrap();
    }
    folder.write("sheet.ply", text);
}

/// Corners of the triangles of the last uses, in the order of the file.
fn last_triangles(scene: &Scene, uses: usize) -> Vec<[Vec3; 3]> {
    let flat = scene.geometry.clone().flattened().unwrap();
    let corner = |index: u32| Vec3::from(flat.positions[index as usize]);
    let last = &flat.triangles[flat.triangles.len() - uses * TRIANGLES..];
    last.iter().map(|triangle| triangle.map(corner)).collect()
}

/// Compares the last uses of a scene with few and of one with many, of which `instances` are not placed.
fn compare_scenes(few: &Scene, many: &Scene, instances: usize) {
    assert!(few.geometry.instances.is_empty(), "few uses are placed");
    assert_eq!(few.geometry.triangles.len(), FEW * TRIANGLES);
    assert_eq!(many.geometry.instances.len(), instances, "of many uses");
    // Mitsuba's have one more for mirror images.
    assert!((1..=2).contains(&many.geometry.prototypes.len()), "of one mesh");
    let uses = instances.min(FEW);
    let (expected, found) = (last_triangles(few, uses), last_triangles(many, uses));
    for (expected, found) in expected.iter().zip(&found) {
        for (expected, found) in expected.iter().zip(found) {
            let error = expected.distance(*found);
            assert!(error < 1e-4, "a corner at {found} instead of {expected}");
        }
    }
    let flat = many.geometry.clone().flattened().unwrap();
    assert!(many.geometry.materials_in_use().eq(flat.materials.iter().copied()));
    let few = &few.geometry;
    assert_eq!(few.materials[0], flat.materials[0]);
    let end = |tangents: &[[f32; 4]]| tangents.last().map(|tangent| tangent.map(f32::round));
    assert_eq!(end(&few.tangents), end(&flat.tangents));
}

/// Loads what `text` gives for few and for many uses, and compares the last uses of both.
fn compare(name: &str, instances: usize, text: impl Fn(usize) -> String) {
    let folder = Folder::new();
    write_ply(&folder);
    let load = |uses: usize| -> Scene {
        let path = folder.write(name, text(uses));
        Scene::load(&path).unwrap_or_else(|error| panic!("{error}"))
    };
    compare_scenes(&load(FEW), &load(MANY), instances);
}

/// Angle of a use, degrees, and the sign of its x axis: every second one is a mirror image.
fn turn(index: usize) -> (f32, f32) {
    (17.0 * index as f32, if index % 2 == 1 { -1.0 } else { 1.0 })
}

fn x_of(index: usize) -> f32 {
    index as f32 * SPACING
}

#[test]
fn pbrt_objects() {
    // The world is mirrored unless the camera already is.
    for mirror in ["Scale -1 1 1 ", ""] {
        compare("room.pbrt", MANY, |uses| pbrt_objects_of(mirror, uses));
    }
}

fn pbrt_objects_of(mirror: &str, uses: usize) -> String {
    let mut text = mirror.to_owned()
        + "LookAt 0 0 -5 0 0 0 0 1 0 Camera \"perspective\" WorldBegin\n\
             LightSource \"infinite\" \"rgb L\" [1 1 1]\n\
             ObjectBegin \"sheet\" Scale 1 2 0.5 Shape \"plymesh\" \"string filename\" \"sheet.ply\"\n\
             ObjectEnd\n";
    for index in (0..uses).rev() {
        let (angle, sign) = turn(index);
        writeln!(
            text,
            "AttributeBegin Translate {} 1 0 Rotate {angle} 0 1 0 Scale {sign} 1 1 \
                 ObjectInstance \"sheet\" AttributeEnd",
            x_of(index)
        )
        .unwrap();
    }
    text
}

#[test]
fn small_meshes_are_placed_while_they_fit() {
    let mut budget = Budget::default();
    for (copies, triangles, are_instances) in [
        (1000, 100, false),
        (1 << 20, 100, true),
        (1 << 20, 12, false),
        (1 << 20, 12, true),
        (1 << 20, 3, false),
    ] {
        let found = budget.takes_instances(copies, triangles);
        assert_eq!(found, are_instances, "{copies} × {triangles}");
    }
}

#[test]
fn mitsuba_groups() {
    compare("room.xml", MANY - PLACED_TRIANGLES / TRIANGLES, |uses| {
        let mut text = r#"<scene version="3.0.0"><sensor type="perspective"/>
            <emitter type="constant"/>
            <shape type="shapegroup" id="group"><shape type="ply">
            <string name="filename" value="sheet.ply"/>
            <transform name="to_world"><scale x="1" y="2" z="0.5"/></transform></shape></shape>"#
            .to_owned();
        for index in (0..uses).rev() {
            let (angle, sign) = turn(index);
            writeln!(
                text,
                r#"<shape type="instance"><ref id="group"/><transform name="to_world">
                <scale x="{sign}" y="1" z="1"/><rotate y="1" angle="{angle}"/>
                <translate x="{}" y="1" z="0"/></transform></shape>"#,
                x_of(index)
            )
            .unwrap();
        }
        text + "</scene>"
    });
}

/// A glTF document of the sheet as mesh 0, with further accessors of three floats in `instances`.
fn document(nodes: &str, roots: &str, instances: &[f32], rest: &str) -> String {
    let (positions, triangles) = sheet();
    let corners = positions.concat();
    let mut bytes = floats(&corners);
    let indices = bytes.len();
    bytes.extend(triangles.concat().iter().flat_map(|index| index.to_le_bytes()));
    let shifts = bytes.len();
    bytes.extend(floats(instances));
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [{roots}]}}], "nodes": [{nodes}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 3}}, "indices": 1,
            "material": 0}}]}}],
        "materials": [{{"normalTexture": {{"index": 0}}}}], "textures": [{{"source": 0}}],
        "images": [{{"uri": "data:image/png;base64,{}"}}],
        "accessors": [
          {{"bufferView": 0, "componentType": 5126, "count": {}, "type": "VEC3",
            "min": [0, 0, -1], "max": [1, 1, 1]}},
          {{"bufferView": 1, "componentType": 5125, "count": {}, "type": "SCALAR"}},
          {{"bufferView": 2, "componentType": 5126, "count": {}, "type": "VEC3"}},
          {{"bufferView": 0, "componentType": 5126, "count": {}, "type": "VEC2"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": {indices}, "byteStride": 12}},
          {{"buffer": 0, "byteOffset": {indices}, "byteLength": {}}},
          {{"buffer": 0, "byteOffset": {shifts}, "byteLength": {}}}],
        "buffers": [{{"byteLength": {}, "uri": "data:;base64,{}"}}]{rest}}}"#,
        base64(&png([[128, 128, 255, 255]; 2])),
        positions.len(),
        3 * triangles.len(),
        instances.len() / 3,
        positions.len(),
        shifts - indices,
        bytes.len() - shifts,
        bytes.len(),
        base64(&bytes)
    )
}

/// Two nodes for each use, one inside the other.
fn nested_nodes(uses: usize) -> String {
    let (mut nodes, mut roots) = (Vec::new(), Vec::new());
    for index in (0..uses).rev() {
        let (angle, sign) = turn(index);
        let (sine, cosine) = (0.5 * angle.to_radians()).sin_cos();
        nodes.push(format!(
            r#"{{"children": [{}], "translation": [{}, 1, 0], "rotation": [0, {sine}, 0, {cosine}]}},
            {{"mesh": 0, "scale": [{sign}, 2, 0.5]}}"#,
            nodes.len() * 2 + 1,
            x_of(index)
        ));
        roots.push((nodes.len() * 2 - 2).to_string());
    }
    document(&nodes.join(","), &roots.join(","), &[0.0; 3], "")
}

#[test]
fn gltf_nodes() {
    compare("room.gltf", MANY, nested_nodes);
    // Lights are sampled by their triangles, which instances do not have in the world.
    let lit = nested_nodes(MANY).replace("\"normalT", "\"emissiveFactor\": [1, 1, 1], \"normalT");
    let folder = Folder::new();
    let scene = Scene::load(&folder.write("lit.gltf", lit)).unwrap();
    assert_eq!(
        (scene.geometry.instances.len(), scene.geometry.triangles.len()),
        (0, MANY * TRIANGLES)
    );
}

#[test]
fn gltf_instances_of_a_node() {
    compare("room.gltf", MANY, |uses| {
        let shifts: Vec<f32> = (0..uses).rev().flat_map(|index| [x_of(index), 1.0, 0.0]).collect();
        let node = r#"{"mesh": 0, "scale": [1, -2, 0.5], "extensions": {"EXT_mesh_gpu_instancing":
            {"attributes": {"TRANSLATION": 2}}}}"#;
        let used = r#", "extensionsUsed": ["EXT_mesh_gpu_instancing"]"#;
        document(node, "0", &shifts, used)
    });
}

#[test]
fn included_gltf_nodes() {
    let folder = Folder::new();
    let room = |uses: usize, rest: &str| -> Scene {
        folder.write("nodes.gltf", nested_nodes(uses));
        let text = "[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n\
             vertical_fov_deg = 45\n             [environment]\nconstant = [1, 1, 1]\n\
             [[include]]\nfile = \"nodes.gltf\"\nscale = [1, 2, 1]\nrotate_deg = [30, 0, 0]\n\
             translate = [0, 3, 1]\n";
        let path = folder.write("room.toml", format!("{text}{rest}"));
        Scene::load(Path::new(&path)).unwrap_or_else(|error| panic!("{error}"))
    };
    compare_scenes(&room(FEW, ""), &room(MANY, ""), MANY);
    // In the place of the file's, a material that emits is placed with its triangles.
    let lit = "materials = { \"material 0\" = \"lit\" }\n[[material]]\nname = \"lit\"\n\
               type = \"diffuse\"\nreflectance = [0, 0, 0]\nemission = [1, 1, 1]\n";
    let Geometry { instances, triangles, .. } = room(MANY, lit).geometry;
    assert_eq!((instances.len(), triangles.len()), (0, MANY * TRIANGLES));
}
