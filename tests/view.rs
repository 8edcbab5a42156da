//! `fenestra view` in a real window: on a virtual X server, with keys sent and pictures read back.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fmt::Write, process::Command};

use bytemuck::Pod;
use fenestra::{
    film::Image,
    gpu::{Buffer, Commands, DescriptorSet, Pipeline},
    math::colour::srgb_to_linear,
    shader::{
        bindings::{Binding, BindingTable, FILM, VIEW, film, view},
        constants::{
            CURVE_CLIP, SHOW_ALBEDO, SHOW_CELLS, SHOW_ERROR, SHOW_LEVELS, SHOW_NORMAL,
            SHOW_PICTURE, SHOW_VISIBLE,
        },
        spirv,
        structs::{ShownFilm, WindowFrame},
    },
    view::keys,
};

use crate::support::{
    self,
    command::{self, BALL, Folder, words, yard},
    faulty_layer, page,
    x11::{Server, View},
};

const SIZE: [u32; 2] = [64, 48];
const CLAY: &str = "type = \"diffuse\"\nreflectance = [0.5, 0.6, 0.4]";

const SKY: &str = "sky = { width = 32, sun_radius_deg = 20.0, sun_radiance = [4, 3, 2] }";
/// Walls around the yard and a roof; the wall to the left is low.
const WALLS: [([f32; 3], [f32; 3]); 5] = [
    ([8.0, 0.2, 8.0], [0.0, 3.0, 0.0]),
    ([0.2, 3.0, 8.0], [4.0, 1.5, 0.0]),
    ([0.2, 1.5, 8.0], [-4.0, 0.75, 0.0]),
    ([8.0, 3.0, 0.2], [0.0, 1.5, -4.0]),
    ([8.0, 3.0, 0.2], [0.0, 1.5, 4.0]),
];

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("yard.toml", yard(SIZE, SKY, CLAY, BALL));
    let mut room = String::new();
    for (size, place) in WALLS {
        let wall = format!("shape = \"box\"\nsize = {size:?}\ntranslate = {place:?}");
        let _ = write!(room, "{wall}\nmaterial = \"clay\"\n[[object]]\n");
    }
    folder.write("room.toml", yard(SIZE, SKY, CLAY, &(room + BALL)));
    folder
}

/// Renders and converts to display values; `more` are options of `convert`.
fn rendered(folder: &Folder, scene: &str, spp: &str, more: &[&str]) -> Vec<[u8; 3]> {
    let render = ["render", scene, "--sampler", "mis", "--depth", "2", "--spp", spp, "-o", "r.exr"];
    folder.run(&render).assert(0, &[]);
    folder.run(&[&["convert", "r.exr", "r.png"], more].concat()).assert(0, &[]);
    image::open(folder.path().join("r.png")).unwrap().into_rgb8().pixels().map(|p| p.0).collect()
}

/// Largest difference of two pictures, levels.
fn difference(one: &[[u8; 3]], other: &[[u8; 3]]) -> u8 {
    assert_eq!(one.len(), other.len());
    let pairs = one.as_flattened().iter().zip(other.as_flattened());
    pairs.map(|(one, other)| one.abs_diff(*other)).max().unwrap()
}

fn film(folder: &Folder, name: &str) -> Vec<[f32; 3]> {
    let path = folder.path().join(name);
    Image::read_exr(&path).unwrap().rgb(&path).unwrap().pixels
}

#[test]
fn the_window_shows_what_render_writes() {
    let folder = folder();
    let server = Server::start();
    let options = ["--sampler", "mis", "--depth", "2", "--spp", "8", "--validate"];
    let mut view = View::open(&server, &folder, "yard.toml", &options, SIZE);
    view.wait_at_rest("mis 8 spp");
    let expected = rendered(&folder, "yard.toml", "8", &[]);
    assert!(difference(&view.picture(SIZE), &expected) <= 1, "the picture at rest");

    // Exposure and curve act on the picture that is there.
    view.tap("=");
    view.wait_for("+0.5 stops");
    view.tap("c");
    let expected =
        rendered(&folder, "yard.toml", "8", &["--exposure", "0.5", "--curve", "reinhard"]);
    view.wait_until(|view| difference(&view.picture(SIZE), &expected) <= 1);
    view.tap("c");
    let filmic = rendered(&folder, "yard.toml", "8", &["--exposure", "0.5", "--curve", "filmic"]);
    view.wait_until(|view| difference(&view.picture(SIZE), &filmic) <= 1);
    view.tap("p");
    view.wait_for_file("yard.view-1.toml");
    assert!(film(&folder, "yard.view-1.exr") == film(&folder, "r.exr"), "the same bits");
    let written = image::open(folder.path().join("yard.view-1.png")).unwrap().into_rgb8();
    let written: Vec<[u8; 3]> = written.pixels().map(|pixel| pixel.0).collect();
    assert!(written == view.picture(SIZE), "the file shows what the window shows");

    // The camera flies to the right; the picture is that of `render` with the camera that was written.
    view.press("d");
    view.wait_for("moving");
    std::thread::sleep(std::time::Duration::from_millis(1000));
    view.release("d");
    view.wait_at_rest("mis 8 spp");
    view.tap("p");
    view.wait_for_file("yard.view-2.toml");
    let camera = std::fs::read_to_string(folder.path().join("yard.view-2.toml")).unwrap();
    let scene = std::fs::read_to_string(folder.path().join("yard.toml")).unwrap();
    let (_, rest) = scene.split_once("[film]").unwrap();
    folder.write("moved.toml", format!("{camera}\n[film]{rest}"));
    rendered(&folder, "moved.toml", "64", &[]);
    let (shown, expected) = (film(&folder, "yard.view-2.exr"), film(&folder, "r.exr"));
    let error = relative_error(&shown, &expected);
    let moved = relative_error(&film(&folder, "yard.view-1.exr"), &expected);
    assert!(error < 0.1 && moved > 1.5 * error, "{error} after the motion, {moved} before");

    // The window grows: the film keeps its shape in the middle.
    view.resize([160, 96]);
    view.wait_until(|view| {
        let picture = view.picture([160, 96]);
        let grey = [33; 3];
        picture[0] == grey && picture[16] != grey && picture[143] != grey && picture[144] == grey
    });
    // One vertex is the least.
    view.tap("[");
    view.tap("[");
    view.wait_for("depth 1");
    view.tap("Escape");
    let run = view.end();
    run.assert(0, &["wrote yard.view-1.png, yard.view-1.exr, yard.view-1.toml"]);
}

/// Such films have fewer pixels than the window on devices that take long for a whole one.
#[test]
fn a_film_of_a_moving_camera_shows_no_blocks() {
    const SIZE: [u32; 2] = [256, 192];
    if !support::is_software() {
        return;
    }
    let folder = folder();
    let server = Server::start();
    let options = ["--size", "256x192", "--sampler", "mis", "--shadow-rays", "256"];
    let mut view = View::open(&server, &folder, "room.toml", &options, SIZE);
    view.press("d");
    view.wait_for("moving");
    // The room is still in view.
    std::thread::sleep(std::time::Duration::from_millis(300));
    let picture = view.picture(SIZE);
    view.release("d");
    // From left to right, blocks of 8×8 pixels change at every eighth column alone.
    let mut changes = [0_u32; 8];
    for row in picture.chunks_exact(SIZE[0] as usize) {
        for (column, pair) in row.windows(2).enumerate() {
            changes[column % 8] += u32::from(pair[0][1].abs_diff(pair[1][1]));
        }
    }
    let (all, most) = (changes.iter().sum::<u32>(), *changes.iter().max().unwrap());
    assert!(2 * most < all, "{most} of {all} levels of change lie at every eighth column");
    view.tap("Escape");
    view.end().assert(0, &[]);
}

/// Mean absolute difference over the mean.
fn relative_error(one: &[[f32; 3]], other: &[[f32; 3]]) -> f32 {
    let pairs = one.as_flattened().iter().zip(other.as_flattened());
    let difference: f32 = pairs.map(|(one, other)| (one - other).abs()).sum();
    difference / other.as_flattened().iter().sum::<f32>()
}

#[test]
fn mis_shows_the_scene_before_guided_learns() {
    let folder = folder();
    let server = Server::start();
    let options = ["--depth", "2", "--spp", "4"];
    let told = |command: &mut Command| {
        command.env("RUST_LOG", "fenestra=debug");
    };
    let mut view = View::open_with(&server, &folder, "room.toml", &options, SIZE, told);
    view.wait_at_rest("guided 4 spp");
    view.tap("Escape");
    let messages = view.end().messages;
    let place = |text| messages.find(text).unwrap_or_else(|| panic!("{text}: {messages}"));
    assert!(place("moving: ") < place("by measurement in"), "{messages}");
}

#[test]
fn samplers_layers_and_insets_can_be_looked_at() {
    let folder = folder();
    let server = Server::start();
    let options = ["--depth", "2", "--spp", "4", "--validate", "--set", "candidates=1"];
    let mut view = View::open(&server, &folder, "room.toml", &options, SIZE);
    view.wait_at_rest("guided 4 spp");
    // The display may show the picture a little after the title.
    std::thread::sleep(std::time::Duration::from_millis(300));
    let picture = view.picture(SIZE);
    for (key, title) in [("h", "relative error"), ("g", "cells"), ("l", "kinds of cells")] {
        let before = view.picture(SIZE);
        view.tap(key);
        view.wait_for(title);
        view.wait_until(|view| view.picture(SIZE) != before);
    }
    view.tap("l");
    view.wait_until(|view| view.picture(SIZE) == picture);
    view.tap("x");
    view.wait_at_rest("guided 4 spp");
    view.wait_at_rest("mis 4 spp");
    let line = SIZE[0] as usize / 2;
    view.wait_until(|view| view.picture(SIZE)[line] == [255; 3]);
    view.tap("z");
    view.tap("4");
    view.wait_at_rest("env 4 spp");
    view.tap("]");
    view.wait_for("depth 3");
    view.wait_at_rest("env 4 spp");
    // The inset lies in the corner, once the window has room for it.
    view.resize([640, 480]);
    let corner = 479 * 640 + 639;
    view.wait_until(|view| view.picture([640, 480]).get(corner).is_some());
    // The line lies in the middle of the films, beside the panel of 250 columns.
    view.wait_until(|view| view.picture([640, 480])[240 * 640 + 250 + 195] == [255; 3]);
    let before = view.picture([640, 480]);
    view.point([320, 380]);
    view.tap("i");
    let line = (480 - 130) * 640 + 500;
    view.wait_until(|view| view.picture([640, 480])[line..line + 9] != before[line..line + 9]);
    // Without the other side, keys choose the sampler of the only one.
    view.tap("x");
    view.tap("4");
    view.wait_until(|view| view.title().starts_with("room | env"));
    view.tap("Escape");
    view.end().assert(0, &[]);
}

/// Size of a window with a panel, and the colours of this and of what lies around the film.
const WIDE: [u32; 2] = [660, 480];
const PANEL: [u8; 3] = [27; 3];
const AROUND: [u8; 3] = [33; 3];

/// Writes the camera until it is as wanted, and returns the table.
#[track_caller]
fn bookmark(view: &mut View<'_>, folder: &Folder, is_wanted: impl Fn(&str) -> bool) -> String {
    for number in 1..99 {
        let name = format!("yard.view-{number}.toml");
        if folder.path().join(&name).exists() {
            continue;
        }
        view.write_by("b", &name);
        // The file appears whole, under its name.
        let text = std::fs::read_to_string(folder.path().join(&name)).unwrap();
        if is_wanted(&text) {
            return text;
        }
    }
    panic!("no camera is as wanted")
}

#[test]
fn controls_change_what_they_say() {
    let folder = folder();
    let server = Server::start();
    let options = words("--sampler=mis --depth=2 --spp=8 --validate --exposure=0.25");
    let mut view = View::open(&server, &folder, "yard.toml", &options, SIZE);
    view.wait_at_rest("mis 8 spp");
    // The display may show the picture a little after the title.
    let moment = std::time::Duration::from_millis(300);
    std::thread::sleep(moment);
    let colour = view.picture(SIZE)[24 * 64 + 32];
    view.resize(WIDE);
    let at = |view: &View<'_>, [x, y]: [usize; 2]| view.picture(WIDE).get(660 * y + x).copied();
    // Columns right of the panel, where the film is.
    let film = |view: &View<'_>| {
        let picture = view.picture(WIDE);
        picture.chunks_exact(660).flat_map(|row| row[250..].to_vec()).collect::<Vec<_>>()
    };
    view.wait_until(|view| at(view, [100, 470]) == Some(PANEL));
    view.wait_until(|view| at(view, [455, 20]) == Some(AROUND));
    // The panel leaves the exposure as it is, on the same pixel of the film.
    std::thread::sleep(moment);
    assert_eq!(at(&view, [458, 242]), Some(colour));

    let before = film(&view);
    view.click([98, 63]);
    view.wait_until(|view| !view.title().contains("+0.2 stops") && film(view) != before);
    // Exposure by the picture does not add to the one before.
    let stops = |view: &View<'_>| {
        let title = view.title();
        title.split(' ').nth_back(1).unwrap().parse::<f32>().unwrap()
    };
    let set = stops(&view);
    view.tap("0");
    view.wait_until(|view| stops(view) != set);
    let expected = format!("{:+.1} stops", stops(&view) + 0.5);
    view.tap("0");
    view.tap("=");
    view.wait_for(&expected);
    view.click([84, 83]);
    let below = |view: &View<'_>| view.picture(WIDE)[660 * 35..660 * 60].to_vec();
    let closed = below(&view);
    view.click([57, 15]);
    view.wait_until(|view| below(view) != closed);
    view.click([57, 42]);
    view.wait_until(|view| !view.title().contains("mis") && view.title().contains(" 8 spp"));
    let noisy = film(&view);
    view.click([200, 103]);
    view.wait_until(|view| film(view) != noisy);

    let first = bookmark(&mut view, &folder, |_| true);
    // The file has the columns beside the panel.
    view.tap("p");
    view.wait_for_file("yard.view-2.toml");
    let written = image::open(folder.path().join("yard.view-2.png")).unwrap();
    assert_eq!((written.width(), written.height()), (WIDE[0] - 250, WIDE[1]));
    view.click([110, 151]);
    bookmark(&mut view, &folder, |camera| camera != first);
    view.click([60, 171]);
    let number = |camera: &str, key: &str| {
        camera.parse::<toml::Table>().unwrap()["camera"].get(key)?.as_float()
    };
    // The control says millimetres, up to 200.
    let has_lens =
        |camera: &str| number(camera, "aperture_radius").is_some_and(|radius| radius <= 0.2);
    bookmark(&mut view, &folder, has_lens);
    view.wait_at_rest(" 8 spp");
    let sharp = film(&view);
    view.click([60, 191]);
    view.wait_until(|view| film(view) != sharp);
    view.wait_at_rest(" 8 spp");
    let blurred = bookmark(&mut view, &folder, |camera| camera.contains("focus_distance"));
    view.click([455, 300]);
    let distance = |camera: &str| number(camera, "focus_distance");
    let is_focused = |camera: &str| distance(camera) != distance(&blurred);
    let focused = bookmark(&mut view, &folder, is_focused);
    assert!((0.5..9.0).contains(&distance(&focused).unwrap()), "{focused}");

    // A drag over the panel moves no camera, and a view that was written is returned to.
    view.drag(1, [100, 460], [200, 440]);
    assert_eq!(bookmark(&mut view, &folder, |_| true), focused);
    view.click([188, 219]);
    bookmark(&mut view, &folder, |camera| camera == first);
    view.wait_at_rest(" 8 spp");

    let vector = |camera: &str, key: &str| {
        let table = camera.parse::<toml::Table>().unwrap();
        glam::Vec3::from(
            [0, 1, 2].map(|axis| table["camera"][key][axis].as_float().unwrap() as f32),
        )
    };
    let way = |camera: &str| vector(camera, "look_at") - vector(camera, "position");
    // Closer by the wheel, up by the right button, and to the left where the middle one drags to the right.
    // The controls have to see first that the pointer has left them.
    view.point([455, 300]);
    std::thread::sleep(moment);
    view.drag(4, [455, 300], [455, 300]);
    let far = way(&first).length();
    bookmark(&mut view, &folder, |camera| way(camera).length() < 0.9 * far);
    let rise =
        |camera: &str| way(camera).y.atan2(-way(camera).z) - way(&first).y.atan2(-way(&first).z);
    view.drag(3, [455, 300], [455, 280]);
    bookmark(&mut view, &folder, |camera| (rise(camera) - 3.0 * 20.0 / 480.0).abs() < 1e-3);
    view.drag(2, [455, 300], [475, 300]);
    bookmark(&mut view, &folder, |camera| vector(camera, "position").x < -0.05);

    let ask = |view: &View<'_>| {
        view.press("Shift");
        view.tap("/");
        view.release("Shift");
    };
    ask(&view);
    view.wait_until(|view| at(view, [500, 440]) == Some(PANEL));
    ask(&view);
    view.wait_until(|view| at(view, [500, 440]) == Some(AROUND));
    view.tap("Tab");
    view.wait_until(|view| at(view, [100, 470]) != Some(PANEL));
    view.tap("Escape");
    view.end().assert(0, &[]);
}

/// Makes a descriptor set of buffers that hold these bytes.
fn set_of(table: &'static BindingTable, content: &[(Binding, &[u8])]) -> DescriptorSet {
    let buffer = |(binding, bytes): &(Binding, &[u8])| {
        (*binding, Buffer::from_slice(support::device(), binding.name, bytes).unwrap())
    };
    let buffers: Vec<_> = content.iter().map(buffer).collect();
    DescriptorSet::new(support::device(), table, &buffers).unwrap()
}

/// Runs a pass of the window.
fn project(shader: &str, sets: &[&DescriptorSet], constants: &impl Pod, invocations: u32) {
    let pipeline = Pipeline::new(support::device(), shader, spirv::pass(shader), &[]).unwrap();
    let mut commands = Commands::begin(support::device()).unwrap();
    commands.dispatch(&pipeline, sets, bytemuck::bytes_of(constants), invocations).unwrap();
    commands.submit_and_wait().unwrap();
    support::assert_silent();
}

/// Five samples of a page of two pixels that begins at the second one of the film. The errors of both are
/// 10%, in the middle of the colours: 0.3 of a mean of 3, and 0.5 of 3 where a tenth of the film's is 4.
#[test]
fn layers_are_shown_as_means() {
    let _alone = support::alone();
    let squares = [0.3_f32, 0.5].map(|error| [45.0 + 20.0 * error * error; 3]);
    let colours = |first: f32| [[first, 5.0, 0.0], [first + 1.0, 0.0, 2.5]];
    let film = set_of(
        &FILM,
        &[
            (film::FILM_SUM, bytemuck::bytes_of(&[[14.0_f32; 3]; 2])),
            (film::FILM_COMPENSATION, bytemuck::bytes_of(&[[1.0_f32; 3]; 2])),
            (film::FILM_SQUARES, bytemuck::bytes_of(&squares)),
            (film::FILM_ALBEDO, bytemuck::bytes_of(&colours(0.5))),
            (film::FILM_NORMAL, bytemuck::bytes_of(&colours(-5.0))),
            (film::FILM_VISIBLE, bytemuck::bytes_of(&[[3_u32, 4], [0, 0]])),
            (film::FILM_GUIDE_CELL, bytemuck::bytes_of(&colours(1.5))),
            (film::FILM_GUIDE_LEVEL, bytemuck::bytes_of(&colours(2.5))),
        ],
    );
    let shown = |layer, sample_count, mean_radiance| -> [[f32; 3]; 2] {
        let shown = set_of(&VIEW, &[(view::SHOWN, bytemuck::bytes_of(&[[-1.0_f32; 3]; 4]))]);
        let constants = ShownFilm {
            first_pixel: 1,
            first_place: 0,
            end_place: 2,
            sample_count,
            layer,
            mean_radiance,
        };
        project("show", &[&film, &shown], &constants, 3);
        let [before, first, second, after] =
            shown.buffer(view::SHOWN).download(4).unwrap().try_into().unwrap();
        assert_eq!([before, after], [[-1.0; 3]; 2], "pixels of other pages");
        [first, second]
    };
    let close = |name: &str, found: [f32; 3], expected: [f32; 3]| {
        let is_close = found.iter().zip(expected).all(|(one, other)| (one - other).abs() < 1e-4);
        assert!(is_close, "{name}: {found:?}, not {expected:?}");
    };
    for (name, layer, expected) in [
        ("picture", SHOW_PICTURE, [[3.0; 3]; 2]),
        ("albedo", SHOW_ALBEDO, [[0.1, 1.0, 0.0], [0.3, 0.0, 0.5]]),
        ("normal", SHOW_NORMAL, [[0.0, 1.0, 0.5], [0.1, 0.5, 0.75]]),
        ("visible", SHOW_VISIBLE, [[0.75; 3], [0.0; 3]]),
        ("cells", SHOW_CELLS, [[0.3, 1.0, 0.0], [0.5, 0.0, 0.5]]),
        ("levels", SHOW_LEVELS, [[0.5, 1.0, 0.0], [0.7, 0.0, 0.5]]),
    ] {
        let found = shown(layer, 5, 0.0);
        (0..2).for_each(|pixel| close(name, found[pixel], expected[pixel]));
    }
    // Values of the map "turbo".
    let (middle, last) = ([0.31151, 0.96054, 0.07775], [0.28573, 0.00140, 0.0]);
    close("10%", shown(SHOW_ERROR, 5, 0.0)[0], middle);
    close("10% of what the film has", shown(SHOW_ERROR, 5, 40.0)[1], middle);
    close("one sample", shown(SHOW_ERROR, 1, 0.0)[0], last);
}

/// Films side by side, each at its size, between what lies around them, an inset and the controls; then a
/// film of two pixels that stands in for a larger one.
#[test]
fn films_inset_and_controls_have_their_places() {
    let _alone = support::alone();
    // Levels of linear values.
    let grey = |level: u8| [srgb_to_linear(f32::from(level) / 255.0); 3];
    let left = [10, 20, 30, 40].map(grey);
    let right = [50, 60, 70, 80, 90, 100, 110, 120].map(grey);
    let inset = [0xff03_0201_u32, 0xff06_0504];
    // Opaque, and half of what lies below.
    let overlay = [0xff09_0807_u32, 0x8000_0000];
    let composed = |frame: WindowFrame| -> Vec<[u8; 4]> {
        let pixels = vec![0_u8; 4 * (frame.width * frame.height) as usize];
        let set = set_of(
            &VIEW,
            &[
                (view::SHOWN, bytemuck::bytes_of(&left)),
                (view::SHOWN_RIGHT, bytemuck::bytes_of(&right)),
                (view::INSET, bytemuck::bytes_of(&inset)),
                (view::OVERLAY, bytemuck::bytes_of(&overlay)),
                (view::WINDOW_PIXELS, &pixels),
            ],
        );
        project("compose", &[&set], &frame, frame.width * frame.height);
        set.buffer(view::WINDOW_PIXELS).download(pixels.len() / 4).unwrap()
    };
    // Bytes are alpha last, and grey but for the inset and the controls.
    let greys = |pixels: &[[u8; 4]]| pixels.iter().map(|pixel| pixel[1]).collect::<Vec<_>>();
    let check = |found: &[u8], expected: &[u8]| {
        let is_close = found.iter().zip(expected).all(|(one, other)| one.abs_diff(*other) <= 1);
        assert!(is_close && found.len() == expected.len(), "{found:?}, not {expected:?}");
    };
    let frame = WindowFrame {
        width: 6,
        height: 4,
        left: 1,
        top: 1,
        shown_width: 4,
        shown_height: 2,
        film_width: 2,
        film_height: 2,
        right_width: 4,
        right_height: 2,
        is_reduced: 0,
        split: 2,
        first_index: 0,
        exposure: 1.0,
        curve: CURVE_CLIP,
        is_bgra: 0,
        inset_width: 2,
        inset_height: 1,
        overlay_width: 2,
        overlay_height: 1,
    };
    let pixels = composed(frame);
    #[rustfmt::skip]
    let expected = [
        8, 17, 33, 33, 33, 33,
        33, 10, 255, 70, 80, 33,
        33, 30, 255, 2, 5, 33,
        33, 33, 33, 33, 33, 33,
    ];
    check(&greys(&pixels), &expected);
    assert_eq!(
        [pixels[0], pixels[15], pixels[16]],
        [[7, 8, 9, 255], [1, 2, 3, 255], [4, 5, 6, 255]]
    );
    let blue_first = composed(WindowFrame { is_bgra: 1, ..frame });
    assert_eq!([blue_first[0], blue_first[15]], [[9, 8, 7, 255], [3, 2, 1, 255]]);
    // The films need not be of one height, and each has the rows of its own.
    for is_reduced in [0, 1] {
        let own = WindowFrame { is_reduced, film_height: 1, inset_height: 0, ..frame };
        let found = greys(&composed(own));
        check(&[&found[7..11], &found[13..17]].concat(), &[10, 255, 70, 80, 10, 255, 110, 120]);
    }
    // Display values between 10 and 20, from the middle of one pixel to that of the next.
    let found = composed(WindowFrame {
        width: 8,
        height: 1,
        left: 0,
        top: 0,
        shown_width: 8,
        shown_height: 1,
        film_height: 1,
        is_reduced: 1,
        split: 8,
        inset_width: 0,
        overlay_width: 0,
        ..frame
    });
    check(&greys(&found), &[10, 10, 11, 14, 16, 19, 20, 20]);
}

#[test]
fn a_display_that_is_missing_or_goes_away_is_an_error() {
    let folder = folder();
    let run = |display: Option<&str>| {
        let mut program = command::program(folder.path());
        program.args(["view", "yard.toml"]).env_remove("WAYLAND_DISPLAY").env_remove("DISPLAY");
        if let Some(display) = display {
            program.env("DISPLAY", display);
        }
        command::Run::of(&program.output().unwrap())
    };
    let parts = ["no window can be opened", "help: a window needs DISPLAY"];
    run(None).assert(75, &parts);
    run(Some(":4711")).assert(75, &parts);
    let server = Server::start();
    let mut view = View::open(&server, &folder, "yard.toml", &["--sampler", "mis"], SIZE);
    view.wait_for("mis ");
    drop(server);
    let run = view.end();
    assert!(run.status.is_some_and(|status| status != 0), "{:?} {}", run.status, run.messages);
    assert!(!run.messages.contains("panicked"), "{}", run.messages);
}

#[test]
fn a_surface_that_is_lost_is_made_again() {
    let folder = folder();
    let server = Server::start();
    let options = ["--sampler", "mis", "--depth", "2", "--spp", "8"];
    let expected = rendered(&folder, "yard.toml", "8", &[]);
    for present in [1, 3] {
        let lose = |command: &mut Command| {
            faulty_layer::insert(command, &[("FAULTY_PRESENT", present)]);
        };
        let mut view = View::open_with(&server, &folder, "yard.toml", &options, SIZE, lose);
        view.wait_at_rest("mis 8 spp");
        view.wait_until(|view| difference(&view.picture(SIZE), &expected) <= 1);
        view.tap("Escape");
        view.end().assert(0, &["the layer loses the surface"]);
    }
}

#[test]
fn the_page_lists_the_keys() {
    let mut table = String::from("| key | effect |\n|---|---|\n");
    for (keys, about) in keys::rows() {
        let keys = keys.split(' ').map(|key| format!("`{key}`")).collect::<Vec<_>>().join(" ");
        let _ = writeln!(table, "| {keys} | {about} |");
    }
    page::check("view.md", "keys", &table);
}
