//! Scene descriptions of pbrt-v4: every concept by a small text, errors with their places, and real
//! scenes where the folder of them is there. `docs/pbrt.md` follows the declaration of features.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    collections::HashSet,
    f32::consts::{FRAC_PI_2, PI},
    path::Path,
};

use fenestra_scene::{
    Camera, Filter, Geometry, Scene,
    coat::albedo_below_coat,
    instance::Instance,
    lamp::{LampKind, SpotFalloff},
    load::LoadOptions,
    material::{Anisotropy, ConductorFresnel, Material, MaterialKind},
    math::equal_area::direction_from_square,
    texture::{Channels, Encoding, Interpolation, Texels, Wrap},
};
use glam::{DVec3, Mat3, Vec2, Vec3};

use crate::support::{assert_each_counts, folder::Folder};

/// A triangle at the corners of the axes, counter-clockwise seen from (1, 1, 1).
const TRIANGLE: &str =
    r#"Shape "trianglemesh" "point3 P" [1 0 0 0 1 0 0 0 1] "integer indices" [0 1 2]"#;
/// A view of the origin from −z without a mirror.
const VIEW: &str = r#"LookAt 0 0 -5 0 0 0 0 1 0 Film "rgb" "integer xresolution" 200
    "integer yresolution" 100 Camera "perspective" "float fov" 60"#;
/// Warning of a scene without light.
const DARK: &str = "no light: nothing is lit";
/// A view whose camera mirrors, so that the world stays as it is.
const MIRRORED: &str = r#"Scale -1 1 1 LookAt 0 0 -5 0 0 0 0 1 0 Camera "perspective""#;

fn load(head: &str, world: &str) -> Scene {
    let folder = Folder::new();
    let text = format!("{head}\nWorldBegin\n{world}\n");
    Scene::load(&folder.write("room.pbrt", text)).unwrap_or_else(|error| panic!("{error}\n{world}"))
}

/// Loads a world seen by a camera that mirrors, so that positions stay as they are.
fn world(text: &str) -> Scene {
    load(MIRRORED, text)
}

/// Message of a world that cannot be read, without the folder.
fn message(text: &str) -> String {
    let folder = Folder::new();
    let path = folder.write("room.pbrt", format!("{MIRRORED}\nWorldBegin\n{text}"));
    let message = Scene::load(&path).expect_err(text).to_string();
    message.replace(&format!("{}/", folder.path().display()), "")
}

/// Warnings without the path that begins each.
fn warnings(scene: &Scene) -> Vec<String> {
    let strip = |warning: &String| warning.split_once(": ").unwrap().1.to_owned();
    scene.warnings.iter().map(strip).collect()
}

fn material(text: &str) -> Material {
    world(&format!("Material {text} {TRIANGLE}")).materials[0].clone()
}

/// Place in the picture, (0, 0) at the lower left corner and (1, 1) at the upper right.
fn project(camera: &Camera, aspect: f32, point: Vec3) -> Vec2 {
    let forward = (camera.look_at - camera.position).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let ray = point - camera.position;
    let height = (0.5 * camera.vertical_fov_deg).to_radians().tan() * ray.dot(forward);
    0.5 * (Vec2::new(ray.dot(right) / (height * aspect), ray.dot(up) / height) + 1.0)
}

fn positions(scene: &Scene) -> Vec<Vec3> {
    scene.geometry.positions.iter().map(|&position| Vec3::from_array(position)).collect()
}

/// Normal of a triangle by its winding.
fn normal(scene: &Scene, triangle: usize) -> Vec3 {
    let positions = positions(scene);
    let [a, b, c] = scene.geometry.triangles[triangle].map(|at| positions[at as usize]);
    (b - a).cross(c - a).normalize()
}

#[test]
fn a_point_is_where_pbrt_shows_it() {
    // The film is 2:1, so that 60° are from bottom to top: tan 30° = 0.57735.
    for (mirror, side) in [("", 1.0), ("Scale -1 1 1 ", -1.0)] {
        let scene = load(&format!("{mirror}{VIEW}"), TRIANGLE);
        let place = |index: usize| project(&scene.camera, 2.0, positions(&scene)[index]);
        let expected = Vec2::new(0.5 + side * 0.5 * (0.2 / 0.57735 / 2.0), 0.5);
        assert!((place(0) - expected).length() < 1e-4, "{} {expected}", place(0));
        let expected = Vec2::new(0.5, 0.5 + 0.5 * (0.2 / 0.57735));
        assert!((place(1) - expected).length() < 1e-4, "{} {expected}", place(1));
        assert!((place(2) - Vec2::splat(0.5)).length() < 1e-4);
        // The outside is that of the winding, whatever mirrors.
        let outside = normal(&scene, 0).dot(positions(&scene).iter().sum::<Vec3>());
        assert!(outside > 0.0, "{mirror}");
        assert_eq!((scene.film.width, scene.film.height), (200, 100));
    }
}

#[test]
fn fov_is_that_of_the_shorter_side_and_lenses_scale() {
    let tall = r#"Film "rgb" "integer xresolution" 100 "integer yresolution" 200
        Scale 0.5 0.5 0.5 Translate 0 0 5
        Camera "perspective" "float fov" 60 "float lensradius" 0.1 "float focaldistance" 3"#;
    let camera = load(tall, "").camera;
    let expected = 2.0 * (2.0 * 30_f32.to_radians().tan()).atan().to_degrees();
    assert!((camera.vertical_fov_deg - expected).abs() < 1e-3, "{camera:?}");
    // Camera from world halves, so that world from camera doubles.
    assert!(
        (camera.aperture_radius - 0.2).abs() < 1e-6 && (camera.focus_distance - 6.0).abs() < 1e-5
    );
    assert!((camera.position - Vec3::new(0.0, 0.0, 5.0)).length() < 1e-5, "{camera:?}");
    let window = r#"Camera "perspective" "float fov" 90
        "float screenwindow" [-0.8888889 0.8888889 -0.5 0.5]"#;
    let scene = load(window, "");
    assert!((scene.camera.vertical_fov_deg - 2.0 * 0.5_f32.atan().to_degrees()).abs() < 1e-3);
    assert_eq!(warnings(&scene), [DARK]);
    for side in ["0.5", "1.5"] {
        let scene = load(&window.replace("0.8888889", side), "");
        assert!(warnings(&scene)[0].contains("`screenwindow`"), "{:?}", scene.warnings);
    }
    // Half as high, and to the right of the axis and below it.
    let scene =
        load(&window.replace("-0.8888889 0.8888889 -0.5 0.5", "0 0.8888889 -1.25 -0.75"), "");
    assert_eq!(warnings(&scene), [DARK]);
    let half = (0.5 * scene.camera.vertical_fov_deg).to_radians().tan();
    let [x, y] = scene.camera.shift.map(|heights| 2.0 * heights * half);
    assert!((half - 0.25).abs() < 1e-6 && (x - 0.4444444).abs() < 1e-6 && (y + 1.0).abs() < 1e-6);
    // Rays through the corners of a crop are those of the whole film.
    let screen = "\"float screenwindow\" [-1.2777778 2.2777778 -0.75 1.25]";
    for (crop, [left, right, top, bottom], window, [right_by, up_by]) in [
        (r#""float cropwindow" [0.5 1 0.25 0.5]"#, [640.0, 1280.0, 180.0, 360.0], "", [0.0; 2]),
        (r#""integer pixelbounds" [100 400 -7 60]"#, [100.0, 400.0, 0.0, 60.0], "", [0.0; 2]),
        (r#""integer pixelbounds" [100 400 0 60]"#, [100.0, 400.0, 0.0, 60.0], screen, [0.5, 0.25]),
    ] {
        let scene = load(&format!("Film \"rgb\" {crop} Camera \"perspective\" {window}"), "");
        assert_eq!(warnings(&scene), [DARK]);
        let (width, height) = (scene.film.width as f32, scene.film.height as f32);
        assert_eq!([width, height], [right - left, bottom - top]);
        let tall = 2.0 * (0.5 * scene.camera.vertical_fov_deg).to_radians().tan();
        let [x, y] = scene.camera.shift;
        for (side, found) in [(-0.5, left), (0.5, right)] {
            let expected = (found - 640.0) / 360.0 + right_by;
            assert!((tall * (x + side * width / height) - expected).abs() < 1e-5, "{crop}");
        }
        for (side, found) in [(0.5, top), (-0.5, bottom)] {
            let expected = (360.0 - found) / 360.0 + up_by;
            assert!((tall * (y + side) - expected).abs() < 1e-5, "{crop}");
        }
    }
    let folder = Folder::new();
    let empty = "Film \"rgb\" \"float cropwindow\" [0.5 0.5 0 1] WorldBegin";
    let message = Scene::load(&folder.write("room.pbrt", empty)).unwrap_err().to_string();
    assert!(message.contains("expected a crop of at least a pixel"), "{message}");
}

#[test]
fn other_cameras_look_from_their_place() {
    let seen = |kind: &str| {
        let film = r#"Film "rgb" "integer xresolution" 200 "integer yresolution" 100"#;
        let scene = load(&format!("{film} LookAt 0 0 -5 0 0 0 0 1 0 Camera {kind}"), TRIANGLE);
        let found = warnings(&scene);
        let expected = kind.split('"').nth(1).unwrap();
        let way = if expected == "orthographic" { "from afar" } else { "of 90°" };
        let named = format!("ignored Camera `{expected}`: `perspective` {way} instead (line 1)");
        assert_eq!(found, [named.as_str(), DARK]);
        scene.camera
    };
    for kind in [
        r#""spherical" "string mapping" "equirectangular""#,
        r#""realistic" "string lensfile" "a.dat" "float aperturediameter" 8 "float focusdistance" 2"#,
    ] {
        let camera = seen(kind);
        assert_eq!(camera.position, Vec3::new(0.0, 0.0, 5.0));
        assert!((camera.vertical_fov_deg - 90.0).abs() < 1e-4, "{camera:?}");
    }
    // All of the window shows at the depth of the triangle, from so far that depth counts little.
    let camera = seen(r#""orthographic" "float screenwindow" [-4 4 -1 3]"#);
    for (point, expected) in [
        ([-4.0, -1.0, 0.0], [0.0, 0.0]),
        ([4.0, 3.0, 0.0], [1.0, 1.0]),
        ([4.0, 3.0, -4.0], [1.0, 1.0]),
    ] {
        let found = project(&camera, 2.0, Vec3::from(point))
            - Vec2::from(camera.shift) * Vec2::new(0.5, 1.0);
        assert!(found.abs_diff_eq(Vec2::from(expected), 0.02), "{point:?}: {found}");
    }
}

#[test]
fn the_film_scales_light_and_chooses_the_filter() {
    let head = r#"Film "rgb" "float iso" 200 "string filename" "a.exr" PixelFilter "box" "float xradius" 0.5
        Camera "perspective" "float shutterclose" 0.25"#;
    let lights = r#"LightSource "infinite" "rgb L" [1 2 3] "float scale" 2
        LightSource "point" AreaLightSource "diffuse""#;
    let scene = load(head, &format!("{lights} {TRIANGLE}"));
    let LampKind::Point { intensity, .. } = scene.lamps[0].kind else { panic!() };
    let emission = scene.materials[0].surface.emission.as_ref().unwrap();
    assert_eq!([intensity, emission.radiance], [Vec3::splat(0.5); 2]);
    assert_eq!(scene.film.filter, Filter::Box);
    assert_eq!((scene.film.width, scene.film.height), (1280, 720));
    assert_eq!(scene.environment.texels[0], Vec3::new(1.0, 2.0, 3.0));
    // A sky of radiance 1 lights the ground by π.
    let lit = world(r#"LightSource "infinite" "float illuminance" 6.2831853"#);
    assert_eq!(lit.environment.texels[0], Vec3::splat(2.0));
    // Light of the temperature for which the white is balanced is white.
    for (kelvin, light) in [
        (5000, r#""spectrum L" "stdillum-D50""#),
        (6500, r#""rgb L" [1 1 1]"#),
        (2855, r#""spectrum L" "stdillum-A""#),
        (3000, r#""blackbody L" 3000"#),
    ] {
        let film = format!("Film \"rgb\" \"float iso\" 50 \"float whitebalance\" {kelvin}");
        let head = format!("{film} Camera \"perspective\"");
        let world = format!("LightSource \"infinite\" {light} LightSource \"point\"");
        let scene = load(&head, &world);
        let white = scene.environment.texels[0];
        assert!(white.abs_diff_eq(Vec3::splat(0.5), 3e-3), "{kelvin}: {white}");
        let LampKind::Point { intensity, .. } = scene.lamps[0].kind else { panic!() };
        assert!(kelvin > 6000 || intensity.x < intensity.z, "{kelvin}: {intensity}");
        assert_eq!(warnings(&scene), [""; 0]);
    }
    let [below, above] = [6996, 6997].map(|kelvin| {
        let film = format!("Film \"rgb\" \"float whitebalance\" {kelvin}");
        let head = format!("{film} Camera \"perspective\"");
        load(&head, r#"LightSource "infinite""#).environment.texels[0]
    });
    assert!(below.x > 1.0 && below.abs_diff_eq(above, 1e-3), "{below} {above}");
    let other = load(r#"PixelFilter "mitchell" Camera "perspective""#, "");
    assert_eq!(other.film.filter, Filter::Gaussian);
    assert!(warnings(&other)[0].contains("PixelFilter `mitchell`"), "{:?}", other.warnings);
}

#[test]
fn transformations_follow_one_another() {
    let at_origin = |transform: &str| {
        let scene = world(&format!("{transform} {TRIANGLE}"));
        positions(&scene)[0]
    };
    let cases = [
        ("Translate 1 2 3 Scale 2 1 1", [3.0, 2.0, 3.0]),
        ("Scale 2 1 1 Translate 1 2 3", [4.0, 2.0, 3.0]),
        ("Rotate 90 0 0 1", [0.0, 1.0, 0.0]),
        ("Translate 9 9 9 Transform [1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1]", [6.0, 6.0, 7.0]),
        ("Translate 1 0 0 ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1]", [7.0, 6.0, 7.0]),
        (
            "Translate 1 0 0 CoordinateSystem \"a\" Identity CoordSysTransform \"a\"",
            [2.0, 0.0, 0.0],
        ),
        ("AttributeBegin Translate 1 0 0 AttributeEnd", [1.0, 0.0, 0.0]),
        ("TransformBegin Translate 1 0 0 TransformEnd", [1.0, 0.0, 0.0]),
        // The camera stands at z = −5 and mirrors x.
        ("CoordSysTransform \"camera\"", [-1.0, 0.0, -5.0]),
    ];
    for (transform, expected) in cases {
        let found = at_origin(transform);
        assert!((found - Vec3::from_array(expected)).length() < 1e-5, "{transform}: {found}");
    }
}

#[test]
fn sides_are_those_of_vertex_normals_else_of_the_winding() {
    let mesh = |normals: &str| {
        format!(
            r#"Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2] {normals}"#
        )
    };
    let against = r#""normal N" [0 0 -1 0 0 -1 0 0 -1]"#;
    let cases = [
        ("", "", 1.0),
        ("", against, -1.0),
        ("ReverseOrientation", "", -1.0),
        ("ReverseOrientation", against, 1.0),
        ("ReverseOrientation ReverseOrientation", "", 1.0),
        ("Scale -1 1 1", "", 1.0),
        ("Scale 1 1 -1", "", -1.0),
        ("Scale -1 1 1 ReverseOrientation", "", -1.0),
    ];
    for (state, normals, side) in cases {
        let text = format!("AreaLightSource \"diffuse\" {state} {}", mesh(normals));
        // In the mirrored world, z is turned, and so is the side.
        for (head, turn) in [(MIRRORED, 1.0), (VIEW, -1.0)] {
            let scene = load(head, &text);
            let found = normal(&scene, 0).z * turn;
            assert!((found - side).abs() < 1e-6, "{state} {normals}: {found}");
            if !normals.is_empty() {
                let shading = Vec3::from_array(scene.geometry.normals[0]);
                assert!(shading.dot(normal(&scene, 0)) > 0.9, "{state}");
            }
            let emission = scene.materials[0].surface.emission.as_ref().unwrap();
            assert!(!emission.two_sided && emission.radiance == Vec3::ONE);
        }
    }
}

#[test]
fn quadrics_and_patches_face_outward() {
    for (shape, area) in [
        ("\"sphere\" \"float radius\" 2", 16.0 * PI),
        ("\"cylinder\" \"float zmin\" 0 \"float zmax\" 3", 6.0 * PI),
        ("\"disk\" \"float height\" 1 \"float innerradius\" 0.5", 0.75 * PI),
        ("\"sphere\" \"float radius\" 2 \"float zmin\" 1 \"float phimax\" 180", 2.0 * PI),
        ("\"sphere\" \"float zmin\" 0.5 \"float zmax\" -0.5", 2.0 * PI),
        ("\"cylinder\" \"float phimax\" 90", PI),
        ("\"disk\" \"float phimax\" 270", 0.75 * PI),
        ("\"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 2 0 2 2 0] \"integer faceIndices\" 3", 4.0),
        (
            r#""loopsubdiv" "integer levels" 1 "point3 P" [1 0 0 0 1 0 0 0 1]
            "integer indices" [0 1 2]"#,
            0.3,
        ),
    ] {
        let scene = world(&format!("Shape {shape}"));
        assert_eq!(warnings(&scene), [DARK]);
        let positions = positions(&scene);
        let (mut sum, mut edges) = (0.0, HashSet::new());
        for (index, triangle) in scene.geometry.triangles.iter().enumerate() {
            let [a, b, c] = *triangle;
            let are_new = [[a, b], [b, c], [c, a]].map(|edge| edges.insert(edge));
            assert_eq!(are_new, [true; 3], "{shape}: triangles overlap");
            let [a, b, c] = triangle.map(|at| positions[at as usize]);
            sum += 0.5 * (b - a).cross(c - a).length();
            let centre = (a + b + c) / 3.0;
            let outward = match shape.contains("disk") || shape.contains("bilinear") {
                true => Vec3::Z,
                false if shape.contains("cylinder") => centre.with_z(0.0),
                false => centre,
            };
            assert!(normal(&scene, index).dot(outward) > 0.0, "{shape}");
        }
        assert!((sum - area).abs() < 0.02 * area.max(5.0), "{shape}: {sum} {area}");
    }
    // Parts begin at +X, and their coordinates end with them.
    let quarter = world(
        r#"Texture "t" "spectrum" "checkerboard" Material "diffuse" "texture reflectance" "t"
        Shape "cylinder" "float phimax" 90 "float zmax" 3"#,
    );
    for (at, [u, v]) in positions(&quarter).iter().zip(&quarter.geometry.uvs[0]) {
        let (sine, cosine) = (u * FRAC_PI_2).sin_cos();
        let expected = Vec3::new(cosine, sine, 4.0 * v - 1.0);
        assert!(at.abs_diff_eq(expected, 1e-5), "{at} {u} {v}");
    }
    let curved = world("Shape \"bilinearmesh\" \"point3 P\" [1 1 1 2 1 2 1 2 2 2 2 4]");
    assert_eq!(curved.geometry.triangles.len(), 512);
    let Geometry { normals, uvs, .. } = &curved.geometry;
    for (at, (normal, uv)) in positions(&curved).iter().zip(normals.iter().zip(&uvs[0])) {
        let expected = Vec3::new(-at.y, -at.x, 1.0).normalize();
        assert!((at.z - at.x * at.y).abs() < 1e-5, "a saddle, not {at}");
        assert!(Vec3::from(*normal).abs_diff_eq(expected, 1e-5), "{at}: {normal:?}");
        assert!((at.truncate() - 1.0).abs_diff_eq(Vec2::from(*uv), 1e-5), "{at}: {uv:?}");
    }
    let flat = world("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0 2 1 0]");
    assert_eq!(flat.geometry.triangles.len(), 2);
    // v of a sphere runs from −z to +z.
    let sphere = world(
        r#"Texture "t" "spectrum" "checkerboard"
        Material "diffuse" "texture reflectance" "t" Shape "sphere""#,
    );
    let top = sphere.geometry.positions.iter().position(|position| position[2] > 0.999).unwrap();
    assert!(sphere.geometry.uvs[0][top][1] > 0.9);
    // That of a ring runs from 0 at its rim to 1 at its hole.
    let ring = world(
        r#"Texture "t" "spectrum" "checkerboard"
        Material "diffuse" "texture reflectance" "t" Shape "disk" "float innerradius" 0.5"#,
    );
    for ([x, y, _], [_, v]) in ring.geometry.positions.iter().zip(&ring.geometry.uvs[0]) {
        assert!((x.hypot(*y) - (1.0 - 0.5 * v)).abs() < 1e-4, "{x} {y} {v}");
    }
}

#[test]
fn objects_are_repeated_where_their_instances_stand() {
    let text = format!(
        r#"ObjectBegin "a" Translate 1 0 0 {TRIANGLE} ObjectEnd
        Translate 0 10 0 ObjectInstance "a" Scale 2 2 2 ObjectInstance "a""#
    );
    let scene = world(&text);
    let found = positions(&scene);
    assert_eq!(scene.geometry.triangles.len(), 2);
    assert_eq!(found[0], Vec3::new(2.0, 10.0, 0.0));
    assert_eq!(found[3], Vec3::new(4.0, 10.0, 0.0));
    assert!(message("ObjectInstance \"b\"").starts_with("room.pbrt:3:1: there is no object `b`"));
    assert!(
        message("ObjectBegin \"a\" ObjectInstance \"a\" ObjectEnd").contains("inside an object")
    );
}

#[test]
fn materials_are_the_nearest() {
    let close = |found: Vec3, expected: [f32; 3]| {
        assert!((found - Vec3::from_array(expected)).abs().max_element() < 1e-4, "{found}");
    };
    assert!(matches!(material(r#""diffuse""#).kind,
        MaterialKind::Diffuse { reflectance } if reflectance == Vec3::splat(0.5)));
    let MaterialKind::DiffuseTransmission { reflectance, transmittance } =
        material(r#""diffusetransmission" "rgb transmittance" [0.1 0.2 0.8] "float scale" 0.5"#)
            .kind
    else {
        panic!()
    };
    close(reflectance, [0.125; 3]);
    close(transmittance, [0.05, 0.1, 0.4]);
    let bright = r#""diffusetransmission" "rgb reflectance" [0.1 0.2 0.9] "float scale" 2"#;
    let MaterialKind::DiffuseTransmission { reflectance, .. } = material(bright).kind else {
        panic!()
    };
    close(reflectance, [0.2, 0.4, 1.0]);
    let MaterialKind::Plastic { diffuse, alpha, ior } = material(
        r#""coateddiffuse" "rgb reflectance" [0.1 0.2 0.3] "float roughness" 0.25 "float eta" 1.3"#,
    )
    .kind
    else {
        panic!()
    };
    close(diffuse, [0.1, 0.2, 0.3].map(albedo_below_coat(1.3)));
    assert_eq!((alpha, ior), (0.5, 1.3));
    for (roughness, expected) in [(0.25, 0.25), (4.0, 1.0)] {
        let plain = r#""dielectric" "bool remaproughness" false "float roughness""#;
        let MaterialKind::Dielectric { alpha, .. } = material(&format!("{plain} {roughness}")).kind
        else {
            panic!()
        };
        assert_eq!(alpha, expected);
    }
    let MaterialKind::Conductor { alpha, fresnel: ConductorFresnel::Exact { eta, k, .. } } =
        material(r#""conductor" "rgb eta" [1.6 0.8 0.5] "spectrum k" "metal-Ag-k""#).kind
    else {
        panic!()
    };
    close(eta, [1.6, 0.8, 0.5]);
    close(k, [4.049, 3.343, 2.393]);
    assert_eq!(alpha, 1e-3);
    // Metal keeps two widths, of which the smaller is its own: 0.2 + 0.8 · 0.4 = 0.52 across.
    for (u, v, rotation) in [(0.52, 0.2, 0.0), (0.2, 0.52, FRAC_PI_2)] {
        let brushed = material(&format!(
            r#""conductor" "bool remaproughness" false "float uroughness" {u} "float vroughness" {v}"#
        ));
        let MaterialKind::Conductor { alpha, .. } = brushed.kind else { panic!() };
        let Anisotropy { strength, rotation: found, direction } = brushed.surface.anisotropy;
        assert_eq!((alpha, found, direction), (0.2, rotation, None));
        assert!((strength * strength - 0.4).abs() < 1e-6, "{strength}");
    }
    let glass = r#""dielectric" "bool remaproughness" false "float uroughness" 0.5 "float vroughness" 0.25"#;
    let MaterialKind::Dielectric { alpha, .. } = material(glass).kind else { panic!() };
    assert_eq!((alpha, material(glass).surface.anisotropy.strength), (0.375, 0.0));
    // Two roughnesses become widths before their mean.
    let frosted = material(r#""dielectric" "float uroughness" 0.04 "float vroughness" 0.36"#).kind;
    let MaterialKind::Dielectric { alpha, .. } = frosted else { panic!() };
    assert!((alpha - 0.4).abs() < 1e-6, "{alpha}");
    // The metal below a coat has a roughness of its own, and reflects less than in air.
    let coated = r#""coatedconductor" "float conductor.roughness" 0.25
        "float interface.roughness" 0.0625 "rgb conductor.eta" [1.5 1.5 0.3] "rgb conductor.k" [0 3 3]"#;
    let MaterialKind::Principled(metal) = material(coated).kind else { panic!() };
    assert_eq!((metal.metallic, metal.roughness, metal.coat_weight), (1.0, 0.5_f32.sqrt(), 1.0));
    assert_eq!(metal.coat_roughness, 0.5);
    close(metal.base_color, [0.0, 0.5, (0.64 + 4.0) / (1.44 + 4.0)]);
    // η = 1 and k = 2√r/√(1 − r) again, over the index of the coat; as a number and as an image.
    let half = material(r#""coatedconductor" "rgb reflectance" [0.5 0.5 0.5]"#);
    let MaterialKind::Principled(metal) = half.kind else { panic!() };
    close(metal.base_color, [17.0 / 41.0; 3]);
    let image = world(
        r#"Texture "t" "spectrum" "checkerboard" "rgb tex1" [0.5 0.5 0.5] "rgb tex2" [0.5 0.5 0.5]
        Material "coatedconductor" "texture reflectance" "t" Shape "sphere""#,
    );
    let mean = image.materials[0].surface.color.as_ref().unwrap().mean()[0];
    assert!((mean - 17.0 / 41.0).abs() < 0.01, "{mean}");
    // η = 1 and k = 2√r/√(1 − r) reflect r at normal incidence.
    let MaterialKind::Conductor { fresnel: ConductorFresnel::Exact { eta, k, .. }, .. } =
        material(r#""conductor" "rgb reflectance" [0.5 1 0]"#).kind
    else {
        panic!()
    };
    close(eta, [1.0; 3]);
    close(k * k / (k * k + 4.0), [0.5, 0.9999, 0.0]);
    let MaterialKind::Dielectric { ior, alpha, .. } =
        material(r#""dielectric" "spectrum eta" "glass-BK7""#).kind
    else {
        panic!()
    };
    assert_eq!((ior, alpha), (1.5168, 0.0));
    let MaterialKind::Dielectric { ior, alpha, .. } =
        material(r#""dielectric" "rgb eta" [1.4 1.4 1.4] "float roughness" 0.04"#).kind
    else {
        panic!()
    };
    assert!((ior - 1.4).abs() < 1e-6 && (alpha - 0.2).abs() < 1e-6);
    let filled = |medium: &str| {
        world(&format!(
            r#"MakeNamedMedium "green" "string type" "homogeneous" "rgb sigma_a" [4 1 2] {medium}
            AttributeBegin MediumInterface "green" "" Material "dielectric" {TRIANGLE} AttributeEnd
            Material "dielectric" {TRIANGLE}"#
        ))
    };
    let clear = filled(r#""rgb sigma_s" [0 0 0] "float scale" 0.5"#);
    let absorption = |index: usize| clear.materials[index].kind.absorption();
    assert_eq!([absorption(0), absorption(1)], [Some(Vec3::new(2.0, 0.5, 1.0)), None]);
    assert_eq!(warnings(&clear), [DARK]);
    for medium in [
        "",
        r#""rgb sigma_s" [0 0 0] "string preset" "Milk""#,
        r#""rgb sigma_s" [0 0 0] "rgb Le" [1 1 1]"#,
    ] {
        let scattering = filled(medium);
        assert_eq!(scattering.materials[0].kind.absorption(), None);
        assert!(warnings(&scattering)[0].contains("ignored other media"), "{medium}");
    }
    assert!(message(&format!("MediumInterface \"fog\" {TRIANGLE}")).contains("no such medium"));
    assert!(matches!(
        material(r#""thindielectric""#).kind,
        MaterialKind::ThinDielectric { ior: 1.5, .. }
    ));
    for (parameter, expected) in [
        ("", "expected a `filename`"),
        (r#""string filename" "../a.bsdf""#, "`../a.bsdf` leads out of that folder"),
    ] {
        let found = message(&format!("Material \"measured\" {parameter} {TRIANGLE}"));
        assert!(found.contains(expected), "{found}");
    }
    let lost = r#"MakeNamedMaterial "a" "string type" "measured" "string filename" "a.bsdf""#;
    let lost = world(&format!("{lost} NamedMaterial \"a\" {TRIANGLE}"));
    assert!(matches!(lost.materials[0].kind, MaterialKind::Diffuse { .. }));
    assert!(warnings(&lost)[0].starts_with("ignored measured `a.bsdf`, which is not there"));
    let older = ["Material \"matte\"", "Texture \"t\" \"color\" \"imagemap\""];
    for text in older.map(|text| format!("{text} {TRIANGLE}")) {
        assert!(message(&text).contains("--upgrade"), "{text}");
    }
    assert!(
        message(&format!("NamedMaterial \"x\" {TRIANGLE}"))
            .starts_with("room.pbrt:3:1: NamedMaterial")
    );
}

#[test]
fn what_lies_below_a_surface_gives_its_colour() {
    let close = |found: Vec3, expected: [f32; 3], tolerance: f32| {
        assert!(found.abs_diff_eq(Vec3::from_array(expected), tolerance), "{found} {expected:?}");
    };
    let plastic = |text: &str| match material(&format!("\"subsurface\" {text}")).kind {
        MaterialKind::Plastic { diffuse, ior, .. } => (diffuse, ior),
        other => panic!("{other:?}"),
    };
    // Diffuse reflectances as published with the coefficients.
    for (name, ior, expected) in [
        ("Skin1", 1.3, [0.44, 0.22, 0.13]),
        ("Skin2", 1.3, [0.63, 0.44, 0.34]),
        ("Marble", 1.5, [0.83, 0.79, 0.75]),
        ("Ketchup", 1.3, [0.16, 0.01, 0.00]),
        ("Spectralon", 1.3, [1.0; 3]),
    ] {
        let (diffuse, found) = plastic(&format!("\"string name\" \"{name}\" \"float eta\" {ior}"));
        close(diffuse, expected, 0.01);
        assert_eq!(found, ior);
    }
    // Milk without a word; reduced scattering leaves out what goes on forward.
    let (milk, ior) = plastic("");
    assert_eq!(ior, 1.33);
    let own = plastic(
        r#""rgb sigma_a" [0.0011 0.0024 0.014] "rgb sigma_s" [5.1 6.42 7.54] "float g" 0.5"#,
    );
    close(own.0, milk.to_array(), 1e-4);
    close(plastic(r#""rgb reflectance" [0.1 0.2 0.3] "rgb mfp" [1 2 3]"#).0, [0.1, 0.2, 0.3], 0.0);
    close(plastic(r#""string name" "Jam""#).0, [0.5; 3], 0.0);
    for strange in [
        r#""rgb sigma_a" [0 0 0] "rgb sigma_s" [0 0 0]"#,
        r#""float eta" 4"#,
        r#""float eta" 1.02 "float g" 7"#,
    ] {
        let (diffuse, _) = plastic(strange);
        assert!((0.0..=1.0).contains(&diffuse.min_element()), "{strange} {diffuse}");
        assert!((0.0..=1.0).contains(&diffuse.max_element()), "{strange} {diffuse}");
    }

    let hair = |text: &str| match material(&format!("\"hair\" {text}")).kind {
        MaterialKind::Diffuse { reflectance } => reflectance,
        other => panic!("{other:?}"),
    };
    // The width 0.3 makes 5.888 of the polynomial: (ln 0.5 / 5.888)² and so on.
    close(hair(r#""rgb sigma_a" [0.013858 0.055432 0]"#), [0.5, 0.25, 1.0], 1e-3);
    close(hair(r#""float pheomelanin" 0"#), [1.0; 3], 1e-6);
    // Each pigment absorbs by colours of its own [d'Eon et al. 2011], as pbrt-v4 has them.
    for (pigments, absorption) in [
        (r#""float eumelanin" 0.5"#, "0.2095 0.3485 0.685"),
        (r#""float pheomelanin" 0.5"#, "0.0935 0.2 0.525"),
        (r#""float eumelanin" 0.5 "float pheomelanin" 0.5"#, "0.303 0.5485 1.21"),
    ] {
        let own = hair(&format!(r#""rgb sigma_a" [{absorption}]"#));
        close(hair(pigments), own.to_array(), 1e-6);
    }
    let [brown, fair] = [hair(""), hair(r#""float eumelanin" 0.13"#)];
    close(brown, fair.map(|share| share.powf(10_f32.sqrt())).to_array(), 1e-5);
    assert!(fair.x > 1.4 * fair.y && fair.y > 1.4 * fair.z, "{fair}");
}

#[test]
fn mixtures_and_surfaces_that_are_not_there() {
    let text = format!(
        r#"MakeNamedMaterial "red" "string type" "diffuse" "rgb reflectance" [1 0 0]
        MakeNamedMaterial "none" "string type" "interface"
        MakeNamedMaterial "thin" "string type" "mix" "string materials" ["red" "none"] "float amount" 0.75
        NamedMaterial "thin" {TRIANGLE}
        NamedMaterial "none" AreaLightSource "diffuse" {TRIANGLE}"#
    );
    let scene = world(&text);
    assert_eq!(scene.geometry.triangles.len(), 1);
    assert_eq!(scene.materials.len(), 1);
    assert_eq!(scene.materials[0].surface.opacity.factor, 0.25);
    // Mixtures one after another are not mixtures of mixtures.
    let mix = "Material \"mix\" \"string materials\" [\"red\" \"none\"] \"float amount\"";
    let many = (1..100).map(|share| format!("{mix} 0.{share:02} {TRIANGLE}"));
    assert_eq!(world(&(text.clone() + &many.collect::<String>())).materials.len(), 100);
    assert_eq!(
        warnings(&scene),
        ["ignored area lights without a surface (line 7): left out, as in pbrt", DARK]
    );
    for (alpha, expected) in [(0.5, 0.5), (1.5, 1.0)] {
        let alpha = world(&format!("{TRIANGLE} \"float alpha\" {alpha} {TRIANGLE}"));
        assert_eq!(alpha.materials.len(), 2);
        assert_eq!(alpha.materials[0].surface.opacity.factor, expected);
    }
    let attribute = world(&format!("Attribute \"shape\" \"float alpha\" 0.5 {TRIANGLE}"));
    assert_eq!(attribute.materials[0].surface.opacity.factor, 0.5);
}

/// Writes an image of 2×1 texels: red and half-opaque blue.
fn image(folder: &Folder) {
    let bytes = [255, 0, 0, 255, 0, 0, 255, 128];
    image::save_buffer(folder.path().join("a.png"), &bytes, 2, 1, image::ColorType::Rgba8).unwrap();
    let bytes = [255, 0, 0, 0, 255, 255];
    image::save_buffer(folder.path().join("b.png"), &bytes, 2, 1, image::ColorType::Rgb8).unwrap();
}

fn textured(textures: &str, rest: &str) -> Scene {
    let folder = Folder::new();
    image(&folder);
    let text = format!("{MIRRORED} WorldBegin {textures}\nMaterial {rest} {TRIANGLE}");
    Scene::load(&folder.write("room.pbrt", text)).unwrap()
}

#[test]
fn images_are_scaled_inverted_mixed_and_placed() {
    let head = r#"Texture "a" "spectrum" "imagemap" "string filename" "a.png""#;
    let rest = r#""diffuse" "texture reflectance" "t""#;
    let color = |textures: &str| {
        let scene = textured(&format!("{head} {textures}"), rest);
        assert!(matches!(scene.materials[0].kind,
            MaterialKind::Diffuse { reflectance } if reflectance == Vec3::ONE));
        scene.materials[0].surface.color.clone().unwrap()
    };
    let plain = color(
        r#"Texture "t" "spectrum" "imagemap" "string filename" "a.png"
        "float uscale" 2 "float vscale" 3 "float udelta" 0.25 "float vdelta" 0.5
        "string wrap" "clamp" "string filter" "point" "float scale" 0.5 "bool invert" true"#,
    );
    assert_eq!(plain.image_from_uv, [[2.0, 0.0, 0.25], [0.0, -3.0, 0.5]]);
    assert_eq!(plain.wrap, [Wrap::Clamp; 2]);
    assert_eq!(plain.interpolation, Interpolation::Nearest);
    assert_eq!((plain.scale, plain.bias), ([-0.5; 3], [1.0; 3]));
    assert_eq!((plain.encoding, plain.channels), (Encoding::Srgb, Channels::Color));
    let scaled = color(r#"Texture "t" "spectrum" "scale" "texture tex" "a" "float scale" 0.25"#);
    assert_eq!(scaled.scale, [0.25; 3]);
    let mixed = color(
        r#"Texture "t" "spectrum" "mix" "texture tex1" "a" "rgb tex2" [1 0 0.5] "float amount" 0.25"#,
    );
    assert_eq!((mixed.scale, mixed.bias), ([0.75; 3], [0.25, 0.0, 0.125]));
    let mixed = color(
        r#"Texture "t" "spectrum" "mix" "rgb tex1" [1 0 0.5] "texture tex2" "a" "float amount" 0.25"#,
    );
    assert_eq!((mixed.scale, mixed.bias), ([0.25; 3], [0.75, 0.0, 0.375]));
    let board = color(
        r#"Texture "t" "spectrum" "checkerboard" "rgb tex1" [1 0 0] "rgb tex2" [0 1 0]
        "float uscale" 8 "float vscale" 6 "float udelta" 1 "float vdelta" 0.5"#,
    );
    assert_eq!(board.image_from_uv, [[4.0, 0.0, 0.5], [0.0, 3.0, 0.25]]);
    let Texels::Halves(texels) = &board.texture.texels else { panic!() };
    assert_eq!(texels[0], texels[3]);
    assert_eq!(texels[0].map(half::f16::to_f32), [1.0, 0.0, 0.0, 1.0]);
    assert_eq!(texels[1].map(half::f16::to_f32), [0.0, 1.0, 0.0, 1.0]);
}

#[test]
fn images_are_multiplied_and_mixed_texel_by_texel() {
    let head = r#"Texture "a" "spectrum" "imagemap" "string filename" "a.png"
        Texture "f" "float" "imagemap" "string filename" "a.png"
        Texture "g" "float" "imagemap" "string filename" "b.png"
        Texture "turned" "spectrum" "imagemap" "string filename" "a.png" "float uscale" -1"#;
    let means = "ignored `scale` and `mix` of images on other coordinates than the first (line 5): \
                 their means count";
    // Red is opaque; blue is opaque by half.
    let (half, third) = (128.0 / 255.0, 1.0 / 3.0);
    for (texture, expected, lost) in [
        (
            r#""scale" "texture tex" "a" "texture scale" "f""#,
            [[1.0, 0.0, 0.0], [0.0, 0.0, half]],
            None,
        ),
        (
            r#""mix" "rgb tex1" [0 1 0] "texture tex2" "a" "texture amount" "f""#,
            [[1.0, 0.0, 0.0], [0.0, 1.0 - half, half]],
            None,
        ),
        // The number of a colour is its mean.
        (
            r#""scale" "texture tex" "a" "texture scale" "g""#,
            [[third, 0.0, 0.0], [0.0, 0.0, 2.0 * third]],
            None,
        ),
        (
            r#""mix" "rgb tex1" [0 1 0] "texture tex2" "a" "texture amount" "g""#,
            [[third, 2.0 * third, 0.0], [0.0, third, 2.0 * third]],
            None,
        ),
        (
            r#""mix" "texture tex1" "a" "texture tex2" "turned" "float amount" 0.25"#,
            [[0.875, 0.0, 0.125], [0.125, 0.0, 0.875]],
            Some(means),
        ),
    ] {
        let scene = textured(
            &format!("{head}\nTexture \"t\" \"spectrum\" {texture}"),
            r#""diffuse" "texture reflectance" "t""#,
        );
        let color = scene.materials[0].surface.color.as_ref().unwrap();
        assert_eq!((color.encoding, color.channels), (Encoding::Linear, Channels::Color));
        let Texels::Halves(texels) = &color.texture.texels else { panic!() };
        for (texel, expected) in texels.iter().zip(expected) {
            for (found, expected) in texel.iter().zip(expected) {
                assert!((found.to_f32() - expected).abs() < 1e-3, "{texture}: {texels:?}");
            }
        }
        let warnings = warnings(&scene);
        assert_eq!(warnings.iter().find(|text| text.contains("mix")).map(|text| &text[..]), lost);
    }
}

#[test]
fn the_number_of_a_coloured_image_scales_all_channels_alike() {
    let folder = Folder::new();
    let bytes = [255, 0, 0, 255, 255, 0];
    image::save_buffer(folder.path().join("a.png"), &bytes, 2, 1, image::ColorType::Rgb8).unwrap();
    let text = format!(
        r#"{MIRRORED} WorldBegin Texture "f" "float" "imagemap" "string filename" "a.png"
        Texture "t" "spectrum" "scale" "rgb tex" [0.3 0.6 0.9] "texture scale" "f"
        Material "diffuse" "texture reflectance" "t" {TRIANGLE}"#
    );
    let scene = Scene::load(&folder.write("room.pbrt", text)).unwrap();
    let values = scene.materials[0].surface.color.as_ref().unwrap().values();
    for (found, expected) in values.iter().zip([[0.1, 0.2, 0.3], [0.2, 0.4, 0.6]]) {
        assert!(Vec3::from_slice(found).abs_diff_eq(expected.into(), 1e-3), "{values:?}");
    }
}

#[test]
fn an_image_is_decoded_as_each_texture_says() {
    let folder = Folder::new();
    let grey = folder.path().join("a.png");
    image::save_buffer(grey, &[128; 4], 1, 1, image::ColorType::Rgba8).unwrap();
    let value = 128.0_f32 / 255.0;
    let expected = [
        ("sRGB", ((value + 0.055) / 1.055).powf(2.4)),
        ("linear", value),
        ("gamma 2.2", value.powf(2.2)),
        ("gamma 1.8", value.powf(1.8)),
    ];
    let textured = expected.map(|(encoding, _)| {
        format!(
            r#"Texture "{encoding}" "spectrum" "imagemap" "string filename" "a.png"
            "string encoding" "{encoding}"
            Material "diffuse" "texture reflectance" "{encoding}" {TRIANGLE}"#
        )
    });
    let text = format!("{MIRRORED} WorldBegin {}", textured.join("\n"));
    let scene = Scene::load(&folder.write("room.pbrt", text)).unwrap();
    for (material, (encoding, expected)) in scene.materials.iter().zip(expected) {
        let [red, .., opacity] = material.surface.color.as_ref().unwrap().values()[0];
        assert!((red - expected).abs() < 1e-3, "{encoding}: {red}, expected {expected}");
        assert!((opacity - value).abs() < 1e-3, "{encoding}: {opacity}, expected {value}");
    }
}

#[test]
fn numbers_are_opacity_or_colours_and_roughness_is_mapped() {
    let float = r#"Texture "f" "float" "imagemap" "string filename" "a.png""#;
    let folder = Folder::new();
    image(&folder);
    let text = format!("{MIRRORED} WorldBegin {float} {TRIANGLE} \"texture alpha\" \"f\"");
    let scene = Scene::load(&folder.write("room.pbrt", text)).unwrap();
    let opacity = scene.materials[0].surface.opacity.texture.clone().unwrap();
    assert_eq!(opacity.channels, Channels::Alpha);
    // Meshes without coordinates have those of pbrt.
    assert_eq!(scene.geometry.uvs[0], [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
    assert!(scene.inputs.iter().any(|input| input.ends_with("a.png")));
    let rough = textured(float, r#""coateddiffuse" "texture roughness" "f""#);
    let texture = rough.materials[0].surface.roughness.clone().unwrap();
    let Texels::Halves(texels) = &texture.texture.texels else { panic!() };
    // √α of α = √roughness.
    let expected = (128.0_f32 / 255.0).sqrt().sqrt();
    assert!((texels[1][0].to_f32() - expected).abs() < 1e-3);
    assert!(matches!(rough.materials[0].kind, MaterialKind::Plastic { alpha: 1.0, .. }));
    let normal = textured("", r#""diffuse" "string normalmap" "a.png""#);
    let map = normal.materials[0].surface.normal.clone().unwrap();
    assert_eq!((map.encoding, map.image_from_uv[1]), (Encoding::Linear, [0.0, -1.0, 1.0]));
    assert_eq!(normal.geometry.tangents.len(), 3);
    // Along u, which falls with x of the shape; the bitangent is the outer normal × the tangent.
    for (scale, x) in [(1, -1.0), (-1, 1.0)] {
        let mesh = r#""point3 P" [0 0 0 1 0 0 0 1 0] "point2 uv" [1 1 0 1 1 2]"#;
        let scaled = format!("Scale {scale} 1 1 Shape \"trianglemesh\" {mesh}");
        let normal = textured("", &format!("\"diffuse\" \"string normalmap\" \"a.png\" {scaled}"));
        assert_eq!(normal.geometry.tangents[0], [x, 0.0, 0.0, 1.0]);
    }
    // Heights of two texels, the left one higher: those of the channel of opacity.
    let clamped = format!("{float} \"string wrap\" \"clamp\"");
    let bumpy = textured(&clamped, r#""diffuse" "texture displacement" "f""#);
    let map = bumpy.materials[0].surface.normal.clone().unwrap();
    assert_eq!((map.encoding, map.channels), (Encoding::Linear, Channels::Color));
    assert!(map.value(Vec2::splat(0.3)).x > 0.6 && bumpy.geometry.tangents.is_empty());
    assert!(!bumpy.warnings.iter().any(|warning| warning.contains("displacement")));
    // The share of a surface that is not there is what the image leaves: here 1 − (1 − value).
    let thin = textured(
        r#"Texture "f" "float" "imagemap" "string filename" "a.png" "bool invert" true
        MakeNamedMaterial "red" "string type" "diffuse"
        MakeNamedMaterial "none" "string type" "interface""#,
        r#""mix" "string materials" ["red" "none"] "texture amount" "f""#,
    );
    let opacity = thin.materials[0].surface.opacity.texture.clone().unwrap();
    assert_eq!((opacity.scale, opacity.bias), ([1.0; 3], [0.0; 3]));
}

#[test]
fn lamps_have_their_places_and_powers() {
    let text = r#"Translate 1 0 0
        LightSource "point" "rgb I" [1 2 3] "float scale" 2 "point3 from" [0 1 0]
        LightSource "point" "float power" 12.566371
        LightSource "distant" "point3 from" [0 1 0] "point3 to" [0 0 0] "float illuminance" 6
            "float scale" 0.5
        LightSource "spot" "float coneangle" 40 "float conedeltaangle" 10 "point3 to" [1 0 0]
        LightSource "spot" "float coneangle" 60 "float conedeltaangle" 60 "float power" 3"#;
    let scene = world(text);
    let kinds: Vec<_> = scene.lamps.iter().map(|lamp| lamp.kind).collect();
    assert_eq!(
        kinds[0],
        LampKind::Point { position: Vec3::ONE.with_z(0.0), intensity: Vec3::new(2.0, 4.0, 6.0) }
    );
    assert!(
        matches!(kinds[1], LampKind::Point { intensity, .. } if (intensity - 1.0).length() < 1e-5)
    );
    let down = Vec3::NEG_Y;
    assert_eq!(kinds[2], LampKind::Directional { direction: down, irradiance: Vec3::splat(3.0) });
    let LampKind::Spot(spot) = kinds[3] else { panic!() };
    assert_eq!((spot.direction, spot.falloff), (Vec3::X, SpotFalloff::SmoothCosine));
    assert!((spot.inner_angle_rad - 30_f32.to_radians()).abs() < 1e-6);
    assert!((spot.outer_angle_rad - 40_f32.to_radians()).abs() < 1e-6);
    // A smooth edge lets half of the light through: here (cos 0 + cos 60°) / 2 is 3/4.
    let LampKind::Spot(spot) = kinds[4] else { panic!() };
    let power = 2.0 * PI * (1.0 - 0.75) * spot.intensity;
    assert!((power - 3.0).length() < 1e-4, "{power}");
    assert_eq!(warnings(&scene), [""; 0]);
    // A plain camera mirrors the world in z.
    let far = load(VIEW, r#"LightSource "point" "point3 from" [0 0 4]"#);
    assert!(matches!(far.lamps[0].kind, LampKind::Point { position, .. } if position.z == -4.0));
    // The disk has the area π, and one side or two.
    for (sides, two_sided) in [(1.0, "false"), (2.0, "true")] {
        let light = format!(r#""diffuse" "float power" 3 "bool twosided" {two_sided}"#);
        let area = world(&format!(r#"AreaLightSource {light} Shape "disk""#));
        let radiance = area.materials[0].surface.emission.as_ref().unwrap().radiance.x;
        let power = sides * radiance * PI.powi(2);
        assert!((power - 3.0).abs() < 0.01, "{radiance}");
    }
}

#[test]
fn lights_of_one_material_keep_their_sides() {
    let light =
        |sides| format!("AreaLightSource \"diffuse\" \"bool twosided\" {sides} {TRIANGLE}\n");
    let scene = world(&["true", "false", "true"].map(light).concat());
    let sides = scene.geometry.materials.iter().map(|&material| {
        scene.materials[material as usize].surface.emission.as_ref().unwrap().two_sided
    });
    assert_eq!(sides.collect::<Vec<_>>(), [true, false, true]);
    assert_eq!(scene.materials.len(), 2);
}

#[test]
fn lamps_with_images_have_their_means() {
    let folder = Folder::new();
    image(&folder);
    let tall = folder.path().join("tall.png");
    image::save_buffer(tall, &[255; 6], 1, 2, image::ColorType::Rgb8).unwrap();
    let text = format!(
        r#"{MIRRORED} WorldBegin
        LightSource "goniometric" "string filename" "a.png" "rgb I" [3 6 9]
        LightSource "goniometric" "string filename" "a.png" "float power" 12.566371
        Rotate 90 0 1 0 LightSource "projection" "string filename" "a.png" "float fov" 90
        LightSource "projection" "string filename" "a.png" "float fov" 90 "float power" 1
        LightSource "projection" "string filename" "tall.png" "float fov" 90
        AreaLightSource "diffuse" "string filename" "a.png" "float power" 3 Shape "disk""#
    );
    let scene = Scene::load(&folder.write("room.pbrt", text)).unwrap();
    let intensity = |lamp: usize| match scene.lamps[lamp].kind {
        LampKind::Point { intensity, .. } => intensity,
        LampKind::Spot(spot) => spot.intensity,
        LampKind::Directional { .. } => panic!(),
    };
    assert!(intensity(0).abs_diff_eq(Vec3::new(1.0, 2.0, 3.0), 1e-5), "{}", intensity(0));
    assert!(intensity(1).abs_diff_eq(Vec3::ONE, 1e-5), "{}", intensity(1));
    let LampKind::Spot(spot) = scene.lamps[2].kind else { panic!() };
    assert!(spot.direction.abs_diff_eq(Vec3::X, 1e-6), "{}", spot.direction);
    assert!(intensity(2).abs_diff_eq(Vec3::new(0.5, 0.0, 0.5), 1e-5), "{}", intensity(2));
    // The frame, 4 wide and 2 high at the distance 1, integrated by its middle points.
    let middle = |index: usize| (index as f32 + 0.5) / 50.0;
    let places = (0..100).flat_map(|x| (0..50).map(move |y| (2.0 * middle(x), 2.0 * middle(y))));
    let solid_angle: f32 = places
        .map(|(x, y)| 0.04 * 0.04 / (1.0 + (x - 2.0).powi(2) + (y - 1.0).powi(2)).powf(1.5))
        .sum();
    let cone = 2.0 * PI * (1.0 - spot.outer_angle_rad.cos());
    assert!((cone / solid_angle - 1.0).abs() < 2e-3, "{cone} {solid_angle}");
    let luminance = |color: Vec3| color.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let power = solid_angle * luminance(intensity(3));
    assert!((power - 1.0).abs() < 2e-3, "{power}");
    let LampKind::Spot(tall) = scene.lamps[4].kind else { panic!() };
    assert!((tall.outer_angle_rad / spot.outer_angle_rad - 1.0).abs() < 1e-5, "{tall:?}");
    // The disk has the area π.
    let emission = scene.materials[0].surface.emission.as_ref().unwrap();
    let mean = Vec3::from(emission.texture.as_ref().unwrap().mean());
    let power = PI.powi(2) * luminance(emission.radiance * mean);
    assert!((power - 3.0).abs() < 0.01, "{power}");
    let found = warnings(&scene);
    assert!(
        found[0].contains("image of LightSource `goniometric` (2, first in line 2)"),
        "{found:?}"
    );
    assert_eq!(found.len(), 2, "{found:?}");
}

#[test]
fn the_stretch_of_a_spot_is_named() {
    for (placed, is_named) in [
        ("Rotate 20 0 1 0 Scale 2 2 -2", false),
        ("Rotate 20 0 1 0 Scale 1.3 0.7 1.1", true),
        ("ConcatTransform [1 0 0 0 1 1 0 0 0 0 1 0 0 0 0 1]", true),
    ] {
        let found = warnings(&world(&format!("{placed} LightSource \"spot\" {TRIANGLE}")));
        let names = |text: &String| text.contains("stretch of LightSource `spot`");
        assert_eq!(found.iter().any(names), is_named, "{placed}: {found:?}");
    }
}

#[test]
fn square_maps_lie_where_pbrt_shows_them() {
    let folder = Folder::new();
    // Red where z of the light is above 0: inside the diamond.
    let side = 32_usize;
    let mut text = format!("PF\n{side} {side}\n-1\n").into_bytes();
    for index in 0..side * side {
        let [u, v] = [index % side, index / side]
            .map(|at| (2.0 * (at as f32 + 0.5) / side as f32 - 1.0).abs());
        let red = if u + v < 1.0 { 4.0_f32 } else { 0.0 };
        text.extend([red, 1.0, 0.0].iter().flat_map(|value| value.to_le_bytes()));
    }
    folder.write("sky.pfm", text);
    for (head, turn) in [(MIRRORED, 1.0), (VIEW, -1.0)] {
        let world = r#"Rotate 90 1 0 0 LightSource "infinite" "string filename" "sky.pfm" "float scale" 0.5"#;
        let text = format!("{head} WorldBegin {world}");
        let scene = Scene::load(&folder.write("room.pbrt", text)).unwrap();
        // z turns to −y; the mirror in z leaves it.
        let found = scene.environment.radiance(Vec3::NEG_Y).x;
        assert!((found - 2.0).abs() < 0.02, "{found}");
        assert!(scene.environment.radiance(Vec3::Y).x < 1e-3);
        assert!((scene.environment.radiance(Vec3::X).y - 0.5).abs() < 1e-3);
        // Lights of both kinds add up.
        let world = r#"LightSource "infinite" "string filename" "sky.pfm"
            LightSource "infinite" "rgb L" [0 0 3]"#;
        let text = format!("{head} WorldBegin {world}");
        let scene = Scene::load(&folder.write("room.pbrt", text)).unwrap();
        assert!((scene.environment.radiance(turn * Vec3::Z).x - 4.0).abs() < 0.04);
        assert!(scene.environment.radiance(turn * Vec3::NEG_Z).x < 1e-2);
        assert!((scene.environment.radiance(Vec3::X).z - 3.0).abs() < 1e-3);
    }
    let found = {
        let negative = format!(
            "{MIRRORED} WorldBegin {}",
            r#"LightSource "infinite" "rgb L" [0 2 0]
            LightSource "infinite" "string filename" "sky.pfm" "float scale" -1"#
        );
        Scene::load(&folder.write("room.pbrt", negative)).unwrap_err().to_string()
    };
    assert!(found.contains("sky.pfm: radiance that is not finite or negative"), "{found}");
    folder.write("sky.pfm", [&b"PF\n2 1\n-1\n"[..], &[0; 24]].concat());
    let found = Scene::load(&folder.path().join("room.pbrt")).unwrap_err().to_string();
    assert!(found.contains("expected a square equal-area map") && found.contains("2×1"), "{found}");
}

/// Writes a square map by its colours at points of the square.
fn write_map(folder: &Folder, name: &str, side: usize, color: impl Fn(Vec2) -> Vec3) {
    let mut text = format!("PF\n{side} {side}\n-1\n").into_bytes();
    // The lowest row comes first.
    for (row, column) in (0..side).rev().flat_map(|row| (0..side).map(move |at| (row, at))) {
        let at = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) / side as f32;
        text.extend(color(at).to_array().iter().flat_map(|value| value.to_le_bytes()));
    }
    folder.write(name, text);
}

#[test]
fn square_maps_keep_directions_and_power() {
    let folder = Folder::new();
    let sky = |head: &str, world: &str| {
        let text = format!("{head} WorldBegin {world}");
        Scene::load(&folder.write("room.pbrt", text)).unwrap().environment
    };
    let light = |name: &str| format!("LightSource \"infinite\" \"string filename\" \"{name}\"");
    let color = |direction: Vec3| Vec3::splat(2.0) + direction;
    write_map(&folder, "a.pfm", 64, |at| color(direction_from_square(at)));
    let turn = Mat3::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), -1.0);
    for (head, mirror) in [(MIRRORED, 1.0), (VIEW, -1.0)] {
        let map = sky(head, &format!("Rotate 57.29578 1 2 3 {}", light("a.pfm")));
        for direction in [Vec3::X, -Vec3::Z, Vec3::new(0.6, -0.48, 0.64)] {
            let own = turn * (direction * Vec3::new(1.0, 1.0, mirror));
            let (found, expected) = (map.radiance(direction), color(own));
            assert!(found.abs_diff_eq(expected, 0.05), "{found} {expected}");
        }
    }
    // One bright texel keeps its power.
    let is_bright = |at: Vec2| at == Vec2::new(3.5, 3.5) / 40.0;
    let bright = Vec3::new(1000.0, 500.0, 0.0);
    write_map(&folder, "a.pfm", 40, |at| if is_bright(at) { bright } else { Vec3::ZERO });
    let map = sky(MIRRORED, &light("a.pfm"));
    let mut mean = DVec3::ZERO;
    for (index, texel) in map.texels.iter().enumerate() {
        let row = index as u32 / map.width;
        let edge = |row: u32| (std::f64::consts::PI * f64::from(row) / f64::from(map.height)).cos();
        mean += texel.as_dvec3() * (0.5 * (edge(row) - edge(row + 1)) / f64::from(map.width));
    }
    let expected = bright.as_dvec3() / 1600.0;
    assert!(mean.abs_diff_eq(expected, 1e-5), "{mean} {expected}");
    // A white sky, and a half of one, light the ground by π in pbrt's sum, which takes half of all angles.
    let lit = format!("{} \"float illuminance\" 3.1415927", light("a.pfm"));
    write_map(&folder, "a.pfm", 64, |_| Vec3::ONE);
    let white = sky(MIRRORED, &lit).radiance(Vec3::NEG_X);
    assert!(white.abs_diff_eq(Vec3::splat(2.0), 0.02), "{white}");
    write_map(&folder, "a.pfm", 64, |at| if at.x < 0.5 { Vec3::ONE } else { Vec3::ZERO });
    let half = sky(MIRRORED, &lit).radiance(Vec3::NEG_X);
    assert!(half.abs_diff_eq(Vec3::splat(4.0), 0.04), "{half}");
    // A small map is as it was beside a large one.
    write_map(&folder, "a.pfm", 2, |at| at.extend(1.0));
    write_map(&folder, "b.pfm", 4, |_| Vec3::ZERO);
    let small = sky(MIRRORED, &light("a.pfm"));
    let both = sky(MIRRORED, &format!("{} {}", light("a.pfm"), light("b.pfm")));
    let mut pairs = small.texels.iter().zip(&both.texels);
    assert!(pairs.all(|(one, other)| one.abs_diff_eq(*other, 1e-4)));
}

/// A sheet of 8 × 2 units, placed or as instances, under an image that lies on it twice along x. Heights rise
/// by 0.01 a texel along x and by 0.03 along y, from the lower edge to the upper.
#[test]
fn heights_become_normals_by_the_size_of_their_image() {
    let folder = Folder::new();
    let bytes: Vec<u8> = (0..16 * 8).map(|at| at % 16 + 3 * (8 - at / 16)).collect();
    image::save_buffer(folder.path().join("a.png"), &bytes, 16, 8, image::ColorType::L8).unwrap();
    let mut ply = "ply\nformat ascii 1.0\nelement vertex 81\nproperty float x\nproperty float y\n\
        property float z\nproperty float u\nproperty float v\nelement face 64\n\
        property list uchar int vertex_indices\nend_header\n"
        .to_owned();
    for (u, v) in (0..81).map(|at| ((at % 9) as f32 / 8.0, (at / 9) as f32 / 8.0)) {
        ply += &format!("{} {} 0 {u} {v}\n", 8.0 * u, 2.0 * v);
    }
    for at in (0..72).filter(|at| at % 9 < 8) {
        ply += &format!("4 {at} {} {} {}\n", at + 1, at + 10, at + 9);
    }
    folder.write("a.ply", ply);
    for uses in [1, 10_000] {
        let text = format!(
            r#"{MIRRORED} WorldBegin Texture "h" "float" "imagemap" "string filename" "a.png"
            "string encoding" "linear" "float scale" 2.55 "float uscale" 2 "string wrap" "clamp"
            Material "diffuse" "texture displacement" "h" ObjectBegin "sheet"
            Shape "plymesh" "string filename" "a.ply" ObjectEnd {}"#,
            "ObjectInstance \"sheet\" ".repeat(uses)
        );
        let scene = Scene::load(&folder.write("room.pbrt", text)).unwrap();
        assert_eq!(scene.geometry.instances.len(), if uses > 1 { uses } else { 0 });
        let found = scene.materials[0].surface.normal.as_ref().unwrap();
        assert_eq!(found.image_from_uv, [[2.0, 0.0, 0.0], [0.0, -1.0, 1.0]]);
        // 16 texels on 4 units along x, 8 on 2 along y.
        let expected = Vec3::new(-0.04, -0.12, 1.0).normalize();
        let normal = 2.0 * found.value(Vec2::splat(0.5)).truncate() - 1.0;
        assert!(normal.abs_diff_eq(expected, 1e-3), "{uses}: {normal} {expected}");
    }
}

#[test]
fn media_and_illuminants_have_their_colours() {
    // Gold is yellow, copper red, silver and aluminium almost white.
    for (metal, expected) in [
        ("Ag", [0.97, 0.96, 0.91]),
        ("Al", [0.91, 0.92, 0.92]),
        ("Au", [0.98, 0.78, 0.34]),
        ("Cu", [0.96, 0.64, 0.54]),
    ] {
        let index = |part: &str| format!("\"spectrum {part}\" \"metal-{metal}-{part}\"");
        let found = material(&format!("\"conductor\" {} {}", index("eta"), index("k")));
        let MaterialKind::Conductor { fresnel, .. } = found.kind else { panic!() };
        let found = fresnel.at_normal_incidence();
        assert!(found.abs_diff_eq(expected.into(), 0.01), "{metal}: {found}");
    }
    let unknown = format!("Material \"conductor\" \"spectrum k\" \"metal-Cu-x\" {TRIANGLE}");
    assert!(message(&unknown).contains("unknown spectrum `metal-Cu-x`"));
    let glass = material("\"dielectric\" \"spectrum eta\" \"glass-BK7\"").kind;
    assert!(matches!(glass, MaterialKind::Dielectric { ior: 1.5168, .. }), "{glass:?}");
    let light = |color: &str| {
        let scene = world(&format!("LightSource \"point\" {color}"));
        let LampKind::Point { intensity, .. } = scene.lamps[0].kind else { panic!() };
        intensity
    };
    let white = light("\"spectrum I\" \"stdillum-D65\"");
    assert!(white.abs_diff_eq(Vec3::ONE, 1e-3), "{white}");
    // The white of D65 lies beside the black body of 6504 K, towards green.
    let cold = light("\"blackbody I\" 6504");
    assert!(cold.abs_diff_eq(Vec3::ONE, 0.06), "{cold}");
    // Illuminant A is a black body of 2856 K: x = 0.4476, y = 0.4074.
    let [warm, tungsten] = ["\"blackbody I\" 2856", "\"spectrum I\" \"stdillum-A\""].map(light);
    assert!(warm.abs_diff_eq(tungsten, 0.01), "{warm} {tungsten}");
}

/// Shape of vertices and faces that is subdivided.
fn subdivided(positions: &[[f32; 3]], faces: &[[u32; 3]], levels: i64) -> String {
    let list = |numbers: String| numbers.replace(['[', ']', ','], " ");
    let [points, faces] = [format!("{positions:?}"), format!("{faces:?}")].map(list);
    format!(
        "Shape \"loopsubdiv\" \"integer levels\" {levels} \"point3 P\" [{points}] \
         \"integer indices\" [{faces}]"
    )
}

#[test]
fn a_closed_mesh_becomes_round_and_keeps_its_outside() {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let corners: Vec<[f32; 3]> =
        axes.into_iter().chain(axes.map(|axis| axis.map(|part: f32| -part))).collect();
    // An octahedron, counter-clockwise from outside.
    let faces =
        [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    let round = world(&subdivided(&corners, &faces, 3)).geometry;
    assert_eq!(round.triangles.len(), 8 * 64);
    assert_eq!(round.positions.len(), 4 * 64 + 2);
    for (position, normal) in round.positions.iter().zip(&round.normals) {
        let [position, normal] = [position, normal].map(|v| Vec3::from_array(*v));
        assert!((0.3..0.7).contains(&position.length()), "{position}");
        assert!(position.normalize().dot(normal) > 0.9, "{position} {normal}");
    }
    let first = |positions: &[[f32; 3]], faces: &[[u32; 3]], levels: i64| {
        Vec3::from(world(&subdivided(positions, faces, levels)).geometry.positions[0])
    };
    // The limit of a vertex of valence 4: β = 3/32, γ = 1/(4 + 4), so half of it.
    assert_eq!(first(&corners, &faces, 0), Vec3::new(0.5, 0.0, 0.0));
    // And of a tetrahedron's, of valence 3: β = 3/16, γ = 1/(3 + 2), so a fifth of it.
    let corners = [[1.0; 3], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];
    for levels in [0, 1] {
        let found = first(&corners, &faces, levels);
        assert!(found.abs_diff_eq(Vec3::splat(0.2), 1e-6), "{found}");
    }
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let faces = [[0, 1, 2], [0, 2, 3]];
    let flat = world(&subdivided(&corners, &faces, 2)).geometry;
    assert_eq!(flat.triangles.len(), 32);
    assert!(flat.positions.iter().all(|position| position[2] == 0.0));
    assert!(flat.normals.iter().all(|normal| *normal == [0.0, 0.0, 1.0]));
    // Limits of a corner between the ends of its edges: ⅗ of itself and ⅕ of each.
    for (levels, expected) in [(0, 0.2), (1, 0.6 * 0.125 + 0.2 * 0.5)] {
        let found = first(&corners, &faces, levels);
        assert!(found.abs_diff_eq(Vec3::new(expected, expected, 0.0), 1e-6), "{found}");
    }
    // An edge of three triangles, whose middle stays.
    let corners =
        [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, -1.0, 0.0]];
    let fan = world(&subdivided(&corners, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]], 1)).geometry;
    let is_middle = |position: &[f32; 3]| Vec3::from(*position).abs_diff_eq(Vec3::ZERO, 1e-6);
    assert!(fan.positions.iter().any(is_middle), "{:?}", fan.positions);
    let many = [[0, 1, 2]; 4096];
    let cases = [(-1, &faces[..]), (13, &faces), (i64::MAX, &faces), (12, &many)];
    for (levels, faces) in cases {
        let found = message(&subdivided(&corners, faces, levels));
        assert!(found.contains("expected `levels` that make at most"), "{found}");
    }
}

#[test]
fn words_strings_and_brackets_need_no_spaces() {
    let text = "Material\"diffuse\"\"rgb reflectance\"[.1 2.5e-1 .3]# note \"[\n";
    let found = world(&format!("{text}{TRIANGLE}")).materials[0].kind.clone();
    let MaterialKind::Diffuse { reflectance } = found else { panic!("{found:?}") };
    assert_eq!(reflectance, Vec3::new(0.1, 0.25, 0.3));
    let text = r#"MakeNamedMaterial "q\"\\" "string type" "diffuse" NamedMaterial "q\"\\""#;
    assert_eq!(world(&format!("{text} {TRIANGLE}")).materials[0].name, r#"q"\"#);
}

#[test]
fn curves_are_tubes_of_their_widths() {
    let text = r#"Scale 2 2 2
        Shape "curve" "point3 P" [0 0 0 0 0 1 0 0 2 0 0 3] "float width0" 0.2 "float width1" 0.1
        Shape "curve" "point3 P" [3 0 0 3 0 1 3 0 2 3 0 3] "float width0" 0.2 "float width1" 0.1
            "string basis" "bspline" "string type" "flat""#;
    let scene = world(text);
    assert_eq!(warnings(&scene).len(), 2, "{:?}", scene.warnings);
    // The spline spans the middle third of its points.
    for (x, from, to) in [(0.0, 0.0, 6.0), (6.0, 2.0, 4.0)] {
        let own = scene.geometry.positions.iter().filter(|p| (p[0] - x).abs() < 1.0);
        let width = |p: &[f32; 3]| 2.0 * (p[0] - x).hypot(p[1]);
        let [first, last] = own.fold([[0.0_f32, 1e9, 0.0], [0.0, -1e9, 0.0]], |[low, high], p| {
            let at = [0.0, p[2], width(p)];
            [if p[2] < low[1] { at } else { low }, if p[2] > high[1] { at } else { high }]
        });
        assert!(
            (first[1] - from).abs() < 1e-5 && (last[1] - to).abs() < 1e-5,
            "{first:?} {last:?}"
        );
        // A hexagon of the same perimeter as the circle reaches 4.7% farther out.
        assert!((first[2] / 0.4 - 1.047).abs() < 1e-3, "{first:?}");
        assert!((last[2] / 0.2 - 1.047).abs() < 1e-3, "{last:?}");
    }
    for (basis, points) in [("bezier", 2), ("bezier", 6), ("bspline", 3)] {
        let points = (points, "0 1 2 ".repeat(points));
        let text = format!("\"string basis\" \"{basis}\" \"point3 P\" [{}]", points.1);
        let expected = format!("{} control points make no curve", points.0);
        assert!(message(&format!("Shape \"curve\" {text}")).contains(&expected));
    }
}

/// Control points on a line: blending of whichever kind keeps it, and radii that grow along it.
#[test]
fn a_straight_curve_is_a_cone_of_the_right_width() {
    let curve = |basis: &str, degree: usize, points: &str, widths: [f32; 2]| {
        let [from, to] = widths;
        let text = format!(
            "Shape \"curve\" \"string basis\" \"{basis}\" \"integer degree\" {degree} \
             \"point3 P\" [{points}] \"float width0\" {from} \"float width1\" {to}"
        );
        world(&text).geometry
    };
    for (basis, degree, points) in
        [("bezier", 2, 5), ("bezier", 3, 7), ("bspline", 2, 6), ("bspline", 3, 6)]
    {
        let (first, last) = match (basis, degree) {
            ("bspline", 2) => (0.5, 4.5),
            ("bspline", _) => (1.0, 4.0),
            _ => (0.0, (points - 1) as f32),
        };
        let controls: String = (0..points).map(|x| format!("1 {x} -2 ")).collect();
        let mesh = curve(basis, degree, &controls, [first, last].map(|x| 0.02 * (1.0 + x)));
        let ends = [mesh.positions[0][1], mesh.positions[mesh.positions.len() - 1][1]];
        assert!((ends[0] - first).abs() < 1e-5, "{basis} {degree} {ends:?}");
        assert!((ends[1] - last).abs() < 1e-5, "{basis} {degree} {ends:?}");
        let along: Vec<f32> = mesh.uvs[0].iter().map(|uv| uv[0]).collect();
        assert_eq!([along[0], along[along.len() - 1]], [0.0, 1.0], "{basis} {degree}");
        let mut area = 0.0;
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|at| Vec3::from(mesh.positions[at as usize]));
            let normal = (b - a).cross(c - a);
            area += 0.5 * normal.length();
            let middle = (a + b + c) / 3.0 - Vec3::new(1.0, 0.0, -2.0);
            assert!(normal.dot(middle.with_y(0.0)) > 0.0, "{basis} {degree}: inside out");
        }
        // The cone's side, whose projections have its mean width.
        let mean_radius = 0.01 * (1.0 + 0.5 * (first + last));
        let expected = std::f32::consts::TAU * mean_radius * (last - first);
        assert!((area / expected - 1.0).abs() < 1e-3, "{basis} {degree} {area} {expected}");
    }
    // A span of four points, whose weights are the coordinates over 8, in eight pieces of six sides.
    for (basis, degree, ring, expected) in [
        ("bezier", 3, 0, [0.0, 0.0, 0.0]),
        ("bezier", 3, 4, [3.0, 3.0, 1.0]),
        ("bspline", 3, 0, [32.0 / 6.0, 8.0 / 6.0, 0.0]),
        ("bspline", 2, 12, [1.0, 6.0, 1.0]),
    ] {
        let mesh = curve(basis, degree, "0 0 0 8 0 0 0 8 0 0 0 8", [0.1; 2]);
        let corners = mesh.positions[6 * ring..][..6].iter().map(|at| Vec3::from(*at));
        let middle = corners.sum::<Vec3>() / 6.0;
        assert!(middle.abs_diff_eq(expected.into(), 1e-4), "{basis} {degree}: {middle}");
    }
}

#[test]
fn other_files_are_included_plain_and_compressed() {
    use std::io::Write;
    let folder = Folder::new();
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gz.write_all(TRIANGLE.as_bytes()).unwrap();
    folder.write("b.pbrt.gz", gz.finish().unwrap());
    folder.write("a.pbrt", "Translate 1 0 0\nInclude \"b.pbrt.gz\"");
    let text =
        format!("{MIRRORED} WorldBegin Import \"a.pbrt\" {TRIANGLE} Include \"a.pbrt\" {TRIANGLE}");
    let path = folder.write("room.pbrt", text);
    let scene = Scene::load(&path).unwrap();
    let x: Vec<f32> = scene.geometry.positions.iter().step_by(3).map(|p| p[0]).collect();
    assert_eq!(x, [2.0, 1.0, 2.0, 2.0], "an import leaves the state alone");
    assert_eq!(scene.inputs.len(), 5);
    let refused = |name: &str, include: &str| {
        folder.write("loop.pbrt", "Include \"loop.pbrt\"");
        let path = folder.write(name, format!("{MIRRORED}\nWorldBegin\n {include}"));
        let message = Scene::load(&path).unwrap_err().to_string();
        message.replace(&format!("{}/", folder.path().display()), "")
    };
    let found = refused("c.pbrt", "Include \"../x.pbrt\"");
    assert!(found.starts_with("c.pbrt:3:2: the file name `../x.pbrt` leads"), "{found}");
    assert!(refused("c.pbrt", "Include \"/dev/zero\"").contains("in the folder of the scene"));
    assert!(
        refused("c.pbrt", "Include \"loop.pbrt\"")
            .starts_with("loop.pbrt:1:1: `loop.pbrt` includes itself")
    );
    assert!(refused("c.pbrt", "Include \"c.pbrt\"").contains("includes itself"));
    assert!(refused("c.pbrt", "Include \"no.pbrt\"").contains("no.pbrt: cannot read"));
}

/// Pictures of particles are files of a ball for each.
#[test]
fn thousands_of_balls_are_copies_of_one() {
    let ball = |index: usize| {
        let (radius, turned) = (1 + index % 3, ["", "ReverseOrientation"][index / 2 % 2]);
        let material = format!("Material \"diffuse\" \"rgb reflectance\" [{} 0 0]", index % 2);
        format!(
            "AttributeBegin Translate {index} 0 0 {turned} {material} \
             Shape \"sphere\" \"float radius\" {radius} AttributeEnd\n"
        )
    };
    let part = "Shape \"sphere\" \"float zmin\" 0 AreaLightSource \"diffuse\" Shape \"sphere\"";
    let geometry = world(&((0..400).map(ball).collect::<String>() + part)).geometry;
    assert_eq!((geometry.prototypes.len(), geometry.instances.len()), (2, 400 - 65));
    // Copies are as large as the file says, whatever the first one was.
    let end = |ball: &Instance| {
        let positions = &geometry.prototypes[ball.prototype as usize].positions;
        let places = positions
            .iter()
            .map(|&own| ball.affine().transform_point3(DVec3::from(own.map(f64::from))));
        places.map(|place| place.x).fold(f64::MIN, f64::max)
    };
    let ends = geometry.instances[332..].iter().map(end).collect::<Vec<_>>();
    for (end, expected) in ends.iter().zip([399.0, 401.0, 400.0]) {
        assert!((end - expected).abs() < 1e-3, "{ends:?}");
    }
}

/// Directives as exporters and the scenes of pbrt-v4 write them, by the source of pbrt-v4.
#[test]
fn files_of_others_mean_what_pbrt_takes_them_for() {
    let head = r#"Sampler "stratified" "integer xsamples" 4 "integer ysamples" 2"#;
    let asked = load(head, TRIANGLE).asked;
    assert_eq!((asked.samples, asked.depth), (Some(8), Some(5)));
    let none = r#"Sampler "independent" "integer pixelsamples" 0"#;
    assert_eq!(load(none, TRIANGLE).asked.samples, None);
    let integrator = r#"Integrator "path" "bool regularize" true "integer maxdepth" 3"#;
    let deep = load(&format!("Integrator \"path\" \"integer maxdepth\" 65 {MIRRORED}"), "");
    assert_eq!(deep.asked.depth, Some(64));
    assert!(warnings(&deep)[0].contains("`maxdepth` above 64 (line 1)"), "{:?}", warnings(&deep));
    let regularized = load(&format!("{integrator} {MIRRORED}"), "");
    assert_eq!(regularized.asked.depth, Some(3));
    assert!(warnings(&regularized)[0].contains("`regularize` of Integrator"));
    let noise = load(&format!("Integrator \"volpath\" \"float rrthreshold\" 0 {MIRRORED}"), "");
    assert_eq!(warnings(&noise), [DARK]);
    let kind = material(r#""coateddiffuse" "float eta" 1 "rgb reflectance" [.25 .25 .25]"#).kind;
    assert!(matches!(kind, MaterialKind::Diffuse { reflectance } if reflectance.x == 0.25));
    let kind = material(r#""hair" "rgb color" [.25 .25 .25]"#).kind;
    assert!(matches!(kind, MaterialKind::Diffuse { reflectance } if reflectance.x == 0.25));
    // The last of a name counts.
    let twice = r#"Material "diffuse" "rgb reflectance" [1 1 1] "rgb reflectance" [.25 .25 .25]"#;
    let scene = world(&format!("{twice} {TRIANGLE}"));
    let reflectance = |scene: &Scene, at: usize| match scene.materials[at].kind {
        MaterialKind::Diffuse { reflectance } => reflectance.x,
        _ => panic!("{scene:?}"),
    };
    assert_eq!(reflectance(&scene, 0), 0.25);
    assert!(warnings(&scene)[0].contains("parameter `reflectance`"), "{:?}", scene.warnings);
    let block = r#"TransformBegin Material "diffuse" "rgb reflectance" [1 1 1] TransformEnd"#;
    assert_eq!(reflectance(&world(&format!("{block} {TRIANGLE}")), 0), 0.5);
    // A shape stands where its motion begins.
    let motion = "ActiveTransform StartTime Translate 1 0 0 ActiveTransform EndTime Translate 9 0 0 \
                  ActiveTransform All Translate 0 1 0";
    let [still, moved] =
        ["Translate 1 1 0", motion].map(|text| positions(&world(&format!("{text} {TRIANGLE}"))));
    assert_eq!(still, moved);
    let camera = format!("{MIRRORED} ActiveTransform EndTime Translate 1 0 0");
    assert_eq!(positions(&load(&camera, &format!("Translate 1 1 0 {TRIANGLE}"))), still);
    let light = format!(r#"AreaLightSource "diffuse" {TRIANGLE} "float alpha" 0"#);
    let scene = world(&light);
    let surface = &scene.materials[0].surface;
    assert_eq!((surface.opacity.factor, reflectance(&scene, 0)), (1.0, 0.0));
    assert!(surface.emission.is_some());
    assert!(warnings(&scene)[0].contains("area lights whose `alpha` is 0"));
    let short = world(&format!("{TRIANGLE} \"normal N\" [0 0 1]"));
    assert!(warnings(&short)[0].contains("`N` of another number than the vertices"));

    let lost = format!("Shape \"plymesh\" \"string filename\" \"no.ply\" {TRIANGLE}");
    let lost = world(&lost);
    assert_eq!(lost.geometry.triangles.len(), 1);
    assert!(warnings(&lost)[0].contains("mesh `no.ply`, which is not there"));

    let folder = Folder::new();
    let pixel: Vec<u8> = [0.5_f32; 3].iter().flat_map(|value| value.to_le_bytes()).collect();
    folder.write("half.pfm", [&b"PF\n1 1\n-1\n"[..], &pixel].concat());
    folder.write("flat.txt", "300 0.25\n900 0.25\n");
    folder.write("begun.pbrt", "Material \"diffuse\"");
    let text = format!(
        "{MIRRORED} WorldBegin Include \"begun.pbrt\" \"spectrum reflectance\" \"flat.txt\"\n\
         # gr\u{fc}n\nMakeNamedMaterial \"gr\u{fc}n\" \"string type\" \"diffuse\"\n\
         AreaLightSource \"diffuse\" \"string filename\" \"half.pfm\" \"float power\" 10\n\
         Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 3 0 2 3 0]"
    );
    let latin: Vec<u8> = text.chars().map(|character| character as u8).collect();
    let scene = Scene::load(&folder.write("room.pbrt", latin)).unwrap();
    assert!((reflectance(&scene, 0) - 0.25).abs() < 1e-3);
    // π · area · mean radiance.
    let radiance = scene.materials[0].surface.emission.as_ref().unwrap().radiance.x;
    assert!((PI * 6.0 * 0.5 * radiance - 10.0).abs() < 1e-2, "{radiance}");
}

#[test]
fn bad_text_is_one_error_with_file_line_and_column() {
    for (text, expected) in [
        (
            "\n Shape \"sphere\" \"float radius\" \"2\"",
            "room.pbrt:4:32: parameter `radius`: expected a number, found the string `2`",
        ),
        (
            "Shape \"sphere\" \"rgb radius\" [1 2 3]",
            "expected the type float or integer, found rgb",
        ),
        (
            "Shape \"sphere\" \"float radius\" [1",
            "room.pbrt:3:16: parameter `radius`: the file ends",
        ),
        ("Shape \"sphere\" \"float radius", "room.pbrt:3:16: expected a closing quote"),
        ("Shape \"sph\nere\"", "room.pbrt:3:7: expected a closing quote"),
        ("Shape \"\\q\"", "after \\, found q"),
        (
            "Shape\"sphere\"\"float radius\"[1 x]",
            "room.pbrt:3:31: parameter `radius`: expected a number, found `x`",
        ),
        ("Shape \"sphere\" \"colour x\" 1", "unknown type `colour`"),
        ("Shape \"trianglemesh\"", "expected vertex positions `P`"),
        ("Shape \"blob\"", "room.pbrt:3:1: Shape \"blob\": unknown shape `blob`"),
        (
            "Shape \"trianglemesh\" \"point3 P\" [0 0]",
            "expected 3 numbers or a multiple of it, found 2",
        ),
        (
            "Shape \"trianglemesh\" \"point3 P\" [0 0 0] \"integer indices\" [0 1 2]",
            "index 1 is out of range",
        ),
        (
            "Shape \"trianglemesh\" \"point3 P\" [0 0 0] \"integer indices\" [0 0.5 2]",
            "expected an integer",
        ),
        ("Shpe \"sphere\"", "room.pbrt:3:1: unknown directive `Shpe`"),
        ("AreaLightSource \"blob\" Shape \"sphere\"", "expected a diffuse light"),
        (
            "Material \"mix\" \"string materials\" [\"a\" \"b\" \"c\"] Shape \"sphere\"",
            "expected two names of `materials`",
        ),
        ("[", "expected a directive"),
        ("Translate 1 2", "expected 3 numbers, found `the end of the file`"),
        ("Translate 1 x 2", "room.pbrt:3:13: Translate: expected 3 numbers, found `x`"),
        ("AttributeBegin", "AttributeBegin without an end"),
        ("AttributeEnd", "an end without its beginning"),
        ("ObjectBegin \"a\" AttributeEnd", "the ObjectBegin of line 3"),
        ("WorldBegin", "a second WorldBegin"),
        ("Camera \"perspective\"", "Camera after WorldBegin"),
        ("CoordSysTransform \"x\"", "no coordinate system `x`"),
        ("LightSource \"infinite\" \"blackbody L\" -1", "expected one temperature"),
        ("LightSource \"infinite\" \"spectrum L\" \"x\"", "unknown spectrum `x`"),
        ("Shape \"sphere\" \"float radius\" 1e999", "expected a number"),
        (
            "Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"a.png\" \"string encoding\" \
             \"gamma -2\" Shape \"sphere\" \"texture alpha\" \"t\"",
            "expected the encoding sRGB, linear or gamma with a number, found `gamma -2`",
        ),
    ] {
        let found = message(text);
        assert!(found.contains(expected), "{text}: {found}");
        assert!(found.starts_with("room.pbrt:"), "{found}");
    }
    assert!(message(&"x".repeat((1 << 16) + 1)).contains("at most 65536 bytes"));
    let folder = Folder::new();
    let found = Scene::load(&folder.write("room.pbrt", b"\xff")).unwrap_err().to_string();
    assert!(found.contains("expected UTF-8"), "{found}");
    for (text, expected) in [
        ("", "the file ends before WorldBegin"),
        ("WorldBegin", "expected triangles or a camera, found neither"),
        ("Camera \"fisheye\" WorldBegin", "expected a perspective camera"),
        ("Scale 0 1 1 Camera \"perspective\" WorldBegin", "flattens space"),
        ("Shape \"sphere\" WorldBegin", "Shape before WorldBegin"),
    ] {
        let path = folder.write("room.pbrt", text);
        let found = Scene::load(&path).unwrap_err().to_string();
        assert!(found.contains(expected), "{text}: {found}");
    }
    let options = LoadOptions { camera: Some("a".into()), ..LoadOptions::default() };
    let path = folder.write("room.pbrt", format!("{MIRRORED} WorldBegin"));
    assert!(Scene::load_with(&path, &options).unwrap_err().to_string().contains("one camera"));
}

/// Makes a pipe that nobody writes to.
#[cfg(unix)]
fn pipe(folder: &Folder, name: &str) {
    let made = std::process::Command::new("mkfifo").arg(folder.path().join(name)).status();
    assert!(made.unwrap().success());
}

#[test]
fn files_that_would_exhaust_the_program_are_refused_soon() {
    let folder = Folder::new();
    let head = format!("{MIRRORED} WorldBegin\n");
    let refused = |text: String| {
        let path = folder.write("room.pbrt", text);
        Scene::load(&path).unwrap_err().to_string().replace(path.to_str().unwrap(), "room.pbrt")
    };
    // Each file includes the next ten times.
    for level in 0..8 {
        folder.write(
            &format!("{level}.pbrt"),
            format!("Include \"{}.pbrt\"\n", level + 1).repeat(10),
        );
    }
    folder.write("8.pbrt", "AttributeBegin AttributeEnd");
    let found = refused(format!("{head}Include \"0.pbrt\""));
    assert!(found.contains(".pbrt:") && found.contains("more than 4096 files are"), "{found}");
    // Each file includes the next.
    for level in 0..40 {
        folder.write(&format!("d{level}.pbrt"), format!("Include \"d{}.pbrt\"", level + 1));
    }
    let found = refused(format!("{head}Include \"d0.pbrt\""));
    assert!(found.contains("d30.pbrt:1:1: more than 32 files include one another"), "{found}");
    // Transforms as extreme as this are no instances, but copies.
    let instances = "ObjectInstance \"ball\"\n".repeat(20_000);
    let instances = format!("Scale 1e-7 1e-7 1e-7\n{instances}");
    let found =
        refused(format!("{head}ObjectBegin \"ball\"\nShape \"sphere\"\nObjectEnd\n{instances}"));
    assert!(found.starts_with("room.pbrt:3:1: ") && found.contains("at most 134217728"), "{found}");
    let vast = "Shape \"loopsubdiv\" \"integer levels\" 40 \"point3 P\" [0 0 0 1 0 0 0 1 0] \
                \"integer indices\" [0 1 2]";
    assert!(refused(format!("{head}{vast}")).starts_with("room.pbrt:2:1: "));
    let saved = "AttributeBegin\n".repeat(5000);
    assert!(refused(format!("{head}{saved}")).starts_with("room.pbrt:4098:1: "));
    let mut textures = "Texture \"t0\" \"float\" \"scale\" \"texture tex\" \"t0\"\n".to_owned();
    textures += &format!("{TRIANGLE} \"texture alpha\" \"t0\"");
    let found = refused(format!("{head}{textures}"));
    assert!(found.starts_with("room.pbrt:2:1: ") && found.contains("refer to one"), "{found}");
    let mix = "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"m\" \"m\"]\n\
               NamedMaterial \"m\"";
    let found = refused(format!("{head}{mix} {TRIANGLE}"));
    assert!(found.starts_with("room.pbrt:2:1: ") && found.contains("mix one another"), "{found}");
    let found = refused(format!("{head}Shape \"disk\" \"float innerradius\" 1"));
    assert!(found.ends_with("`innerradius` from 0 to below the radius, found 1"), "{found}");
}

#[test]
fn files_elsewhere_and_pipes_are_no_input() {
    let folder = Folder::new();
    folder.write("metal.spd", "400 1 700 2");
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty \
               float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    folder.write("mesh.ply", ply);
    let text = format!("{MIRRORED} WorldBegin Shape \"plymesh\" \"string filename\" \"mesh.ply\"");
    let scene = Scene::load(&folder.write("room.pbrt", text)).unwrap();
    assert!(scene.inputs.iter().any(|path| path.ends_with("mesh.ply")), "{:?}", scene.inputs);
    let use_of = |name: &str| {
        [
            format!("Shape \"plymesh\" \"string filename\" \"{name}.ply\""),
            format!("LightSource \"infinite\" \"string filename\" \"{name}.exr\""),
            format!("Include \"{name}.pbrt\""),
            format!("Import \"{name}.pbrt.gz\""),
            format!(
                "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"{name}.png\"\n\
                 Material \"diffuse\" \"texture reflectance\" \"t\" {TRIANGLE}"
            ),
            format!("Material \"diffuse\" \"string normalmap\" \"{name}.png\" {TRIANGLE}"),
            format!("Material \"conductor\" \"spectrum k\" \"{name}.spd\" {TRIANGLE}"),
            format!("AreaLightSource \"diffuse\" \"string filename\" \"{name}.exr\" {TRIANGLE}"),
        ]
    };
    let refused = |text: &str| {
        let path = folder.write("room.pbrt", format!("{MIRRORED} WorldBegin\n{text}"));
        // Without an image the rest renders.
        let is_image = text.contains(".png") || text.contains("AreaLight");
        let found = match Scene::load(&path) {
            Ok(scene) if is_image => scene.warnings[0].clone(),
            loaded => loaded.unwrap_err().to_string(),
        };
        assert!(found.contains("room.pbrt:2:"), "{found}");
        found
    };
    for name in ["../metal", "/dev/zero", "a/../../metal"] {
        for text in use_of(name) {
            let found = refused(&text);
            assert!(found.contains("expected one in the folder of the scene"), "{text}: {found}");
        }
    }
    #[cfg(unix)]
    {
        for extension in ["ply", "exr", "pbrt", "pbrt.gz", "png", "spd"] {
            pipe(&folder, &format!("pipe.{extension}"));
        }
        for text in use_of("pipe") {
            let found = refused(&text);
            assert!(found.contains("expected a regular file, found a pipe"), "{text}: {found}");
        }
        let found = Scene::load(&folder.path().join("pipe.pbrt")).unwrap_err().to_string();
        assert!(found.contains("found a pipe"), "{found}");
    }
}

#[test]
fn mixtures_of_diffuse_materials_are_diffuse() {
    let text = format!(
        r#"MakeNamedMaterial "red" "string type" "diffuse" "rgb reflectance" [1 0 0]
        MakeNamedMaterial "blue" "string type" "diffuse" "rgb reflectance" [0 0 1]
        MakeNamedMaterial "both" "string type" "mix" "string materials" ["red" "blue"] "float amount" 0.25
        NamedMaterial "both" {TRIANGLE}"#
    );
    let scene = world(&text);
    let MaterialKind::Diffuse { reflectance } = scene.materials[0].kind else { panic!() };
    assert_eq!(reflectance, Vec3::new(0.75, 0.0, 0.25));
    assert_eq!(warnings(&scene), [DARK]);
    // Nothing is lost of a mixture that is the first alone.
    let alone = r#"MakeNamedMaterial "red" "string type" "diffuse"
        MakeNamedMaterial "glass" "string type" "dielectric"
        MakeNamedMaterial "alone" "string type" "mix" "string materials" ["red" "glass"]
        "float amount" 0 NamedMaterial "alone""#;
    assert_eq!(warnings(&world(&format!("{alone} {TRIANGLE}"))), [DARK]);
    assert!(matches!(
        material(r#""conductor" "rgb reflectance" [1 1 1]"#).kind,
        MaterialKind::Mirror { reflectance: Vec3::ONE }
    ));
}

#[test]
fn everything_left_out_is_named_once() {
    let head = r#"Option "seed" 3
        ColorSpace "rec2020"
        Integrator "ambientocclusion" "integer maxdepth" 7
        Film "rgb" "string sensor" "canon_eos_100d" "float maxcomponentvalue" 10
        Camera "perspective" "float halffov" 3"#;
    let world = format!(
        r#"ActiveTransform StartTime
        MakeNamedMedium "fog" "string type" "homogeneous"
        MediumInterface "fog" ""
        Shape "sphere" "float phimax" 180 "float sharp" 1
        Shape "sphere" "float sharp" 1
        Shape "curve" "point3 P" [0 0 0 1 1 1 2 2 2 3 3 3]
        Material "coateddiffuse" "float uroughness" 0.1 "float vroughness" 0.2 "rgb albedo" [1 0 0]
        Scale 1 0 1 {TRIANGLE}
        Material "hair" {TRIANGLE}
        Identity Texture "m" "spectrum" "marble" "integer octaves" 4
        Texture "d" "spectrum" "directionmix" "vector3 dir" [0 1 0]
        Material "diffuse" "texture reflectance" "m" {TRIANGLE} "vector S" [1 0 0 1 0 0 1 0 0]
        Material "diffuse" "texture reflectance" "d" {TRIANGLE}
        ObjectBegin "lit" AreaLightSource "diffuse" {TRIANGLE} ObjectEnd ObjectInstance "lit""#
    );
    let scene = load(head, &world);
    assert_eq!(scene.asked.depth, Some(7));
    let expected = [
        "ignored Option `seed` (line 1)",
        "ignored ColorSpace `rec2020` (line 2)",
        "ignored `ActiveTransform`, `TransformTimes` (line 7): nothing moves",
        "ignored other media (5, first in line 8)",
        "ignored Integrator `ambientocclusion` (line 3)",
        "ignored sensor `canon_eos_100d` (line 4)",
        "ignored `maxcomponentvalue` of the film (line 4)",
        "ignored parameter `halffov` of Camera \"perspective\" (line 5)",
        "ignored parameter `sharp` of Shape \"sphere\" (2, first in line 10)",
        "ignored exact form of `curve` (line 12): tubes of 3 to 6 sides",
        "ignored `albedo` of coats (line 13): coats are clear",
        "ignored `uroughness` other than `vroughness`, of plastic and glass or textures (line 13): their \
         mean α, or the texture",
        "ignored shapes whose transformation flattens space (2, first in line 14): left out",
        "ignored parameters of `hair` (line 15): diffuse of its colour",
        "ignored texture `marble`: 0.5 instead (line 16)",
        "ignored texture `directionmix`: its mean instead (line 17)",
        "ignored tangents `S` of meshes (line 18)",
        "ignored area lights in objects (line 20): dark, as in pbrt",
        DARK,
    ];
    let found = warnings(&scene);
    let missing: Vec<_> = expected.iter().filter(|e| !found.iter().any(|f| f == *e)).collect();
    assert!(missing.is_empty() && found.len() == expected.len(), "{missing:#?}\n{found:#?}");
}

/// Folder of scenes from elsewhere, which the repository does not hold: `FENESTRA_IMPORT`.
fn real(name: &str) -> Option<Scene> {
    let folder = std::env::var_os("FENESTRA_IMPORT")?;
    Some(Scene::load(&Path::new(&folder).join("pbrt").join(name)).unwrap())
}

fn textures(scene: &Scene) -> usize {
    scene.materials.iter().filter(|material| material.surface.color.is_some()).count()
}

fn emitters(scene: &Scene) -> usize {
    scene.materials.iter().filter(|material| material.surface.emission.is_some()).count()
}

/// Mean place in the picture of the triangles of a material.
fn place_of(scene: &Scene, name: &str) -> Vec2 {
    let material =
        scene.materials.iter().position(|material| material.name == name).unwrap() as u32;
    let positions = positions(scene);
    let owned = scene.geometry.triangles.iter().zip(&scene.geometry.materials);
    let corners: Vec<Vec3> = owned
        .filter(|(_, owner)| **owner == material)
        .flat_map(|(triangle, _)| triangle.map(|at| positions[at as usize]))
        .collect();
    let aspect = scene.film.width as f32 / scene.film.height as f32;
    project(&scene.camera, aspect, corners.iter().sum::<Vec3>() / corners.len() as f32)
}

#[test]
fn real_scenes_load_whole() {
    let Some(room) = real("living-room/living-room_patched.pbrt") else { return };
    // Less the triangles of no area in the files: 190 of 143 163.
    assert_eq!(room.geometry.triangles.len(), 142_973);
    assert_eq!((room.materials.len(), textures(&room), emitters(&room)), (19, 4, 0));
    assert_eq!(room.camera.vertical_fov_deg, 58.715_508);
    assert_eq!((room.environment.width, room.environment.height), (1024, 512));
    // The sofa is on the right of the picture, the painting above it, the mirror on the left.
    for (name, x, y) in [("Sofa", 0.79, 0.36), ("Painting", 0.87, 0.69), ("Mirror", 0.32, 0.64)] {
        let found = place_of(&room, name);
        assert!((found - Vec2::new(x, y)).length() < 0.01, "{name}: {found}");
    }
    let expected = ["PixelFilter `triangle`", "dropped 190"];
    let found = warnings(&room);
    assert_eq!(found.len(), expected.len(), "{found:?}");
    expected.iter().for_each(|part| assert!(found.iter().any(|f| f.contains(part)), "{part}"));

    let stairs = real("staircase2/staircase2_patched.pbrt").unwrap();
    assert_eq!(stairs.geometry.triangles.len(), 30_911 + 16 + 5 * 128 - 2432);
    assert_eq!((stairs.materials.len(), textures(&stairs), emitters(&stairs)), (21, 3, 13));
    assert_eq!(stairs.camera.vertical_fov_deg, 70.0);

    let taxi = real("low-poly-taxi/low-poly-taxi.pbrt").unwrap();
    assert_eq!(taxi.geometry.triangles.len(), 12_002 + 24 - 24);
    assert_eq!((taxi.materials.len(), textures(&taxi), emitters(&taxi)), (14, 0, 4));
    assert_eq!(taxi.lamps.len(), 2);

    // A map that is not there is an error, an image of a texture a warning.
    let folder = std::env::var_os("FENESTRA_IMPORT").unwrap();
    let dark = Path::new(&folder).join("pbrt/living-room/living-room.pbrt");
    let found = Scene::load(&dark).unwrap_err().to_string();
    assert!(found.contains("living-room.pbrt:") && found.contains("cannot read"), "{found}");
    let plain = real("staircase2/staircase2.pbrt").unwrap();
    assert!(warnings(&plain)[1].contains("wood5.tga: cannot read"), "{:?}", plain.warnings);
}

/// Each parameter, alone in place of `@`, makes a scene that no other parameter of its value makes; those
/// after `;` state defaults of pbrt, and change nothing.
#[test]
fn every_parameter_counts_and_none_for_another() {
    let lit = format!("LightSource \"point\" {TRIANGLE}");
    let surface = |kind: &str| format!("Material {kind} @ {TRIANGLE}");
    let texture = |kind: &str| {
        let used = "Material \"diffuse\" \"texture reflectance\" \"t\"";
        format!("Texture \"t\" \"spectrum\" \"{kind}\" @ {used} {TRIANGLE}")
    };
    let light = |kind: &str| format!("LightSource \"{kind}\" @");
    let color = "[.1 .2 .3]";
    let coated = r#""rgb sigma_a" [1 2 3] "rgb sigma_s" [3 2 1]"#;
    let groups = [
        (
            r#"Camera "perspective" "float lensradius" 0.1 @"#,
            lit.clone(),
            "float fov 50|float screenwindow [-1 1 -1 3]|float shutteropen 0.5|float shutterclose 0.25|\
             float focaldistance 3;float fov 90|float shutteropen 0|float shutterclose 1|\
             float focaldistance 1e6",
        ),
        (
            r#"Film "rgb" @ Camera "perspective""#,
            lit,
            "integer xresolution 64|integer yresolution 64|float iso 50|float whitebalance 4000|\
             integer pixelbounds [0 8 0 9]|float cropwindow [0 0.5 0 0.25];integer xresolution 1280|\
             integer yresolution 720|float iso 100|float cropwindow [0 1 0 1]|\
             string sensor \"cie1931\"",
        ),
        (
            r#"PixelFilter "gaussian" @ Camera "perspective""#,
            format!("LightSource \"point\" {TRIANGLE}"),
            ";float xradius 1.5|float yradius 1.5|float sigma .5",
        ),
        (
            MIRRORED,
            light("distant"),
            "rgb L C|float scale 2|float illuminance 3|point3 from [1 0 0]|point3 to [1 0 0];\
             float scale 1|point3 from [0 0 0]|point3 to [0 0 1]",
        ),
        (
            MIRRORED,
            light("point"),
            "rgb I C|float scale 2|float power 2|point3 from [1 0 0];point3 from [0 0 0]",
        ),
        (
            MIRRORED,
            light("spot"),
            "rgb I C|float scale 2|float power 2|point3 from [1 0 0]|point3 to [1 0 0]|\
             float coneangle 20|float conedeltaangle 20;float coneangle 30|float conedeltaangle 5|\
             point3 from [0 0 0]|point3 to [0 0 1]",
        ),
        (MIRRORED, light("infinite"), "rgb L C|float scale 2|float illuminance 2"),
        (
            MIRRORED,
            format!("AreaLightSource \"diffuse\" @ {TRIANGLE}"),
            "rgb L C|float scale 2|float power 2|bool twosided true;float scale 1|bool twosided false",
        ),
        (
            MIRRORED,
            surface("\"coateddiffuse\""),
            "rgb reflectance C|float roughness .2|float eta 1.8;rgb reflectance [.5 .5 .5]|float roughness 0|\
             float eta 1.5|bool remaproughness true|float g 0|float thickness .01|\
             integer maxdepth 10|integer nsamples 1",
        ),
        (
            MIRRORED,
            surface("\"coateddiffuse\" \"float roughness\" 0.2"),
            "bool remaproughness false",
        ),
        (
            MIRRORED,
            surface("\"conductor\""),
            "float roughness .2|float uroughness .2|float vroughness .2|rgb eta C|rgb k C|\
             rgb reflectance C;float roughness 0|spectrum eta \"metal-Cu-eta\"|spectrum k \"metal-Cu-k\"",
        ),
        (
            MIRRORED,
            surface("\"coatedconductor\""),
            "float conductor.roughness .2|float interface.roughness .2|rgb conductor.eta C|\
             rgb conductor.k C|float interface.eta 1.8|rgb reflectance C;float conductor.roughness 0|\
             float interface.roughness 0|float interface.eta 1.5|spectrum conductor.k \"metal-Cu-k\"",
        ),
        (
            MIRRORED,
            surface("\"dielectric\""),
            "float eta 1.8|float roughness .2;float eta 1.5|float roughness 0",
        ),
        (MIRRORED, surface("\"thindielectric\""), "float eta 1.8;float eta 1.5"),
        (
            MIRRORED,
            surface("\"diffusetransmission\""),
            "rgb reflectance C|rgb transmittance C|float scale .5;rgb reflectance [.25 .25 .25]|\
             rgb transmittance [.25 .25 .25]|float scale 1",
        ),
        (
            MIRRORED,
            surface(&format!("\"subsurface\" {coated}")),
            "float g .5|float eta 1.6|float roughness .2;\
             float g 0|float eta 1.33|float roughness 0|float scale 1",
        ),
        (MIRRORED, surface("\"subsurface\""), "string name \"Ketchup\"|rgb reflectance C"),
        (
            MIRRORED,
            surface("\"hair\""),
            "rgb sigma_a C|float eumelanin .5|float pheomelanin .5|rgb reflectance C|float beta_n .5;\
             float eumelanin 1.3|float beta_n .3|float beta_m .3|float eta 1.55|float alpha 2",
        ),
        (MIRRORED, texture("mix"), "rgb tex1 C|rgb tex2 C|float amount .3;float amount .5"),
        (MIRRORED, texture("scale"), "rgb tex C|float scale .5;rgb tex [1 1 1]|float scale 1"),
        (
            MIRRORED,
            texture("checkerboard"),
            "rgb tex1 C|rgb tex2 C|float uscale 2|float vscale 2|float udelta .3|float vdelta .3;\
             rgb tex1 [1 1 1]|rgb tex2 [0 0 0]|float uscale 1|float vscale 1|float udelta 0|float vdelta 0",
        ),
        (
            MIRRORED,
            "Shape \"sphere\" @".to_owned(),
            "float radius 2|float zmin .5|float zmax .5|float phimax 90|float alpha .5;float radius 1|\
             float zmin -1|float zmax 1|float phimax 360|float alpha 1",
        ),
        (
            MIRRORED,
            "Shape \"disk\" @".to_owned(),
            "float radius 2|float innerradius .5|float height .5|float phimax 90|float alpha .5;\
             float radius 1|float innerradius 0|float height 0|float phimax 360|float alpha 1",
        ),
        (
            MIRRORED,
            "Shape \"cylinder\" @".to_owned(),
            "float radius 2|float zmin .5|float zmax .5|float phimax 90|float alpha .5;float radius 1|\
             float zmin -1|float zmax 1|float phimax 360|float alpha 1",
        ),
    ];
    for (head, world, parameters) in groups {
        let read = |parameter: &str| {
            let stated = parameter.trim().splitn(3, ' ').collect::<Vec<_>>();
            let stated = <[_; 3]>::try_from(stated).map_or(String::new(), |[kind, name, value]| {
                format!("\"{kind} {name}\" {}", if value == "C" { color } else { value })
            });
            let scene = load(&head.replace('@', &stated), &world.replace('@', &stated));
            Scene { warnings: warnings(&scene), ..scene }
        };
        assert_each_counts(&format!("{head} {world}"), parameters, read);
    }
}
