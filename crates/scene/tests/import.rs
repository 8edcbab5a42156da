//! Real glTF and OBJ files of others: run where the folder is present, by `FENESTRA_IMPORT` or
//! `../shared/import`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::path::{Path, PathBuf};

use fenestra_scene::{
    Scene,
    material::{Material, MaterialKind},
    mesh::Mesh,
};
use glam::{Vec3, Vec4};

/// Folder of the files; none if this machine has none.
fn folder() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/import");
    let folder = std::env::var_os("FENESTRA_IMPORT").map_or(beside, PathBuf::from);
    folder.is_dir().then_some(folder)
}

#[test]
fn files_of_others_load_with_all_their_parts() {
    let Some(folder) = folder() else { return };
    let mut faults = Vec::new();
    for (path, counts, expected) in EXPECTED {
        let scene = Scene::load(&folder.join(path)).unwrap();
        let geometry = &scene.geometry;
        let warnings: Vec<_> = scene
            .warnings
            .iter()
            .filter(|text| !text.contains("no --environment") && !text.contains("no perspective"))
            .collect();
        let uses = scene.materials.iter().map(|material| material.surface.textures().count()).sum();
        let found = [geometry.triangles.len(), scene.materials.len(), uses];
        let is_named = warnings.len() == expected.len()
            && expected.iter().all(|part| warnings.iter().any(|text| text.contains(part)));
        if found != *counts || !is_named {
            faults.push(format!("{path}: {found:?} {warnings:#?}"));
        }
        let has_normal_map =
            scene.materials.iter().any(|material| material.surface.normal.is_some());
        if has_normal_map && geometry.tangents.is_empty() {
            faults.push(format!("{path}: no tangents"));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn surfaces_of_others_are_of_the_right_kind() {
    let Some(folder) = folder() else { return };
    let load = |path: &str| Scene::load(&folder.join(path)).unwrap().materials;
    let tree = load("obj/bonsai-tree/bonsai-tree.obj");
    let leaves = tree.iter().filter(|material| material.surface.opacity.texture.is_some());
    assert_eq!(leaves.count(), 1, "leaves are cut out by their image");
    let aquarium = load("obj/aquarium/aquarium.obj");
    let is_pane =
        |material: &&Material| matches!(material.kind, MaterialKind::ThinDielectric { .. });
    assert_eq!(aquarium.iter().filter(is_pane).count(), 2, "glass and water");
    let spheres = load("gltf/TransmissionRoughnessTest/TransmissionRoughnessTest.glb");
    let is_solid = |material: &&Material| matches!(material.kind, MaterialKind::Dielectric { .. });
    assert!(spheres.iter().filter(is_solid).count() >= 5, "{spheres:?}");
    let gallery = load("gltf_scenes/virtual_gallery/scene.gltf");
    let emitters = gallery.iter().filter(|material| material.surface.emission.is_some());
    assert_eq!(emitters.count(), 1);
    let glass = gallery.iter().find(|material| material.name == "Glass").unwrap();
    assert!((glass.surface.opacity.factor - 0.309).abs() < 1e-3);
}

/// MikkTSpace with the sign for v downwards, as the makers of glTF export it.
#[test]
fn tangents_agree_with_those_of_an_exporter() {
    let Some(folder) = folder() else { return };
    let name = "AlphaBlendModeTest";
    let mut bytes = std::fs::read(folder.join(format!("gltf/{name}/{name}.glb"))).unwrap();
    let copy = tempfile::TempDir::new().unwrap();
    let path = copy.path().join("a.glb");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Mesh::read(&path, &mut Vec::new()).unwrap()
    };
    let stored = read(&bytes);
    for start in 0..bytes.len() - 9 {
        if &bytes[start..start + 9] == b"\"TANGENT\"" {
            bytes[start + 1] = b'_';
        }
    }
    let found = read(&bytes);
    assert_eq!(found.triangles.len(), stored.triangles.len());
    let (mut count, mut agree) = (0, 0);
    for (one, other) in found.triangles.iter().zip(&stored.triangles) {
        for (one, other) in one.iter().zip(other) {
            let Some(&one) = found.tangents.get(*one as usize) else { continue };
            let (one, other) = (Vec4::from(one), Vec4::from(stored.tangents[*other as usize]));
            if one.truncate() != Vec3::ZERO {
                count += 1;
                let is_near = one.truncate().dot(other.truncate()) > 0.99;
                agree += usize::from(is_near && one.w == other.w);
            }
        }
    }
    assert!(count > 50 && agree == count, "{agree} of {count}");
}

/// Files with the counts that others have found in them, of triangles, materials and uses of textures, and
/// parts of the warnings beside those on environment and camera.
const EXPECTED: &[(&str, [usize; 3], &[&str])] = &[
    ("gltf/AlphaBlendModeTest/AlphaBlendModeTest.glb", [61, 6, 13], &[]),
    ("gltf/Cameras/Cameras.gltf", [2, 1, 0], &["orthographic cameras"]),
    ("gltf/ClearCoatTest/ClearCoatTest.glb", [37116, 19, 11], &["`KHR_materials_clearcoat`"]),
    ("gltf/EmissiveStrengthTest/EmissiveStrengthTest.glb", [90, 6, 1], &[]),
    (
        "gltf/MetalRoughSpheresNoTextures/MetalRoughSpheresNoTextures.glb",
        [1040213, 99, 0],
        &["dropped 196 triangles of zero area"],
    ),
    ("gltf/NegativeScaleTest/NegativeScaleTest.glb", [7724, 6, 2], &[]),
    ("gltf/NormalTangentTest/NormalTangentTest.glb", [7774, 1, 4], &[]),
    ("gltf/OrientationTest/OrientationTest.glb", [524, 7, 0], &[]),
    ("gltf/SimpleInstancing/SimpleInstancing.glb", [1500, 1, 0], &[]),
    ("gltf/SimpleSparseAccessor/SimpleSparseAccessor.gltf", [12, 1, 0], &[]),
    ("gltf/TextureEncodingTest/TextureEncodingTest.glb", [3844, 14, 18], &[]),
    ("gltf/TextureSettingsTest/TextureSettingsTest.glb", [72, 10, 9], &[]),
    ("gltf/TextureTransformTest/TextureTransformTest.gltf", [24, 9, 9], &[]),
    ("gltf/TransmissionRoughnessTest/TransmissionRoughnessTest.glb", [77792, 9, 10], &[]),
    ("gltf/UnlitTest/UnlitTest.glb", [88, 2, 0], &[]),
    ("gltf/VertexColorTest/VertexColorTest.glb", [36, 2, 2], &[]),
    (
        "gltf_scenes/low_poly_mini_village/scene.gltf",
        [46486, 4, 5],
        &["dropped 92 triangles of zero area"],
    ),
    (
        "gltf_scenes/virtual_gallery/scene.gltf",
        [27126, 7, 10],
        &["third and further sets of texture coordinates", "textures of `KHR_materials_specular`"],
    ),
    (
        "obj/aquarium/aquarium.obj",
        [5622, 9, 4],
        &["`Ka` other than black", "colour and strength of `Ks`"],
    ),
    (
        "obj/bonsai-tree/bonsai-tree.obj",
        [8128, 4, 4],
        &["smoothing groups", "`Ka` other than black", "colour and strength of `Ks`"],
    ),
    (
        "obj/full-bookcase/full-bookcase.obj",
        [2328, 5, 4],
        &["dropped 20 triangles of zero area", "colour and strength of `Ks`"],
    ),
];
