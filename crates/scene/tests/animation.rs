//! Animations: key frames of the camera, and nodes of glTF files.
#![expect(clippy::unwrap_used, reason = "tests may panic")]

use fenestra_scene::{Error, Scene, load::LoadOptions, still_hash};
use glam::Vec3;

use crate::support::gltf::{Attribute, gltf_of};

fn at(name: &str, text: &str, time: Option<f32>) -> Result<Scene, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    Scene::load_with(&path, &LoadOptions { time, ..LoadOptions::default() })
}

const ROOM: &str = r#"
camera = { position = [0, 1, 5], look_at = [0, 1, 0], vertical_fov_deg = 40, keyframe = [
  { time = 1, position = [2, 1, 5] },
  { time = 3, position = [6, 1, 5], look_at = [6, 1, 1], focus_distance = 2 },
] }
environment = { constant = [1, 1, 1] }
"#;

#[test]
fn the_camera_follows_its_key_frames() {
    let camera = |time| at("room.toml", ROOM, time).unwrap().camera;
    assert_eq!(camera(None).position, Vec3::new(0.0, 1.0, 5.0), "without a time");
    assert_eq!(camera(Some(0.0)).position, Vec3::new(2.0, 1.0, 5.0), "before the first");
    let halfway = camera(Some(2.0));
    assert_eq!(halfway.position, Vec3::new(4.0, 1.0, 5.0));
    assert_eq!(halfway.look_at, Vec3::new(3.0, 1.0, 0.5));
    // The first key focuses where it looks: 29^½ away.
    assert!((halfway.focus_distance - 0.5 * (2.0 + 29_f32.sqrt())).abs() < 1e-5);
    assert_eq!(camera(Some(9.0)).position.x, 6.0, "after the last");
    let focused = ROOM.replace("_deg = 40,", "_deg = 40, focus_distance = 3, shift = [0.2, -0.1],");
    let first = at("room.toml", &focused, Some(1.0)).unwrap().camera;
    assert_eq!((first.focus_distance, first.shift), (3.0, [0.2, -0.1]), "that of the camera");

    let keys = "position = [2, 1, 5], up = [1, 1, 0], vertical_fov_deg = 50 }";
    let leaning = ROOM.replace("position = [2, 1, 5] }", keys);
    let first = at("room.toml", &leaning, Some(1.0)).unwrap().camera;
    assert_eq!((first.up, first.vertical_fov_deg), (Vec3::new(1.0, 1.0, 0.0), 50.0));

    let widening = ROOM.replace("focus_distance = 2", "focus_distance = 2, aperture_radius = 0.5");
    assert_eq!(at("room.toml", &widening, Some(2.0)).unwrap().camera.aperture_radius, 0.25);

    let [one, other] = [1.0, 2.0].map(|time| at("room.toml", ROOM, Some(time)).unwrap());
    assert_ne!(one.hash, other.hash);
    assert_eq!(still_hash(&one), still_hash(&other), "the camera alone moves");

    for (from, to, message) in [
        ("time = 3", "time = 1", "camera.keyframe: expected times that ascend, found [1.0, 1.0]"),
        (
            "look_at = [6, 1, 1]",
            "look_at = [6, 1, 5]",
            "camera.keyframe at 3 s: camera.position and",
        ),
        ("focus_distance", "focus", "unknown field `focus`"),
    ] {
        let error = at("room.toml", &ROOM.replace(from, to), None).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
}

#[test]
fn the_camera_passes_its_keys_and_does_not_overshoot() {
    const TIMES: [f32; 4] = [0.0, 1.0, 1.5, 3.0];
    let curve = |values: [f32; 4], time: f32| {
        let key = |(time, x): (f32, f32)| format!("{{ time = {time}, position = [{x}, 1, 5] }},\n");
        let keys: String = TIMES.into_iter().zip(values).map(key).collect();
        let head = "camera = { position = [0, 1, 5], look_at = [0, 1, 0], vertical_fov_deg = 40";
        let text =
            format!("{head}, keyframe = [\n{keys}] }}\nenvironment = {{ constant = [1, 1, 1] }}");
        at("room.toml", &text, Some(time)).unwrap().camera.position.x
    };
    let values = [1.0, 4.0, 4.0, -2.0];
    for (time, value) in TIMES.into_iter().zip(values) {
        assert_eq!(curve(values, time), value);
    }
    assert_eq!([curve(values, -1.0), curve(values, 1.2), curve(values, 9.0)], [1.0, 4.0, -2.0]);
    for step in 0..300 {
        let found = curve(values, 0.01 * step as f32);
        assert!((-2.0..=4.0).contains(&found), "{found}");
    }
    // A straight line stays one, and the slope is the same on both sides of a key.
    assert!((curve([0.0, 2.0, 3.0, 6.0], 2.2) - 4.4).abs() < 1e-5);
    let rising = [0.0, 1.0, 5.0, 6.0];
    let slope = |from: f32| (curve(rising, from + 1e-3) - curve(rising, from)) / 1e-3;
    assert!((slope(1.0) - slope(1.0 - 1e-3)).abs() < 0.05, "{} {}", slope(1.0), slope(0.999));
    // By the lengths of both stretches: 1 s at 1 per second, then 0.5 s at 8.
    let expected = 3.0 * 1.5 / ((2.0 * 0.5 + 1.0) / 1.0 + (0.5 + 2.0 * 1.0) / 8.0);
    assert!((slope(1.0) - expected).abs() < 0.05, "{} {expected}", slope(1.0));
}

/// A triangle, keys at 1, 2 and 4 s, and values for shifts, turns about Y and shifts with slopes.
fn document(channels: &str, samplers: &str) -> String {
    let half = 0.5_f32.sqrt();
    // Along X, the slope after the first key is 2; the second has the slope 8 before it, the value 3 and the
    // slope 4 after it.
    let mut cubic = [0.0; 27];
    [cubic[6], cubic[9], cubic[12], cubic[15]] = [2.0, 8.0, 3.0, 4.0];
    let attributes = [
        Attribute::floats("POSITION", "VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]),
        Attribute::floats("_TIMES", "SCALAR", &[1.0, 2.0, 4.0]),
        Attribute::floats("_SHIFTS", "VEC3", &[0., 0., 0., 0., 0., 4., 8., 0., 4.]),
        Attribute::floats(
            "_TURNS",
            "VEC4",
            &[0., 0., 0., 1., 0., -half, 0., -half, 0., 0., 0., 1.],
        ),
        Attribute::floats("_CUBIC", "VEC3", &cubic),
    ];
    let rest = format!(
        r#", "animations": [{{"name": "ride", "channels": [{channels}], "samplers": [{samplers}]}}]"#
    );
    let text = gltf_of(&attributes, 3, "", &rest);
    let cubic = text.find("\"bufferView\": 4").unwrap();
    let (before, after) = text.split_at(cubic);
    before.to_owned() + &after.replacen("\"count\": 3", "\"count\": 9", 1)
}

fn channel(path: &str) -> String {
    format!(r#"{{"sampler": 0, "target": {{"node": 0, "path": "{path}"}}}}"#)
}

/// Corners of the triangle at a time.
fn corners(path: &str, sampler: &str, time: Option<f32>) -> [Vec3; 3] {
    let scene = at("ride.gltf", &document(&channel(path), sampler), time).unwrap();
    let animated = scene.warnings.iter().filter(|warning| warning.contains("animation")).count();
    assert_eq!(animated, usize::from(time.is_none()), "{:?}", scene.warnings);
    let positions = &scene.geometry.positions;
    [0, 1, 2].map(|corner| Vec3::from(positions[corner]))
}

#[test]
fn nodes_of_a_gltf_file_move() {
    let shifts = |kind: &str| format!(r#"{{"input": 1, "output": 2, "interpolation": "{kind}"}}"#);
    let corner = |sampler: &str, time| corners("translation", sampler, time)[0];
    let linear = &shifts("LINEAR");
    assert_eq!(corner(linear, None), Vec3::ZERO);
    assert_eq!(corner(linear, Some(0.0)), Vec3::ZERO);
    assert_eq!(corner(linear, Some(1.25)), Vec3::new(0.0, 0.0, 1.0));
    assert_eq!(corner(linear, Some(3.0)), Vec3::new(4.0, 0.0, 4.0));
    assert_eq!(corner(linear, Some(5.0)), Vec3::new(8.0, 0.0, 4.0));
    assert_eq!(corner(&shifts("STEP"), Some(3.0)), Vec3::new(0.0, 0.0, 4.0));
    // Hermite halfway: half of the ends, and an eighth of the slopes' difference times the seconds.
    let cubic = r#"{"input": 1, "output": 4, "interpolation": "CUBICSPLINE"}"#;
    assert_eq!(corner(cubic, Some(1.5)), Vec3::new(1.5 + 0.25 - 1.0, 0.0, 0.0));
    assert_eq!(corner(cubic, Some(3.0)), Vec3::new(1.5 + 1.0, 0.0, 0.0));
    // The parts of a transform that no channel moves stand.
    let wide = r#"[{"mesh": 0, "scale": [2, 3, 1]}]"#;
    let wide = document(&channel("translation"), linear).replace(r#"[{"mesh": 0}]"#, wide);
    let geometry = at("ride.gltf", &wide, Some(1.25)).unwrap().geometry;
    assert_eq!(geometry.positions, [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 3.0, 1.0]]);

    // A quarter turn about Y, by the shorter way although the quaternions have opposite signs.
    let turns = r#"{"input": 1, "output": 3}"#;
    let [.., along_x, along_y] = corners("rotation", turns, Some(2.0));
    assert!(along_x.distance(Vec3::new(0.0, 0.0, -1.0)) < 1e-6, "{along_x}");
    assert!(along_y.distance(Vec3::Y) < 1e-6);
    let [_, halfway, _] = corners("rotation", turns, Some(1.5));
    let half = 0.5_f32.sqrt();
    assert!(halfway.distance(Vec3::new(half, 0.0, -half)) < 1e-6, "{halfway}");
}

#[test]
fn animations_that_do_not_fit_are_refused_or_named() {
    let message = |sampler: &str| {
        let text = document(&channel("translation"), sampler);
        at("ride.gltf", &text, Some(1.0)).unwrap_err().to_string()
    };
    for (sampler, expected) in [
        (r#"{"input": 1, "output": 4}"#, "1 values for each of them, found 3 times and 9 values"),
        (r#"{"input": 2, "output": 2}"#, "accessor 2: expected vectors of one floats"),
        (r#"{"input": 1, "output": 3}"#, "accessor 3: expected vectors of three floats"),
    ] {
        let found = message(sampler);
        assert!(found.contains(expected), "{found}");
    }
    let weights = document(&channel("weights"), r#"{"input": 1, "output": 1}"#);
    let warnings = at("ride.gltf", &weights, Some(1.0)).unwrap().warnings;
    let expected = "ignored animated weights of morph targets (animation `ride`)";
    assert!(warnings.iter().any(|warning| warning.contains(expected)), "{warnings:?}");
}
