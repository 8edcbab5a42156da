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

/// Counts of a loaded file that others have found in it.
struct Expected {
    path: &'static str,
    triangles: usize,
    materials: usize,
    /// Uses of textures in all materials.
    textures: usize,
    /// Parts of the warnings beside those on environment and camera.
    warnings: &'static [&'static str],
}

fn textures(scene: &Scene) -> usize {
    scene.materials.iter().map(|material| material.surface.textures().count()).sum()
}

#[test]
fn files_of_others_load_with_all_their_parts() {
    let Some(folder) = folder() else { return };
    let mut faults = Vec::new();
    for expected in EXPECTED {
        let path = folder.join(expected.path);
        let scene = Scene::load(&path).unwrap();
        let geometry = &scene.geometry;
        let warnings: Vec<_> = scene
            .warnings
            .iter()
            .filter(|text| !text.contains("no --environment") && !text.contains("no perspective"))
            .collect();
        let found = (geometry.triangles.len(), scene.materials.len(), textures(&scene));
        let is_named = warnings.len() == expected.warnings.len()
            && expected.warnings.iter().all(|part| warnings.iter().any(|text| text.contains(part)));
        if found != (expected.triangles, expected.materials, expected.textures) || !is_named {
            faults.push(format!("{}: {found:?} {warnings:#?}", expected.path));
        }
        let has_normal_map =
            scene.materials.iter().any(|material| material.surface.normal.is_some());
        if has_normal_map && geometry.tangents.is_empty() {
            faults.push(format!("{}: no tangents", expected.path));
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

const EXPECTED: &[Expected] = &[
    Expected {
        path: "gltf/AlphaBlendModeTest/AlphaBlendModeTest.glb",
        triangles: 61,
        materials: 6,
        textures: 13,
        warnings: &[],
    },
    Expected {
        path: "gltf/Cameras/Cameras.gltf",
        triangles: 2,
        materials: 1,
        textures: 0,
        warnings: &["orthographic cameras"],
    },
    Expected {
        path: "gltf/ClearCoatTest/ClearCoatTest.glb",
        triangles: 37116,
        materials: 19,
        textures: 11,
        warnings: &["`KHR_materials_clearcoat`"],
    },
    Expected {
        path: "gltf/EmissiveStrengthTest/EmissiveStrengthTest.glb",
        triangles: 90,
        materials: 6,
        textures: 1,
        warnings: &[],
    },
    Expected {
        path: "gltf/MetalRoughSpheresNoTextures/MetalRoughSpheresNoTextures.glb",
        triangles: 1040213,
        materials: 99,
        textures: 0,
        warnings: &["dropped 196 triangles of zero area"],
    },
    Expected {
        path: "gltf/NegativeScaleTest/NegativeScaleTest.glb",
        triangles: 7724,
        materials: 6,
        textures: 2,
        warnings: &[],
    },
    Expected {
        path: "gltf/NormalTangentTest/NormalTangentTest.glb",
        triangles: 7774,
        materials: 1,
        textures: 4,
        warnings: &[],
    },
    Expected {
        path: "gltf/OrientationTest/OrientationTest.glb",
        triangles: 524,
        materials: 7,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/SimpleInstancing/SimpleInstancing.glb",
        triangles: 1500,
        materials: 1,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/SimpleSparseAccessor/SimpleSparseAccessor.gltf",
        triangles: 12,
        materials: 1,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/TextureEncodingTest/TextureEncodingTest.glb",
        triangles: 3844,
        materials: 14,
        textures: 18,
        warnings: &[],
    },
    Expected {
        path: "gltf/TextureSettingsTest/TextureSettingsTest.glb",
        triangles: 72,
        materials: 10,
        textures: 9,
        warnings: &[],
    },
    Expected {
        path: "gltf/TextureTransformTest/TextureTransformTest.gltf",
        triangles: 24,
        materials: 9,
        textures: 9,
        warnings: &[],
    },
    Expected {
        path: "gltf/TransmissionRoughnessTest/TransmissionRoughnessTest.glb",
        triangles: 77792,
        materials: 9,
        textures: 10,
        warnings: &[],
    },
    Expected {
        path: "gltf/UnlitTest/UnlitTest.glb",
        triangles: 88,
        materials: 2,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/VertexColorTest/VertexColorTest.glb",
        triangles: 36,
        materials: 2,
        textures: 2,
        warnings: &[],
    },
    Expected {
        path: "gltf_scenes/low_poly_mini_village/scene.gltf",
        triangles: 46486,
        materials: 4,
        textures: 5,
        warnings: &["dropped 92 triangles of zero area"],
    },
    Expected {
        path: "gltf_scenes/virtual_gallery/scene.gltf",
        triangles: 27126,
        materials: 7,
        textures: 10,
        warnings: &[
            "third and further sets of texture coordinates",
            "textures of `KHR_materials_specular`",
        ],
    },
    Expected {
        path: "obj/aquarium/aquarium.obj",
        triangles: 5622,
        materials: 9,
        textures: 4,
        warnings: &["`Ka` other than black", "colour and strength of `Ks`"],
    },
    Expected {
        path: "obj/bonsai-tree/bonsai-tree.obj",
        triangles: 8128,
        materials: 4,
        textures: 4,
        warnings: &["smoothing groups", "`Ka` other than black", "colour and strength of `Ks`"],
    },
    Expected {
        path: "obj/full-bookcase/full-bookcase.obj",
        triangles: 2328,
        materials: 5,
        textures: 4,
        warnings: &["dropped 20 triangles of zero area", "colour and strength of `Ks`"],
    },
];
