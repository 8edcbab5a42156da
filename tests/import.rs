//! Real glTF and OBJ files of others: run where the folder is present, by `FENESTRA_IMPORT` or
//! `../shared/import`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::path::{Path, PathBuf};

use fenestra::scene::{Scene, mesh::Mesh};
use glam::{Vec3, Vec4};

/// Folder of the files; none if this machine has none.
fn folder() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/import");
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
    let of = |surface: &fenestra::brdf::material::Surface| {
        let emission = surface.emission.as_ref().and_then(|emission| emission.texture.as_ref());
        [&surface.color, &surface.roughness, &surface.metallic, &surface.normal]
            .into_iter()
            .flatten()
            .chain(&surface.opacity.texture)
            .chain(emission)
            .count()
    };
    scene.materials.iter().map(|material| of(&material.surface)).sum()
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

const EXPECTED: &[Expected] = &[
    Expected {
        path: "gltf/AlphaBlendModeTest/AlphaBlendModeTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/Cameras/Cameras.gltf",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/ClearCoatTest/ClearCoatTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/EmissiveStrengthTest/EmissiveStrengthTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/MetalRoughSpheresNoTextures/MetalRoughSpheresNoTextures.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/NegativeScaleTest/NegativeScaleTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/NormalTangentTest/NormalTangentTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/OrientationTest/OrientationTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/SimpleInstancing/SimpleInstancing.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/SimpleSparseAccessor/SimpleSparseAccessor.gltf",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/TextureEncodingTest/TextureEncodingTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/TextureSettingsTest/TextureSettingsTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/TextureTransformTest/TextureTransformTest.gltf",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/TransmissionRoughnessTest/TransmissionRoughnessTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/UnlitTest/UnlitTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf/VertexColorTest/VertexColorTest.glb",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf_scenes/low_poly_mini_village/scene.gltf",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "gltf_scenes/virtual_gallery/scene.gltf",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "obj/aquarium/aquarium.obj",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "obj/bonsai-tree/bonsai-tree.obj",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
    Expected {
        path: "obj/full-bookcase/full-bookcase.obj",
        triangles: 0,
        materials: 0,
        textures: 0,
        warnings: &[],
    },
];

#[test]
fn tangents_agree_with_those_of_an_exporter() {
    let Some(folder) = folder() else { return };
    let source = folder.join("gltf_scenes/virtual_gallery");
    let copy = tempfile::TempDir::new().unwrap();
    for name in ["scene.bin", "scene.gltf"] {
        std::fs::copy(source.join(name), copy.path().join(name)).unwrap();
    }
    std::fs::create_dir(copy.path().join("textures")).unwrap();
    for entry in std::fs::read_dir(source.join("textures")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap();
        std::fs::copy(&path, copy.path().join("textures").join(name)).unwrap();
    }
    let read = |path: &Path| Mesh::read(path, &mut Vec::new()).unwrap();
    let stored = read(&copy.path().join("scene.gltf"));
    let text = std::fs::read_to_string(source.join("scene.gltf")).unwrap();
    let path = copy.path().join("without.gltf");
    std::fs::write(&path, text.replace("\"TANGENT\"", "\"_TANGENT\"")).unwrap();
    let found = read(&path);
    assert_eq!(found.triangles.len(), stored.triangles.len());
    let (mut count, mut agree) = (0, 0);
    for (one, other) in found.triangles.iter().zip(&stored.triangles) {
        for (one, other) in one.iter().zip(other) {
            let one = Vec4::from_array(found.tangents[*one as usize]);
            let other = Vec4::from_array(stored.tangents[*other as usize]);
            if one.truncate() != Vec3::ZERO {
                count += 1;
                let is_near = one.truncate().dot(other.truncate()) > 0.9;
                agree += usize::from(is_near && one.w == other.w);
            }
        }
    }
    assert!(count > 100 && agree * 100 > count * 95, "{agree} of {count}");
}
