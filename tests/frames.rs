//! `render --frames`: names, cameras, guides that are carried, frames that are skipped.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::fs;

use fenestra::film::{Attribute as FileAttribute, Image, Metadata, Statistics};

use crate::support::{
    command::{self, Folder},
    gltf::{self, Attribute},
};

/// A ball under a roof, before a camera that moves for a quarter of a second.
fn folder() -> Folder {
    let folder = Folder::new();
    let keys = "[[camera.keyframe]]\ntime = 0\n[[camera.keyframe]]\ntime = 0.25\n\
                position = [1.0, 0.8, 2.5]\n";
    let scene =
        command::yard([24, 16], command::SKY, command::CLAY, &command::roofed_ball()) + keys;
    folder.write("scene.toml", scene);
    folder
}

#[test]
fn frames_follow_the_camera_and_have_numbers_of_their_own() {
    let folder = folder();
    let options = ["render", "scene.toml", "--fps=8", "--spp=2", "--sampler=mis", "--depth=1"];
    let render = |rest: &[&str]| folder.run(&[&options, rest].concat());
    render(&["--frames=0-2", "-o", "all.##.exr"]).assert(0, &["frame 2 at 0.250 s: all.02.exr"]);
    let frames = ["all.00.exr", "all.01.exr", "all.02.exr"].map(|name| folder.image(name));
    assert_eq!(frames[1].attributes["fenestra.time"], FileAttribute::Double(0.125));
    assert!(frames[0].channels != frames[1].channels && frames[1].channels != frames[2].channels);
    // A frame alone is the one of the sequence, as its metadata say.
    render(&["--frames=2", "-o", "alone.#.exr"]).assert(0, &[]);
    let alone = folder.image("alone.2.exr");
    assert_eq!(alone.channels, frames[2].channels);
    let of = |image: &Image| {
        let Metadata { scene_hash, sample_ranges, .. } =
            Metadata::load(image, "a".as_ref()).unwrap();
        (scene_hash, sample_ranges)
    };
    assert_eq!(of(&alone), of(&frames[2]));
    // Parts of two seeds of one frame merge, those of two frames do not.
    render(&["--frames=2", "--seed=1", "-o", "other.#.exr"]).assert(0, &[]);
    folder.run(&["merge", "alone.2.exr", "other.2.exr", "-o", "both.exr"]).assert(0, &[]);
    folder.run(&["merge", "all.01.exr", "other.2.exr", "-o", "no.exr"]).assert(1, &["scene hash"]);
    for (option, name) in
        [("--output", "one.exr"), ("--stats", "s.json"), ("--save-guide", "g.guide")]
    {
        let named = format!("{option} {name}: every frame would have this name");
        let options = ["render", "scene.toml", "--frames=0-2", option, name];
        folder.run(&options).assert(2, &[&named]);
    }
}

#[test]
fn a_guide_is_carried_and_finished_frames_are_skipped() {
    let folder = folder();
    let options = ["render", "scene.toml", "--fps=8", "--set=candidates=1"];
    let render = |rest: &[&str]| folder.run(&[&options, rest].concat());
    let frames =
        ["--spp=2", "--frames=0-2", "-o", "f.#.exr", "--stats", "f.#.json", "--skip-existing"];
    folder.write("f.1.exr", "an image that someone has rendered");
    render(&frames).assert(0, &["f.1.exr is there: skipped"]);
    let rays = |frame: u32| folder.json::<Statistics>(&format!("f.{frame}.json")).rays["camera"];
    let picture = 2 * 24 * 16;
    assert!(rays(0) > picture, "the first frame trains");
    assert_eq!(rays(2), picture, "the camera alone moves");
    // A checkpoint says that the image is not finished.
    render(&["--frames=1", "--spp=1", "--checkpoint-interval=1h", "-o", "f.#.exr"]).assert(0, &[]);
    render(&frames).assert(0, &["f.0.exr is there", "frame 1 at", "f.2.exr is there"]);
    render(&["--spp=2", "--frames=1", "-o", "whole.#.exr", "--save-guide", "g.#.guide"])
        .assert(0, &[]);
    assert_eq!(folder.image("f.1.exr").channels, folder.image("whole.1.exr").channels);
    // Every frame may go on from a guide of its own.
    let own = ["--spp=1", "--frames=1", "-o", "own.#.exr", "--stats", "own.#.json"];
    render(&[&own[..], &["--load-guide", "g.#.guide"]].concat()).assert(0, &[]);
    assert_eq!(folder.json::<Statistics>("own.1.json").rays["camera"], 24 * 16, "no training");
}

/// Where more than the camera moves, no frame is rendered with what is on the device for the one before.
#[test]
fn a_scene_that_moves_is_loaded_for_every_frame() {
    let folder = folder();
    let attributes = [
        Attribute::floats("POSITION", "VEC3", &[-0.5, 0., 1., 0.5, 0., 1., 0., 1., 1.]),
        Attribute::floats("_TIMES", "SCALAR", &[0., 0.1, 0.25]),
        Attribute::floats("_SHIFTS", "VEC3", &[0., 0., 0., 0., 0.2, 0., 0., 0.5, 0.]),
    ];
    let ride = r#", "animations": [{"channels": [{"sampler": 0, "target": {"node": 0, "path":
        "translation"}}], "samplers": [{"input": 1, "output": 2}]}]"#;
    folder.write("ride.gltf", gltf::gltf_of(&attributes, 3, "", ride));
    let scene = fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    folder.write("scene.toml", scene + "[[include]]\nfile = \"ride.gltf\"\n");
    let options = ["render", "scene.toml", "--fps=8", "--spp=1", "--sampler=mis", "--depth=1"];
    let render = |rest: &[&str]| folder.run(&[&options, rest].concat()).assert(0, &[]);
    render(&["--frames=0-2x2", "-o", "both.#.exr"]);
    render(&["--frames=2", "-o", "alone.#.exr"]);
    let [both, alone] = ["both.2.exr", "alone.2.exr"].map(|name| folder.image(name).channels);
    assert_eq!(both, alone);
}
