//! A camera that moves over one renderer: its pictures, and what `guided` keeps.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{cell::Cell, rc::Rc};

use fenestra::{
    sampler::Sampler,
    scene::{Camera, Scene},
    session::{Renderer, Settings},
};
use glam::Vec3;

use crate::support::{
    self,
    guide::Guide as _,
    replicates::{BLOCK, REPLICATES, assert_same, replicates, rows},
    scenes,
    statistics::estimates,
};

/// Camera at the other side of the room.
fn elsewhere(scene: &Scene) -> Camera {
    Camera {
        position: Vec3::new(-1.2, 1.2, 1.6),
        look_at: Vec3::new(0.6, 0.6, -0.6),
        ..scene.camera
    }
}

fn settings(sampler: Sampler, seed: u32) -> Settings {
    Settings { sampler, seed, shadow_rays: 2, ..Settings::default() }
}

/// Settings of `guided` without choices by measurement.
fn guided() -> Settings {
    let parameters = support::parameters(&["candidates=1", "share-paths=off"]);
    Settings { parameters, ..settings(Sampler::Guided, 3) }
}

/// Numbers of rays that the guide has counted, those since the last rebuild included.
fn counted(renderer: &Renderer) -> u64 {
    let state = renderer.guide_state().unwrap().unwrap();
    let rays = |counts: &[[u32; 3]], parts: u64| {
        counts.iter().map(|[trials, ..]| u64::from(*trials)).sum::<u64>() / parts
    };
    rays(&state.counts, 16) + rays(&state.pending, 1)
}

#[test]
fn a_moved_camera_sees_what_a_new_renderer_sees() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut moving = support::renderer(&scene, settings(Sampler::Mis, 3));
    moving.render_pass(1).unwrap();
    for (size, seed) in [([19, 13], 8), ([32, 24], 9)] {
        moving.look(&elsewhere(&scene), size, seed, true).unwrap();
        moving.render_pass(2).unwrap();
        let mut there = scenes::mixed_room();
        there.camera = elsewhere(&scene);
        (there.film.width, there.film.height) = (size[0], size[1]);
        let mut other = support::renderer(&there, settings(Sampler::Mis, seed));
        other.render_pass(2).unwrap();
        assert!(moving.sums().unwrap() == other.sums().unwrap(), "{size:?}");
    }
    support::assert_silent();
}

#[test]
fn a_pass_that_is_stopped_leaves_no_trace_after_the_next_look() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut renderer = support::renderer(&scene, guided());
    let stops = Rc::new(Cell::new(true));
    let watched = Rc::clone(&stops);
    renderer.set_watch(Box::new(move |_| watched.get()));
    renderer.render_pass(4).unwrap();
    assert!(renderer.is_stopped() && renderer.sample_count() == 0);
    stops.set(false);
    renderer.look(&scene.camera, [32, 24], 3, true).unwrap();
    renderer.render_pass(2).unwrap();
    assert!(!renderer.is_stopped() && renderer.sample_count() == 2);
    assert!(renderer.sums().unwrap().sum == support::render(&scene, guided(), 2).0.sum);
}

#[test]
fn what_guided_has_learned_stays() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut renderer = support::renderer(&scene, guided());
    renderer.render_pass(4).unwrap();
    let before = counted(&renderer);
    renderer.look(&elsewhere(&scene), [16, 12], 4, false).unwrap();
    renderer.render_pass(1).unwrap();
    let small = renderer.totals().clone();
    assert_eq!(small.camera_rays, 16 * 12, "no training precedes the first sample");
    let after = counted(&renderer);
    assert!(after > before, "{after} of {before}");
    renderer.look(&elsewhere(&scene), [32, 24], 5, true).unwrap();
    assert!(counted(&renderer) * 100 >= after * 99, "{} of {after}", counted(&renderer));
    renderer.render_pass(1).unwrap();
    support::assert_silent();
}

#[test]
fn pictures_after_a_motion_are_unbiased() {
    let _alone = support::alone();
    let mut scene = scenes::mixed_room();
    let home = scene.camera;
    scene.camera = elsewhere(&scene);
    let reference = Settings { depth: 2, ..settings(Sampler::Mis, 0) };
    let reference = replicates(&scene, &reference, 0, 32);
    let mut settings = Settings { depth: 2, ..settings(Sampler::Guided, 0) };
    settings.parameters.set("candidates=1").unwrap();
    let values = rows(&scene, &settings, 100..100 + REPLICATES, 8, BLOCK, |renderer| {
        let seed = renderer.settings().seed;
        renderer.look(&home, [32, 24], seed + 1000, true).unwrap();
        renderer.render_pass(4).unwrap();
        renderer.look(&home, [16, 12], seed + 2000, false).unwrap();
        renderer.render_pass(2).unwrap();
        renderer.look(&scene.camera, [32, 24], seed + 3000, true).unwrap();
    });
    assert_same("after a motion", &estimates(&values), &reference, 0.03);
}
