//! `--denoise` of `render` and `convert`, with a library of its own that has the API of Open Image Denoise
//! (`support/oidn.c`), and with the real one where `FENESTRA_OIDN` names it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use fenestra::film::{Attribute, Image};

use crate::support::{
    c_library,
    command::{BALL, Folder, Run, Running, program, yard},
    random::Random,
};

const VARIABLE: &str = "FENESTRA_OIDN";
const WIDTH: u32 = 24;
const HEIGHT: u32 = 20;

/// Compiles the stand-in, with the names of version 1 if `is_old`.
fn stub(folder: &Folder, is_old: bool) -> PathBuf {
    let place = folder.path().join("library");
    let (name, options) = if is_old {
        ("libOpenImageDenoise.so.1", &["-lm", "-DOLD"][..])
    } else {
        ("libOpenImageDenoise.so.2", &["-lm"][..])
    };
    c_library::compile_to(&place.join(name), "oidn", options);
    place
}

fn run(folder: &Folder, library: &Path, arguments: &[&str]) -> Run {
    let mut program = program(folder.path());
    Run::of(&program.args(arguments).env(VARIABLE, library).output().unwrap())
}

/// Writes a grey film with noise of ±50% and its layers.
fn noisy(folder: &Folder, name: &str, has_layers: bool) -> Image {
    let mut image = Image::new(WIDTH, HEIGHT);
    let mut random = Random(1);
    let mut pixel = || [0.2 + 0.2 * random.uniform_f32(); 3];
    let pixels: Vec<[f32; 3]> = (0..image.pixel_count()).map(|_| pixel()).collect();
    image.insert_triple(["R", "G", "B"], &pixels);
    if has_layers {
        let layer = |value| vec![value; pixels.len()];
        image.insert_triple(["Albedo.R", "Albedo.G", "Albedo.B"], &layer([0.5; 3]));
        image.insert_triple(["N.X", "N.Y", "N.Z"], &layer([0.0, 0.0, 1.0]));
    }
    image.attributes.insert("fenestra.sampler".into(), Attribute::Text("mis".into()));
    image.write_exr(&folder.path().join(name)).unwrap();
    image
}

/// Mean and variance of the red of a picture.
fn moments(image: &Image) -> (f64, f64) {
    let red: Vec<f64> = image.channels["R"].iter().map(|value| f64::from(*value)).collect();
    let mean = red.iter().sum::<f64>() / red.len() as f64;
    let squares = red.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, squares / red.len() as f64)
}

fn mark(image: &Image) -> &str {
    match &image.attributes["fenestra.denoised"] {
        Attribute::Text(text) => text,
        other => panic!("expected text, found {other:?}"),
    }
}

/// Denoises a noisy grey by the library there, and tests that it is smoother, of the same mean, marked,
/// and that the film is untouched.
fn becomes_smooth(library: &Path, version: &str) {
    let folder = Folder::new();
    let film = noisy(&folder, "in.exr", true);
    let bytes = fs::read(folder.path().join("in.exr")).unwrap();
    let result = run(&folder, library, &["convert", "in.exr", "out.exr", "--denoise"]);
    result.assert(0, &["Open Image Denoise", "with Albedo, N", "biased"]);
    let denoised = folder.image("out.exr");
    let (before, after) = (moments(&film), moments(&denoised));
    assert!(after.1 < 0.3 * before.1, "variance {} of {}", after.1, before.1);
    assert!((after.0 / before.0 - 1.0).abs() < 0.05, "mean {} of {}", after.0, before.0);
    assert!(mark(&denoised).starts_with(version), "{}", mark(&denoised));
    assert_eq!(denoised.attributes["fenestra.sampler"], film.attributes["fenestra.sampler"]);
    assert_eq!(denoised.channels.len(), 3, "the picture alone");
    assert_eq!(fs::read(folder.path().join("in.exr")).unwrap(), bytes, "the film");
}

#[test]
fn a_noisy_picture_becomes_smooth() {
    let folder = Folder::new();
    becomes_smooth(&stub(&folder, false), "Open Image Denoise 2.3.1 with Albedo, N");
    // A file may be named instead of its folder.
    becomes_smooth(
        &stub(&folder, true).join("libOpenImageDenoise.so.1"),
        "Open Image Denoise 1.4.3 with Albedo, N",
    );
    if let Some(real) = env::var_os(VARIABLE) {
        eprintln!("with the library of {}", real.display());
        becomes_smooth(real.as_ref(), "Open Image Denoise ");
    }
}

#[test]
fn pictures_are_denoised_before_they_are_cut_or_scaled() {
    let folder = Folder::new();
    let library = stub(&folder, false);
    noisy(&folder, "in.exr", true);
    let convert = |arguments: &[&str]| {
        let arguments = [&["convert", "in.exr"], arguments, &["--denoise"]].concat();
        run(&folder, &library, &arguments).assert(0, &["biased"]);
    };
    convert(&["all.exr"]);
    convert(&["part.exr", "--crop", "8,8,12,10"]);
    let all = folder.image("all.exr");
    let part = folder.image("part.exr");
    assert_eq!((part.origin, part.width, part.height), ([8, 8], 4, 2));
    assert_eq!(part.channels["G"][0], all.channels["G"][(8 * WIDTH + 8) as usize]);
    convert(&["scaled.exr", "--exposure", "1"]);
    let scaled = folder.image("scaled.exr");
    assert_eq!(scaled.channels["B"][5], 2.0 * all.channels["B"][5]);
    assert_eq!(mark(&scaled), mark(&all));
    convert(&["shown.png"]);
    convert(&["shown.hdr"]);
    // Noise that neighbours share stays: the picture of pixels that share none is taken where there is one.
    let mut film = folder.image("in.exr");
    film.insert_triple(["Unfiltered.R", "Unfiltered.G", "Unfiltered.B"], &[[2.0; 3]; 24 * 20]);
    film.write_exr(&folder.path().join("in.exr")).unwrap();
    convert(&["unfiltered.exr"]);
    assert!(
        folder.image("unfiltered.exr").channels["R"].iter().all(|red| (red - 2.0).abs() < 1e-3)
    );
    assert!(image::open(folder.path().join("shown.png")).unwrap().width() == WIDTH);
}

#[test]
fn bad_pixels_and_missing_layers_are_named() {
    let folder = Folder::new();
    let library = stub(&folder, false);
    let mut film = noisy(&folder, "in.exr", false);
    film.channels.get_mut("R").unwrap()[30] = f32::NAN;
    film.channels.get_mut("G").unwrap()[30] = f32::INFINITY;
    film.channels.get_mut("B").unwrap()[0] = f32::NEG_INFINITY;
    film.write_exr(&folder.path().join("in.exr")).unwrap();
    let result = run(&folder, &library, &["convert", "in.exr", "out.exr", "--denoise"]);
    result.assert(0, &["2 pixels are not finite", "lacks the layers Albedo and N"]);
    let denoised = folder.image("out.exr");
    assert!(denoised.channels.values().flatten().all(|value| (0.15..0.45).contains(value)));
    assert_eq!(mark(&denoised), "Open Image Denoise 2.3.1");
    let mut depth = Image::new(2, 2);
    depth.channels.insert("Z".into(), vec![1.0; 4]);
    depth.write_exr(&folder.path().join("depth.exr")).unwrap();
    let result = run(&folder, &library, &["convert", "depth.exr", "out.exr", "--denoise"]);
    result.assert(1, &["depth.exr: expected channels R, G, B", "found Z"]);
}

#[test]
fn layers_reach_the_denoiser_as_they_are_but_finite() {
    let folder = Folder::new();
    let library = stub(&folder, false);
    let mut film = noisy(&folder, "in.exr", true);
    film.channels.get_mut("Albedo.R").unwrap()[7] = f32::INFINITY;
    film.channels.get_mut("N.Z").unwrap()[30] = f32::NAN;
    film.write_exr(&folder.path().join("in.exr")).unwrap();
    for (layer, expected) in [("albedo", [0.5; 3]), ("normal", [0.0, 0.0, 1.0])] {
        let mut program = program(folder.path());
        program.args(["convert", "in.exr", "out.exr", "--denoise"]).env("STUB_SHOWS", layer);
        Run::of(&program.env(VARIABLE, &library).output().unwrap()).assert(0, &[]);
        let shown = folder.image("out.exr");
        for (channel, expected) in ["R", "G", "B"].into_iter().zip(expected) {
            let is_near = |value: &f32| (value - expected).abs() < 1e-6;
            assert!(shown.channels[channel].iter().all(is_near), "{layer} {channel}");
        }
    }
}

#[test]
fn a_denoised_picture_is_no_film() {
    let folder = Folder::new();
    let library = stub(&folder, false);
    noisy(&folder, "in.exr", true);
    run(&folder, &library, &["convert", "in.exr", "out.exr", "--denoise"]).assert(0, &[]);
    let refused = ["out.exr: made by Open Image Denoise 2.3.1 with Albedo, N, and so biased"];
    folder.run(&["merge", "out.exr", "in.exr", "-o", "sum.exr"]).assert(1, &refused);
    run(&folder, &library, &["convert", "out.exr", "twice.exr", "--denoise"]).assert(1, &refused);
    assert_eq!(folder.files(), ["in.exr", "library", "out.exr"]);
    folder.write("scene.toml", yard([WIDTH, HEIGHT], "constant = [1, 1, 1]", CLAY, BALL));
    let study = ["study", "scene.toml", "--samplers", "mis", "--spp", "1", "--seeds", "1"];
    let arguments = [&study[..], &["--reference", "out.exr", "-o", "report"]].concat();
    folder.run(&arguments).assert(1, &refused);
}

#[test]
fn a_library_that_is_missing_or_fails_is_explained() {
    let folder = Folder::new();
    noisy(&folder, "in.exr", true);
    let convert = |library: &Path, parts: &[&str]| {
        let result = run(&folder, library, &["convert", "in.exr", "out.exr", "--denoise"]);
        result.assert(1, parts);
        assert!(!folder.path().join("out.exr").exists());
    };
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let asked = "--denoise needs the library Open Image Denoise (libOpenImageDenoise.so.2)";
    convert(&empty, &[asked, "FENESTRA_OIDN=", "empty holds none", "help: install"]);
    convert(&folder.path().join("absent.so"), &[asked, "absent.so holds none"]);
    let text = folder.write("text/libOpenImageDenoise.so.2", "no library");
    convert(&text, &[asked, "cannot be loaded", "libOpenImageDenoise.so.2"]);
    let source = folder.write("nothing.c", "int nothing;\n");
    let nothing = folder.path().join("nothing.so");
    let status =
        Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&nothing, &source]).status();
    assert!(status.unwrap().success());
    convert(&nothing, &["nothing.so is no Open Image Denoise", "it lacks oidnNewDevice"]);
    let mut program = program(folder.path());
    program.args(["convert", "in.exr", "out.exr", "--denoise"]).env("STUB_FAILS", "1");
    let failed = Run::of(&program.env(VARIABLE, stub(&folder, false)).output().unwrap());
    failed.assert(1, &["libOpenImageDenoise.so.2): the filter failed: out of luck"]);
    // A render fails before its work.
    folder.write("scene.toml", yard([16, 12], "constant = [1, 1, 1]", CLAY, BALL));
    let result = run(&folder, &empty, &["render", "scene.toml", "--denoise"]);
    result.assert(1, &[asked]);
    assert!(!folder.path().join("scene.exr").exists());
}

const CLAY: &str = "type = \"diffuse\"\nreflectance = [0.5, 0.4, 0.3]";

#[test]
fn options_that_contradict_each_other_are_refused() {
    let folder = Folder::new();
    noisy(&folder, "in.exr", true);
    let arguments = ["convert", "in.exr", "out.png", "--denoise", "--layer", "N"];
    folder.run(&arguments).assert(2, &["--denoise", "--layer"]);
    folder.write("scene.toml", yard([16, 12], "constant = [1, 1, 1]", CLAY, BALL));
    let arguments = ["render", "scene.toml", "--denoise", "-o", "/dev/null"];
    folder.run(&arguments).assert(2, &["--denoise needs a file beside --output"]);
    let arguments =
        ["render", "scene.toml", "-o", "scene.exr", "--denoise", "--stats", "scene.denoised.exr"];
    folder.run(&arguments).assert(2, &["scene.denoised.exr would replace the file of --denoise"]);
}

/// The filter takes 20 s of a film of 3840×2160 pixels on two cores.
#[test]
fn an_interrupt_does_not_wait_for_a_large_picture() {
    let folder = Folder::new();
    let library = stub(&folder, false);
    folder.write("scene.toml", yard([32, 24], "constant = [1, 1, 1]", CLAY, BALL));
    for (size, is_denoised) in [("40x30", true), ("1040x520", false)] {
        let options = ["render", "scene.toml", "--sampler=mis", "--denoise", "-o=o.exr", "--size"];
        let options = [&options[..], &[size, "--spp=100000000"]].concat();
        let variable = Some((VARIABLE, library.as_path()));
        let running = Running::start_with(variable, folder.path(), &options, "device: ");
        let told = if is_denoised { "o.denoised.exr" } else { "convert o.exr o.denoised.exr" };
        running.interrupt().assert(130, &["interrupted", "wrote o.exr", told]);
        let denoised = folder.path().join("o.denoised.exr");
        assert_eq!(denoised.exists(), is_denoised, "{size}");
        fs::remove_file(denoised).unwrap_or_default();
    }
}

#[test]
fn a_render_keeps_its_film() {
    let folder = Folder::new();
    let library = stub(&folder, false);
    folder.write("scene.toml", yard([32, 24], "constant = [1, 1, 1]", CLAY, BALL));
    let render = |arguments: &[&str]| {
        let common =
            ["render", "scene.toml", "--sampler", "mis", "--spp", "2", "--shadow-rays", "1"];
        let mut program = program(folder.path());
        program.args(common).args(arguments).env("STUB_WANTS_LAYERS", "1");
        Run::of(&program.env(VARIABLE, &library).output().unwrap())
    };
    render(&["-o", "plain.exr"]).assert(0, &[]);
    let result = render(&["-o", "film.exr", "--denoise", "--png", "--exposure=-2"]);
    result.assert(0, &["biased", "wrote film.exr, film.png, film.denoised.exr, film.denoised.png"]);
    let [plain, film, denoised] =
        ["plain.exr", "film.exr", "film.denoised.exr"].map(|name| folder.image(name));
    for channel in ["R", "G", "B"] {
        assert_eq!(film.channels[channel], plain.channels[channel]);
    }
    assert!(film.channels.contains_key("Albedo.R") && film.channels.contains_key("N.X"));
    assert!(!film.attributes.contains_key("fenestra.denoised"));
    assert_eq!(mark(&denoised), "Open Image Denoise 2.3.1 with Albedo, N");
    assert_eq!(denoised.attributes["samplesPerPixel"], Attribute::Integer(2));
    assert!(moments(&denoised).1 < moments(&film).1);
    let [shown, clean] = ["film.png", "film.denoised.png"].map(|name| folder.path().join(name));
    let [shown, clean] = [shown, clean].map(|path| fs::read(path).unwrap());
    assert_ne!(shown, clean);
    // Noise that pixels have in common would stay: none shares a path unless asked to.
    let guided = ["render", "scene.toml", "--spp=1", "--depth=2", "-o=guided.exr", "--denoise"];
    run(&folder, &library, &guided).assert(0, &[]);
    let sharing = &folder.image("guided.exr").attributes["fenestra.sampler_parameters.share-paths"];
    assert_eq!(*sharing, Attribute::Text("off".into()));
    // Both previews have the exposure asked for.
    for (picture, preview) in [("film.exr", shown), ("film.denoised.exr", clean)] {
        let options = ["convert", picture, "again.png", "--exposure=-2"];
        folder.run(&options).assert(0, &[]);
        assert!(fs::read(folder.path().join("again.png")).unwrap() == preview, "{picture}");
    }
}

#[test]
fn a_picture_to_show_is_denoised_where_the_library_is_found() {
    let folder = Folder::new();
    let library = stub(&folder, false);
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    folder.write("scene.toml", yard([8, 6], "constant = [1, 1, 1]", CLAY, BALL));
    let film = ["render", "scene.toml", "--sampler", "mis", "--depth", "1", "-o"];
    let shown = [&film[..], &["a.exr"]].concat();
    let told = [
        "quality good (--quality): stops after 50 s or 1024 spp",
        "stopped by --quality good",
        "biased",
    ];
    run(&folder, &library, &shown).assert(0, &told);
    for name in ["a.exr", "a.png", "a.denoised.exr", "a.denoised.png"] {
        assert!(folder.path().join(name).exists(), "{name}");
    }
    let shown = [&film[..], &["b.exr", "--quality", "preview"]].concat();
    let told = [
        "quality preview (--quality): stops after 10 s or 64 spp",
        "not denoised: ",
        "wrote b.exr, b.png\n",
    ];
    run(&folder, &empty, &shown).assert(0, &told);
    // A stop rule alone makes the film alone.
    run(&folder, &library, &[&film[..], &["c.exr", "--spp", "1"]].concat())
        .assert(0, &["wrote c.exr\n"]);
    let both = [&film[..], &["d.exr", "--quality", "final", "--time", "1s"]].concat();
    run(&folder, &library, &both).assert(2, &["'--quality <QUALITY>' cannot be used with"]);
}
