//! Layers of groups of lights: they add up to the picture, and each is that of its lights alone.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::{
    film::{Aov, Sums},
    sampler::{Parameters, Sampler},
    scene::{EnvironmentMap, Filter, Lamp, Scene},
    session::{Renderer, Settings},
};
use glam::Vec3;

use crate::support::{
    self, assert_error,
    replicates::{BLOCK, REPLICATES, assert_near, block_means, rows},
    scenes,
    statistics::estimates,
};

/// Returns settings with groups of lights, without what is measured from run to run.
fn settings(sampler: Sampler, depth: u32) -> Settings {
    let mut parameters = Parameters { share_paths: Some(1), ..Parameters::default() };
    // Shares as controls, since bits of so few rays would expect nothing.
    let few = ["environment-lobes=24", "brdf-lobes=4", "views=8", "lobes=24", "control-bits=off"];
    few.iter().for_each(|assignment| parameters.set(assignment).unwrap());
    parameters.candidates = (sampler == Sampler::Guided).then_some(1);
    Settings { sampler, parameters, depth, aovs: vec![Aov::LightGroups], ..Settings::default() }
}

/// A room with glass, a mirror, a pane and a sheet, lit by the sky, a lamp `key` and a glowing box.
fn room() -> Scene {
    let mut scene = scenes::glazed_room();
    scene.film.filter = Filter::Gaussian;
    scene.lamps[0].light_group = Some("key".into());
    scene
}

/// Tests whether the groups of every pixel add up to it.
fn assert_adds_up(sums: &Sums, label: &str) {
    let of = |sums: &Sums, pixel| sums.mean(pixel).iter().sum::<f64>();
    let pixels = sums.pixel_count();
    let mean = (0..pixels).map(|pixel| of(sums, pixel)).sum::<f64>() / pixels as f64;
    for pixel in 0..pixels {
        let means: Vec<_> = sums.groups.iter().map(|own| sums.group_means(own)(pixel)).collect();
        for (channel, whole) in sums.mean(pixel).into_iter().enumerate() {
            let sum: f64 = means.iter().map(|mean| mean[channel]).sum();
            let tolerance = 1e-6 * (whole.abs() + mean);
            assert!((sum - whole).abs() < tolerance, "{label}, {pixel}: {sum} against {whole}");
        }
    }
}

#[test]
fn groups_add_up_to_the_picture_of_every_sampler() {
    let _alone = support::alone();
    let mut scene = room();
    [scene.film.width, scene.film.height] = [16, 12];
    for &sampler in Sampler::ALL {
        for depth in [1, 8] {
            let label = format!("{} {depth}", sampler.name());
            let mut settings = settings(sampler, depth);
            let (sums, _) = support::render(&scene, settings.clone(), 2);
            let names: Vec<_> = sums.groups.iter().map(|group| group.name.as_str()).collect();
            assert_eq!(names, ["environment", "key", "lamps"], "{label}");
            let is_lit = |values: &[[f32; 3]]| values.iter().any(|value| value[1] > 0.0);
            assert!(sums.groups.iter().all(|group| is_lit(&group.sum)), "{label}");
            assert_adds_up(&sums, &label);
            if matches!(sampler, Sampler::Guided | Sampler::Mis) {
                settings.aovs.clear();
                let plain = support::render(&scene, settings, 2).0;
                assert!(plain.sum == sums.sum && plain.groups.is_empty(), "{label}: other bits");
            }
        }
    }
}

/// Blackens all lights but those of a group.
fn alone(scene: &Scene, group: &str) -> Scene {
    let mut scene = scene.clone();
    if group != "environment" {
        scene.environment = EnvironmentMap::constant(Vec3::ZERO, 1.0).unwrap();
    }
    scene.lamps.retain(|lamp| lamp.light_group.as_deref() == Some(group));
    if group != "lamps" {
        scene.materials[4].surface.emission.as_mut().unwrap().radiance = Vec3::ZERO;
    }
    scene
}

/// Without lamps the directions of `mis` stay the same.
#[test]
fn the_environments_group_has_the_bits_of_its_picture() {
    let _alone = support::alone();
    let mut scene = room();
    let settings = settings(Sampler::Mis, 4);
    let (sums, _) = support::render(&scene, settings.clone(), 4);
    scene = alone(&scene, "environment");
    let (own, _) = support::render(&scene, Settings { aovs: Vec::new(), ..settings }, 4);
    assert!(own.sum == sums.groups[0].sum && own.compensation == sums.groups[0].compensation);
}

#[test]
fn a_group_is_the_picture_of_its_lights_alone() {
    let _alone = support::alone();
    let scene = room();
    let settings = settings(Sampler::Mis, 2);
    let mut renderer = support::renderer(&scene, settings.clone());
    let mut groups = vec![Vec::new(); 2];
    for seed in 0..REPLICATES {
        renderer.restart(seed).unwrap();
        renderer.render_pass(24).unwrap();
        let sums = renderer.sums().unwrap();
        for (rows, group) in groups.iter_mut().zip(&sums.groups[1..]) {
            let (sum, compensation) = (group.sum.clone(), group.compensation.clone());
            rows.push(block_means(&Sums { sum, compensation, ..sums.clone() }, BLOCK));
        }
    }
    let plain = Settings { aovs: Vec::new(), ..settings };
    for (rows_of_group, name) in groups.iter().zip(["key", "lamps"]) {
        let own = rows(&alone(&scene, name), &plain, 100..100 + REPLICATES, 24, BLOCK, |_| {});
        assert_near(name, &estimates(rows_of_group), &estimates(&own), 0.1);
    }
}

/// More lamps than are drawn by power alone, some with the environment's group.
#[test]
fn many_lamps_keep_their_groups() {
    let _alone = support::alone();
    let mut scene = scenes::mixed_room();
    for index in 0..40_u8 {
        let [x, z] = [index % 8, index / 8].map(|place| f32::from(place) * 0.4 - 1.4);
        scenes::add_point(&mut scene, Vec3::new(x, 2.2, z), Vec3::ONE);
        let group = ["left", "right", "environment"][usize::from(index % 3)];
        scene.lamps[usize::from(index)].light_group = Some(group.into());
    }
    let settings = settings(Sampler::Mis, 2);
    let (sums, _) = support::render(&scene, settings.clone(), 8);
    assert_adds_up(&sums, "many");
    let total = |sums: &Sums, name: &str| {
        let group = sums.group(name).unwrap();
        (0..sums.pixel_count()).map(|pixel| sums.group_means(group)(pixel)[1]).sum::<f64>()
    };
    let lamps = std::mem::take(&mut scene.lamps);
    for name in ["environment", "left", "right"] {
        let own = |lamp: &&Lamp| lamp.light_group.as_deref() == Some(name);
        scene.lamps = lamps.iter().filter(own).cloned().collect();
        let (own, _) = support::render(&scene, settings.clone(), 8);
        let ratio = total(&sums, name) / total(&own, name);
        assert!((ratio - 1.0).abs() < 0.05, "{name}: {ratio}");
    }
}

#[test]
fn what_cannot_be_kept_apart_is_refused() {
    let _alone = support::alone();
    let mut scene = room();
    let new = |scene: &Scene, settings| Renderer::new(support::device(), scene, settings);
    let mut shared = settings(Sampler::Guided, 2);
    shared.parameters.set("share-paths=4").unwrap();
    assert_error(new(&scene, shared), &["expected --set share-paths=off"]);
    for index in 0..6 {
        let mut lamp = scene.lamps[0].clone();
        lamp.light_group = Some(format!("lamp {index}"));
        scene.lamps.push(lamp);
    }
    let refused = new(&scene, settings(Sampler::Mis, 1));
    assert_error(refused, &["at most 8 groups, found 9: environment, key, lamp 0"]);
}
