//! Scenes drawn at random from the corners of all that scene files may say: no sampler makes a pixel
//! that is not finite or, but for the noise of `control-variates`, negative, and no material returns more
//! light than it receives.
//!
//! `FENESTRA_PROPERTY_SCENES` is the number of scenes, `FENESTRA_PROPERTY_SEED` the first: see
//! `docs/reliability.md`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{env, fs};

use fenestra::{
    film::{Aov, Sums},
    sampler::Sampler,
    scene::Scene,
    session::Settings,
};
use glam::Vec3;
use tempfile::TempDir;

use crate::support::{self, command::pfm, random::Random, scenes};

/// Standard errors by which the mean of a furnace may pass one.
const FURNACE_LIMIT: f64 = 6.0;

/// A unit triangle, one of no area, a needle, and a pair that coincides.
const TRIANGLES: [&str; 4] =
    ["3 0 1 2", "3 0 1 3\n3 0 1 2", "3 0 4 1\n3 0 1 2", "3 0 1 2\n3 0 1 2\n3 2 1 0"];

fn setting(name: &str, otherwise: u64) -> u64 {
    env::var(name).map_or(otherwise, |text| text.parse().expect("a whole number"))
}

fn pick<'a>(random: &mut Random, values: &[&'a str]) -> &'a str {
    values[(random.uniform() * values.len() as f64) as usize]
}

fn triangles(random: &mut Random) -> String {
    let faces = pick(random, &TRIANGLES);
    format!(
        "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty \
         float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n-1 0 0\n1 0 \
         0\n0 1 0\n3 0 0\n0 1e-7 0\n{faces}\n",
        faces.lines().count()
    )
}

/// A material of any model, `[0, 1]` its range of reflectance.
fn material(random: &mut Random) -> String {
    let colour = |random: &mut Random| {
        pick(random, &["[0, 0, 0]", "[1, 1, 1]", "[1, 0, 0]", "[0.5, 0.5, 0.5]"])
    };
    let rough = |random: &mut Random| pick(random, &["0.0317", "1", "0.3"]);
    let kinds =
        ["diffuse", "plastic", "conductor", "metal", "principled", "mirror", "glass", "pane"];
    match pick(random, &kinds) {
        "diffuse" => format!("type = \"diffuse\"\nreflectance = {}", colour(random)),
        "plastic" => format!(
            "type = \"plastic\"\ndiffuse = {}\nroughness = {}\nior = {}",
            colour(random),
            rough(random),
            pick(random, &["1.01", "1.5", "4"])
        ),
        "conductor" => format!(
            "type = \"conductor\"\nroughness = {}\neta = {}\nk = {}",
            rough(random),
            pick(random, &["[1, 1, 1]", "[0.2, 1, 3]"]),
            pick(random, &["[0, 0, 0]", "[4, 2, 1]"])
        ),
        "metal" => format!(
            "type = \"conductor\"\nroughness = {}\nreflectance = {}",
            rough(random),
            colour(random)
        ),
        "principled" => format!(
            "type = \"principled\"\nbase_color = {}\nmetallic = {}\nroughness = {}",
            colour(random),
            pick(random, &["0", "1", "0.5"]),
            pick(random, &["0", "1", "0.5"])
        ),
        "mirror" => format!("type = \"mirror\"\nreflectance = {}", colour(random)),
        "glass" => format!(
            "type = \"dielectric\"\nior = {}\n{}",
            pick(random, &["1.02", "1.5", "3"]),
            pick(random, &["", "roughness = 1", "roughness = 0.0317"])
        ),
        _ => format!("type = \"thin_dielectric\"\nior = {}", pick(random, &["1.01", "1.5", "3"])),
    }
}

fn object(random: &mut Random, name: &str) -> String {
    let shape = match pick(random, &["box", "sphere", "mesh", "flat"]) {
        "box" => "shape = \"box\"\nsize = [1, 1, 1]".to_owned(),
        "sphere" => "shape = \"sphere\"\nradius = 0.5\nsegments = 8".to_owned(),
        "mesh" => "mesh = \"triangles.ply\"".to_owned(),
        _ => "shape = \"box\"\nsize = [2, 0.00001, 2]".to_owned(),
    };
    let scale = pick(random, &["1", "1e-4", "1e4", "[1, 1e-3, 1]", "[100, 1, 0.01]", "[-1, 1, 1]"]);
    let turn = pick(random, &["[0, 0, 0]", "[90, 0, 0]", "[13, 47, 71]"]);
    let place = pick(random, &["[0, 0, 0]", "[0, 0, 0]", "[0.3, 0.2, 0.1]", "[0, -0.5, 1000]"]);
    format!(
        "[[object]]\n{shape}\nmaterial = \"{name}\"\nscale = {scale}\nrotate_deg = {turn}\n\
         translate = {place}\n"
    )
}

/// Text of a scene; under a furnace, light from every direction is 1.
fn scene_text(random: &mut Random, is_furnace: bool) -> String {
    let camera = pick(random, &["[0, 0.5, 3]", "[0.1, 0.2, 0.05]", "[0, 50, 1]", "[0, 0, 2000]"]);
    let sky = if is_furnace {
        "constant = [1, 1, 1]"
    } else {
        pick(
            random,
            &[
                "constant = [0, 0, 0]",
                "constant = [1e6, 1e6, 1e6]",
                "sky = { width = 64 }",
                "map = \"spot.pfm\"",
                "map = \"black.pfm\"",
            ],
        )
    };
    let mut text = format!(
        "[camera]\nposition = {camera}\nlook_at = [0, 0, 0]\nvertical_fov_deg = {}\n[film]\nwidth = \
         8\nheight = 6\n[environment]\n{sky}\n",
        pick(random, &["1", "45", "150"])
    );
    let count = [0, 1, 3, 12, 12][(random.uniform() * 5.0) as usize];
    for index in 0..count {
        text += &format!("[[material]]\nname = \"m{index}\"\n{}\n", material(random));
    }
    for index in 0..count {
        text += &object(random, &format!("m{index}"));
        if random.uniform() < 0.3 {
            // The same object again: faces that coincide.
            let start = text.rfind("[[object]]").unwrap();
            let again = text[start..].to_owned();
            text += &again;
        }
    }
    text
}

/// Fails with the scene if a pixel is impossible. Samples of `control-variates` are differences: a pixel
/// of few of them may lie below zero, by its noise.
fn check(sums: &Sums, sampler: Sampler, is_furnace: bool, what: &str) {
    for pixel in 0..sums.pixel_count() {
        let mean = sums.mean(pixel);
        let least = if sampler == Sampler::ControlVariates { f64::NEG_INFINITY } else { 0.0 };
        let is_possible = mean.iter().all(|value| value.is_finite() && *value >= least);
        assert!(is_possible, "pixel {pixel}: {mean:?}\n{what}");
    }
    if is_furnace {
        for channel in 0..3 {
            let count = sums.pixel_count() as f64;
            let pixels = 0..sums.pixel_count();
            let mean = pixels.clone().map(|pixel| sums.mean(pixel)[channel]).sum::<f64>() / count;
            let variance = pixels.map(|pixel| sums.variance_of_mean(pixel)[channel]).sum::<f64>();
            let error = variance.sqrt() / count;
            let most = 1.0 + 1e-4 + FURNACE_LIMIT * error;
            assert!(mean <= most, "{mean} ± {error} comes back from a furnace\n{what}");
        }
    }
}

#[test]
fn no_scene_makes_an_impossible_pixel() {
    let _alone = support::alone();
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.toml");
    let mut map = [[0.0; 3]; 32];
    fs::write(folder.path().join("black.pfm"), pfm([8, 4], &map)).unwrap();
    map[11] = [1e7; 3];
    fs::write(folder.path().join("spot.pfm"), pfm([8, 4], &map)).unwrap();
    let first = setting("FENESTRA_PROPERTY_SEED", 1);
    let (mut rendered, mut refused) = (0, 0);
    for seed in first..first + setting("FENESTRA_PROPERTY_SCENES", 3) {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9));
        fs::write(folder.path().join("triangles.ply"), triangles(&mut random)).unwrap();
        let is_furnace = random.uniform() < 0.4;
        let text = scene_text(&mut random, is_furnace);
        let scene = match Scene::parse(&path, &text) {
            Ok(scene) => scene,
            Err(error) => {
                println!("{seed} refused: {error}");
                refused += 1;
                continue;
            }
        };
        let depth = [1, 2, 4][(3.0 * random.uniform()) as usize];
        println!("{seed}: {} materials, depth {depth}", scene.materials.len());
        // Three scenes have every sampler: making renderers takes most of the time.
        for &sampler in Sampler::ALL.iter().skip(seed as usize % 3).step_by(3) {
            let settings = Settings { sampler, depth, ..Settings::default() };
            let samples = if is_furnace { 16 } else { 3 };
            let (sums, totals) = support::render(&scene, settings, samples);
            let what = format!("seed {seed}, {}, depth {depth}\n{text}", sampler.name());
            assert_eq!(totals.dropped_samples, 0, "{what}");
            check(&sums, sampler, is_furnace, &what);
            rendered += 1;
        }
    }
    println!("{rendered} renders of finite pixels, {refused} scenes refused");
    assert!(rendered > refused, "most scenes are sound");
}

/// Light that no file can hold: samples that meet it are left out, and the statistics tell how many.
#[test]
fn samples_that_are_not_finite_are_counted() {
    let _alone = support::alone();
    let mut scene = scenes::room(vec![scenes::diffuse(Vec3::splat(0.5))]);
    scene.camera.position = Vec3::new(20.0, 1.0, 0.0);
    scene.environment = scenes::environment(16, |direction| {
        Vec3::splat(if direction.z > 0.0 { f32::INFINITY } else { 1.0 })
    });
    let aovs = vec![Aov::LightGroups];
    let settings = Settings { sampler: Sampler::Cosine, depth: 1, aovs, ..Settings::default() };
    let mut renderer = support::renderer(&scene, settings);
    renderer.render_pass(2).unwrap();
    let sums = renderer.sums().unwrap();
    assert_eq!(sums.non_finite_count(), 0);
    for pixel in 0..sums.pixel_count() {
        let means: Vec<_> = sums.groups.iter().map(|own| sums.group_means(own)(pixel)).collect();
        assert!(means.as_flattened().iter().all(|mean| mean.is_finite()), "{pixel}: {means:?}");
    }
    let dark = (0..sums.pixel_count()).filter(|pixel| sums.mean(*pixel) == [0.0; 3]).count();
    let dropped = renderer.totals().dropped_samples;
    assert!(dropped >= 2 * dark as u64 && dark > 50, "{dropped} of {dark} pixels");
}
