//! `--pixel x,y`: the picture of one hit and its numbers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use serde_json::Value;

use crate::{
    support::command::{self, Folder},
    twin::srbf::kernel_deviation,
};

/// Writes a scene of a clay ball in the open, with sky above it in the picture, or in a closed box.
fn scene(is_closed: bool) -> Folder {
    let folder = Folder::new();
    let roof = if is_closed {
        "[[object]]\nshape = \"box\"\nsize = [9.0, 9.0, 9.0]\nmaterial = \"clay\"\n"
    } else {
        ""
    };
    folder.write(
        "scene.toml",
        format!(
            r#"
[camera]
position = [0.0, 0.5, 3.0]
look_at = [0.0, 0.5, 0.0]
vertical_fov_deg = 45.0

[film]
width = 24
height = 16

[environment.sky]

[[material]]
name = "clay"
type = "diffuse"
reflectance = [0.6, 0.4, 0.3]

[[object]]
shape = "sphere"
radius = 0.5
material = "clay"
translate = [0.0, 0.5, 0.0]
{roof}"#
        ),
    );
    folder
}

fn run(folder: &Folder, options: &[&str]) -> command::Run {
    let few = ["environment-lobes=24", "brdf-lobes=4", "views=4", "lobes=32"];
    let mut arguments = vec!["render", "scene.toml", "-o", "out.exr", "--validate"];
    if !options.contains(&"--spp") {
        arguments.extend(["--spp", "1"]);
    }
    let has_lobes = options.iter().any(|option| ["product", "visibility"].contains(option));
    if has_lobes {
        arguments.extend(few.iter().flat_map(|assignment| ["--set", assignment]));
    }
    arguments.extend(options);
    folder.run(&arguments)
}

fn numbers(folder: &Folder) -> Value {
    folder.json("out.pixel_12_8.json")
}

fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|i| value[i].as_f64().unwrap())
}

fn sum(numbers: &Value, key: &str) -> f64 {
    numbers["lobes"].as_array().unwrap().iter().map(|lobe| lobe[key].as_f64().unwrap()).sum()
}

fn height(folder: &Folder) -> u32 {
    let picture = image::open(folder.path().join("out.pixel_12_8.png")).unwrap();
    assert_eq!(picture.width(), 512);
    picture.height()
}

#[test]
fn lobes_near_blocked_directions_lose_weight() {
    let folder = scene(true);
    let options = ["--sampler", "visibility", "--shadow-rays", "12", "--pixel", "12,8"];
    run(&folder, &options).assert(0, &[]);
    let numbers = numbers(&folder);

    let rays = numbers["rays"].as_array().unwrap();
    assert_eq!(rays.len(), 12);
    assert!(rays.iter().all(|ray| ray["visible"] == false));
    let cached = numbers["cached"].as_array().unwrap();
    // Take the rays traced before the last one, in their order.
    let traced: Vec<_> =
        rays[..11].iter().filter(|ray| vector(&ray["contribution"]) != [0.0; 3]).collect();
    assert!(traced.len() > 3, "{} rays were traced", traced.len());
    assert_eq!(cached.len(), traced.len());
    for (entry, ray) in cached.iter().zip(&traced) {
        let (entry, ray) = (vector(&entry["direction"]), vector(&ray["direction"]));
        assert!((0..3).all(|i| (entry[i] - ray[i]).abs() < 2e-4), "{entry:?} {ray:?}");
    }

    assert!((sum(&numbers, "before") - 1.0).abs() < 1e-6);
    assert!((sum(&numbers, "after") - 1.0).abs() < 1e-6);
    // V = (1 / (1 + Num))²: lobes with many cached directions close to them fall behind the others.
    let mut ratios: Vec<(usize, f64)> = numbers["lobes"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|lobe| lobe["before"].as_f64().unwrap() > 1e-4)
        .map(|lobe| {
            let axis = vector(&lobe["axis"]);
            let bandwidth = lobe["bandwidth"].as_f64().unwrap();
            let deviation = kernel_deviation(bandwidth as f32);
            let is_close = |entry: &&Value| {
                let direction = vector(&entry["direction"]);
                let cosine: f64 = (0..3).map(|i| axis[i] * direction[i]).sum();
                1.0 - cosine < f64::from(deviation)
            };
            let close = cached.iter().filter(is_close).count();
            (close, lobe["after"].as_f64().unwrap() / lobe["before"].as_f64().unwrap())
        })
        .collect();
    ratios.sort_by_key(|ratio| ratio.0);
    let (least, most) = (ratios[0], ratios[ratios.len() - 1]);
    assert!(most.0 > least.0, "every lobe has {} directions close to it", least.0);
    let expected = ((1.0 + least.0 as f64) / (1.0 + most.0 as f64)).powi(2);
    assert!((most.1 / least.1 / expected - 1.0).abs() < 0.01, "{least:?} {most:?}");

    // Three panels with two lines between them.
    assert_eq!(height(&folder), 3 * 256 + 2 * 4);
}

#[test]
fn each_kind_of_sampler_has_its_panels() {
    let folder = scene(false);
    run(&folder, &["--sampler", "mis", "--pixel", "12,8"]).assert(0, &[]);
    assert_eq!(height(&folder), 256);
    let rays = numbers(&folder)["rays"].as_array().unwrap().clone();
    assert_eq!(rays.len(), 5);
    assert!(rays.iter().any(|ray| ray["visible"] == true));

    run(&folder, &["--sampler", "product", "--pixel", "12,8"]).assert(0, &[]);
    assert_eq!(height(&folder), 2 * 256 + 4);
    let numbers = numbers(&folder);
    assert!((sum(&numbers, "before") - 1.0).abs() < 1e-6);
    assert_eq!(sum(&numbers, "before"), sum(&numbers, "after"));
}

/// Puts the ball in a room that is open to the front, where the camera is.
fn room() -> Folder {
    let folder = scene(false);
    let mut text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    for (size, translate) in [
        ([6.2, 0.2, 8.0], [0.0, -0.1, 0.0]),
        ([6.2, 0.2, 8.0], [0.0, 4.1, 0.0]),
        ([0.2, 4.0, 8.0], [-3.1, 2.0, 0.0]),
        ([0.2, 4.0, 8.0], [3.1, 2.0, 0.0]),
        ([6.2, 4.0, 0.2], [0.0, 2.0, -4.1]),
    ] {
        text.push_str(&format!(
            "\n[[object]]\nshape = \"box\"\nsize = {size:?}\nmaterial = \"clay\"\n\
             translate = {translate:?}\n"
        ));
    }
    folder.write("scene.toml", text);
    folder
}

#[test]
fn guided_shows_what_the_cell_of_the_hit_knows() {
    let folder = room();
    let options = ["--sampler", "guided", "--spp", "16", "--pixel", "12,8", "--set", "regions=64"];
    let pinned = ["--shadow-rays", "5", "--set", "candidates=1"];
    run(&folder, &[&options[..], &pinned].concat()).assert(0, &[]);
    assert_eq!(height(&folder), 3 * 256 + 2 * 4);
    let numbers = numbers(&folder);
    let regions = numbers["regions"].as_array().unwrap();
    let number = |region: &Value, key: &str| region[key].as_f64().unwrap();
    let total = |key: &str| regions.iter().map(|region| number(region, key)).sum::<f64>();
    assert_eq!(regions.len(), 64);
    assert!((total("probability") - 1.0).abs() < 1e-3, "{}", total("probability"));
    assert!((total("share") - 1.0).abs() < 1e-6);
    assert!((total("solid_angle") / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-6);
    let cell = &numbers["cell"];
    assert!(["fine", "coarse"].contains(&cell["level"].as_str().unwrap()), "{cell}");
    assert_eq!(total("trials"), cell["trials"].as_f64().unwrap());
    assert_eq!(total("hits"), cell["hits"].as_f64().unwrap());
    let face = cell["face"].as_str().unwrap();
    let axis = ["x", "y", "z"].iter().position(|axis| face.ends_with(axis)).unwrap();
    let along = vector(&numbers["normal"])[axis];
    assert!((if face.starts_with('-') { -along } else { along }) > 0.5, "{face} {along}");

    // Sky shows only to the front, past the edges of the room, so rays go there. Regions below the
    // horizon have not been looked at.
    let mean = |front: bool, key: &str| {
        let is_chosen = |region: &&Value| {
            let z = vector(&region["direction"])[2];
            if front { z > 0.85 } else { z < 0.5 && number(region, "trials") > 0.0 }
        };
        let chosen: Vec<f64> =
            regions.iter().filter(is_chosen).map(|region| number(region, key)).collect();
        chosen.iter().sum::<f64>() / chosen.len() as f64
    };
    let (front, back) = (mean(true, "visibility"), mean(false, "visibility"));
    assert!(front > 2.0 * back, "V: {front} to the front, {back} to the back");
    let gain = |front| mean(front, "probability") / mean(front, "share");
    assert!(gain(true) > 2.0 * gain(false), "{} {}", gain(true), gain(false));

    let rays = numbers["rays"].as_array().unwrap();
    assert_eq!(rays.len(), 13 * 5, "five of each of the next samples");
    assert_eq!((&rays[0]["sample"], &rays[5]["sample"]), (&Value::from(16), &Value::from(17)));
    for ray in rays {
        let traced = vector(&ray["contribution"]) != [0.0; 3];
        assert_eq!(traced, ray["region"].is_u64(), "{ray}");
        if ray["visible"] == true {
            assert!(vector(&ray["direction"])[2] > 0.0, "the only way out: {ray}");
        }
    }
    assert!(rays.iter().filter(|ray| ray["visible"] == true).count() > 8);
}

#[test]
fn where_guided_learned_nothing_it_shows_its_rays() {
    let folder = scene(false);
    let options = ["--sampler", "guided", "--shadow-rays", "5", "--pixel", "12,8"];
    run(&folder, &options).assert(0, &[]);
    assert_eq!(height(&folder), 256);
    let numbers = numbers(&folder);
    assert!(numbers["cell"].is_null());
    // Two rays a sample in the open, a quarter of five.
    assert_eq!(numbers["rays"].as_array().unwrap().len(), 64);
    run(&folder, &["--sampler", "guided", "--pixel", "0,0"])
        .assert(0, &["the pixel sees the environment"]);
}

/// Rays to lamps are not the sampler's.
#[test]
fn a_black_environment_has_no_rays() {
    let folder = scene(false);
    let text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let lamp =
        "[[lamp]]\ntype = \"point\"\nposition = [0.0, 3.0, 3.0]\nintensity = [9.0, 9.0, 9.0]\n";
    let text = text.replace("[environment.sky]", "");
    folder.write("scene.toml", text + lamp);
    for sampler in ["mis", "product", "guided"] {
        run(&folder, &["--sampler", sampler, "--shadow-rays", "5", "--pixel", "12,8"])
            .assert(0, &[]);
        assert_eq!(numbers(&folder)["rays"].as_array().unwrap().len(), 0, "{sampler}");
    }
}

#[test]
fn what_has_no_picture_says_so() {
    let folder = scene(false);
    run(&folder, &["--pixel", "24,8"]).assert(2, &["--pixel 24,8"]);
    run(&folder, &["--pixel", "1"]).assert(2, &["x,y"]);
    assert!(!folder.path().join("out.exr").exists());
    // For the sky, the image is written, and a warning says why there is no picture.
    run(&folder, &["--pixel", "0,0"]).assert(0, &["the pixel sees the environment"]);
    assert!(folder.path().join("out.exr").exists());
    assert!(!folder.path().join("out.pixel_0_0.png").exists());
}
