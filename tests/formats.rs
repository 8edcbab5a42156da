//! glTF and OBJ files as whole scenes: materials, cameras, instances, and a warning for every kind of
//! thing that is left out. `docs/formats.md` follows the declaration of those kinds.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fs, path::Path};

use fenestra::{
    film::Statistics,
    scene::{
        Scene,
        features::{self, Feature},
        load::LoadOptions,
        material::MaterialKind,
    },
};
use glam::Vec3;

use crate::support::{
    assert_error,
    command::{self, Folder},
    gltf::gltf,
};

/// Warnings without the path that begins each.
fn warnings(scene: &Scene) -> Vec<String> {
    let strip = |warning: &String| warning.split_once(": ").unwrap().1.to_owned();
    scene.warnings.iter().map(strip).collect()
}

fn load(name: &str, text: &str) -> Scene {
    let folder = Folder::new();
    Scene::load(&folder.write(name, text)).unwrap()
}

#[test]
fn everything_that_a_gltf_file_loses_is_named_once() {
    let materials = r#"{"name": "wood", "alphaMode": "MASK", "emissiveFactor": [1, 0, 0],
            "normalTexture": {"index": 0}, "occlusionTexture": {"index": 0},
            "extensions": {"KHR_materials_iridescence": {"iridescenceFactor": 1},
                "KHR_materials_transmission": {"transmissionFactor": 0.4}, "NEW_one": {}},
            "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0,
                "extensions": {"KHR_texture_transform": {"texCoord": 2}}}}},
           {"name": "not used", "extensions": {"KHR_materials_iridescence": {}}}"#;
    let nodes = r#"{"mesh": 0, "children": [1, 2], "skin": 0},
        {"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}}, {"mesh": 0}"#;
    let rest = r#", "extensionsRequired": ["KHR_materials_unlit"],
        "extensionsUsed": ["KHR_materials_unlit", "KHR_lights_punctual"],
        "textures": [{}], "animations": [{"name": "swing", "channels": [], "samplers": []}],
        "skins": [{"joints": [1]}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "range": 2}]}}"#;
    let text = gltf(nodes, materials, r#", "material": 0"#, rest);
    let attributes = r#""POSITION": 0, "TEXCOORD_2": 0, "COLOR_1": 0"#;
    let text = text.replace(r#""POSITION": 0"#, attributes);
    let scene = load("room.gltf", &text);
    let found = warnings(&scene);
    let expected = [
        "ignored animations (animation `swing`): played by `--frames`; else nodes stand as the file \
         places them",
        "ignored further sets of vertex colours (mesh `sail`)",
        "ignored third and further sets of texture coordinates (mesh `sail`)",
        "ignored range of lights (node `lamp`): light falls off with the squared distance alone",
        "ignored textures without an image (2, first in material `wood`)",
        "ignored `KHR_materials_iridescence` (material `wood`): reflections without the colours of thin \
         films",
        "ignored transmission of less than half the light (material `wood`): the surface is opaque",
        "ignored extension `NEW_one` (material `wood`)",
    ];
    for warning in expected {
        assert!(found.iter().any(|text| text == warning), "expected {warning:?} in {found:#?}");
    }
    assert_eq!(found.len(), expected.len() + 2, "and those on light and camera: {found:#?}");
    assert_eq!(scene.geometry.triangles.len(), 2);

    // A scene that gives the mesh a material of its own loses none of those of the file.
    let folder = Folder::new();
    folder.write("room.gltf", &text);
    let object = "mesh = \"room.gltf\"";
    let toml = command::yard(
        [8, 8],
        "constant = [1, 1, 1]",
        "type = \"diffuse\"\nreflectance = [0, 0, 0]",
        object,
    );
    let of_materials = |scene: &Scene| {
        scene.warnings.iter().filter(|warning| warning.contains("material")).count()
    };
    let scene = Scene::load(&folder.write("a.toml", &toml)).unwrap();
    assert_eq!(of_materials(&scene), 0, "{:?}", scene.warnings);
    let own = toml.strip_suffix("material = \"clay\"\n").unwrap();
    let scene = Scene::load(&folder.write("b.toml", own)).unwrap();
    assert_eq!(of_materials(&scene), 4, "{:#?}", scene.warnings);
    assert!(scene.warnings.iter().any(|text| text.contains("lights of a file in a `.toml` scene")));
}

#[test]
fn a_variant_chooses_the_materials_of_primitives() {
    let materials = r#"{"name": "beech"}, {"name": "oak"}"#;
    let mappings = r#", "material": 0, "extensions": {"KHR_materials_variants": {"mappings": [
        {"material": 0, "variants": [0]}, {"material": 1, "variants": [2, 1]}]}}"#;
    let rest = r#", "extensions": {"KHR_materials_variants": {"variants": [
        {"name": "light"}, {"name": "dark"}, {"name": "winter"}]}}"#;
    let folder = Folder::new();
    let path = folder.write("chair.gltf", gltf(r#"{"mesh": 0}"#, materials, mappings, rest));
    let with = |name: &str| {
        Scene::load_with(&path, &LoadOptions { variant: Some(name.into()), ..Default::default() })
    };
    let scene = Scene::load(&path).unwrap();
    assert_eq!(scene.variants, ["light", "dark", "winter"]);
    assert!(
        warnings(&scene).iter().any(|text| text.starts_with("ignored `KHR_materials_variants`"))
    );
    for (name, material) in [("light", "beech"), ("dark", "oak"), ("winter", "oak")] {
        let scene = with(name).unwrap();
        assert_eq!(scene.materials[0].name, material, "{name}");
        assert!(!warnings(&scene).iter().any(|text| text.contains("variants")), "{scene:?}");
    }
    assert_error(with("red"), &["there is no such variant, the file has light, dark, winter"]);
    let options = LoadOptions { variant: Some("light".into()), ..Default::default() };
    assert_error(
        Scene::load_with(&folder.write("a.obj", ""), &options),
        &["--variant light: the option is for glTF files"],
    );
}

#[test]
fn cameras_stand_at_their_nodes() {
    let nodes = r#"{"mesh": 0, "translation": [0, 0, 5], "children": [1, 2, 3]}, {"camera": 0},
        {"name": "side", "camera": 1, "rotation": [0, 0.70710678, 0, 0.70710678]}, {"camera": 2}"#;
    let rest = r#", "cameras": [{"type": "orthographic", "name": "flat",
        "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1}},
        {"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 2, "znear": 0.1}},
        {"type": "perspective", "name": "far", "perspective": {"yfov": 1, "znear": 0.1}}]"#;
    let folder = Folder::new();
    let path = folder.write("room.gltf", gltf(nodes, "", "", rest));
    let with = |name: &str| {
        Scene::load_with(&path, &LoadOptions { camera: Some(name.into()), ..Default::default() })
    };
    let scene = Scene::load(&path).unwrap();
    let camera = scene.camera;
    assert_eq!(camera.position, Vec3::new(0.0, 0.0, 5.0));
    let forward = (camera.look_at - camera.position).normalize();
    assert!(forward.abs_diff_eq(Vec3::NEG_X, 1e-5), "{forward}");
    assert!((camera.vertical_fov_deg - 28.6479).abs() < 1e-3);
    assert_eq!((scene.film.width, scene.film.height), (640, 320));
    let found = warnings(&scene);
    assert!(found.iter().any(|text| text.starts_with("ignored orthographic cameras (`flat`)")));
    assert!(found.iter().any(|text| text.starts_with("ignored cameras that are not used (`far`)")));
    assert_eq!(with("side").unwrap().hash, scene.hash);
    assert_eq!(with("far").unwrap().film.height, 480);
    assert_eq!(with("2").unwrap().hash, with("far").unwrap().hash);
    assert!((with("flat").unwrap().camera.position.z - 205.0).abs() < 1e-3);
    assert_error(with("near"), &["there is no such camera, the file has `flat`, `side`, `far`"]);

    // Without a camera, all of the bounding box is in view.
    let scene = load("b.gltf", &gltf(r#"{"mesh": 0}"#, "", "", ""));
    assert!(
        warnings(&scene)[0].starts_with("no perspective camera; one that frames the bounding box"),
        "{scene:?}"
    );
    let away = scene.camera.look_at - scene.camera.position;
    for &corner in &scene.geometry.positions {
        let direction = Vec3::from_array(corner) - scene.camera.position;
        assert!(direction.angle_between(away).to_degrees() < 22.5);
    }
}

#[test]
fn instances_and_sparse_accessors_are_read() {
    let nodes = r#"{"mesh": 0, "scale": [2, 2, 2], "extensions": {"EXT_mesh_gpu_instancing":
        {"attributes": {"TRANSLATION": 1}}}}"#;
    let text = gltf(nodes, "", "", r#", "extensionsRequired": ["EXT_mesh_gpu_instancing"]"#);
    let sparse = r#""type": "VEC3", "sparse": {"count": 1,
        "indices": {"bufferView": 2, "componentType": 5121}, "values": {"bufferView": 1}},
            "min""#;
    let text = text.replacen("\"type\": \"VEC3\",\n            \"min\"", sparse, 1);
    let scene = load("a.gltf", &text);
    let expected = [[0.0, 0.0, 14.0], [0.0, 0.0, 28.0], [0.0, 2.0, 14.0]];
    assert_eq!(scene.geometry.positions, expected);
    let folder = Folder::new();
    let broken = text.replace("\"count\": 3", "\"count\": 1");
    assert_error(
        Scene::load(&folder.write("b.gltf", broken)),
        &["accessor 0: sparse index 1 is out of range"],
    );
    let broken = text.replace("\"TRANSLATION\": 1", "\"TRANSLATION\": 9");
    assert_error(
        Scene::load(&folder.write("b.gltf", broken)),
        &["node 0: EXT_mesh_gpu_instancing has no accessor 9"],
    );
}

#[test]
fn everything_that_an_obj_file_loses_is_named_once() {
    let folder = Folder::new();
    folder.write(
        "room.mtl",
        "newmtl leaf\nKd 0.2 0.5 0.1 # green\nKa 0 0 0\nKs 0 0 0\nTf 0 1 0\nbump leaf.png\nillum 2\n\
         newmtl paint\nKd 0.5 0.5 0.5\nKs 0.3 0.3 0.3\nNs 98\nNi 1.6\nillum 10\nmap_Ks a.png\n\
         map_Kd -blendu off a.png\nKe 1 1 1\n",
    );
    let text = "mtllib room.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0\nvt 0 0\ng a\ns 1\nf 1 2 3\n\
        usemtl leaf\nf 1/1 2/1 3/1\nusemtl paint\nf 1 2 3\nusemtl lost\nf 3 2 1\nl 1 2\ncstype bezier\n";
    image::GrayImage::new(2, 2).save(folder.path().join("leaf.png")).unwrap();
    let path = folder.write("room.obj", text);
    let scene = Scene::load(&path).unwrap();
    let found = warnings(&scene);
    let expected = [
        "ignored points and lines (line 15): `p`, `l`",
        "ignored `cstype` (line 16)",
        "ignored smoothing groups `s` (line 7): where faces have no normals",
        "1 pairs of triangles lie back to back with different materials; each side shows the one \
         that looks at it",
        "2 triangles lie on others of another material that look the same way; either is seen, by \
         chance",
        "ignored heights in `bump`, `map_bump` (material `leaf`, room.mtl:6): their unit is open",
        "ignored `Tf` other than white (material `leaf`): of all but thin panes",
        "ignored `illum 10` (material `paint`, room.mtl:13)",
        "ignored `map_Ks` (material `paint`, room.mtl:14)",
        "ignored option `-blendu` (material `paint`, room.mtl:15)",
        "ignored colour and strength of `Ks` (material `paint`): Fresnel's equations give the \
         gloss of plastic",
        "ignored materials that no library describes (`lost`, line 13): they are white",
        "ignored vertex colours of faces with a material (all vertices): for those without, and \
         materials with `vertex_color`; sRGB",
    ];
    assert!(scene.warnings[0].contains("a.png: "), "{:#?}", scene.warnings);
    assert!(scene.warnings[0].contains("rendered without this texture (room.mtl:15)"));
    assert_eq!(found[1..=expected.len()], expected);
    assert_eq!(found.len(), expected.len() + 3, "and those on light and camera: {found:#?}");
    assert!(matches!(scene.materials[0].kind, MaterialKind::Diffuse { .. }));
    let MaterialKind::Plastic { diffuse, alpha, ior } = scene.materials[1].kind else { panic!() };
    assert_eq!((diffuse, ior), (Vec3::splat(0.5), 1.6));
    assert!((alpha - 0.02_f32.sqrt()).abs() < 1e-6, "{alpha}");
    assert_eq!(scene.geometry.materials, [3, 0, 1, 2]);

    // The program prints each, and refuses them all under --strict.
    let run = folder.run(&["render", "room.obj", "--strict", "-o", "room.exr"]);
    run.assert(
        1,
        &["room.obj: --strict: 16 warnings:\n", "heights in `bump`, `map_bump` (material `leaf`"],
    );
    folder.run(&["study", "room.obj", "--strict"]).assert(1, &["--strict: 16 warnings:"]);
    folder.run(&["info", "room.obj"]).assert(0, &[]);
}

#[test]
fn a_render_without_light_says_so_and_does_not_count_as_converged() {
    let folder = Folder::new();
    let dark = command::yard([8, 6], "constant = [0, 0, 0]", command::CLAY, command::BALL);
    folder.write("dark.toml", &dark);
    folder.write("black.pfm", command::pfm([2, 1], &[[0.0; 3]; 2]));
    let statistics = |options: &[&str]| -> Statistics {
        let options = [&["render", "-o", "a.exr", "--stats", "a.json"][..], options].concat();
        let run = folder.run(&options);
        run.assert(0, &[]);
        let statistics: Statistics = folder.json("a.json");
        let black = "no sample has found any light: the image is black";
        assert_eq!(run.messages.contains(black), !statistics.found_light);
        statistics
    };
    let found = statistics(&["dark.toml", "--spp", "80", "--error", "0.5"]);
    assert_eq!((found.stop_reason.as_str(), found.found_light), ("spp", false));
    assert_eq!(found.relative_standard_error, None);
    assert!(found.warnings.iter().any(|warning| warning.contains("the image is black")));

    folder.write("lit.gltf", gltf(r#"{"mesh": 0}"#, "", "", ""));
    let size = ["lit.gltf", "--spp", "2", "--size", "8x6"];
    let found = statistics(&size);
    assert!(found.found_light && found.warnings.len() == 2, "{:?}", found.warnings);
    let warnings: Vec<&str> = found.warnings.iter().map(String::as_str).collect();
    folder.run(&["export", "lit.gltf", "out", "--format=mitsuba"]).assert(0, &warnings);
    let found = statistics(&[&size[..], &["--environment", "black.pfm"]].concat());
    assert!(!found.found_light && found.warnings.len() == 3, "{:?}", found.warnings);
    let camera = ["render", "dark.toml", "--camera", "a"];
    folder.run(&camera).assert(1, &["--camera a: a scene in .toml has one camera"]);
}

#[test]
fn the_pages_list_every_warning() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    for (page, name, features) in [
        ("formats.md", "gltf", features::GLTF),
        ("formats.md", "obj", features::OBJ),
        ("formats.md", "mtl", features::MTL),
        ("formats.md", "ply", features::PLY),
        ("formats.md", "mitsuba", features::MITSUBA),
        ("pbrt.md", "pbrt", features::PBRT),
    ] {
        let text = fs::read_to_string(docs.join(page)).unwrap();
        let start = text.split_once(&format!("<!-- {name} -->\n")).unwrap().1;
        let table = start.split_once(&format!("<!-- end of {name} -->")).unwrap().0;
        let found: Vec<&str> = table.lines().filter(|row| row.contains("| warning |")).collect();
        let row = |Feature { name, details }: &Feature| format!("| {name} | warning | {details} |");
        assert_eq!(found, features.iter().map(row).collect::<Vec<_>>(), "{page}, {name}");
        let mut names: Vec<&str> =
            table.lines().map(|row| row.split(" | ").next().unwrap()).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{page}, {name}: a row twice");
        let is_read = |extension: &&str| {
            table.contains(&format!("| `{extension}` | done |"))
                || table.contains(&format!("| `{extension}` | mapped |"))
        };
        assert!(name != "gltf" || features::GLTF_EXTENSIONS.iter().all(is_read));
    }
}
