//! Exports to glTF and pbrt: what a format has no place for is named, and the rest comes back.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests may panic")]

use std::collections::BTreeMap;

use fenestra_scene::{
    Geometry, Scene,
    export::{Settings, gltf, mitsuba, pbrt},
    lamp::LampKind,
    load::LoadOptions,
    material::{ConductorFresnel, Material, MaterialKind, Surface},
    math::{colour::luminance, random::random_independent_1d},
    texture::{Texels, Texture, TextureUse, Wrap},
};
use glam::{Vec2, Vec3};

use crate::support::folder::{Folder, yard};

const SETTINGS: Settings = Settings { depth: 1, samples: 4 };

/// Loads a square of this material with an image whose channels have the means 1, 0.4 and 0.2.
fn square(folder: &Folder, clay: &str) -> Scene {
    let image = folder.path().join("a.png");
    let bytes = [255, 116, 102, 255, 88, 0];
    image::save_buffer(image, &bytes, 2, 1, image::ColorType::Rgb8).unwrap();
    folder.write(
        "square.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n\
         f 1/1/1 2/2/1 3/3/1 4/4/1\n",
    );
    let text = yard([8, 6], "constant = [0, 0, 0]", clay, "mesh = \"square.obj\"");
    Scene::load(&folder.write("scene.toml", text)).unwrap()
}

/// Warnings about materials of the exports to glTF and pbrt, and the scenes that are read again.
fn again(folder: &Folder, scene: &Scene) -> [(Vec<String>, Scene); 2] {
    let [first, second] = ["a.gltf", "a.pbrt"].map(|name| folder.path().join(name));
    let exports = [gltf::export(scene, &first), pbrt::export(scene, &second, SETTINGS)];
    let warnings = exports.map(|exported| {
        exported.write().unwrap();
        exported.warnings.into_iter().filter(|text| text.starts_with("material")).collect()
    });
    let [gltf, pbrt] = warnings;
    [(gltf, Scene::load(&first).unwrap()), (pbrt, Scene::load(&second).unwrap())]
}

#[test]
fn each_difference_is_named_by_the_format_that_forces_it() {
    let folder = Folder::new();
    let image = |rest: &str| format!("{{ texture = \"a.png\", {rest} }}");
    let mixed = format!(
        "type = \"principled\"\nbase_color = [0.5, 0.5, 0.5]\nroughness = {}\nmetallic = {}",
        image("channel = \"g\", interpolation = \"nearest\", scale = [2, 2]"),
        image("factor = 0.9"),
    );
    let bumpy = format!(
        "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]\nnormal = {}",
        image("scale = [-1, 1]")
    );
    let one_sided = "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]\ntwo_sided = false";
    type Named = &'static [&'static str];
    let cases: [(&str, Named, Named, Named); 5] = [
        (
            one_sided,
            &["its back is black in Fenestra"],
            &[],
            &["its back is black in Fenestra, and as the front in pbrt"],
        ),
        (
            "type = \"dielectric\"\nreflectance = [0.5, 1, 1]",
            &["the factor of its reflected light has no place in glTF's glass"],
            &[],
            &["the factors of reflected and transmitted light have no place in pbrt's glass"],
        ),
        (
            "type = \"conductor\"\nalpha = 0.25\neta = [0.2, 0.9, 1.1]\nk = [3.9, 2.4, 2.1]",
            &["its refractive index becomes"],
            &["masks and shadows separately"],
            &["pbrt has no colours of vertices"],
        ),
        (
            &mixed,
            &["its textures of roughness and metal lie on the surface in two ways"],
            &["masks and shadows separately", "principled differs from glTF's"],
            &["pbrt mixes no metal with others", "its dielectric become pbrt's coateddiffuse"],
        ),
        (
            &bumpy,
            &[],
            &["its normal map is turned or mirrored"],
            &["its normal map is turned or mirrored"],
        ),
    ];
    for (clay, gltf, of_xml, pbrt) in cases {
        let mut scene = square(&folder, clay);
        let count = scene.geometry.positions.len();
        scene.geometry.tangents = vec![[1.0, 0.0, 0.0, 1.0]; count];
        if clay.contains("eta =") {
            scene.geometry.colors = vec![[0.5, 0.5, 1.0, 1.0]; count];
            scene.materials[0].surface.vertex_color = true;
        }
        let [(of_gltf, _), (of_pbrt, read)] = again(&folder, &scene);
        let mut of_mitsuba =
            mitsuba::export(&scene, &folder.path().join("a.xml"), SETTINGS).warnings;
        of_mitsuba.retain(|text| text.starts_with("material"));
        for (expected, found) in [(gltf, of_gltf), (of_xml, of_mitsuba), (pbrt, of_pbrt)] {
            assert_eq!(found.len(), expected.len(), "{found:?}");
            let is_named = |part: &&&str| found.iter().any(|text| text.contains(**part));
            assert_eq!(expected.iter().filter(is_named).count(), expected.len(), "{found:?}");
        }
        // 0.46 of it is metal: 0.9 times the luminance of the means.
        let is_coated = matches!(read.materials[0].kind, MaterialKind::Plastic { ior: 1.5, .. });
        assert_eq!(is_coated, clay == mixed, "{:?}", read.materials[0].kind);
    }
}

#[test]
fn gltf_keeps_frames_of_vertices_and_the_second_coordinates() {
    let folder = Folder::new();
    let clay = "type = \"diffuse\"\nreflectance = { texture = \"a.png\" }\n\
                normal = { texture = \"a.png\" }";
    let mut scene = square(&folder, clay);
    let geometry = &mut scene.geometry;
    geometry.tangents = vec![[0.0, 1.0, 0.0, -1.0]; geometry.positions.len()];
    geometry.uvs[1] = geometry.uvs[0].iter().map(|&[u, v]| [0.5 * u, v]).collect();
    scene.materials[0].surface.color.as_mut().unwrap().uv_set = 1;
    let [(warnings, read), _] = again(&folder, &scene);
    assert_eq!(warnings, [""; 0]);
    let surface = &read.materials[0].surface;
    let sets = [&surface.color, &surface.normal].map(|used| used.as_ref().unwrap().uv_set);
    assert_eq!(sets, [1, 0]);
    assert_eq!(read.geometry.tangents, scene.geometry.tangents);
    let sum = |scene: &Scene| scene.geometry.uvs[1].iter().map(|uv| uv[0]).sum::<f32>();
    assert_eq!(sum(&read), sum(&scene));
    let [Texels::Bytes(ours), Texels::Bytes(read)] = [&scene, &read]
        .map(|scene| &scene.materials[0].surface.color.as_ref().unwrap().texture.texels)
    else {
        panic!("bytes")
    };
    assert_eq!(ours, read);
    let text = std::fs::read_to_string(folder.path().join("a.gltf")).unwrap();
    assert!(!text.contains("alphaMode"), "{text}");
}

#[test]
fn gltf_keeps_dielectrics_cutoffs_and_skies() {
    let folder = Folder::new();
    let clay = "type = \"principled\"\nbase_color = [0.5, 0.25, 0.125]\nmetallic = 0.25\n\
                roughness = 0.5\nior = 1.25\nspecular = 0.5\nspecular_color = [1, 0.5, 0.25]\n\
                opacity = { texture = \"a.png\", channel = \"g\", scale = [2, 1] }\n\
                opacity_cutoff = 0.25\n[[lamp]]\ntype = \"point\"\nposition = [1, 2, 3]\n\
                intensity = [4, 5, 6]";
    square(&folder, clay);
    let sky = "sky = { width = 32 }";
    let text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let path = folder.write("scene.toml", text.replace("constant = [0, 0, 0]", sky));
    let ours = Scene::load(&path).unwrap();
    let path = folder.path().join("a.gltf");
    gltf::export(&ours, &path).write().unwrap();
    let map = folder.path().join("a/environment.exr");
    let options = LoadOptions { environment: Some(map.clone()), ..Default::default() };
    let read = Scene::load_with(&path, &options).unwrap();
    assert!(read.inputs.contains(&map), "{:?}", read.inputs);
    assert_eq!(read.environment.texels, ours.environment.texels);
    let kind = |scene: &Scene| format!("{:?}", scene.materials[0].kind);
    assert_eq!(kind(&read), kind(&ours));
    assert_eq!(read.materials[0].surface.opacity.cutoff, Some(0.25));
    square(&folder, &clay.replace("specular = 0.5", "specular = 1"));
    let tinted = Scene::load(&folder.path().join("scene.toml")).unwrap();
    let tinted_path = folder.path().join("b.gltf");
    gltf::export(&tinted, &tinted_path).write().unwrap();
    assert_eq!(kind(&Scene::load(&tinted_path).unwrap()), kind(&tinted));
    // A reader may refuse or leave out extensions that are not listed.
    let text = std::fs::read_to_string(&path).unwrap();
    let used = text.split_once("\"extensionsUsed\"").unwrap().1.split_once(']').unwrap().0;
    let used: Vec<_> = used.split('"').filter(|name| name.starts_with("KHR")).collect();
    let expected = ["lights_punctual", "materials_ior", "materials_specular", "texture_transform"];
    assert_eq!(used, expected.map(|name| format!("KHR_{name}")));
}

#[test]
fn absorption_views_and_spots_come_back() {
    let folder = Folder::new();
    let clay = "type = \"dielectric\"\nabsorption = [4, 2, 0]\n[[lamp]]\ntype = \"spot\"\n\
                position = [1, 2, 3]\ndirection = [0, -1, 0]\nintensity = [4, 5, 6]\n\
                inner_angle_deg = 10\nouter_angle_deg = 30";
    let mut scene = square(&folder, clay);
    // The shorter side of the film is its width.
    scene.film.width = 3;
    for (_, read) in again(&folder, &scene) {
        let absorption = read.materials[0].kind.absorption().unwrap();
        assert!(absorption.abs_diff_eq(Vec3::new(4.0, 2.0, 0.0), 1e-4), "{absorption}");
        let angle = read.camera.vertical_fov_deg;
        assert!((angle - 45.0).abs() < 1e-3, "{angle}");
        let LampKind::Spot(spot) = read.lamps[0].kind else { panic!("{:?}", read.lamps) };
        let angles = [spot.inner_angle_rad, spot.outer_angle_rad].map(f32::to_degrees);
        assert!((angles[0] - 10.0).abs().max((angles[1] - 30.0).abs()) < 1e-3, "{angles:?}");
    }
    // The plane of focus lies between Mitsuba's clip planes, however far it is.
    (scene.camera.aperture_radius, scene.camera.focus_distance) = (0.1, 1e4);
    let path = folder.path().join("a.xml");
    mitsuba::export(&scene, &path, SETTINGS).write().unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("name=\"far_clip\" value=\"20000\""), "{text}");
    // Mitsuba takes no colours above 1, and shifts no lens.
    for part in ["\"sigma_t\" value=\"1, 0.5, 0\"", "\"scale\" value=\"4\""] {
        assert!(text.contains(part), "{text}");
    }
    let read = Scene::load(&path).unwrap();
    assert_eq!(read.materials[0].kind.absorption(), Some(Vec3::new(4.0, 2.0, 0.0)));
    let camera = read.camera;
    assert_eq!((camera.aperture_radius, camera.focus_distance), (0.1, 1e4));
    scene.camera.shift = [0.25, 0.5];
    let export = mitsuba::export(&scene, &path, SETTINGS);
    export.write().unwrap();
    assert!(export.warnings.concat().contains("shifts no thin lens"), "{:?}", export.warnings);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("\"perspective\"") && !text.contains("aperture"), "{text}");
}

/// Surfaces that light goes straight through are no vertices there, and no shadow to lamps: Mitsuba's `path`
/// has both.
#[test]
fn light_goes_straight_through_surfaces_in_mitsuba() {
    let folder = Folder::new();
    let path = folder.path().join("a.xml");
    let diffuse = "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]";
    let lamp = "[[lamp]]\ntype = \"point\"\nposition = [1, 2, 3]\nintensity = [4, 5, 6]";
    for (clay, integrator) in [
        (diffuse.to_owned(), "path"),
        (format!("{diffuse}\nopacity = 0.5"), "volpath"),
        ("type = \"thin_dielectric\"".to_owned(), "volpath"),
    ] {
        let scene = square(&folder, &format!("{clay}\n{lamp}"));
        mitsuba::export(&scene, &path, SETTINGS).write().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(&format!("<integrator type=\"{integrator}\">")), "{clay}: {text}");
        let pbrt = pbrt::export(&scene, &path, SETTINGS).warnings.concat();
        assert_eq!(pbrt.contains("panes, which stop it"), clay.contains("thin"), "{pbrt}");
    }
}

#[test]
fn a_folder_of_another_format_is_named() {
    let folder = Folder::new();
    let scene = square(&folder, "type = \"mirror\"\nreflectance = [1, 1, 1]");
    let [first, second] = ["a.xml", "a.pbrt"].map(|name| folder.path().join(name));
    for _ in 0..2 {
        let export = mitsuba::export(&scene, &first, SETTINGS);
        assert_eq!(export.warnings, [""; 0], "it replaces itself alone");
        export.write().unwrap();
    }
    let warnings = pbrt::export(&scene, &second, SETTINGS).warnings.concat();
    assert!(warnings.contains("a.xml: its meshes and images lie in the same folder"), "{warnings}");
    // A scene of someone else's, with no such folder, loses nothing.
    let alone = folder.write("b.xml", "<scene/>").with_extension("gltf");
    let warnings = gltf::export(&scene, &alone).warnings.concat();
    assert!(!warnings.contains("b.xml"), "{warnings}");
}

#[test]
fn normals_of_vertices_that_point_to_the_back_are_turned() {
    let folder = Folder::new();
    let mut scene = square(&folder, "type = \"dielectric\"");
    scene.geometry.normals.iter_mut().for_each(|normal| *normal = normal.map(|part| -part));
    let path = folder.path().join("a.xml");
    mitsuba::export(&scene, &path, SETTINGS).write().unwrap();
    let [(_, gltf), (warnings, pbrt)] = again(&folder, &scene);
    assert_eq!(warnings, [""; 0]);
    for read in [Scene::load(&path).unwrap(), gltf, pbrt] {
        let Geometry { positions, normals, triangles, .. } = &read.geometry;
        for triangle in triangles {
            let [a, b, c] = triangle.map(|at| Vec3::from(positions[at as usize]));
            let front = (b - a).cross(c - a).normalize();
            assert!(triangle.iter().all(|&at| front.dot(normals[at as usize].into()) > 0.9));
        }
    }
}

/// Where coordinates do not tell the directions of a normal map, a surface has none.
#[test]
fn normal_maps_without_coordinates_are_left_out() {
    let folder = Folder::new();
    let clay =
        "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]\nnormal = { texture = \"a.png\" }";
    let mut scene = square(&folder, clay);
    let path = folder.path().join("a.xml");
    for has_coordinates in [true, false] {
        if !has_coordinates {
            scene.geometry.uvs[0].clear();
        }
        mitsuba::export(&scene, &path, SETTINGS).write().unwrap();
        let [(_, gltf), (_, pbrt)] = again(&folder, &scene);
        for read in [Scene::load(&path).unwrap(), gltf, pbrt] {
            assert_eq!(read.materials[0].surface.normal.is_some(), has_coordinates);
        }
    }
}

/// Shares are at most 1, whatever images times factors come to.
#[test]
fn bright_images_are_cut_off_where_shares_end() {
    let folder = Folder::new();
    // Factors that share an image of glTF are not alike.
    let image = |factor: f32| {
        format!("{{ texture = \"a.png\", factor = {factor}, interpolation = \"nearest\" }}")
    };
    let [color, roughness, metallic, opacity] = [0.5, 0.4, 0.75, 0.8].map(image);
    let clay = format!(
        "type = \"principled\"\nbase_color = {color}\nroughness = {roughness}\n\
         metallic = {metallic}\nopacity = {opacity}"
    );
    let mut scene = square(&folder, &clay);
    let [dark, bright] = [0.25, 4.0].map(half::f16::from_f32);
    let mut brighten = |used: &mut Option<TextureUse>| {
        let used = used.as_mut().unwrap();
        let texels = Texels::Halves(vec![[dark; 4], [bright; 4]]);
        used.texture = Texture { texels, ..(*used.texture).clone() }.into();
    };
    let Surface { color, roughness, metallic, opacity, .. } = &mut scene.materials[0].surface;
    [color, roughness, metallic, &mut opacity.texture].into_iter().for_each(&mut brighten);
    let path = folder.path().join("b.xml");
    let mitsuba = mitsuba::export(&scene, &path, SETTINGS).warnings.concat();
    assert!(mitsuba.contains("above 1 in places, where Mitsuba"), "{mitsuba}");
    let [(warnings, gltf), _] = again(&folder, &scene);
    let is_named = |text: &String| text.contains("above 1 in places; it is cut off");
    assert!(warnings.len() == 4 && warnings.iter().all(is_named), "{warnings:?}");
    let at = |used: &Option<TextureUse>, u: f32| used.as_ref().unwrap().value(Vec2::new(u, 0.5)).x;
    for (u, texel) in [(0.25, 0.25), (0.75, 4.0)] {
        let Surface { color, roughness, metallic, opacity, .. } = &gltf.materials[0].surface;
        let MaterialKind::Principled(own) = gltf.materials[0].kind else { panic!() };
        for (name, factor, found) in [
            ("colour", 0.5, own.base_color.x * at(color, u)),
            ("roughness", 0.4, own.roughness * at(roughness, u)),
            ("metal", 0.75, own.metallic * at(metallic, u)),
            ("opacity", 0.8, opacity.factor * at(&opacity.texture, u)),
        ] {
            let expected = f32::min(factor * texel, 1.0);
            assert!((found - expected).abs() < 2e-3, "{name} at {u}: {found}, not {expected}");
        }
    }
    // Light has no such bound, nor a place in `KHR_materials_unlit` above 1.
    let clay = "type = \"diffuse\"\nreflectance = [0, 0, 0]\nemission_two_sided = true\n\
                emission = { texture = \"a.png\", interpolation = \"nearest\" }";
    let mut scene = square(&folder, clay);
    let emission = scene.materials[0].surface.emission.as_mut().unwrap();
    emission.radiance *= 1.5;
    brighten(&mut emission.texture);
    mitsuba::export(&scene, &path, SETTINGS).write().unwrap();
    let [(_, gltf), (_, pbrt)] = again(&folder, &scene);
    for read in [Scene::load(&path).unwrap(), gltf, pbrt] {
        let emission = read.materials[0].surface.emission.as_ref().unwrap();
        for (u, expected) in [(0.25, 0.375), (0.75, 6.0)] {
            let found = emission.radiance.x * at(&emission.texture, u);
            assert!((found - expected).abs() < 4e-3, "{found}, not {expected}");
        }
    }
}

#[test]
fn what_gltf_and_plastics_of_mitsuba_cannot_say_is_named() {
    let folder = Folder::new();
    let warnings = |clay: &str| {
        let [(gltf, _), (pbrt, _)] = again(&folder, &square(&folder, clay));
        [gltf.concat(), pbrt.concat()]
    };
    let of_index = |index: f32| {
        let clay = format!("type = \"dielectric\"\nior = {index}\ntwo_sided = false");
        warnings(&clay)
    };
    // Glass has no back.
    assert_eq!(of_index(1.25), ["", ""]);
    assert!(of_index(0.8)[0].contains("refractive indices are at least 1"));
    let [gltf, pbrt] = warnings(
        "type = \"diffuse_transmission\"\nreflectance = [0.75, 0.25, 0]\ntransmittance = [0.25, 0.75, 0]",
    );
    assert!(gltf.contains("the same share of all colours") && pbrt.is_empty(), "{gltf}{pbrt}");

    let clay = "type = \"plastic\"\nalpha = 0.05\ndiffuse = [0.5, 0.5, 0.5]\nvertex_color = true";
    let mut scene = square(&folder, clay);
    scene.geometry.colors = vec![[0.5, 0.5, 1.0, 1.0]; scene.geometry.positions.len()];
    let path = folder.path().join("a.xml");
    let export = mitsuba::export(&scene, &path, SETTINGS);
    export.write().unwrap();
    assert!(export.warnings.concat().contains("plastic has no colours of vertices"));
    assert!(!std::fs::read_to_string(&path).unwrap().contains("mesh_attribute"));
}

#[test]
fn cut_surfaces_and_opacities_as_colours_come_back_from_pbrt() {
    let folder = Folder::new();
    let read = |clay: &str| {
        let [_, (_, read)] = again(&folder, &square(&folder, clay));
        read.materials[0].surface.clone()
    };
    // An opacity at the cutoff is that of an opaque surface.
    let clay = "type = \"diffuse\"\nreflectance = [0, 0, 0]\nopacity_cutoff = 0.5\nopacity = ";
    let opacity = |factor: &str| read(&format!("{clay}{factor}")).opacity.factor;
    assert_eq!([opacity("0.5"), opacity("0.4")], [1.0, 0.0]);
    // One channel stands for all.
    for (channel, expected) in [("r", [255, 255]), ("g", [116, 88]), ("b", [102, 0])] {
        let image = format!("{{ texture = \"a.png\", linear = true, channel = \"{channel}\" }}");
        let surface = read(&format!("type = \"diffuse\"\nreflectance = {image}"));
        let values = surface.color.unwrap().values();
        let found = values.iter().map(|value| [0, 1, 2].map(|at| (255.0 * value[at]).round()));
        assert_eq!(found.collect::<Vec<_>>(), expected.map(|byte| [byte as f32; 3]), "{channel}");
    }
    // Opacity is linear, although the image is one of colours.
    let image = folder.path().join("b.png");
    image::save_buffer(image, &[9, 9, 9, 128], 1, 1, image::ColorType::Rgba8).unwrap();
    let clay = "type = \"diffuse\"\nreflectance = { texture = \"b.png\", channel = \"a\" }";
    let value = read(clay).color.unwrap().values()[0][0];
    assert!((value - 128.0 / 255.0).abs() < 1e-3, "{value}");
}

/// Light of both sides of a sheet comes back, one colour and an image as well.
#[test]
fn sheets_come_back() {
    let folder = Folder::new();
    let transmittance = Vec3::new(0.5, 0.25, 0.125);
    for (reflectance, factor) in [
        ("[0.25, 0.5, 0.125]", Vec3::new(0.25, 0.5, 0.125)),
        (
            "{ texture = \"a.png\", linear = true, factor = [0.25, 0.5, 0.125] }",
            Vec3::new(0.25, 0.5, 0.125),
        ),
    ] {
        let clay = format!(
            "type = \"diffuse_transmission\"\nreflectance = {reflectance}\n\
             transmittance = [0.5, 0.25, 0.125]"
        );
        let scene = square(&folder, &clay);
        let image = |scene: &Scene| {
            let color = &scene.materials[0].surface.color;
            color.as_ref().map_or(Vec3::ONE, |used| Vec3::from(used.mean()))
        };
        let mean = image(&scene);
        // Mitsuba keeps the sum of both sides and the ratio of their luminances.
        let path = folder.path().join("a.xml");
        mitsuba::export(&scene, &path, SETTINGS).write().unwrap();
        let sheet = Scene::load(&path).unwrap();
        let MaterialKind::DiffuseTransmission { reflectance: own, transmittance: other } =
            sheet.materials[0].kind
        else {
            panic!("{:?}", sheet.materials[0])
        };
        let all = (own + other) * image(&sheet);
        assert!(all.abs_diff_eq((factor + transmittance) * mean, 3e-3), "{all}");
        let [found, expected] = [(own, other), (factor, transmittance)]
            .map(|(own, other)| luminance(other) / luminance(own + other));
        assert!((found - expected).abs() < 1e-3 && sheet.materials[0].surface.two_sided);
        for (warnings, read) in again(&folder, &scene) {
            assert_eq!(warnings, [""; 0]);
            let MaterialKind::DiffuseTransmission { reflectance: own, transmittance: other } =
                read.materials[0].kind
            else {
                panic!("{:?}", read.materials[0])
            };
            for (found, expected) in [(own, factor), (other, transmittance)] {
                let [found, expected] = [found * image(&read), expected * mean];
                assert!(found.abs_diff_eq(expected, 3e-3), "{found}, not {expected}");
            }
        }
    }
}

/// The base of Mitsuba's principled model has another mean below a dielectric, that of its metal the same.
#[test]
fn bases_come_back_from_mitsuba_whatever_their_share_of_metal() {
    let folder = Folder::new();
    for metallic in ["0", "0.25", "1"] {
        let clay = format!(
            "type = \"principled\"\nbase_color = [0.5, 0.25, 0.125]\nroughness = 0.9\n\
             metallic = {metallic}"
        );
        let path = folder.path().join("a.xml");
        mitsuba::export(&square(&folder, &clay), &path, SETTINGS).write().unwrap();
        let read = Scene::load(&path).unwrap();
        let MaterialKind::Principled(own) = read.materials[0].kind else { panic!() };
        let base = Vec3::new(0.5, 0.25, 0.125);
        assert!(own.base_color.abs_diff_eq(base, 2e-3), "{metallic}: {own:?}");
    }
}

#[test]
fn mirrors_and_coats_come_back_from_pbrt() {
    let folder = Folder::new();
    // A quarter of the reflectance 0.04 is that of the index 1.1 / 0.9.
    let clay =
        "type = \"principled\"\nbase_color = [0.5, 0.5, 0.5]\nroughness = 0.5\nspecular = 0.25";
    let [_, (_, read)] = again(&folder, &square(&folder, clay));
    let MaterialKind::Plastic { ior, .. } = read.materials[0].kind else { panic!() };
    assert!((ior - 1.1 / 0.9).abs() < 1e-4, "{ior}");
    let [_, (_, read)] =
        again(&folder, &square(&folder, "type = \"mirror\"\nreflectance = [1, 1, 1]"));
    assert!(matches!(read.materials[0].kind, MaterialKind::Mirror { reflectance: Vec3::ONE }));
    let clay = "type = \"plastic\"\nalpha = 0.25\ndiffuse = { texture = \"a.png\", \
                linear = true, factor = [0.25, 0.5, 0.5] }";
    let [_, (_, read)] = again(&folder, &square(&folder, clay));
    let MaterialKind::Plastic { diffuse, .. } = read.materials[0].kind else { panic!() };
    let mean = diffuse * Vec3::from(read.materials[0].surface.color.as_ref().unwrap().mean());
    assert!(mean.abs_diff_eq(Vec3::new(0.25, 0.2, 0.1), 2e-3), "{mean}");
}

/// A roughness is a number: of colours, the luminance.
#[test]
fn coats_for_mitsuba_are_as_light_by_an_image_as_by_its_mean() {
    let folder = Folder::new();
    let of = |diffuse: &str, rough: &str| {
        let clay = format!("type = \"plastic\"\ndiffuse = {diffuse}\n{rough}");
        let mut scene = square(&folder, &clay);
        let surface = &mut scene.materials[0].surface;
        // Scene files have no such image, but those of others do.
        surface.roughness = surface.normal.take();
        let warnings = mitsuba::export(&scene, &folder.path().join("a.xml"), SETTINGS).warnings;
        let rest = warnings.iter().find_map(|text| text.split("its base is ").nth(1)).unwrap();
        rest.split_once(' ').unwrap().0.parse::<f32>().unwrap()
    };
    let mean: f32 = 0.2126 + 0.7152 * 0.4 + 0.0722 * 0.2;
    let [number, image] =
        [format!("roughness = {mean}"), "alpha = 1.0\nnormal = { texture = \"a.png\" }".to_owned()]
            .map(|rough| of("[0.2, 0.2, 0.2]", &rough));
    assert!(number > 1.05 && (number - image).abs() < 2e-3, "{number} {image}");
    assert_eq!(of("{ texture = \"a.png\" }", "alpha = 0.25"), 1.0, "its red is 1 already");
}

#[test]
fn light_of_backs_for_mitsuba_lies_behind_and_is_whole() {
    let folder = Folder::new();
    let clay = "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]\nemission = [1, 1, 1]\n\
                emission_two_sided = true";
    let path = folder.path().join("a.xml");
    mitsuba::export(&square(&folder, clay), &path, SETTINGS).write().unwrap();
    let Geometry { positions, normals, .. } = Scene::load(&path).unwrap().geometry;
    // Only corners of the square stand so high; it faces +z.
    let high = positions.iter().zip(&normals).filter(|(position, _)| position[1] > 0.9);
    let (front, back): (Vec<_>, Vec<_>) = high.partition(|(_, normal)| normal[2] > 0.0);
    assert!(!front.is_empty() && front.iter().all(|(at, _)| at[2] == 0.0), "{front:?}");
    assert!(
        !back.is_empty() && back.iter().all(|(at, _)| (-0.01..0.0).contains(&at[2])),
        "{back:?}"
    );
    let holes = "opacity = { texture = \"a.png\", channel = \"g\" }";
    let scene = square(&folder, &format!("{clay}\n{holes}"));
    let warnings = mitsuba::export(&scene, &path, SETTINGS).warnings.concat();
    assert!(warnings.contains("also where it is not opaque"), "{warnings}");
}

/// Corners of the triangles of the first material with their places in its images of colour and opacity.
fn places_in_images(scene: &Scene) -> Vec<[Vec3; 3]> {
    let Surface { color, opacity, .. } = &scene.materials[0].surface;
    let Geometry { positions, uvs, triangles, materials, .. } = &scene.geometry;
    let own = triangles.iter().zip(materials).filter(|(_, material)| **material == 0);
    let corner = |&corner: &u32| {
        let place = |used: &Option<TextureUse>| {
            let used = used.as_ref().unwrap();
            let uv = Vec2::from(uvs[used.uv_set as usize][corner as usize]).extend(1.0);
            Vec2::from(used.image_from_uv.map(|row| Vec3::from(row).dot(uv))).extend(0.0)
        };
        [positions[corner as usize].into(), place(color), place(&opacity.texture)]
    };
    own.flat_map(|(triangle, _)| triangle).map(corner).collect()
}

/// In pbrt the meshes have the coordinates of the first image, by which the second is placed.
#[test]
fn images_lie_where_they_did_by_the_second_coordinates() {
    let folder = Folder::new();
    let image = |place: &str| format!("{{ texture = \"a.png\", channel = \"g\", {place} }}");
    let clay = format!(
        "type = \"diffuse\"\nreflectance = {}\nopacity = {}",
        image("scale = [2, 3], offset = [0.25, 0.5]"),
        image("scale = [4, 0.5], offset = [0.5, 0.125]"),
    );
    let mut scene = square(&folder, &clay);
    let geometry = &mut scene.geometry;
    geometry.uvs[1] = geometry.uvs[0].iter().map(|&[u, v]| [1.0 - v, 0.5 * u]).collect();
    let Surface { color, opacity, .. } = &mut scene.materials[0].surface;
    for used in [color, &mut opacity.texture] {
        used.as_mut().unwrap().uv_set = 1;
    }
    let path = folder.path().join("a.xml");
    mitsuba::export(&scene, &path, SETTINGS).write().unwrap();
    let mitsuba = Scene::load(&path).unwrap();
    let [_, (_, pbrt)] = again(&folder, &scene);
    let expected = places_in_images(&scene);
    for read in [mitsuba, pbrt] {
        let found = places_in_images(&read);
        assert!(found.len() == expected.len() && !found.is_empty(), "{}", found.len());
        for (found, expected) in found.iter().zip(&expected) {
            let alike = |part: usize| found[part].abs_diff_eq(expected[part], 1e-4);
            assert!((0..3).all(alike), "{found:?}, not {expected:?}");
        }
    }
}

#[test]
fn images_continue_as_far_as_formats_let_them() {
    let folder = Folder::new();
    let clay = "type = \"diffuse\"\nreflectance = { texture = \"a.png\", wrap = \"mirror\" }";
    let mut scene = square(&folder, clay);
    let used = scene.materials[0].surface.color.as_mut().unwrap();
    let [end, centre] = [0.999, 0.75].map(|u| used.value(Vec2::new(u, 0.5)));
    assert_eq!(end, centre, "a mirrored image goes on with its last texel");
    let upright = Texture { width: 1, height: 2, ..(*used.texture).clone() };
    let upright = TextureUse { texture: upright.into(), ..used.clone() };
    let [across, along] = [&*used, &upright].map(|used| used.value(Vec2::splat(0.5)));
    assert!(across == along && across != centre, "the mean of two columns is that of two rows");
    used.wrap = [Wrap::Clamp, Wrap::Repeat];
    let [_, (warnings, read)] = again(&folder, &scene);
    assert!(warnings[0].contains("continues along u and v in two ways"), "{warnings:?}");
    assert_eq!(read.materials[0].surface.color.as_ref().unwrap().wrap, [Wrap::Clamp; 2]);
    let path = folder.path().join("a.xml");
    mitsuba::export(&scene, &path, SETTINGS).write().unwrap();
    let read = Scene::load(&path).unwrap();
    let images: Vec<_> =
        read.materials.iter().filter_map(|own| own.surface.color.as_ref()).collect();
    assert!(!images.is_empty() && images.iter().all(|used| used.wrap == [Wrap::Clamp; 2]));
}

#[test]
fn gltf_keeps_matrices_of_scale_turn_and_shift() {
    let folder = Folder::new();
    let mut scene = square(&folder, "type = \"diffuse\"\nreflectance = { texture = \"a.png\" }");
    let path = folder.path().join("a.gltf");
    let mut read = |matrix: [[f32; 3]; 2]| {
        scene.materials[0].surface.color.as_mut().unwrap().image_from_uv = matrix;
        let export = gltf::export(&scene, &path);
        export.write().unwrap();
        let color = Scene::load(&path).unwrap().materials[0].surface.color.take().unwrap();
        (color.image_from_uv, export.warnings.iter().any(|text| text.contains("is sheared")))
    };
    for ([x, y], angle) in [([2.0, 3.0], 0.5_f32), ([1.0, -1.0], 0.0), ([-2.0, 0.5], 3.0)] {
        let (sine, cosine) = angle.sin_cos();
        let matrix = [[cosine * x, sine * y, 0.25], [-sine * x, cosine * y, 0.75]];
        let (found, is_sheared) = read(matrix);
        let mut pairs = matrix.iter().flatten().zip(found.iter().flatten());
        assert!(!is_sheared && pairs.all(|(a, b)| (a - b).abs() < 1e-5), "{found:?}");
    }
    assert!(read([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0]]).1);
    let same = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    assert_eq!(read(same), (same, false));
    let text = std::fs::read_to_string(folder.path().join("a.gltf")).unwrap();
    assert!(!text.contains("KHR_texture_transform"), "{text}");
}

/// Properties of a square's material at a place, given by three corners and the shares of their edges.
fn properties(scene: &Scene, corners: [Vec3; 3], at: Vec2) -> BTreeMap<&'static str, Vec3> {
    let geometry = &scene.geometry;
    let vertices = corners.map(|corner| {
        let distance = |vertex: &usize| Vec3::from(geometry.positions[*vertex]).distance(corner);
        let vertices = 0..geometry.positions.len();
        vertices.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    });
    let value = |used: &Option<TextureUse>| {
        let Some(used) = used else { return Vec3::ONE };
        let uvs = &geometry.uvs[used.uv_set as usize];
        let [a, b, c] = vertices.map(|vertex| Vec2::from(uvs[vertex]));
        let uv = (a + at.x * (b - a) + at.y * (c - a)).extend(1.0);
        let [u, v] = used.image_from_uv.map(|row| Vec3::from(row).dot(uv));
        used.value(Vec2::new(u, v)).truncate()
    };
    let Material { kind, surface, .. } = &scene.materials[0];
    let number = |used: &Option<TextureUse>| luminance(value(used).min(Vec3::ONE));
    let anisotropy = &surface.anisotropy;
    let stretch = value(&anisotropy.direction) * Vec3::new(1.0, 1.0, anisotropy.strength);
    let stretch = anisotropy.direction.is_some().then_some(("stretch", stretch));
    let mut found = BTreeMap::from([
        ("opacity", Vec3::splat(surface.opacity.factor * number(&surface.opacity.texture))),
        ("light", surface.emission.as_ref().map_or(Vec3::ZERO, |e| e.radiance * value(&e.texture))),
    ]);
    let mut alpha = |alpha: f32| {
        let rough = number(&surface.roughness);
        found.insert("alpha", Vec3::splat(alpha * rough * rough));
    };
    let mut rest = Vec::new();
    let color = match kind {
        MaterialKind::Principled(own) => {
            alpha(own.roughness * own.roughness);
            rest.push(("metal", Vec3::splat(own.metallic * number(&surface.metallic))));
            own.base_color
        }
        MaterialKind::Conductor { alpha: width, fresnel } => {
            alpha(*width);
            let (name, color) = match fresnel {
                ConductorFresnel::Schlick { reflectance } => ("colour", *reflectance),
                ConductorFresnel::Exact { .. } => {
                    ("of exact metals", fresnel.at_normal_incidence())
                }
            };
            rest.push((name, color));
            Vec3::ONE
        }
        MaterialKind::Dielectric { ior, alpha: width, transmittance, .. } => {
            alpha(*width);
            rest.push(("index", Vec3::splat(*ior)));
            *transmittance
        }
        MaterialKind::Diffuse { reflectance } => *reflectance,
        other => panic!("{other:?}"),
    };
    found.extend(rest.into_iter().chain(stretch));
    let color = found.get("colour").copied().unwrap_or(color);
    found.insert("colour", (color * value(&surface.color)).min(Vec3::ONE));
    found
}

/// Random materials, in which no factor is 1 and no two numbers are alike.
#[test]
fn properties_that_no_warning_names_come_back() {
    let folder = Folder::new();
    let mut counts: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for case in 0..70 {
        let random: Vec<f32> =
            (0..32).map(|at| 0.1 + 0.8 * random_independent_1d(case, 7, at, 0)).collect();
        let image = |at: usize, factor: f32| {
            let wrap = if random[at + 3] < 0.5 { "clamp" } else { "repeat" };
            format!(
                "{{ texture = \"a.png\", factor = {factor}, offset = [{}, 0], wrap = \"{wrap}\", \
                 interpolation = \"{}\" }}",
                random[at + 1],
                if random[at + 4] < 0.5 { "nearest" } else { "bilinear" }
            )
        };
        let color = |at: usize, factor: f32| match random[at] < 0.5 {
            true => image(at, factor * random[at + 2]),
            false => format!("[{}, {}, {factor}]", 0.5 * random[at + 1], random[at + 2]),
        };
        let number = |at: usize| match random[at] < 0.5 {
            true => image(at, random[at + 2]),
            false => random[at + 1].to_string(),
        };
        let mut clay = match case % 5 {
            0 => format!("type = \"diffuse\"\nreflectance = {}", color(0, 0.8)),
            1 => format!(
                "type = \"principled\"\nbase_color = {}\nroughness = {}\nmetallic = {}",
                color(0, 0.8),
                number(3),
                number(6)
            ),
            2 => format!(
                "type = \"conductor\"\neta = [{}, 1.3, 0.9]\nk = [3, {}, 2.5]\nroughness = {}",
                random[0],
                5.0 * random[1],
                random[3]
            ),
            3 => format!(
                "type = \"conductor\"\nreflectance = {}\nroughness = {}",
                color(0, 0.8),
                number(3)
            ),
            _ => format!(
                "type = \"dielectric\"\nior = {}\nroughness = {}\ntransmittance = {}",
                1.2 + random[0],
                random[3],
                color(6, 0.9)
            ),
        };
        if random[9] < 0.6 {
            clay += &format!("\nemission_two_sided = true\nemission = {}", color(10, 3.0));
        }
        if random[13] < 0.4 {
            clay += &format!("\nopacity = {}", number(14));
        }
        if random[17] < 0.6 && case % 5 == 1 {
            clay += &format!("\nanisotropy = {}", image(18, random[20]));
        }
        let scene = square(&folder, &clay);
        let [.., a, b, _, c] = &scene.geometry.positions[..] else { panic!() };
        let corners = [*a, *b, *c].map(Vec3::from);
        let [gltf, pbrt, xml] = ["a.gltf", "a.pbrt", "a.xml"].map(|name| folder.path().join(name));
        let exports = [
            ("glTF", &gltf, gltf::export(&scene, &gltf)),
            ("pbrt", &pbrt, pbrt::export(&scene, &pbrt, SETTINGS)),
            ("Mitsuba", &xml, mitsuba::export(&scene, &xml, SETTINGS)),
        ];
        for (format, path, export) in exports {
            let is_loss = |text: &String| {
                text.starts_with("material") && !text.contains("masks and shadows separately")
            };
            if export.warnings.iter().any(is_loss) {
                continue;
            }
            export.write().unwrap();
            let read = Scene::load(path).unwrap();
            for at in [0.1, 0.35, 0.8].map(|x| Vec2::new(x, 0.3)) {
                let [ours, theirs] = [&scene, &read].map(|scene| properties(scene, corners, at));
                for (name, ours) in ours {
                    let Some(theirs) = theirs.get(name) else { continue };
                    *counts.entry((format, name)).or_default() += 1;
                    assert!(
                        ours.abs_diff_eq(*theirs, 0.01 * ours.max_element().max(0.6)),
                        "{format}, {name} at {at}: {ours}, not {theirs}, of\n{clay}"
                    );
                }
            }
        }
    }
    for format in ["glTF", "pbrt", "Mitsuba"] {
        for name in ["alpha", "colour", "light", "opacity"] {
            assert!(counts[&(format, name)] > 20, "{counts:?}");
        }
    }
    assert!(counts[&("glTF", "stretch")] > 5, "{counts:?}");
}
