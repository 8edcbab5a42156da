//! Bad input to `render`. Each case either fails with its exit status and a message that names the
//! file and the mistake, or drops the bad part, warns with a count and renders a finite image.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{
    fmt::Write,
    fs,
    process::Command,
    time::{Duration, Instant},
};

use fenestra::{
    brdf::fresnel::fresnel_conductor,
    film::{Attribute, Image},
    scene::mesh::Mesh,
};
use glam::Vec3;

use crate::support::{
    self, c_library,
    command::{Folder, Run, Running, pfm, prepare, program},
    png_chunk,
};

/// One quad, `quad.ply`, under a constant environment. Each case changes a part of it.
const SCENE: &str = r#"[camera]
position = [0.0, 0.0, 3.0]
look_at = [0.0, 0.0, 0.0]
vertical_fov_deg = 45.0

[film]
width = 16
height = 12

[environment]
constant = [1.0, 1.0, 1.0]

[[material]]
name = "grey"
type = "diffuse"
reflectance = [0.5, 0.5, 0.5]

[[object]]
name = "quad"
mesh = "quad.ply"
material = "grey"
"#;

/// Formats an ASCII PLY mesh.
fn ply(vertices: &[&str], faces: &[&str]) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n\
         {}\n{}\n",
        vertices.len(),
        faces.len(),
        vertices.join("\n"),
        faces.join("\n")
    )
}

const QUAD_VERTICES: [&str; 4] = ["-1 -1 0", "1 -1 0", "1 1 0", "-1 1 0"];
const QUAD_FACES: [&str; 2] = ["3 0 1 2", "3 0 2 3"];

/// Writes `quad.ply` and `scene.toml`, in which `new` replaces `old`, into a new folder.
fn scene(old: &str, new: &str) -> Folder {
    assert!(old.is_empty() || SCENE.contains(old), "{old:?} is in the scene");
    let folder = Folder::new();
    let text = if old.is_empty() { format!("{new}{SCENE}") } else { SCENE.replace(old, new) };
    folder.write("scene.toml", text);
    folder.write("quad.ply", ply(&QUAD_VERTICES, &QUAD_FACES));
    folder
}

const RENDER: [&str; 5] = ["render", "scene.toml", "--spp=2", "-o", "out.exr"];

/// Checks that rendering fails with status 1 and these messages and writes nothing.
#[track_caller]
fn assert_refused(folder: &Folder, parts: &[&str]) {
    let before = folder.files();
    folder.run(&RENDER).assert(1, parts);
    assert_eq!(folder.files(), before, "a failed render leaves no file behind");
}

/// Checks that rendering succeeds with these warnings and that every pixel is finite.
#[track_caller]
fn assert_renders(folder: &Folder, warnings: &[&str]) -> Image {
    folder.run(&RENDER).assert(0, warnings);
    let image = folder.image("out.exr");
    for (name, samples) in &image.channels {
        assert!(samples.iter().all(|sample| sample.is_finite()), "channel {name} is finite");
    }
    assert!(image.channels["G"].iter().any(|sample| *sample > 0.0), "the image is not black");
    image
}

#[test]
fn the_unchanged_scene_renders() {
    let image = assert_renders(&scene("", ""), &[]);
    assert_eq!([image.width, image.height], [16, 12]);
}

#[test]
fn a_missing_scene_is_named() {
    Folder::new().run(&RENDER).assert(1, &["error: scene.toml: cannot read: No such file"]);
}

#[test]
fn text_that_is_no_toml_has_line_and_column() {
    assert_refused(&scene("width = 16", "width = = 16"), &["error: scene.toml:7:9: "]);
    assert_refused(&scene("width = 16", "width = \"wide\""), &["error: scene.toml:7:9: ", "u32"]);
    let folder = scene("", "");
    folder.write("scene.toml", &SCENE.as_bytes()[..SCENE.len() / 2]);
    assert_refused(&folder, &["error: scene.toml:"]);
    folder.write("scene.toml", b"\xff\xfe binary");
    assert_refused(&folder, &["error: scene.toml: not a text file: byte 0 is not UTF-8"]);
}

#[test]
fn an_unknown_key_has_line_and_column() {
    let folder = scene("reflectance = [", "reflectanse = [");
    assert_refused(&folder, &["error: scene.toml:16:1: ", "reflectanse", "reflectance"]);
    let folder = scene("vertical_fov_deg = 45.0", "vertical_fov_deg = 45.0\nfov = 1");
    assert_refused(&folder, &["error: scene.toml:5:1: ", "fov", "vertical_fov_deg"]);
}

#[test]
fn numbers_that_cannot_be_rendered_are_named() {
    let cases = [
        ("look_at = [0.0, 0.0, 0.0]", "look_at = [nan, 0.0, 0.0]", "camera.look_at"),
        ("look_at = [0.0, 0.0, 0.0]", "look_at = [0.0, 0.0, 3.0]", "must differ"),
        ("vertical_fov_deg = 45.0", "vertical_fov_deg = 180.0", "camera.vertical_fov_deg"),
        ("[1.0, 1.0, 1.0]", "[1.0, inf, 1.0]", "environment.constant"),
        ("[1.0, 1.0, 1.0]", "[1.0, -1.0, 1.0]", "environment.constant"),
        ("[0.5, 0.5, 0.5]", "[0.5, 1.5, 0.5]", "material `grey` (line 13): reflectance"),
        ("material = \"grey\"", "material = \"gray\"", "unknown material `gray`"),
        ("material = \"grey\"", "material = \"grey\"\nscale = 0", "scale must not be 0"),
        ("material = \"grey\"", "material = \"grey\"\nscale = 1e20", "expected at most 1e9 m"),
        ("width = 16", "width = 0", "film.width: expected 1 to"),
        ("height = 12", "height = 1000000", "film.height: expected 1 to"),
    ];
    for (old, new, message) in cases {
        assert_refused(&scene(old, new), &["error: scene.toml: ", message]);
    }
}

#[test]
fn impossible_sizes_are_refused() {
    let folder = scene("", "");
    for size in ["0x12", "16", "16x0", "100000x100000", "-1x5"] {
        let run = folder.run(&["render", "scene.toml", &format!("--size={size}")]);
        run.assert(2, &["--size", "expected WIDTHxHEIGHT"]);
    }
    for crop in ["0,0,0,5", "5,0,1,5", "1,2,3"] {
        let run = folder.run(&["render", "scene.toml", &format!("--crop={crop}")]);
        run.assert(2, &["--crop", "expected x0,y0,x1,y1"]);
    }
    // The film has 16×12 pixels.
    let run = folder.run(&["render", "scene.toml", "--crop=0,0,17,5"]);
    run.assert(2, &["crop", "16"]);
}

#[test]
fn wrong_options_exit_with_2() {
    let folder = scene("", "");
    let cases = [
        ("--spp=0", "--spp"),
        ("--time=soon", "expected a duration"),
        ("--error=-1", "--error"),
        ("--sampler=best", "possible values: "),
        ("--shadow-rays=0", "--shadow-rays"),
        ("--depth=0", "--depth"),
        ("--set=colour=1", "colour"),
        ("--sample-offset=4294967295", "the last sample must be below 4294967295"),
        ("--output=out.png", "expected a name that ends in .exr"),
        ("--aov=beauty", "possible values: "),
    ];
    for (option, message) in cases {
        folder.run(&["render", "scene.toml", option]).assert(2, &[message]);
    }
}

#[test]
fn a_missing_or_truncated_mesh_is_named() {
    let folder = scene("quad.ply", "absent.ply");
    assert_refused(&folder, &["error: absent.ply: cannot read: No such file"]);
    let folder = scene("", "");
    let whole = ply(&QUAD_VERTICES, &QUAD_FACES);
    folder.write("quad.ply", &whole[..whole.len() - 8]);
    assert_refused(&folder, &["error: quad.ply:", "truncated"]);
    folder.write("quad.ply", &whole[..whole.find("end_header").unwrap()]);
    assert_refused(&folder, &["error: quad.ply:", "truncated: the file ends before `end_header`"]);
    folder.write("quad.ply", "solid quad\n");
    assert_refused(&folder, &["error: quad.ply:1:1: expected a PLY file that starts with `ply`"]);
}

#[test]
fn an_index_out_of_range_is_named() {
    let folder = scene("", "");
    folder.write("quad.ply", ply(&QUAD_VERTICES, &["3 0 1 2", "3 0 2 4"]));
    let parts =
        ["error: quad.ply:15:", "face 1 of 2: vertex index 4 is out of range", "4 vertices"];
    assert_refused(&folder, &parts);
}

#[test]
fn triangles_that_cannot_be_hit_are_dropped_with_a_warning() {
    let folder = scene("", "");
    let vertices = ["-1 -1 0", "1 -1 0", "1 1 0", "-1 1 0", "nan 0 1", "inf 0 1"];
    // Two good triangles, a point, a line, one with a NaN corner, one with an infinite corner.
    let faces = ["3 0 1 2", "3 0 2 3", "3 0 0 0", "3 0 1 1", "3 0 1 4", "3 2 3 5"];
    folder.write("quad.ply", ply(&vertices, &faces));
    let warnings = [
        "object `quad` (quad.ply, line 18): dropped 2 triangles of zero area of 6",
        "object `quad` (quad.ply, line 18): dropped 2 triangles with infinite or NaN corners of 6",
    ];
    assert_renders(&folder, &warnings);
}

#[test]
fn a_mesh_without_triangles_leaves_the_environment() {
    let folder = scene("", "");
    folder.write("quad.ply", ply(&QUAD_VERTICES, &[]));
    let image = assert_renders(&folder, &["the mesh has no triangles"]);
    assert!(image.channels["R"].iter().all(|sample| (sample - 1.0).abs() < 1e-5));
}

#[test]
fn a_missing_or_truncated_map_is_named() {
    let with_map = |name: &str| scene("constant = [1.0, 1.0, 1.0]", &format!("map = {name:?}"));
    for name in ["sky.hdr", "sky.exr", "sky.pfm"] {
        let folder = with_map(name);
        assert_refused(&folder, &[&format!("error: {name}: cannot read: No such file")]);
        folder.write(name, "neither of them");
        assert_refused(&folder, &[&format!("error: {name}: not a ")]);
    }
    let folder = with_map("sky.pfm");
    let whole = pfm([4, 2], &[[1.0; 3]; 8]);
    folder.write("sky.pfm", &whole[..whole.len() - 4]);
    let parts = ["error: sky.pfm: truncated: 4×2 texels of 3 floats need 96 bytes, found 92"];
    assert_refused(&folder, &parts);
    let folder = with_map("sky.hdr");
    folder.write("sky.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n\u{1}\u{1}");
    assert_refused(&folder, &["error: sky.hdr: not a readable Radiance file"]);
    let folder = with_map("sky.exr");
    folder.write_image("sky.exr", [8, 4], [1.0; 3]);
    let whole = fs::read(folder.path().join("sky.exr")).unwrap();
    folder.write("sky.exr", &whole[..whole.len() - 5]);
    assert_refused(&folder, &["error: sky.exr: not a readable OpenEXR file"]);
    let folder = with_map("sky.gif");
    folder.write("sky.gif", "GIF89a");
    assert_refused(&folder, &["sky.gif: expected a PNG", "EXR or PFM image"]);
}

#[test]
fn texels_that_are_not_radiance_never_reach_the_film() {
    let folder = scene("constant = [1.0, 1.0, 1.0]", "map = \"sky.pfm\"");
    let mut texels = [[1.0; 3]; 8];
    for (texel, bad) in [(0, f32::NAN), (3, f32::INFINITY), (5, -1.0)] {
        texels[texel][0] = bad;
    }
    folder.write("sky.pfm", pfm([4, 2], &texels));
    assert_renders(&folder, &["sky.pfm: 3 of 8 texels are negative, infinite", "were set to 0"]);
}

/// Replaces the scene's diffuse material by a measured one.
fn measured(file: &str) -> Folder {
    scene(
        "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]",
        &format!("type = \"measured\"\nfile = {file:?}"),
    )
}

#[test]
fn a_missing_or_truncated_brdf_is_named() {
    for name in ["paint.binary", "paint.brdf"] {
        let parts = [&*format!("error: {name}: cannot read: No such file")];
        assert_refused(&measured(name), &parts);
    }
    let folder = measured("paint.binary");
    let header = |sizes: [i32; 3]| sizes.iter().flat_map(|size| size.to_le_bytes()).collect();
    let mut bytes: Vec<u8> = header([90, 90, 180]);
    bytes.extend([0; 100]);
    folder.write("paint.binary", &bytes);
    let parts =
        ["error: paint.binary: truncated: expected a MERL file of 34992012 bytes, found 112"];
    assert_refused(&folder, &parts);
    folder.write("paint.binary", header([90, 90, 360]));
    assert_refused(&folder, &["paint.binary: ", "90 × 90 × 180", "90 × 90 × 360"]);
    let folder = measured("paint.bsdf");
    folder.write("paint.bsdf", "tensor_file\0\x01\0\x09\0\0\0");
    let parts = ["error: paint.bsdf: truncated: its header goes on after byte 18"];
    assert_refused(&folder, &parts);
    for command in [&["info"][..], &["fit", "brdf"]] {
        folder.run(&[command, &["paint.bsdf"]].concat()).assert(1, &parts);
    }
    let folder = measured("paint.brdf");
    folder.write("paint.brdf", "3 450 550 650\n0.1 0 0.1 3.1 0.2 0.2\n");
    assert_refused(&folder, &["error: paint.brdf:2:", "records of 7 numbers", "6 left over"]);
    folder.write("paint.brdf", "3 450 550 650\n0.1 0 0.1 3.1 0.2 0.2 high\n");
    assert_refused(&folder, &["error: paint.brdf:2:23: expected a number, found \"high\""]);
}

#[test]
fn a_nan_in_a_brdf_never_reaches_the_film() {
    let folder = measured("paint.brdf");
    let mut text = String::from("3 450 550 650\n");
    for theta_in in [10, 30, 50, 70] {
        for theta_out in [5, 25, 45, 65] {
            for phi in (-150..=180).step_by(30) {
                let [a, b, c] = [theta_in, theta_out, phi].map(|deg| f64::from(deg).to_radians());
                let value = if (theta_in, theta_out, phi) == (30, 25, 0) { "nan" } else { "0.2" };
                text += &format!("{a} 0 {b} {c} {value} 0.2 0.2\n");
            }
        }
    }
    folder.write("paint.brdf", text);
    assert_renders(&folder, &["paint.brdf", "1 records that are not finite"]);
}

#[test]
fn no_device_is_explained() {
    let folder = scene("", "");
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        let mut command = program(folder.path());
        command.args(RENDER).env_remove("VK_DRIVER_FILES").env_remove("VK_ICD_FILENAMES");
        command.env(variable, "/nonexistent");
        let run = Run::of(&command.output().unwrap());
        run.assert(75, &["finds no driver", "help: ", "./setup"]);
    }
    let run = folder.run(&["render", "scene.toml", "--device=no such device"]);
    run.assert(75, &["no Vulkan device matches --device no such device", "help: "]);
}

#[test]
fn a_full_disk_is_reported_and_the_older_image_kept() {
    let folder = scene("", "");
    folder.write("out.exr", "older image");
    let before = folder.files();
    // Every write to this device fails for lack of space.
    let run = folder.run(&["render", "scene.toml", "--spp=2", "--output=/dev/full"]);
    run.assert(75, &["error: /dev/full: cannot write: No space left on device"]);
    let mut rendering = program(folder.path());
    c_library::fail_in(&mut rendering, folder.path(), ("FAULTY_BYTES", 512));
    let run = Run::of(&rendering.args(RENDER).output().unwrap());
    run.assert(75, &["error: out.exr: cannot write: No space left on device"]);
    assert_eq!(folder.files(), before, "no temporary file is left");
    assert_eq!(fs::read(folder.path().join("out.exr")).unwrap(), b"older image");
}

#[test]
fn an_output_that_cannot_be_written_is_named() {
    let folder = scene("", "");
    folder.write("file", "");
    let run = folder.run(&["render", "scene.toml", "--spp=2", "-o", "file/out.exr"]);
    run.assert(1, &["error: file", "cannot "]);
    fs::create_dir(folder.path().join("folder.exr")).unwrap();
    let run = folder.run(&["render", "scene.toml", "--spp=2", "-o", "folder.exr"]);
    run.assert(1, &["error: folder.exr: cannot write"]);
    assert!(!run.messages.contains("2 spp"), "found before the work:\n{}", run.messages);
}

#[test]
fn an_interrupt_writes_what_there_is() {
    let folder = scene("", "");
    let options = ["render", "scene.toml", "--spp=100000000", "-o", "out.exr"];
    // The program names the device once it listens for interrupts.
    let run = Running::start(folder.path(), &options, "device: ").interrupt();
    run.assert(130, &["interrupted"]);
    let image = folder.image("out.exr");
    let samples = &image.attributes["samplesPerPixel"];
    assert!(matches!(samples, Attribute::Integer(1..100_000_000)), "{samples:?}");
    assert!(image.channels["R"].iter().all(|sample| sample.is_finite() && *sample > 0.0));
}

/// Runs the program with a limit of a minute, after which the status is 124.
#[cfg(unix)]
fn run_limited(folder: &Folder, arguments: &[&str]) -> Run {
    let mut limited = Command::new("timeout");
    prepare(&mut limited, folder.path());
    limited.args(["60", env!("CARGO_BIN_EXE_fenestra")]).args(arguments);
    Run::of(&limited.output().unwrap())
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_no_input() {
    let refused = "expected a regular file, found a ";
    let map = |name: &str| scene("constant = [1.0, 1.0, 1.0]", &format!("map = {name:?}"));
    let mesh = |name: &str| scene("quad.ply", name);
    let cases = [
        (scene("", ""), "pipe.toml"),
        (mesh("pipe.ply"), "pipe.ply"),
        (mesh("pipe.obj"), "pipe.obj"),
        (mesh("pipe.glb"), "pipe.glb"),
        (map("pipe.hdr"), "pipe.hdr"),
        (map("pipe.exr"), "pipe.exr"),
        (map("pipe.pfm"), "pipe.pfm"),
        (measured("pipe.binary"), "pipe.binary"),
        (measured("pipe.brdf"), "pipe.brdf"),
    ];
    for (folder, name) in &cases {
        let pipe = folder.path().join(name);
        assert!(Command::new("mkfifo").arg(pipe).status().unwrap().success());
        let read = if name.ends_with(".toml") { name } else { "scene.toml" };
        let run = run_limited(folder, &["render", read, "--spp=2", "-o", "out.exr"]);
        run.assert(1, &[&format!("error: {name}: {refused}pipe")]);
    }
    let folder = mesh("quad.obj");
    let obj = "mtllib pipe.mtl\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n";
    folder.write("quad.obj", obj);
    assert!(Command::new("mkfifo").arg(folder.path().join("pipe.mtl")).status().unwrap().success());
    let run = run_limited(&folder, &RENDER);
    run.assert(0, &["quad.obj:1: cannot read the material library `pipe.mtl`"]);
    folder.write("quad.obj", obj.replace("pipe.mtl", "/dev/zero"));
    let run = run_limited(&folder, &RENDER);
    run.assert(0, &["quad.obj:1: cannot read the material library `/dev/zero` (", "absolute"]);
}

#[cfg(unix)]
#[test]
fn an_output_is_a_file_a_device_or_standard_output() {
    let folder = scene("", "");
    let pipe = folder.path().join("pipe.exr");
    assert!(Command::new("mkfifo").arg(pipe).status().unwrap().success());
    for options in [&["-o", "pipe.exr"][..], &["-o", "out.exr", "--stats", "pipe.exr"]] {
        let arguments = [&["render", "scene.toml", "--spp=2"], options].concat();
        let parts = ["error: pipe.exr: expected a file to write, /dev/stdout or a device"];
        run_limited(&folder, &arguments).assert(1, &parts);
    }
    let arguments = ["render", "scene.toml", "--spp=2", "-o", "/dev/stdout"];
    let output = program(folder.path()).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder.write("piped.exr", output.stdout);
    let image = folder.image("piped.exr");
    assert_eq!([image.width, image.height], [16, 12]);
    let run = folder.run(&[&arguments[..], &["--png"]].concat());
    run.assert(2, &["--png needs a file beside --output", "/dev/stdout"]);
}

#[test]
fn an_output_never_replaces_an_input() {
    let folder = scene("constant = [1.0, 1.0, 1.0]", "map = \"m.exr\"");
    folder.write_image("m.exr", [8, 4], [1.0; 3]);
    folder.write("quad.obj", "mtllib quad.mtl\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    folder.write("quad.mtl", "newmtl a\nKd 1 1 1\n");
    let text = fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    folder.write("scene.toml", text.replace("quad.ply", "quad.obj"));
    let before = folder.files();
    let contents = || before.iter().map(|name| fs::read(folder.path().join(name)).unwrap());
    let kept: Vec<_> = contents().collect();
    let guided = ["-o", "out.exr", "--sampler", "guided", "--save-guide", "./quad.obj"];
    let twice = ["-o", "n.exr", "--sampler", "guided", "--save-guide", "./n.exr"];
    let cases: [(&[&str], &str); 8] = [
        (&["-o", "m.exr"], "--output m.exr would replace m.exr, which is read"),
        (
            &["-o", "out.exr", "--stats", "scene.toml"],
            "--stats scene.toml would replace scene.toml",
        ),
        (&["-o", "out.exr", "--stats", "quad.mtl"], "--stats quad.mtl would replace quad.mtl"),
        (&guided, "--save-guide ./quad.obj would replace quad.obj"),
        (&twice, "--save-guide ./n.exr would replace the file of --output"),
        (&["-o", "out.exr", "--stats", "out.exr"], "--stats out.exr would replace the file of"),
        (&["-o", "out.exr", "--png", "--stats", "out.png"], "--stats out.png would replace"),
        (
            &["-o", "out.exr", "--stats", "out.checkpoint.exr"],
            "the checkpoint out.checkpoint.exr would replace the file of --stats",
        ),
    ];
    for (options, message) in cases {
        let arguments = [&["render", "scene.toml", "--spp=2"], options].concat();
        folder.run(&arguments).assert(2, &[&format!("error: {message}")]);
    }
    assert_eq!(folder.files(), before);
    assert_eq!(contents().collect::<Vec<_>>(), kept);
}

#[test]
fn no_command_writes_over_what_it_reads() {
    let folder = scene("constant = [1.0, 1.0, 1.0]", "map = \"m.exr\"");
    folder.write_image("m.exr", [8, 4], [1.0; 3]);
    folder.run(&["export", "scene.toml", "s.xml", "--format=mitsuba"]).assert(0, &[]);
    for name in ["a.exr", "b.exr"] {
        folder.run(&["render", "scene.toml", "--spp=1", "-o", name]).assert(0, &[]);
    }
    folder.write("report/study.json", r#"{"format": "fenestra study 3"}"#);
    fs::copy(folder.path().join("a.exr"), folder.path().join("report/a.exr")).unwrap();
    std::os::unix::fs::symlink("report/a.exr", folder.path().join("ours.exr")).unwrap();
    std::os::unix::fs::symlink("a.exr", folder.path().join("soft.exr")).unwrap();
    fs::hard_link(folder.path().join("a.exr"), folder.path().join("hard.exr")).unwrap();
    let before = folder.files();
    let contents = || before.iter().map(|name| fs::read(folder.path().join(name)).ok());
    let kept: Vec<_> = contents().collect();
    let mut commands: Vec<Vec<&str>> = vec![
        vec!["fit", "env", "m.exr", "-o", "m.exr"],
        vec!["fit", "env", "scene.toml", "-o", "./scene.toml"],
        vec!["study", "scene.toml", "-o", "report", "--reference=ours.exr"],
        vec!["study", "scene.toml", "-o", "report", "--reference=report"],
        vec!["export", "s.xml", "./s.xml", "--format=mitsuba"],
        vec!["export", "s.xml", "s.pbrt", "--format=pbrt"],
    ];
    for name in ["a.exr", "./a.exr", "soft.exr", "hard.exr"] {
        commands.push(vec!["merge", "a.exr", "b.exr", "-o", name]);
        commands.push(vec!["compare", "a.exr", "b.exr", "--heatmap", name]);
        commands.push(vec!["convert", "a.exr", name]);
    }
    for command in commands {
        folder.run(&command).assert(2, &[" would replace ", ", which is read"]);
    }
    assert_eq!(folder.files(), before);
    assert_eq!(contents().collect::<Vec<_>>(), kept);
}

#[test]
fn every_output_is_tried_before_the_work() {
    let folder = scene("", "");
    folder.write("file", "");
    fs::create_dir(folder.path().join("out.png")).unwrap();
    let guided = ["--sampler", "guided", "--save-guide", "file/a.guide"];
    for options in [&["--stats", "file/s.json"][..], &["--png"], &guided] {
        let run = folder.run(&[&RENDER[..], options].concat());
        run.assert(1, &["cannot "]);
        assert!(!folder.path().join("out.exr").exists(), "{options:?}: found before the work");
    }
}

#[test]
fn shapes_of_too_many_triangles_are_refused() {
    let mut objects = String::new();
    // Equal shapes would be instances of one.
    for index in 1..=100 {
        writeln!(
            objects,
            "[[object]]\nshape = \"sphere\"\nradius = {index}.0\nsegments = 4096\nmaterial = \"grey\""
        )
        .unwrap();
    }
    let folder = scene("", "");
    folder.write("scene.toml", format!("{SCENE}{objects}"));
    let parts = ["object 3 (sphere, line ", "may have 33554432 triangles together, found "];
    assert_refused(&folder, &parts);
}

#[test]
fn a_request_beyond_the_memory_limit_says_who_asks_for_how_much() {
    // A header that lies about a map within the limits of its format.
    let mut lie = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 16384\n".to_vec();
    lie.resize(3 << 20, 2);
    let map = scene("constant = [1.0, 1.0, 1.0]", "map = \"lie.hdr\"");
    map.write("lie.hdr", &lie);
    let shape = scene("mesh = \"quad.ply\"", "shape = \"sphere\"\nradius = 1.0\nsegments = 4096");
    let tree = scene("mesh = \"quad.ply\"", "shape = \"sphere\"\nradius = 1.0\nsegments = 1024");
    let film = ["--size=8000x8000"];
    let groups = ["--size=8000x8000", "--aov=light-groups", "--sampler=mis"];
    // Software devices keep two copies.
    let asks = if support::is_software() { ["7.2", "11.4"] } else { ["4.3", "7.2"] };
    let [film_asks, groups_ask] =
        asks.map(|asks| format!("a film of 8000x8000 pixels asks for {asks} GiB"));
    let cases: [(&Folder, &str, &[&str], &str); 5] = [
        (
            &map,
            "1G",
            &[],
            "lie.hdr: not enough memory: a map of 16384×8192 texels asks for 6.0 GiB",
        ),
        (&shape, "300M", &[], "a shape asks for 4"),
        (&tree, "300M", &[], "the tree over 10"),
        (&scene("", ""), "1G", &film, &film_asks),
        (&scene("", ""), "1G", &groups, &groups_ask),
    ];
    for (folder, limit, options, who) in cases {
        let limit = format!("--max-memory={limit}");
        let run = folder.run(&[&RENDER[..], &[&*limit], options].concat());
        run.assert(1, &["not enough memory: ", who, "; allow more, or make it smaller"]);
        assert!(!folder.path().join("out.exr").exists());
    }
    let run = scene("", "").run(&[&RENDER[..], &["--max-memory=lots"]].concat());
    run.assert(2, &["expected a size such as 512M or 8G, found \"lots\""]);
}

/// Thousands of triangles in one place, in the middle of the picture.
#[test]
fn rays_that_are_given_up_are_counted_with_their_pixels() {
    let folder = scene("", "");
    let mut faces = QUAD_FACES.map(str::to_owned).to_vec();
    faces.resize(40_000, "3 4 5 6".to_owned());
    let faces: Vec<&str> = faces.iter().map(String::as_str).collect();
    let crowd = ["-0.1 -0.1 0.5", "0.1 -0.1 0.5", "0 0.1 0.5"];
    folder.write("quad.ply", ply(&[&QUAD_VERTICES[..], &crowd].concat(), &faces));
    let bounds = |crop: &[&str]| {
        let run = folder.run(&[&RENDER[..], &["--tracer", "device"], crop].concat());
        run.assert(0, &["rays were given up after too many steps of traversal"]);
        let bounds = run.messages.split("within --crop ").nth(1).unwrap();
        let bounds = bounds.split(' ').next().unwrap().split(',').map(|bound| bound.parse::<u32>());
        let [left, top, right, bottom] = bounds.collect::<Result<Vec<_>, _>>().unwrap()[..] else {
            panic!("expected four bounds in {}", run.messages)
        };
        // The crowd itself, and pixels of the quad whose shadow rays meet it.
        assert!((1..8).contains(&left) && (1..6).contains(&top), "{}", run.messages);
        assert!((9..=16).contains(&right) && (7..=12).contains(&bottom), "{}", run.messages);
        [left, top, right, bottom]
    };
    // Pixels count from the corner of the film.
    assert_eq!(bounds(&[]), bounds(&["--crop", "3,3,16,12"]));
    // A crowd in front of every pixel, and a filter that asks for none around the window.
    let crowd = ["-9 -9 0.5", "9 -9 0.5", "0 9 0.5"];
    folder.write("quad.ply", ply(&[&QUAD_VERTICES[..], &crowd].concat(), &faces));
    folder.write("scene.toml", SCENE.replace("height = 12", "height = 12\nfilter = \"box\""));
    for window in ["0,0,16,12", "3,4,11,9"] {
        let more =
            ["--tracer", "device", "--sampler", "mis", "--shadow-rays", "1", "--crop", window];
        let run = folder.run(&[&RENDER[..], &more].concat());
        run.assert(0, &[&format!("pixels within --crop {window} may be wrong")]);
    }
}

/// A gigabyte of zeros as the colour profile of a PNG image, under a limit of 700 MB: each thread takes some.
#[cfg(target_os = "linux")]
#[test]
fn a_colour_profile_that_inflates_takes_no_memory() {
    use std::io::Write;
    let folder = scene("reflectance = [0.5, 0.5, 0.5]", "reflectance = { texture = \"bomb.png\" }");
    let mut profile =
        flate2::write::ZlibEncoder::new(b"x\0\0".to_vec(), flate2::Compression::fast());
    (0..1024).for_each(|_| profile.write_all(&[0; 1 << 20]).unwrap());
    let chunk = png_chunk(b"iCCP", &profile.finish().unwrap());
    image::RgbImage::new(2, 2).save(folder.path().join("bomb.png")).unwrap();
    let mut bytes = fs::read(folder.path().join("bomb.png")).unwrap();
    // Behind the signature and the header
    bytes.splice(33..33, chunk);
    folder.write("bomb.png", bytes);
    let mut shell = Command::new("sh");
    let line = "ulimit -v 700000; exec \"$0\" info scene.toml";
    shell.args(["-c", line, env!("CARGO_BIN_EXE_fenestra")]).current_dir(folder.path());
    Run::of(&shell.output().unwrap()).assert(0, &[]);
}

/// Waves get smaller before anything is refused, which changes no bit.
#[test]
fn less_memory_makes_smaller_waves_and_the_same_picture() {
    let folder = scene("width = 16\nheight = 12", "width = 160\nheight = 120");
    let render = |limit: &str| {
        let options = [&RENDER[..], &[limit, "--sampler=visibility", "--stats=s.json"]].concat();
        folder.run(&options).assert(0, &[]);
        let stats: serde_json::Value = folder.json("s.json");
        let image = folder.image("out.exr");
        (stats["buffer_bytes"]["shadow rays"].as_u64().unwrap(), image.channels)
    };
    let (bytes, picture) = render("--max-memory=4G");
    let (fewer, same) = render("--max-memory=300M");
    // The limit is on the memory of the host.
    if support::is_software() {
        assert!(fewer < bytes, "{fewer} of {bytes} bytes");
    }
    assert!(same == picture);
}

#[test]
fn loading_that_takes_long_says_so_and_ends_at_an_interrupt() {
    use std::fmt::Write;
    let mut balls = String::from("shape = \"blobs\"\nblend = 0.5\ncells = 256\nballs = [\n");
    for index in 0..512 {
        writeln!(balls, "{{ at = [{}, 0, {}], radius = 1 }},", index % 23, index / 23).unwrap();
    }
    let folder = scene("mesh = \"quad.ply\"", &format!("{balls}]"));
    let running = Running::start(
        folder.path(),
        &RENDER,
        "loading scene.toml: 2 s, making object `quad` (blobs",
    );
    let start = Instant::now();
    running.interrupt().assert(130, &["error: interrupted before anything was rendered"]);
    assert!(start.elapsed() < Duration::from_secs(2), "took {:?}", start.elapsed());
    assert!(!folder.path().join("out.exr").exists());
}

#[test]
fn a_gltf_accessor_that_is_not_there_is_named() {
    let folder = scene("quad.ply", "quad.gltf");
    folder.write(
        "quad.gltf",
        r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 5126}}]}], "accessors": []}"#,
    );
    assert_refused(
        &folder,
        &["error: quad.gltf: ", "POSITION names accessor 5126, the file has 0"],
    );
}

#[test]
fn an_obj_with_many_normals_and_names_is_read_in_linear_time() {
    use std::fmt::Write;
    const NORMALS: usize = 200_000;
    const NAMES: usize = 60_000;
    let mut text = String::from("v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    for normal in 1..=NORMALS {
        writeln!(text, "vn 0 0 {normal}\nvt {normal} 0").unwrap();
    }
    // Every pair of normal and texture coordinates occurs twice, and shares its vertex.
    for normal in (1..=NORMALS).chain(1..=NORMALS) {
        if normal <= NAMES {
            writeln!(text, "usemtl material_of_number_{normal}").unwrap();
        }
        writeln!(text, "f 1/{normal}/{normal} 2//1 3//1").unwrap();
    }
    let folder = Folder::new();
    folder.write("many.obj", text);
    let start = Instant::now();
    let mesh = Mesh::read(&folder.path().join("many.obj"), &mut Vec::new()).unwrap();
    assert!(start.elapsed() < Duration::from_secs(10), "took {:?}", start.elapsed());
    assert_eq!((mesh.positions.len(), mesh.materials.len()), (NORMALS + 2, NAMES));
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        assert_eq!(mesh.normals[triangle[0] as usize][2], (index % NORMALS + 1) as f32);
    }
}

#[test]
fn a_conductor_that_reflects_nothing_is_never_negative() {
    for step in 1..=10_000_u16 {
        let cosine = f32::from(step) / 10_000.0;
        let found = fresnel_conductor(cosine, Vec3::ONE, Vec3::ZERO);
        assert!(found.min_element() >= 0.0, "{found} at cosine {cosine}");
    }
    let folder = scene(
        "type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]",
        "type = \"conductor\"\neta = [1, 1, 1]\nk = [0, 0, 0]\nalpha = 0.2",
    );
    for sampler in ["brdf", "mis", "product", "guided"] {
        folder.run(&[&RENDER[..], &["--sampler", sampler]].concat()).assert(0, &[]);
        let image = folder.image("out.exr");
        for name in ["R", "G", "B"] {
            let least = image.channels[name].iter().copied().fold(f32::INFINITY, f32::min);
            assert!(least >= 0.0, "{sampler}: {least} in {name}");
        }
    }
}
