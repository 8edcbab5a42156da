//! `fenestra export`: the files for Mitsuba say what the scene says. `docs/peers/agreement.py`
//! compares the pictures.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{f32::consts::PI, fs, path::Path, sync::Arc};

use fenestra::{
    film::Image,
    scene::{
        Camera, Scene,
        export::{Settings, gltf, mitsuba::export, pbrt},
        lamp::LampKind,
        material::{Distribution, Material, MaterialKind, Surface},
        measured::{MeasuredTable, RglTraits},
        texture::{TextureUse, Wrap},
    },
    surface::TextureTables,
};
use glam::{Mat4, Vec2, Vec3};
use serde_json::Value;

use crate::{
    support::command::{BALL, Folder, assert_parts, yard},
    twin::texture::texture_value,
};

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
    let options = ["--depth=3", "--spp=16", "--size=48x24", "--strict"];
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
            "<integer name=\"width\" value=\"48\"/>",
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

/// The plane of focus of a pinhole, which pbrt puts at 10⁶ m, does not count.
#[test]
fn clip_planes_stand_around_the_scene() {
    let folder = Folder::new();
    let focus = "vertical_fov_deg = 45.0\nfocus_distance = 1e6";
    let text = yard([8, 6], "constant = [1, 1, 1]", DIFFUSE, BALL);
    folder.write("scene.toml", text.replace("vertical_fov_deg = 45.0", focus));
    folder.run(&["export", "scene.toml", "a.xml", "--format=mitsuba"]).assert(0, &[]);
    let xml = fs::read_to_string(folder.path().join("a.xml")).unwrap();
    let [near, far] = ["near_clip", "far_clip"].map(|name| {
        let (_, rest) = xml.split_once(&format!("name=\"{name}\" value=\"")).unwrap();
        rest.split_once('"').unwrap().0.parse::<f32>().unwrap()
    });
    assert!(near < 1e-4 && (5.0..30.0).contains(&far), "{near} and {far}");
}

/// Through a lens that is shifted and mirrors, focused beyond the scene, to a wide film and to a tall one; to
/// Mitsuba, which shifts no lens, with the one and the other.
#[test]
fn cameras_come_back_as_they_were() {
    let folder = Folder::new();
    let shift = "\nshift = [0.25, -0.5]";
    let lens = "\naperture_radius = 0.125\nfocus_distance = 500.0";
    for size in [[8, 6], [6, 8]] {
        let with = |parts: &[&str]| {
            let camera = format!("vertical_fov_deg = 45.0\nmirrored = true{}", parts.concat());
            let text = yard(size, "constant = [1, 1, 1]", DIFFUSE, BALL);
            let text = text.replace("vertical_fov_deg = 45.0", &camera);
            Scene::parse(Path::new("scene.toml"), &text).unwrap()
        };
        let [shifted, focused, both] = [with(&[shift]), with(&[lens]), with(&[shift, lens])];
        let [pinhole, xml, text, json] =
            ["a.xml", "b.xml", "a.pbrt", "a.gltf"].map(|name| folder.path().join(name));
        export(&shifted, &pinhole, SETTINGS).write().unwrap();
        export(&focused, &xml, SETTINGS).write().unwrap();
        pbrt::export(&both, &text, SETTINGS).write().unwrap();
        gltf::export(&both, &json).write().unwrap();
        for (path, ours) in [(&pinhole, &shifted), (&xml, &focused), (&text, &both)] {
            let camera = Scene::load(path).unwrap().camera;
            let numbers = |of: &Camera| {
                [
                    of.vertical_fov_deg,
                    of.shift[0],
                    of.shift[1],
                    of.aperture_radius,
                    of.aperture_radius * of.focus_distance,
                ]
            };
            let pairs = numbers(&camera).into_iter().zip(numbers(&ours.camera));
            assert!(
                pairs.into_iter().all(|(a, b)| (a - b).abs() <= 1e-4 * b.abs()),
                "{size:?}: {camera:?}"
            );
        }
        // Mitsuba focuses between its clip planes, and glTF's axes are right-handed.
        let text = fs::read_to_string(&xml).unwrap();
        assert_parts(&text, &["name=\"far_clip\" value=\"1000\"", "<scale x=\"-1\"/>"]);
        let json: Value = folder.json("a.gltf");
        // Other readers take the shape of the picture from it.
        let aspect = json["cameras"][0]["perspective"]["aspectRatio"].as_f64().unwrap();
        assert!((aspect * f64::from(size[1]) - f64::from(size[0])).abs() < 1e-6, "{aspect}");
        let nodes = json["nodes"].as_array().unwrap();
        let camera = nodes.iter().find(|node| !node["camera"].is_null()).unwrap();
        let matrix: [f32; 16] = serde_json::from_value(camera["matrix"].clone()).unwrap();
        assert!(Mat4::from_cols_array(&matrix).determinant() > 0.9, "{matrix:?}");
    }
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
    let image = folder.image("out/scene/environment.exr");
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
    let tinted = format!("{exact}\nreflectance = [0.5, 0.25, 1.0]");
    let (_, xml, _) = exported("constant = [1, 1, 1]", &tinted, &[]);
    assert_parts(&xml, &["\"specular_reflectance\" value=\"0.5, 0.25, 1\"", "\"3.5, 2.5, 2\""]);
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
    let warnings = export(&scene, Path::new("a.xml"), SETTINGS).warnings.clone();
    let [warning] = &warnings[..] else { unreachable!("one warning") };
    let found = warning.rsplit_once("reflectance ").unwrap().1;
    let found: Vec<f32> = found.split(", ").map(|number| number.parse().unwrap()).collect();
    let error = (Vec3::from_slice(&found) - reflectance).abs() / reflectance;
    assert!(warning.contains("`clay`") && warning.contains("paint.binary"), "{warning}");
    assert!(error.max_element() < 0.01, "{warning}");

    // A file that Mitsuba reads goes as it is, with its differences named.
    let mut table = MeasuredTable::tabulate(|_, _| reflectance / PI).unwrap();
    table.rgl = Some(RglTraits { is_spectral: true });
    let path = "foil.bsdf".into();
    scene.materials[0].kind = MaterialKind::Measured { path, table: Arc::new(table) };
    let [spectra] = &export(&scene, Path::new("a.xml"), SETTINGS).warnings[..] else {
        unreachable!("one warning")
    };
    assert!(spectra.contains("only Mitsuba's spectral variants read"), "{spectra}");
}

/// Writes an image of 2 × 2 texels and a square with texture coordinates.
fn write_square(folder: &Folder) {
    let texels = vec![255, 0, 0, 0, 255, 0, 0, 51, 255, 255, 255, 255];
    let image = image::RgbImage::from_raw(2, 2, texels).unwrap();
    image.save(folder.path().join("four colours.png")).unwrap();
    folder.write(
        "square.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n\
         f 1/1/1 2/2/1 3/3/1 4/4/1\n",
    );
}

/// Exports a square of the material `clay` with further tables, and reads both scenes.
#[track_caller]
fn both(clay: &str, more: &str) -> (Folder, String, Vec<String>, [Scene; 2]) {
    let folder = Folder::new();
    write_square(&folder);
    let text = yard([8, 6], "constant = [0, 0, 0]", clay, "mesh = \"square.obj\"") + more;
    let ours = Scene::load(&folder.write("scene.toml", text)).unwrap();
    let path = folder.path().join("out.xml");
    let warnings = {
        let exported = export(&ours, &path, SETTINGS);
        exported.write().unwrap();
        exported.warnings
    };
    let xml = fs::read_to_string(&path).unwrap();
    let read = Scene::load(&path).unwrap();
    (folder, xml, warnings, [ours, read])
}

/// Value of a texture at some coordinates of the mesh.
fn value_at(used: &TextureUse, uv: Vec2) -> Vec3 {
    let mut tables = TextureTables::default();
    let index = tables.add(Some(used));
    let words = tables.words(0..tables.word_count);
    texture_value(&words, &tables.uses, index, uv, uv).truncate()
}

/// Fails unless factor times texture is the same for both, in and beyond the image.
#[track_caller]
fn assert_same_values(pairs: [(Vec3, &Option<TextureUse>); 2]) {
    for index in 0..40 {
        let uv = Vec2::new(0.37 * index as f32 - 4.0, 0.53 * index as f32 - 9.0);
        let [ours, read] = pairs
            .map(|(factor, used)| factor * used.as_ref().map_or(Vec3::ONE, |u| value_at(u, uv)));
        assert!(ours.abs_diff_eq(read, 1e-3), "at {uv}: {read}, expected {ours}");
    }
}

/// Factor and texture of a diffuse material.
fn reflectance_of(material: &Material) -> (Vec3, &Option<TextureUse>) {
    let MaterialKind::Diffuse { reflectance } = material.kind else { unreachable!("diffuse") };
    (reflectance, &material.surface.color)
}

#[test]
fn an_image_with_two_factors_is_two_images() {
    let with = |factor| {
        format!(
            "type = \"diffuse\"\nreflectance = {{ texture = \"four colours.png\", factor = {factor} }}"
        )
    };
    let loam = with("[1.0, 0.25, 0.5]");
    let more = format!(
        "[[material]]\nname = \"loam\"\n{loam}\n[[object]]\nmesh = \"square.obj\"\n\
         material = \"loam\"\n"
    );
    let (_, _, _, scenes) = both(&with("[0.5, 0.25, 1.0]"), &more);
    for index in 0..2 {
        assert_same_values(scenes.each_ref().map(|scene| reflectance_of(&scene.materials[index])));
    }
}

#[test]
fn textures_are_the_same_at_all_coordinates() {
    for (keys, file) in [
        ("", "t00_four_colours.png"),
        (", linear = true, wrap = \"mirror\"", "t00_four_colours.png"),
        (", wrap = \"clamp\", interpolation = \"nearest\"", "t00_four_colours.png"),
        (", scale = [2, 3], offset = [0.3, 0.1], rotate_deg = 30.0", "t00_four_colours.png"),
        (", channel = \"g\"", "t00_four_colours.png"),
        (", factor = [0.5, 0.25, 1.0]", "t00_four_colours.exr"),
    ] {
        let clay =
            format!("type = \"diffuse\"\nreflectance = {{ texture = \"four colours.png\"{keys} }}");
        let (folder, xml, warnings, [ours, read]) = both(&clay, "");
        assert_eq!(warnings, [""; 0]);
        assert!(folder.path().join("out").join(file).is_file(), "{keys}: {xml}");
        assert_parts(&xml, &[&format!("value=\"out/{file}\"")]);
        assert_same_values([&ours, &read].map(|scene| reflectance_of(&scene.materials[0])));
        let (header, _) = ply(&folder.path().join("out/m00_clay.ply"));
        assert_parts(&header, &["property float u\nproperty float v\n"]);
        assert_eq!(read.materials[0].surface.two_sided, ours.materials[0].surface.two_sided);
    }
}

#[test]
fn of_two_ways_to_continue_an_image_mitsuba_has_that_of_u() {
    let folder = Folder::new();
    write_square(&folder);
    let clay = "type = \"diffuse\"\nreflectance = { texture = \"four colours.png\" }";
    let text = yard([8, 6], "constant = [0, 0, 0]", clay, "mesh = \"square.obj\"");
    let mut ours = Scene::load(&folder.write("scene.toml", text)).unwrap();
    ours.materials[0].surface.color.as_mut().unwrap().wrap = [Wrap::Clamp, Wrap::Mirror];
    let path = folder.path().join("out.xml");
    let exported = export(&ours, &path, SETTINGS);
    exported.write().unwrap();
    assert!(matches!(&exported.warnings[..], [one] if one.contains("that of u")));
    let read = Scene::load(&path).unwrap();
    assert_eq!(read.materials[0].surface.color.as_ref().unwrap().wrap, [Wrap::Clamp; 2]);
}

#[test]
fn one_image_serves_all_uses_of_equal_values() {
    let use_of = |channel| format!("{{ texture = \"four colours.png\", channel = \"{channel}\" }}");
    let clay = format!(
        "type = \"principled\"\nbase_color = [0.5, 0.5, 0.5]\nmetallic = {}\nroughness = {}\n\
         opacity = {}",
        use_of("r"),
        use_of("g"),
        use_of("g")
    );
    let (folder, _, warnings, [ours, read]) = both(&clay, "");
    assert_eq!(warnings.len(), 2, "masking and the diffuse part: {warnings:?}");
    let images = fs::read_dir(folder.path().join("out")).unwrap();
    let is_image = |name: &std::ffi::OsString| name.to_string_lossy().ends_with(".png");
    assert_eq!(images.filter(|entry| is_image(&entry.as_ref().unwrap().file_name())).count(), 2);
    let surfaces = [&ours, &read].map(|scene| &scene.materials[0].surface);
    assert_same_values(surfaces.map(|surface| (Vec3::ONE, &surface.metallic)));
    assert_same_values(surfaces.map(|surface| (Vec3::ONE, &surface.roughness)));
    assert_same_values(surfaces.map(|surface| (Vec3::ONE, &surface.opacity.texture)));
    let numbers = |scene: &Scene| scene.materials[0].kind.parameters().2.concat();
    let pairs = numbers(&read).into_iter().zip(numbers(&ours));
    // The base depends on the means of both images.
    pairs.for_each(|(read, ours)| assert!((read - ours).abs() < 2e-3, "{read} {ours}"));
}

#[test]
fn surfaces_keep_sides_opacity_and_bumps() {
    let diffuse = |keys: &str| format!("{DIFFUSE}\n{keys}");
    let (_, xml, _, [_, read]) = both(&diffuse("two_sided = false\nopacity = 0.25"), "");
    assert!(!xml.contains("twosided"), "{xml}");
    assert_parts(&xml, &["<bsdf type=\"mask\" id=\"m00_clay\">", "\"opacity\" value=\"0.25\""]);
    assert!(!read.materials[0].surface.two_sided);
    assert_eq!(read.materials[0].surface.opacity.factor, 0.25);

    let bumps = "normal = { texture = \"four colours.png\", strength = 2.0 }";
    let (_, xml, warnings, [ours, read]) = both(&diffuse(bumps), "");
    assert_eq!(warnings, [""; 0]);
    // Inside of `twosided`, Mitsuba mirrors the bumps of the back.
    let order = ["normalmap", "twosided", "diffuse"].map(|kind| xml.find(kind).unwrap());
    assert!(order.is_sorted(), "{xml}");
    let map = |scene: &Scene| scene.materials[0].surface.normal.clone().unwrap();
    for index in 0..9 {
        let uv = Vec2::new(0.3 * (index % 3) as f32 + 0.1, 0.3 * (index / 3) as f32 + 0.1);
        let expected = Vec3::new(2.0, 2.0, 1.0) * (2.0 * value_at(&map(&ours), uv) - 1.0);
        let found = 2.0 * value_at(&map(&read), uv) - 1.0;
        assert!(
            found.normalize().abs_diff_eq(expected.normalize(), 1e-3),
            "at {uv}: {found}, expected {expected}"
        );
    }

    // Coordinates that mirror the image turn its bitangent.
    let (folder, _, _, [mut mirrored, _]) = both(&diffuse(bumps), "");
    mirrored.geometry.uvs[0].iter_mut().for_each(|uv| uv[0] = 1.0 - uv[0]);
    export(&mirrored, &folder.path().join("out.xml"), SETTINGS).write().unwrap();
    let read = Scene::load(&folder.path().join("out.xml")).unwrap();
    let uv = Vec2::new(0.3, 0.7);
    let expected = Vec3::new(2.0, -2.0, 1.0) * (2.0 * value_at(&map(&mirrored), uv) - 1.0);
    let found = 2.0 * value_at(&map(&read), uv) - 1.0;
    assert!(found.normalize().abs_diff_eq(expected.normalize(), 1e-3), "{found} {expected}");

    let cut = "opacity = { texture = \"four colours.png\", interpolation = \"nearest\" }\n\
               opacity_cutoff = 0.5";
    let (_, _, warnings, [_, read]) = both(&diffuse(cut), "");
    assert_eq!(warnings, [""; 0]);
    let used = read.materials[0].surface.opacity.texture.clone().unwrap();
    // Luminances are 0.21 and 0.72 above 0.21 and 1, in linear values.
    for (uv, expected) in
        [([0.2, 0.8], 0.0), ([0.8, 0.8], 1.0), ([0.2, 0.2], 0.0), ([0.8, 0.2], 1.0)]
    {
        assert_eq!(value_at(&used, uv.into()), Vec3::splat(expected));
    }
    let blurred = cut.replace(", interpolation = \"nearest\"", "");
    let (folder, _, warnings, _) = both(&diffuse(&blurred), "");
    assert!(matches!(&warnings[..], [one] if one.contains("cutoff")), "{warnings:?}");
    let enlarged = folder.path().join("out/t00_four_colours.exr");
    assert_eq!(Image::read_exr(&enlarged).unwrap().width, 16);
}

#[test]
fn surfaces_emit_on_the_sides_that_the_scene_says() {
    let clay = format!("{DIFFUSE}\nemission = [1, 2, 3]");
    let (folder, xml, warnings, [ours, read]) = both(&clay, "");
    assert_eq!(warnings, [""; 0]);
    assert_eq!(read.materials[0].surface.emission, ours.materials[0].surface.emission);
    assert!(!xml.contains("type=\"constant\""), "{xml}");
    assert!(!folder.path().join("out/m00_clay_back.ply").exists());

    let factor = "factor = [4, 2, 1]";
    let clay = format!("{DIFFUSE}\nemission = {{ texture = \"four colours.png\", {factor} }}");
    let (_, _, _, [ours, read]) = both(&clay, "");
    let emissions =
        [&ours, &read].map(|scene| scene.materials[0].surface.emission.as_ref().unwrap());
    assert_same_values(emissions.map(|emission| (emission.radiance, &emission.texture)));

    let (folder, xml, warnings, [ours, read]) =
        both(&format!("{DIFFUSE}\nemission = [1, 2, 3]\nemission_two_sided = true"), "");
    assert_eq!(warnings, [""; 0]);
    assert_eq!(xml.matches("type=\"area\"").count(), 2);
    assert!(folder.path().join("out/m00_clay_back.ply").is_file());
    let count = ours.geometry.triangles.len();
    assert_eq!(read.geometry.triangles.len(), 2 * count);
    let normal = |triangle: usize| {
        let [a, b, c] = read.geometry.triangles[triangle]
            .map(|at| Vec3::from(read.geometry.positions[at as usize]));
        (b - a).cross(c - a).normalize()
    };
    for triangle in 0..count {
        assert!(normal(triangle).dot(normal(count + triangle)) < -0.999);
    }

    let glass = "type = \"dielectric\"\nemission = [1, 2, 3]\nemission_two_sided = true";
    let (_, _, warnings, _) = both(glass, "");
    assert!(matches!(&warnings[..], [one] if one.contains("light of the back")), "{warnings:?}");
}

/// Three images that lie in three ways on one mesh, and a film that is higher than wide.
#[test]
fn pbrt_shows_every_image_where_the_scene_does() {
    let folder = Folder::new();
    write_square(&folder);
    let image = |rest: &str| format!("{{ texture = \"four colours.png\", {rest} }}");
    let clay = format!(
        "type = \"conductor\"\nreflectance = {}\nroughness = {}\nopacity = {}",
        image("scale = [0.9, 0.8], offset = [0.3, 0.1]"),
        image(
            "channel = \"g\", interpolation = \"nearest\", scale = [0.4, 0.7], offset = [0.15, 0.12]"
        ),
        image("channel = \"r\", scale = [0.5, 0.3], offset = [0.2, 0.4]"),
    );
    let text = yard([6, 8], "constant = [0, 0, 0]", &clay, "mesh = \"square.obj\"");
    let mut ours = Scene::load(&folder.write("scene.toml", text)).unwrap();
    ours.materials[0].surface.opacity.factor = 0.5;
    let path = folder.path().join("out.pbrt");
    pbrt::export(&ours, &path, SETTINGS).write().unwrap();
    let read = Scene::load(&path).unwrap();
    let [expected, found] = [&ours, &read].map(|scene| scene.camera.vertical_fov_deg);
    assert!((found - expected).abs() < 1e-3, "{found}, expected {expected}");
    let vertex = |scene: &Scene, index: usize| {
        let uv = Vec2::from(scene.geometry.uvs[0][index]);
        let kind = &scene.materials[0].kind;
        let MaterialKind::Conductor { alpha, .. } = kind else { unreachable!("{kind:?}") };
        let surface = &scene.materials[0].surface;
        [
            value_at(surface.color.as_ref().unwrap(), uv),
            alpha.sqrt() * value_at(surface.roughness.as_ref().unwrap(), uv),
            surface.opacity.factor * value_at(surface.opacity.texture.as_ref().unwrap(), uv),
        ]
    };
    let positions =
        |scene: &Scene| scene.geometry.positions.iter().map(|p| Vec3::from(*p)).collect();
    let [ours_at, read_at]: [Vec<Vec3>; 2] = [&ours, &read].map(positions);
    // The square stands at z = 0, unlike the corners of the floor.
    for (index, place) in ours_at.iter().enumerate().filter(|(_, place)| place.z == 0.0) {
        let other = read_at.iter().position(|other| other.abs_diff_eq(*place, 1e-5)).unwrap();
        for (expected, found) in vertex(&ours, index).into_iter().zip(vertex(&read, other)) {
            assert!(found.abs_diff_eq(expected, 2e-3), "at {place}: {found}, expected {expected}");
        }
    }
}

#[test]
fn specular_materials_come_back_as_they_were() {
    for (clay, element) in [
        ("type = \"mirror\"\nreflectance = [0.9, 0.5, 0.25]", "\"conductor\""),
        ("type = \"dielectric\"\nior = 1.25\ntransmittance = [0.5, 1, 1]", "\"dielectric\""),
        ("type = \"dielectric\"\nabsorption = [3, 0, 0.5]", "\"volpath\""),
        ("type = \"dielectric\"\nalpha = 0.0625\nreflectance = [0.5, 1, 1]", "\"roughdielectric\""),
        ("type = \"thin_dielectric\"\nior = 1.5", "\"thindielectric\""),
        (
            "type = \"conductor\"\nalpha = 0.0625\neta = [0.25, 1, 1]\nk = [3, 2, 2.5]\n\
             reflectance = { texture = \"four colours.png\" }",
            "\"roughconductor\"",
        ),
        (
            "type = \"thin_dielectric\"\ntransmittance = { texture = \"four colours.png\" }",
            "\"bitmap\"",
        ),
    ] {
        let (_, xml, warnings, [ours, read]) = both(clay, "");
        assert_eq!(warnings, [""; 0]);
        assert_parts(&xml, &[element]);
        assert_eq!(xml.contains("twosided"), element.contains("conductor"), "{xml}");
        let kind = |scene: &Scene| format!("{:?}", scene.materials[0].kind);
        assert_eq!(kind(&read), kind(&ours));
        let surfaces = [&read, &ours].map(|scene| scene.materials[0].surface.clone());
        let [read, ours] = surfaces.clone().map(|surface| Surface { color: None, ..surface });
        assert_eq!(read, ours);
        assert_same_values(surfaces.each_ref().map(|surface| (Vec3::ONE, &surface.color)));
    }
}

#[test]
fn lamps_come_back_as_they_were() {
    let lamps = r#"
[[lamp]]
type = "point"
position = [1, 2, 3]
intensity = [4, 5, 6]

[[lamp]]
type = "directional"
direction = [0, -0.6, 0.8]
irradiance = [1, 2, 3]

[[lamp]]
type = "spot"
position = [1, 2, 3]
direction = [0.6, -0.8, 0]
intensity = [4, 5, 6]
inner_angle_deg = 10.0
outer_angle_deg = 30.0
falloff = "linear_angle"
"#;
    let (_, _, warnings, [ours, read]) = both(DIFFUSE, lamps);
    assert_eq!(warnings, [""; 0]);
    assert_eq!(read.lamps[..2], ours.lamps[..2]);
    let [ours, read] = [ours, read].map(|scene| scene.lamps[2].kind);
    let (LampKind::Spot(ours), LampKind::Spot(read)) = (ours, read) else {
        unreachable!("two spots")
    };
    assert_eq!((ours.position, ours.intensity), (read.position, Vec3::new(4.0, 5.0, 6.0)));
    assert!(ours.direction.abs_diff_eq(read.direction, 1e-6));
    assert!((ours.inner_angle_rad - read.inner_angle_rad).abs() < 1e-6);
    assert!((ours.outer_angle_rad - read.outer_angle_rad).abs() < 1e-6);

    let (_, _, warnings, _) = both(DIFFUSE, &lamps.replace("linear_angle", "smooth_cosine"));
    assert!(matches!(&warnings[..], [one] if one.contains("spot falls off")), "{warnings:?}");
    let (folder, _, _, [wide, _]) = both(DIFFUSE, &lamps.replace("30.0", "120.0"));
    gltf::export(&wide, &folder.path().join("wide.gltf")).write().unwrap();
    let json: Value = folder.json("wide.gltf");
    let spot = &json["extensions"]["KHR_lights_punctual"]["lights"][2]["spot"];
    assert!(
        (spot["outerConeAngle"].as_f64().unwrap() - f64::from(0.5 * PI)).abs() < 1e-6,
        "{spot}"
    );
}

#[test]
fn colours_of_vertices_are_written_with_their_factor() {
    let folder = Folder::new();
    let text = yard([8, 6], "constant = [1, 1, 1]", DIFFUSE, BALL);
    let mut scene = Scene::load(&folder.write("scene.toml", text)).unwrap();
    scene.geometry.colors = vec![[0.5, 0.5, 1.0, 1.0]; scene.geometry.positions.len()];
    scene.materials[0].surface.vertex_color = true;
    let path = folder.path().join("out.xml");
    let exported = export(&scene, &path, SETTINGS);
    assert_eq!(exported.warnings, [""; 0]);
    exported.write().unwrap();
    let xml = fs::read_to_string(&path).unwrap();
    assert_parts(&xml, &["type=\"mesh_attribute\"", "value=\"vertex_color\""]);
    let mesh = folder.path().join("out/m00_clay.ply");
    let (header, _) = ply(&mesh);
    assert_parts(&header, &["property float r\nproperty float g\nproperty float b\n"]);
    let expected = [0.25_f32, 0.125, 0.125].map(f32::to_le_bytes).concat();
    let bytes = fs::read(&mesh).unwrap();
    assert!(bytes.windows(12).any(|window| window == expected));
    drop(exported);
    scene.geometry.colors.iter_mut().for_each(|color| color[3] = 0.5);
    let exported = export(&scene, &path, SETTINGS);
    assert!(matches!(&exported.warnings[..], [one] if one.contains("opacity of its vertices")));
    // glTF has it, for materials that are not opaque.
    let path = folder.path().join("out.gltf");
    gltf::export(&scene, &path).write().unwrap();
    let read = Scene::load(&path).unwrap();
    let alphas =
        |scene: &Scene| scene.geometry.colors.iter().filter(|color| color[3] == 0.5).count();
    assert!(alphas(&read) > 0, "{:?}", read.geometry.colors.first());
}

/// Tangents stand on normals.
#[test]
fn flat_faces_keep_their_bumps_in_gltf() {
    let folder = Folder::new();
    write_square(&folder);
    let clay = format!("{DIFFUSE}\nnormal = {{ texture = \"four colours.png\" }}");
    let text = yard([8, 6], "constant = [0, 0, 0]", &clay, "mesh = \"square.obj\"");
    let mut scene = Scene::load(&folder.write("scene.toml", text)).unwrap();
    scene.geometry.normals.fill([0.0; 3]);
    let path = folder.path().join("out.gltf");
    gltf::export(&scene, &path).write().unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert_parts(&text, &["\"NORMAL\"", "\"TANGENT\""]);
}

/// Numbers of images are at most 1 in glTF.
#[test]
fn images_of_radiance_keep_it_in_gltf() {
    let folder = Folder::new();
    write_square(&folder);
    folder.write_image("bright.exr", [2, 2], [4.0, 2.0, 0.5]);
    let clay = format!(
        "{DIFFUSE}\nemission = {{ texture = \"bright.exr\", factor = [2, 1, 1], wrap = \"clamp\" }}"
    );
    let text = yard([8, 6], "constant = [0, 0, 0]", &clay, "mesh = \"square.obj\"");
    let ours = Scene::load(&folder.write("scene.toml", text)).unwrap();
    let path = folder.path().join("out.gltf");
    gltf::export(&ours, &path).write().unwrap();
    let read = Scene::load(&path).unwrap();
    let [ours, read] = [&ours, &read].map(|scene| {
        let emission = scene.materials[0].surface.emission.as_ref().unwrap();
        emission.radiance * value_at(emission.texture.as_ref().unwrap(), Vec2::splat(0.5))
    });
    assert!(ours.abs_diff_eq(Vec3::new(8.0, 2.0, 0.5), 1e-3), "{ours}");
    assert!(read.abs_diff_eq(ours, 0.02 * ours.x), "{read}, expected {ours}");
}

/// Stretched highlights come back from every format, but for what Mitsuba and pbrt have no words for.
#[test]
fn stretched_highlights_are_written() {
    let metal = "type = \"conductor\"\neta = [0.2, 0.9, 1.1]\nk = [3.9, 2.4, 2.2]\nalpha = 0.1\n\
        anisotropy = 0.5\nanisotropy_rotate_deg = ";
    let principled = "type = \"principled\"\nbase_color = [0.9, 0.6, 0.3]\nmetallic = 1\n\
        roughness = 0.3\nanisotropy = 0.5\nanisotropy_rotate_deg = ";
    for (text, turn, is_exact) in [
        (metal, 0, [true; 3]),
        (metal, 90, [true; 3]),
        (metal, 180, [true; 3]),
        (metal, 30, [true, false, false]),
        (principled, 0, [true; 3]),
        (principled, 270, [true, false, true]),
    ] {
        let (folder, _, mitsuba_warnings, [ours, from_mitsuba]) =
            both(&format!("{text}{turn}"), "");
        let [gltf_path, pbrt_path] = ["out.gltf", "out.pbrt"].map(|name| folder.path().join(name));
        let to_gltf = gltf::export(&ours, &gltf_path);
        let to_pbrt = pbrt::export(&ours, &pbrt_path, SETTINGS);
        let warnings = [&to_gltf.warnings, &mitsuba_warnings, &to_pbrt.warnings];
        let named = warnings.map(|all| all.iter().any(|text| text.contains("they become round")));
        assert_eq!(named, is_exact.map(|is_exact| !is_exact), "{text}{turn}");
        to_gltf.write().unwrap();
        to_pbrt.write().unwrap();
        let [from_gltf, from_pbrt] = [gltf_path, pbrt_path].map(|path| Scene::load(&path).unwrap());
        let material = &ours.materials[0];
        for (read, is_exact) in [&from_gltf, &from_mitsuba, &from_pbrt].into_iter().zip(is_exact) {
            assert_eq!(read.geometry.uvs[0].len(), read.geometry.positions.len(), "{text}{turn}");
            // Index 0 may be a diffuse surface of another object.
            let found = read.materials.iter().find(|own| own.name == material.name);
            let found = found.unwrap_or(&read.materials[0]);
            let [found_widths, expected] = [found, material].map(|of| {
                let [along, across] = of.surface.anisotropy.widths(match &of.kind {
                    MaterialKind::Conductor { alpha, .. } => *alpha,
                    MaterialKind::Principled(own) => own.roughness * own.roughness,
                    kind => panic!("{kind:?}"),
                });
                Vec2::new(along, across)
            });
            let mean = Vec2::splat(0.5 * expected.element_sum());
            let expected = if is_exact { expected } else { mean };
            assert!(found_widths.abs_diff_eq(expected, 1e-4), "{text}{turn}: {found_widths}");
            let turned = found.surface.anisotropy.rotation - material.surface.anisotropy.rotation;
            assert!(!is_exact || turned.sin().abs() < 1e-6, "{text}{turn}: {turned}");
        }
    }
}

/// Beckmann's normals come back from Mitsuba's models, and are named where a format has none.
#[test]
fn distributions_are_written_or_named() {
    let glass = "type = \"dielectric\"\nalpha = 0.2";
    let plastic = "type = \"plastic\"\nalpha = 0.2\ndiffuse = [0.5, 0.5, 0.5]";
    let metal = "type = \"conductor\"\nalpha = 0.2\neta = [0.2, 0.9, 1.1]\nk = [3.9, 2.4, 2.2]";
    let by_color = "type = \"conductor\"\nalpha = 0.2\nreflectance = [0.9, 0.8, 0.7]";
    for (text, is_written) in [(glass, true), (plastic, true), (metal, true), (by_color, false)] {
        let (folder, _, warnings, [ours, read]) =
            both(&format!("{text}\ndistribution = \"beckmann\""), "");
        let is_named = |warnings: &[String]| {
            warnings.iter().any(|text| text.contains("its microfacets become GGX"))
        };
        assert_eq!(is_named(&warnings), !is_written, "{warnings:?}");
        let found = read.materials.iter().find(|own| own.name == ours.materials[0].name);
        let found = found.unwrap_or(&read.materials[0]).surface.distribution;
        assert_eq!(found == Distribution::Beckmann, is_written, "{text}");
        let path = folder.path().join("out");
        assert!(is_named(&gltf::export(&ours, &path.with_extension("gltf")).warnings), "{text}");
        assert!(is_named(&pbrt::export(&ours, &path.with_extension("pbrt"), SETTINGS).warnings));
    }
}

#[test]
fn coats_and_sheens_go_to_gltf_alone() {
    for (cover, name, numbers) in [
        ("coat_weight = 0.5\ncoat_roughness = 0.25", "coat", vec![0.5, 0.25]),
        (
            "sheen_color = [0.5, 0.25, 0]\nsheen_roughness = 0.75",
            "sheen",
            vec![0.5, 0.25, 0.0, 0.75],
        ),
    ] {
        goes_to_gltf_alone(cover, name, &numbers);
    }
}

fn goes_to_gltf_alone(cover: &str, name: &str, expected: &[f32]) {
    let clay =
        format!("type = \"principled\"\nbase_color = [0.5, 0.2, 0.1]\nroughness = 0.5\n{cover}");
    let (folder, _, warnings, [ours, _]) = both(&clay, "");
    let named = format!("its {name} is left out");
    let is_named = |text: &String| text.contains(&named);
    assert!(warnings.iter().any(is_named), "{warnings:?}");
    assert!(
        pbrt::export(&ours, &folder.path().join("out.pbrt"), SETTINGS)
            .warnings
            .iter()
            .any(is_named)
    );
    let path = folder.path().join("out.gltf");
    let exported = gltf::export(&ours, &path);
    assert!(!exported.warnings.iter().any(is_named));
    exported.write().unwrap();
    let numbers = |scene: &Scene| scene.materials[0].kind.parameters().2;
    assert_eq!(numbers(&Scene::load(&path).unwrap()), numbers(&ours));
    assert_eq!(numbers(&ours)[2], expected);
}
