//! `fenestra export`: the files for Mitsuba say what the scene says. `docs/peers/agreement.py`
//! compares the pictures.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

#[path = "support/command.rs"]
mod command;

use std::{f32::consts::PI, fs, path::Path, sync::Arc};

use command::{BALL, Folder, yard};
use fenestra::{
    brdf::{MeasuredTable, material::MaterialKind},
    export::mitsuba::{Export, Settings},
    film::Image,
    scene::Scene,
};
use glam::Vec3;

const DIFFUSE: &str = "type = \"diffuse\"\nreflectance = [0.5, 0.25, 0.125]";
const PLASTIC: &str = "type = \"plastic\"\ndiffuse = [0.5, 0.25, 0.125]\nalpha = 0.25\nior = 1.33";
const SETTINGS: Settings = Settings { depth: 1, samples: 4 };

/// Exports a yard with this environment and clay, and returns its folder and XML.
fn exported(environment: &str, clay: &str, options: &[&str]) -> (Folder, String, String) {
    let folder = Folder::new();
    folder.write("scene.toml", yard([32, 24], environment, clay, BALL));
    let arguments = [&["export", "scene.toml", "out", "--format=mitsuba"][..], options].concat();
    let run = folder.run(&arguments);
    run.assert(0, &[]);
    assert_eq!(run.output, "out/scene.xml\n");
    let xml = fs::read_to_string(folder.path().join("out/scene.xml")).unwrap();
    (folder, xml, run.messages)
}

/// Fails unless `xml` holds all of `parts`.
#[track_caller]
fn assert_parts(xml: &str, parts: &[&str]) {
    for part in parts {
        assert!(xml.contains(part), "expected {part} in:\n{xml}");
    }
}

/// Returns the header of a PLY file and the number of bytes after it.
fn ply(path: &Path) -> (String, usize) {
    let bytes = fs::read(path).unwrap();
    let end = b"end_header\n";
    let header = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
    (String::from_utf8(bytes[..header].to_vec()).unwrap(), bytes.len() - header)
}

/// Number in a line of a PLY header.
fn count(header: &str, element: &str) -> usize {
    let line = header.lines().find_map(|line| line.strip_prefix(element)).unwrap();
    line.trim().parse().unwrap()
}

#[test]
fn a_diffuse_scene_is_written_without_a_warning() {
    let constant = "constant = [1.0, 2.0, 3.0]\nscale = 0.5";
    let options = ["--depth=3", "--spp=16", "--strict"];
    let (folder, xml, messages) = exported(constant, DIFFUSE, &options);
    assert_eq!(messages, "");
    assert_parts(
        &xml,
        &[
            "<scene version=\"3.0.0\">",
            "<integer name=\"max_depth\" value=\"4\"/>",
            "<integer name=\"sample_count\" value=\"16\"/>",
            "<string name=\"fov_axis\" value=\"y\"/>",
            "<float name=\"fov\" value=\"45\"/>",
            "<lookat origin=\"0, 1, 3\" target=\"0, 0.3, 0\" up=\"0, 1, 0\"/>",
            "<integer name=\"width\" value=\"32\"/>",
            "<rgb name=\"radiance\" value=\"0.5, 1, 1.5\"/>",
            "<bsdf type=\"twosided\" id=\"m00_clay\">",
            "<rgb name=\"reflectance\" value=\"0.5, 0.25, 0.125\"/>",
            "<string name=\"filename\" value=\"scene/m00_clay.ply\"/>",
        ],
    );
    let (header, bytes) = ply(&folder.path().join("out/scene/m00_clay.ply"));
    let (vertices, triangles) = (count(&header, "element vertex"), count(&header, "element face"));
    let scene = Scene::load(&folder.path().join("scene.toml")).unwrap();
    assert_eq!(triangles, scene.geometry.triangles.len());
    assert_eq!(bytes, 24 * vertices + 13 * triangles);
}

#[test]
fn triangles_without_normals_are_written_apart_and_stay_flat() {
    let folder = Folder::new();
    folder.write(
        "quad.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
         property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
    );
    let object = "mesh = \"quad.ply\"";
    folder.write("scene.toml", yard([8, 6], "constant = [1, 1, 1]", DIFFUSE, object));
    folder.run(&["export", "scene.toml", "a/b.xml", "--format=mitsuba"]).assert(0, &[]);
    let (header, bytes) = ply(&folder.path().join("a/b/m00_clay_flat.ply"));
    assert!(!header.contains("nx"), "{header}");
    assert_eq!((count(&header, "element face"), bytes), (2, 4 * 12 + 2 * 13));
    let xml = fs::read_to_string(folder.path().join("a/b.xml")).unwrap();
    assert_parts(&xml, &["b/m00_clay_flat.ply", "<boolean name=\"face_normals\" value=\"true\"/>"]);
}

/// Mitsuba's `envmap`, as measured on version 3.9.1: its middle looks along +Z, texel columns lie
/// at (i + ½)/width and rows at j/(height − 1).
fn mitsuba_radiance(image: &Image, texels: &[[f32; 3]], local: Vec3) -> Vec3 {
    let (width, height) = (image.width as usize, image.height as usize);
    let u = (local.x.atan2(-local.z) / (2.0 * PI)).rem_euclid(1.0);
    let x = (u * width as f32 - 0.5).rem_euclid(width as f32);
    let y = local.y.clamp(-1.0, 1.0).acos() / PI * (height - 1) as f32;
    let (column, row) = (x as usize % width, (y as usize).min(height - 2));
    let texel = |column: usize, row: usize| Vec3::from(texels[row * width + column % width]);
    let at = |row| texel(column, row).lerp(texel(column + 1, row), x - column as f32);
    at(row).lerp(at(row + 1), y - row as f32)
}

#[test]
fn the_environment_is_the_same_in_every_direction() {
    let sky = "sky = { width = 32, sun_radius_deg = 20.0, sun_radiance = [20, 15, 10] }\n\
               rotation_deg = 30.0";
    let (folder, xml, _) = exported(sky, DIFFUSE, &[]);
    assert_parts(&xml, &["<rotate y=\"1\" angle=\"210"]);
    let scene = Scene::load(&folder.path().join("scene.toml")).unwrap();
    let image = Image::read_exr(&folder.path().join("out/scene/environment.exr")).unwrap();
    assert_eq!([image.width, image.height], [32, 33]);
    let texels = image.triple(["R", "G", "B"]).unwrap();
    let (sine, cosine) = 210.0_f32.to_radians().sin_cos();
    let mut largest = 0.0_f32;
    for index in 0..2000 {
        // Spiral over the sphere.
        let y = 1.0 - (index as f32 + 0.5) / 1000.0;
        let azimuth = 2.4 * index as f32;
        let ring = (1.0 - y * y).sqrt();
        let world = Vec3::new(ring * azimuth.cos(), y, ring * azimuth.sin());
        let local = Vec3::new(
            cosine * world.x - sine * world.z,
            world.y,
            sine * world.x + cosine * world.z,
        );
        let expected = scene.environment.radiance(world);
        let found = mitsuba_radiance(&image, &texels, local);
        largest = largest.max((found - expected).abs().max_element() / expected.max_element());
    }
    assert!(largest < 2e-3, "{largest}");
}

#[test]
fn differences_are_named_once_and_refused_by_strict() {
    let (_, xml, messages) = exported("constant = [1, 1, 1]", PLASTIC, &[]);
    assert_parts(&xml, &["roughplastic", "<float name=\"int_ior\" value=\"1.33\"/>"]);
    assert_eq!(messages.matches("material `clay`").count(), 2, "{messages}");
    assert_eq!(messages.matches("loses light").count(), 1, "{messages}");

    let folder = Folder::new();
    folder.write("scene.toml", yard([8, 6], "constant = [1, 1, 1]", PLASTIC, BALL));
    let arguments = ["export", "scene.toml", "out", "--format=mitsuba", "--strict"];
    folder.run(&arguments).assert(1, &["scene.toml", "`clay`", "--strict"]);
    assert_eq!(folder.files(), ["scene.toml"]);
}

#[test]
fn conductors_keep_their_fresnel_reflectance() {
    let exact = "type = \"conductor\"\nalpha = 0.0625\neta = [0.25, 0.5, 1.5]\nk = [3.5, 2.5, 2.0]";
    let (_, xml, messages) = exported("constant = [1, 1, 1]", exact, &["--strict"]);
    assert_eq!(messages, "");
    assert_parts(
        &xml,
        &["roughconductor", "\"eta\" value=\"0.25, 0.5, 1.5\"", "\"k\" value=\"3.5, 2.5, 2\""],
    );
    let schlick = "type = \"conductor\"\nalpha = 0.25\nreflectance = [1.0, 0.75, 0.5]";
    let (_, xml, messages) = exported("constant = [1, 1, 1]", schlick, &[]);
    assert_parts(&xml, &["principled", "name=\"roughness\" value=\"0.5\"", "1, 0.75, 0.5"]);
    assert_parts(&messages, &["masks and shadows separately"]);
}

#[test]
fn measured_materials_become_diffuse_with_their_albedo() {
    let text = yard([8, 6], "constant = [1, 1, 1]", DIFFUSE, BALL);
    let mut scene = Scene::parse(Path::new("scene.toml"), &text).unwrap();
    let reflectance = Vec3::new(0.5, 0.25, 0.125);
    let table = MeasuredTable::tabulate(|_, _| reflectance / PI).unwrap();
    let path = "paint.binary".into();
    scene.materials[0].kind = MaterialKind::Measured { path, table: Arc::new(table) };
    let export = Export::new(&scene, Path::new("a.xml"), SETTINGS).unwrap();
    let [warning] = &export.warnings[..] else { unreachable!("one warning") };
    let found = warning.rsplit_once("reflectance ").unwrap().1;
    let found: Vec<f32> = found.split(", ").map(|number| number.parse().unwrap()).collect();
    let error = (Vec3::from_slice(&found) - reflectance).abs() / reflectance;
    assert!(warning.contains("`clay`") && warning.contains("paint.binary"), "{warning}");
    assert!(error.max_element() < 0.01, "{warning}");
}
