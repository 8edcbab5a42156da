//! A scene that is exported and read again gives the same picture: z-tests of block means of
//! independent replicates, for each format and scenes that cover materials, textures, lamps and lights.
//!
//! A scene is exact in a format where the format says all of it; the other differences are in
//! `docs/peers.md`. With 8 + 8 replicates, |t| > 7.5 has a chance of 3e-6. Seeds are fixed: a run that
//! passed passes again on the same device.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fs, path::PathBuf};

use fenestra::{
    pass::Roulette,
    scene::{Scene, export, lamp::LampKind, load::LoadOptions},
    session::Settings,
};

use crate::support::{
    self,
    command::{self, Folder},
    replicates::{LIMIT, replicates},
    statistics::{Comparison, Estimate},
};

const MITSUBA: &str = "xml";
const PBRT: &str = "pbrt";
const GLTF: &str = "gltf";

/// Camera that sees nothing but the floor and what stands on it.
const VIEW: &str = "[camera]\nposition = [0.0, 2.2, 2.6]\nlook_at = [0.0, 0.2, 0.0]\n\
                    vertical_fov_deg = 40.0\n\n[film]\nwidth = 32\nheight = 24\n";
const GREY: &str = "[environment]\nconstant = [0.8, 1.0, 1.2]\n";
const DARK: &str = "[environment]\nconstant = [0.0, 0.0, 0.0]\n";

/// Material and object of a floor.
fn floor(reflectance: &str) -> String {
    format!(
        "[[material]]\nname = \"floor\"\ntype = \"diffuse\"\nreflectance = {reflectance}\n\n\
         [[object]]\nshape = \"box\"\nsize = [20.0, 0.2, 20.0]\nmaterial = \"floor\"\n\
         translate = [0.0, -0.1, 0.0]\n"
    )
}

/// Material and a ball of it at some x.
fn ball(name: &str, x: f32, material: &str) -> String {
    format!(
        "[[material]]\nname = \"{name}\"\n{material}\n\n[[object]]\nshape = \"sphere\"\n\
         radius = 0.35\nsegments = 64\nmaterial = \"{name}\"\ntranslate = [{x}, 0.35, 0.0]\n"
    )
}

/// Material and a square of it with texture coordinates, upright or lying above the floor.
fn square(name: &str, placement: &str, material: &str) -> String {
    format!(
        "[[material]]\nname = \"{name}\"\n{material}\n\n[[object]]\nmesh = \"square.obj\"\n\
         material = \"{name}\"\n{placement}\n"
    )
}

/// A scene in a folder with the images and meshes that it names.
struct Original {
    folder: Folder,
    scene: Scene,
    reference: Vec<Estimate>,
}

fn settings() -> Settings {
    // Few paths end: judgements need little noise.
    let roulette = Roulette { vertex: 2, throughput: 0.02 };
    Settings { depth: 4, roulette, ..Settings::default() }
}

impl Original {
    fn new(text: &str) -> Self {
        let folder = Folder::new();
        let texels = (0..8 * 6 * 4_u32).map(|i| match i % 4 {
            3 => 40 + (i * 7 % 200) as u8,
            _ => (30 + i * 97 % 211) as u8,
        });
        let image = image::RgbaImage::from_raw(8, 6, texels.collect()).unwrap();
        image.save(folder.path().join("colours.png")).unwrap();
        let normals = (0..64_u32).flat_map(|i| {
            let (x, y) = (i % 8, i / 8);
            [(90 + 10 * x) as u8, (160 - 9 * y) as u8, 220]
        });
        let image = image::RgbImage::from_raw(8, 8, normals.collect()).unwrap();
        image.save(folder.path().join("bumps.png")).unwrap();
        folder.write(
            "square.obj",
            "v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nvt 0 0\nvt 1 0\nvt 1 1\n\
             vt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n",
        );
        folder.write(
            "colored.ply",
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
             property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n\
             -0.5 -0.5 0 255 40 40\n0.5 -0.5 0 40 255 40\n0.5 0.5 0 40 40 255\n\
             -0.5 0.5 0 250 250 90\n4 0 1 2 3\n",
        );
        let scene = Scene::load(&folder.write("scene.toml", text)).unwrap();
        let reference = replicates(&scene, &settings(), 1, 12);
        Self { folder, scene, reference }
    }

    /// Exports the scene, reads it again with the film of the original, and returns it with the warnings
    /// of the export.
    fn again(&self, format: &str) -> (Scene, Vec<String>) {
        let path: PathBuf = self.folder.path().join(format!("out it/{format} a.{format}"));
        let own = export::Settings { depth: 4, samples: 4 };
        let export = match format {
            MITSUBA => export::mitsuba::export(&self.scene, &path, own),
            PBRT => export::pbrt::export(&self.scene, &path, own),
            _ => export::gltf::export(&self.scene, &path),
        };
        export.write().unwrap();
        let mut options = LoadOptions::default();
        if format == GLTF {
            options.environment = Some(path.with_extension("").join("environment.exr"));
            options.rotation_deg = Some(self.scene.environment.rotation_rad.to_degrees());
        }
        let mut scene = Scene::load_with(&path, &options).unwrap();
        if format == GLTF {
            scene.film = self.scene.film;
        }
        assert_eq!(scene.film, self.scene.film);
        (scene, export.warnings)
    }

    /// Fails unless the scene comes back from the format with the same picture. Values may differ by
    /// `tolerance` of the mean beyond the noise, and exactly the warnings with `expected` come.
    #[track_caller]
    fn assert_same(&self, format: &str, tolerance: f64, expected: &[&str]) {
        let (scene, warnings) = self.again(format);
        let warnings: Vec<_> =
            warnings.iter().filter(|text| !text.starts_with("environment:")).collect();
        assert_eq!(warnings.len(), expected.len(), "{format}: {warnings:#?}");
        for part in expected {
            assert!(warnings.iter().any(|text| text.contains(part)), "{part}: {warnings:#?}");
        }
        let values = replicates(&scene, &settings(), 1001, 12);
        let comparison = Comparison::new(&values, &self.reference);
        eprintln!("{format}: {comparison:?}");
        let level = self.reference.iter().map(|value| value.mean).sum::<f64>()
            / self.reference.len() as f64;
        for (index, (value, own)) in values.iter().zip(&self.reference).enumerate() {
            let difference = (value.mean - own.mean).abs();
            let error = (value.squared_error + own.squared_error).sqrt().max(1e-9);
            assert!(
                difference < LIMIT * error + tolerance * level,
                "{format}, value {index}: {} ± {}, expected {} ± {}",
                value.mean,
                value.error(),
                own.mean,
                own.error()
            );
        }
        assert!((comparison.ratio - 1.0).abs() < 0.01, "{format}: {}", comparison.ratio);
    }
}

const TEXTURED: &str = "{ texture = \"colours.png\", scale = [20, 20], rotate_deg = 30.0 }";

#[test]
fn diffuse_and_metal_surfaces_with_textures() {
    let _alone = support::alone();
    let metal = "type = \"conductor\"\nalpha = 0.2\neta = [0.2, 0.9, 1.1]\nk = [3.9, 2.5, 2.3]";
    let sheen = "type = \"conductor\"\nroughness = { texture = \"colours.png\", channel = \"g\", \
                 interpolation = \"nearest\", scale = [8, 4] }\nreflectance = [1.0, 1.0, 1.0]";
    let scene = [VIEW, GREY, &floor(TEXTURED), &ball("metal", -0.5, metal)].concat()
        + &ball("sheen", 0.5, sheen);
    let original = Original::new(&scene);
    original.assert_same(MITSUBA, 0.0, &["`metal`: Mitsuba's conductor", "`sheen`: Mitsuba's"]);
    original.assert_same(PBRT, 0.0, &[]);
    // Schlick's approximation in place of Fresnel's equations.
    original.assert_same(GLTF, 0.05, &["`metal`: its refractive index becomes"]);
}

#[test]
fn principled_surfaces_and_mirrors() {
    let _alone = support::alone();
    let both = "{ texture = \"colours.png\", channel = \"b\", scale = [3, 2] }";
    let mixed = format!(
        "type = \"principled\"\nbase_color = [0.9, 0.6, 0.3]\nmetallic = {both}\n\
         roughness = {both}\nior = 1.4\nspecular = 0.5"
    );
    let scene = [VIEW, GREY, &floor("[0.5, 0.4, 0.3]"), &ball("mixed", -0.5, &mixed)].concat()
        + &ball("mirror", 0.5, "type = \"mirror\"\nreflectance = [1.0, 1.0, 1.0]");
    let original = Original::new(&scene);
    let expected = ["separately", "Disney's", "strength and colour"];
    original.assert_same(MITSUBA, 0.02, &expected);
    original.assert_same(GLTF, 0.0, &[]);
}

#[test]
fn plastic_keeps_its_colour() {
    let _alone = support::alone();
    let coat =
        |color: &str| format!("type = \"plastic\"\ndiffuse = {color}\nalpha = 0.15\nior = 1.4");
    let texture = "{ texture = \"colours.png\", interpolation = \"nearest\" }";
    let scene =
        [VIEW, GREY, &floor("[0.5, 0.4, 0.3]"), &ball("red", -0.5, &coat("[0.8, 0.2, 0.1]"))]
            .concat()
            + &square("card", "translate = [0.5, 0.5, 0.0]", &coat(texture));
    let original = Original::new(&scene);
    original.assert_same(
        MITSUBA,
        0.0,
        &["red`: Mitsuba's", "red`: M", "card`: M", "card`: Mitsuba's"],
    );
    original.assert_same(PBRT, 0.002, &["`red`: its coat and base", "`card`: its coat and base"]);
}

#[test]
fn glass_comes_back() {
    let _alone = support::alone();
    let pane = "type = \"thin_dielectric\"\nior = 1.6";
    let scene = [
        VIEW,
        GREY,
        &floor("[0.6, 0.5, 0.3]"),
        &ball("smooth", -0.8, "type = \"dielectric\"\nabsorption = [3, 0, 1]"),
        &ball("rough", 0.0, "type = \"dielectric\"\nior = 1.3\nalpha = 0.1"),
        &square("pane", "translate = [0.8, 0.5, 0.3]", pane),
    ]
    .concat();
    let original = Original::new(&scene);
    for format in [MITSUBA, PBRT, GLTF] {
        original.assert_same(format, 0.0, &[]);
    }
    let stained = format!("{pane}\ntransmittance = {{ texture = \"colours.png\" }}");
    let original = Original::new(&scene.replace(pane, &stained));
    for format in [MITSUBA, GLTF] {
        original.assert_same(format, 0.0, &[]);
    }
    assert!(original.again(PBRT).1[0].contains("the colours of its surface"));
    let original = Original::new(&scene.replace(pane, &format!("{pane}\nalpha = 0.25")));
    original.assert_same(GLTF, 0.0, &[]);
    for format in [MITSUBA, PBRT] {
        assert!(original.again(format).1[0].contains("rough pane becomes a smooth one"));
    }
}

#[test]
fn lamps_come_back() {
    let _alone = support::alone();
    for (format, falloff) in
        [(MITSUBA, "linear_angle"), (PBRT, "smooth_cosine"), (GLTF, "squared_cosine")]
    {
        let lamps = format!(
            "[[lamp]]\ntype = \"point\"\nposition = [-1, 1, 0.5]\nintensity = [2, 1, 0.5]\n\n\
             [[lamp]]\ntype = \"directional\"\ndirection = [0.4, -1, -0.2]\n\
             irradiance = [0.3, 0.5, 0.7]\n\n[[lamp]]\nname = \"cone\"\ntype = \"spot\"\n\
             position = [1, 1.5, 1]\ndirection = [-0.5, -1, -0.5]\nintensity = [1, 2, 3]\n\
             inner_angle_deg = 5.0\nouter_angle_deg = 30.0\nfalloff = \"{falloff}\"\n\n"
        );
        let scene = [VIEW, DARK, &lamps, &floor("[0.6, 0.5, 0.3]")].concat()
            + &ball("ball", 0.0, "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]");
        let original = Original::new(&scene);
        original.assert_same(format, 0.0, &[]);
        for other in [MITSUBA, PBRT, GLTF] {
            let (read, warnings) = original.again(other);
            let named = warnings.iter().any(|text| text.contains("lamp `cone`: between"));
            assert_eq!(named, other != format, "{other}: {warnings:?}");
            let kinds = read.lamps.iter().zip(&original.scene.lamps);
            assert_eq!(read.lamps.len(), 3);
            assert!(
                kinds
                    .into_iter()
                    .any(|(a, b)| matches!(a.kind, LampKind::Point { .. }) && a.kind == b.kind)
            );
        }
    }
}

#[test]
fn lights_of_surfaces_and_holes_in_them() {
    let _alone = support::alone();
    let clay = "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]";
    let lying = "translate = [0.0, 1.2, 0.0]\nrotate_deg = [90.0, 0.0, 0.0]";
    let lamp = format!("{clay}\nemission = [6, 5, 4]");
    let picture = format!(
        "{clay}\nemission = {{ texture = \"colours.png\", factor = [3, 2, 1], wrap = \"clamp\" }}"
    );
    let leaf = format!(
        "{clay}\nopacity = {{ texture = \"colours.png\", channel = \"a\", wrap = \"repeat\" }}"
    );
    let net = format!(
        "{clay}\nopacity = {{ texture = \"colours.png\", channel = \"a\", \
         interpolation = \"nearest\" }}\nopacity_cutoff = 0.5"
    );
    let glow = "type = \"diffuse\"\nreflectance = [0, 0, 0]\nemission = [0.9, 0.5, 0.2]\n\
                emission_two_sided = true";
    let scene = [
        VIEW,
        DARK,
        &floor("[0.6, 0.5, 0.3]"),
        &square("lamp", lying, &lamp),
        &square("picture", "translate = [-0.6, 0.5, -0.6]", &picture),
        &square("leaf", "translate = [0.5, 0.5, 0.2]", &leaf),
        &square("net", "translate = [-0.5, 0.4, 0.4]", &net),
        &square("glow", "translate = [0.7, 0.5, -0.6]", glow),
    ]
    .concat();
    let original = Original::new(&scene);
    for format in [MITSUBA, PBRT, GLTF] {
        original.assert_same(format, 0.001, &[]);
    }
    let (read, _) = original.again(GLTF);
    let text = fs::read_to_string(&read.path).unwrap();
    assert!(text.contains("KHR_materials_unlit") && text.contains("emissiveStrength"), "{text}");
}

#[test]
fn bumps_and_colours_of_vertices() {
    let _alone = support::alone();
    let bumps = "type = \"diffuse\"\nreflectance = [0.7, 0.7, 0.7]\n\
                 normal = { texture = \"bumps.png\", strength = 1.5 }";
    let lamp = "[[lamp]]\ntype = \"point\"\nposition = [-1, 1.5, 1.5]\nintensity = [3, 3, 3]\n\n";
    let colored = "[[material]]\nname = \"colored\"\ntype = \"diffuse\"\n\
                   reflectance = [0.9, 0.8, 0.7]\nvertex_color = true\n\n[[object]]\n\
                   mesh = \"colored.ply\"\nmaterial = \"colored\"\ntranslate = [0.6, 0.5, 0.0]\n";
    let scene = [
        VIEW,
        DARK,
        lamp,
        &floor("[0.2, 0.2, 0.2]"),
        &square("bumps", "translate = [-0.6, 0.5, 0.0]", bumps),
        colored,
    ]
    .concat();
    let original = Original::new(&scene);
    original.assert_same(MITSUBA, 0.0, &[]);
    original.assert_same(GLTF, 0.001, &[]);
    let (_, warnings) = original.again(PBRT);
    assert!(
        matches!(&warnings[..], [one] if one.contains("no colours of vertices")),
        "{warnings:?}"
    );
}

#[test]
fn environments_and_lenses_come_back() {
    let _alone = support::alone();
    let sky = "[environment]\nsky = { width = 64, sun_radius_deg = 20.0, \
               sun_radiance = [20, 15, 10] }\nrotation_deg = 30.0\n";
    let lens = "vertical_fov_deg = 40.0\naperture_radius = 0.1\nfocus_distance = 3.0\n\
                shift = [0.3, -0.1]\nmirrored = true";
    let view = VIEW.replace("vertical_fov_deg = 40.0", lens);
    let chrome = "type = \"conductor\"\nalpha = 0.3\neta = [0.2, 0.9, 1.1]\nk = [3.9, 2.5, 2.3]";
    let scene = [&view, sky, &floor("[0.6, 0.5, 0.3]"), &ball("chrome", 0.0, chrome)].concat();
    let original = Original::new(&scene);
    // Mitsuba has the lens or the shift.
    for part in ["shift = [0.3, -0.1]\n", "aperture_radius = 0.1\nfocus_distance = 3.0\n"] {
        let other = Original::new(&scene.replace(part, ""));
        other.assert_same(MITSUBA, 0.0, &["separately"]);
    }
    // The map is resampled twice.
    original.assert_same(PBRT, 0.005, &[]);
    let (_, warnings) = original.again(GLTF);
    let expected = [
        "camera: glTF has no lens",
        "camera: glTF shifts no lens",
        "camera: glTF mirrors",
        "--rotate-environment 30",
        "refractive index",
    ];
    for part in expected {
        assert!(warnings.iter().any(|text| text.contains(part)), "{part}: {warnings:?}");
    }
    assert_eq!(warnings.len(), expected.len());
}

#[test]
fn what_a_format_cannot_say_is_named_and_refused_by_strict() {
    let folder = Folder::new();
    let clay = "type = \"mirror\"\nreflectance = [0.9, 0.5, 0.3]\ntwo_sided = false";
    let yard = command::yard([8, 6], "constant = [1, 1, 1]", clay, command::BALL);
    folder.write("scene.toml", yard);
    for (format, parts) in [
        ("pbrt", &["its back is black", "at normal incidence alone"][..]),
        ("gltf", &["its back is black", "mirror becomes a metal", "environment: glTF has none"]),
    ] {
        let arguments = ["export", "scene.toml", "out", &format!("--format={format}"), "--strict"];
        folder.run(&arguments).assert(1, &["scene.toml", "`clay`", "--strict"]);
        assert_eq!(folder.files(), ["scene.toml"]);
        let run = folder.run(&arguments[..4]);
        run.assert(0, parts);
        assert_eq!(run.output, format!("out/scene.{format}\n"));
        fs::remove_dir_all(folder.path().join("out")).unwrap();
    }
}
