//! The sampler `guided` on the device: unbiased in every mode, deterministic, and worth its name.
//!
//! Each mode is compared with `mis` by 4 or 12 block means × 3 channels of 8 + 8 replicates, each
//! learned from nothing. |t| > 7.5 has a chance of 3e-6, so the 19 comparisons of the file raise a
//! false alarm once in about 490 runs.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::collections::BTreeSet;

use fenestra::{
    film::Aov,
    pass::Roulette,
    sampler::{
        Parameters, Sampler,
        guided::{CellKey, GuideState, PARTS_PER_RAY, SHARE_WORDS, with_epoch},
        regions::{FACE_COUNT, Partition, face_normal},
    },
    scene::Scene,
    session::{Renderer, Settings},
    shader::{
        rooms::guided::{GUIDE_COUNT_WORDS, GUIDE_RESPONSE_UNITS},
        structs::Wave,
    },
};
use glam::Vec3;

use crate::support::{
    self, assert_error,
    guide::Guide as _,
    replicates::{BLOCK, REPLICATES, assert_near, assert_same, replicates, rows},
    scenes,
    statistics::{estimates, z_of_mean},
};

const FIRST_SEED: u32 = 7000;

fn guided(candidates: u32) -> Settings {
    let parameters = Parameters { candidates: Some(candidates), ..Parameters::default() };
    // Few paths end: judgements need little noise.
    let roulette = Roulette { vertex: 2, throughput: 0.02 };
    Settings { sampler: Sampler::Guided, parameters, roulette, ..Settings::default() }
}

/// Shows a scene on a film of four blocks.
fn small(mut scene: Scene) -> Scene {
    (scene.film.width, scene.film.height) = (16, 16);
    scene
}

/// Compares modes with `mis` at the same depth.
fn agree(scene: &Scene, depth: u32, samples: u32, modes: &[(&str, Settings)]) {
    let mis = Settings { depth, ..Settings::default() };
    let reference = replicates(scene, &mis, FIRST_SEED + REPLICATES, 4 * samples);
    for (name, settings) in modes {
        let settings = Settings { depth, ..settings.clone() };
        let values = replicates(scene, &settings, FIRST_SEED, samples);
        assert_same(&format!("{} {name}", scene.name), &values, &reference, 0.02);
    }
}

#[test]
fn every_mode_is_unbiased_in_a_room() {
    let _alone = support::alone();
    let with = |candidates: u32, change: &dyn Fn(&mut Settings)| {
        let mut settings = guided(candidates);
        change(&mut settings);
        settings
    };
    let unchanged = |_: &mut Settings| {};
    agree(
        &scenes::mixed_room(),
        1,
        40,
        &[
            ("as measured", with(1, &|settings| settings.parameters.candidates = None)),
            ("one-sample", with(1, &unchanged)),
            ("4 candidates", with(4, &unchanged)),
            ("8 candidates", with(8, &unchanged)),
            // Training sweeps and one pass by their snapshot: the picture teaches nothing.
            ("1 shadow ray", with(4, &|settings| settings.shadow_rays = 1)),
            ("two groups of shadow rays", with(1, &|settings| settings.shadow_rays = 9)),
            // Nine cells fit besides the faces: nearly every place falls back.
            (
                "overflow",
                with(4, &|settings| settings.parameters.guided.guide_memory = 15 * 16 * 256),
            ),
            (
                "overflow, few regions",
                with(1, &|settings| {
                    settings.parameters.guided.guide_memory = 15 * 16 * 256;
                    settings.parameters.guided.regions = 16;
                }),
            ),
        ],
    );
}

/// Forces keys to collide: by cells so large that all walls share a few, and by cells so small that
/// their coordinates, kept modulo 256, repeat every 26 cm or less. There is room for all of them,
/// for few, or for none but the faces.
#[test]
fn places_that_share_a_key_are_unbiased() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mis = Settings { shadow_rays: 16, ..Settings::default() };
    let reference = replicates(&scene, &mis, FIRST_SEED, 128);
    let mut teacher = support::renderer(&scene, guided(1));
    teacher.render_pass(4).unwrap();
    let taught = teacher.guide_state().unwrap().unwrap();
    // Each of 256 regions takes a word to read and those to count; the shares come on top.
    let cell_bytes = 256 * (4 + 4 * u64::from(GUIDE_COUNT_WORDS)) + 4 * SHARE_WORDS as u64;
    for (name, edge, memory, candidates, samples) in [
        ("huge cells", 1e3, 1 << 27, 1, 32),
        ("huge cells", 1e3, 1 << 27, 4, 32),
        // Cells of other places mislead the candidates: a few samples carry much of the light.
        ("repeating cells", 1e-3, 1 << 27, 4, 96),
        ("repeating cells, little room", 1e-3, 40 * cell_bytes, 1, 32),
        ("faces only", 0.22, 1, 1, 32),
        // Six cells mislead four candidates: one sample in a hundred carries some of the light.
        ("faces only", 0.22, 1, 4, 512),
    ] {
        let mut settings = guided(candidates);
        settings.parameters.guided.guide_memory = memory;
        // The learned counts keep their keys, which now name other places.
        let mut state = taught.clone();
        state.origin.largest_edge = edge;
        state.samples = u32::MAX;
        let prepare = |renderer: &mut Renderer| {
            renderer.restore_guide(&state).unwrap();
        };
        let seeds = FIRST_SEED..FIRST_SEED + REPLICATES;
        let values = estimates(&rows(&scene, &settings, seeds, samples, BLOCK, prepare));
        assert_near(&format!("{name}, {candidates} candidates"), &values, &reference, 0.05);

        // Check that keys are shared, or not, as the name says.
        let mut renderer = support::renderer(&scene, settings);
        state.keys.truncate(6);
        state.counts.truncate(6 * state.origin.regions as usize);
        state.shares.truncate(6 * SHARE_WORDS);
        (state.pending, state.pending_shares) = (Vec::new(), Vec::new());
        state.missing.clear();
        renderer.restore_guide(&state).unwrap();
        renderer.render_pass(8).unwrap();
        let cells = renderer.guide_state().unwrap().unwrap().keys.len();
        match name {
            "huge cells" => assert!((12..400).contains(&cells), "{cells} cells"),
            "repeating cells" => assert!(cells > 4000, "{cells} cells"),
            "faces only" => assert_eq!(cells, 6),
            _ => assert_eq!(cells, 40),
        }
    }
}

/// Compares many replicates of one sample, which reads only the training, with `mis` at the same
/// seeds: the camera's numbers are the same, so the differences come from shadow rays alone. 36
/// values, |t| > 6 with 47 degrees of freedom: a false alarm in about 10⁵ runs.
#[test]
fn the_first_pass_after_training_is_unbiased() {
    let _alone = support::alone();
    const SEEDS: u32 = 48;
    let scene = small(scenes::mixed_room());
    let rows = |settings: Settings| rows(&scene, &settings, 0..SEEDS, 1, BLOCK, |_| {});
    let reference = rows(Settings { shadow_rays: 64, ..Settings::default() });
    let values = rows(guided(4));
    let mean = |rows: &[Vec<f64>], index: usize| {
        rows.iter().map(|row| row[index]).sum::<f64>() / f64::from(SEEDS)
    };
    let count = reference[0].len();
    let average = (0..count).map(|index| mean(&reference, index)).sum::<f64>() / count as f64;
    let mut compared = 0;
    for index in 0..count {
        // So few samples say nothing about the spread of blocks that see hardly any light.
        if mean(&reference, index) < 0.02 * average {
            continue;
        }
        compared += 1;
        let differences: Vec<f64> =
            values.iter().zip(&reference).map(|(a, b)| a[index] - b[index]).collect();
        let t = z_of_mean(&differences, 0.0);
        assert!(t.abs() < 6.0, "value {index} of {}: t = {t}", mean(&reference, index));
    }
    assert!(compared > count / 2, "{compared} of {count} values compared");
}

#[test]
fn every_vertex_of_a_path_is_unbiased() {
    let _alone = support::alone();
    let scene = small(scenes::room(vec![
        scenes::diffuse(Vec3::splat(0.8)),
        scenes::copper(0.4),
        scenes::plastic(0.3),
    ]));
    let mut every_ray = guided(1);
    every_ray.parameters.guided.later_rays = Some(5);
    let mut unguided = guided(1);
    unguided.parameters.guided.bounce_candidates = 1;
    let modes = [
        ("one-sample, depth 4", guided(1)),
        ("4, depth 4", guided(4)),
        ("one-sample, depth 4, no fewer rays", every_ray),
        ("one-sample, depth 4, bounces by the BRDF", unguided),
        // Throughputs of guided bounces depend on the tables, and so does roulette.
        (
            "one-sample, depth 4, roulette",
            Settings { roulette: Roulette { vertex: 1, throughput: 1.0 }, ..guided(1) },
        ),
    ];
    agree(&scene, 4, 8, &modes);
}

#[test]
fn later_vertices_have_the_rays_they_are_given() {
    let _alone = support::alone();
    let rays = |depth: u32, later_rays: Option<u32>| {
        let mut settings = Settings { depth, ..guided(1) };
        settings.parameters.guided.later_rays = later_rays;
        // The choice of cohorts traces rays too.
        settings.parameters.share_paths = Some(1);
        let mut renderer = support::renderer(&scenes::mixed_room(), settings);
        renderer.render_pass(1).unwrap();
        f64::from(renderer.totals().shadow_rays_traced as u32)
    };
    let first = rays(1, None);
    let [one, two, five] = [Some(1), None, Some(5)].map(|later| rays(2, later) - first);
    assert!(one > 0.1 * first, "{one} of {first}");
    // Directions below the horizon are not traced; their number depends on the training.
    assert!((two / one - 2.0).abs() < 0.2, "{one} → {two}");
    assert!((five / one - 5.0).abs() < 0.5, "{one} → {five}");
    support::assert_silent();
}

#[test]
fn passes_may_be_grouped_at_will() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let render = |passes: &[u32]| {
        let mut renderer = support::renderer(&scene, guided(4));
        for samples in passes {
            renderer.render_pass(*samples).unwrap();
        }
        (renderer.sums().unwrap(), renderer.totals().shadow_rays_traced)
    };
    // The regions are split anew after 16 samples.
    let (whole, rays) = render(&[21]);
    let (parts, rays_of_parts) = render(&[1, 5, 1, 8, 2, 4]);
    assert_eq!(rays, rays_of_parts);
    for pixel in 0..whole.pixel_count() {
        assert_eq!(whole.mean(pixel), parts.mean(pixel), "pixel {pixel}");
    }
}

/// Returns the number of rays counted since the last rebuild.
fn pending_rays(renderer: &Renderer) -> f64 {
    let pending = renderer.guide_state().unwrap().unwrap().pending;
    pending.iter().map(|[trials, ..]| f64::from(*trials)).sum()
}

#[test]
fn late_samples_teach_by_one_in_four() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut renderer = support::renderer(&scene, guided(1));
    // The last rebuild comes after 64 samples.
    renderer.render_pass(80).unwrap();
    let first = pending_rays(&renderer);
    renderer.render_pass(3).unwrap();
    let one_more = pending_rays(&renderer);
    renderer.render_pass(13).unwrap();
    let four_more = pending_rays(&renderer);
    assert!(first > 16.0 * 1000.0, "{first} rays");
    assert!((16.0 * one_more / first - 17.0).abs() < 0.1, "{first} → {one_more}");
    assert!((16.0 * four_more / first - 20.0).abs() < 0.2, "{first} → {four_more}");
    // The samples that teach do not depend on the grouping.
    let mut other = support::renderer(&scene, guided(1));
    for samples in [65, 16, 1, 14] {
        other.render_pass(samples).unwrap();
    }
    assert_eq!(pending_rays(&other), four_more);
    assert!(other.sums().unwrap() == renderer.sums().unwrap());
    support::assert_silent();
}

/// A sample of a wave shows the cell that it found itself: as near as this, many pixels have cells of two
/// sizes.
#[test]
fn samples_of_a_wave_show_their_own_cells() {
    let _alone = support::alone();
    let mut scene = scenes::mixed_room();
    scene.camera.vertical_fov_deg = 2.0;
    let settings = Settings { aovs: vec![Aov::GuideCell], ..guided(1) };
    // The last rebuild comes after 64 samples.
    let together = support::render_passes(&scene, settings.clone(), &[64, 12]);
    let apart = support::render_passes(&scene, settings, &[&[64][..], &[1; 12]].concat());
    assert!(together == apart);
    let is_mixed =
        |sum: &[f32; 3]| sum.iter().any(|sum| !((256.0 * sum) as u32).is_multiple_of(76));
    assert!(together.guide_cell.iter().any(is_mixed), "every pixel shows one cell");
}

/// With few regions a short render refines cells, and their parts are found. The mode "few regions"
/// above shows that they are unbiased.
#[test]
fn parts_of_refined_cells_are_found() {
    let _alone = support::alone();
    let mut settings = guided(1);
    settings.parameters.guided.regions = 16;
    let mut renderer = support::renderer(&scenes::mixed_room(), settings);
    renderer.render_pass(64).unwrap();
    support::assert_silent();
    let state = renderer.guide_state().unwrap().unwrap();
    assert!(!state.refined.is_empty());
    let parts: Vec<u32> = state
        .refined
        .iter()
        .filter_map(|&cell| CellKey(state.keys[cell as usize]).child_group())
        .collect();
    // Rays that a part counted itself.
    let regions = state.origin.regions as usize;
    let rays = |cell: usize| -> u32 {
        state.counts[cell * regions..][..regions].iter().map(|[trials, ..]| trials).sum()
    };
    let found = (FACE_COUNT..state.keys.len())
        .filter(|&cell| {
            let key = CellKey(state.keys[cell]);
            !key.is_coarse() && parts.contains(&key.sibling_group()) && rays(cell) > 0
        })
        .count();
    assert!(found >= state.refined.len(), "{found} parts of {} cells", state.refined.len());
}

#[test]
fn a_renderer_goes_on_where_another_stopped() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let renderer = || support::renderer(&scene, guided(4));
    let mut whole = renderer();
    whole.render_pass(21).unwrap();
    let whole = whole.sums().unwrap();
    // Stop before and after the regions are split anew.
    for (stop, rebuilt_at) in [(5, 4), (16, 12), (19, 16)] {
        let mut first = renderer();
        first.render_pass(stop).unwrap();
        let (sums, state) = (first.sums().unwrap(), first.guide_state().unwrap().unwrap());
        assert_eq!((state.samples, state.rebuilt_at), (stop, rebuilt_at));
        let mut second = renderer();
        second.restore(&sums).unwrap();
        assert!(!second.restore_guide(&state).unwrap());
        second.render_pass(21 - stop).unwrap();
        let parts = second.sums().unwrap();
        for pixel in 0..whole.pixel_count() {
            assert_eq!(whole.mean(pixel), parts.mean(pixel), "{stop} samples, pixel {pixel}");
        }
    }
    support::assert_silent();
}

/// Tables shaped by the outcomes of some random numbers are never sampled with the same: those of every
/// rebuild, guide, training and seed differ, and a guide that goes on remembers the guides it began with.
#[test]
fn every_epoch_has_its_own_random_numbers() {
    let mut seeds = BTreeSet::new();
    for case in 0..3_u32.pow(4) {
        let [seed, is_training, sample, tag] = [1, 3, 9, 27].map(|divisor| case / divisor % 3);
        let wave = with_epoch(Wave { seed, is_training, ..Wave::default() }, sample, tag);
        assert_eq!(wave.epoch_start, sample);
        assert!(seeds.insert(wave.epoch_seed), "{wave:?}");
    }

    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut renderer = support::renderer(&scene, guided(1));
    renderer.render_pass(2).unwrap();
    let (sums, learned) = (renderer.sums().unwrap(), renderer.guide_state().unwrap().unwrap());
    assert_eq!(learned.tag, 0);
    let mut tag = |samples: u32, state: &GuideState| {
        renderer.restart(0).unwrap();
        if samples > 0 {
            renderer.restore(&sums).unwrap();
        }
        renderer.restore_guide(state).unwrap();
        renderer.guide_state().unwrap().unwrap().tag
    };
    let mut other = learned.clone();
    other.counts[0][0] += 1;
    assert_ne!(other.epoch_tag(), learned.epoch_tag(), "guides that learned other things");
    let loaded = tag(0, &learned);
    assert_eq!(loaded, learned.epoch_tag());
    assert_eq!(tag(2, &GuideState { tag: loaded, ..learned }), loaded, "resumed");
    renderer.restart(0).unwrap();
    assert_eq!(
        renderer.guide_state().unwrap().unwrap().tag,
        0,
        "who starts again went on from no guide"
    );
}

#[test]
fn a_restart_forgets_the_regions_too() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut renderer = support::renderer(&scene, guided(1));
    renderer.render_pass(18).unwrap();
    let first = renderer.guide_state().unwrap().unwrap();
    let sums = renderer.sums().unwrap();
    renderer.restart(0).unwrap();
    renderer.render_pass(18).unwrap();
    assert!(renderer.guide_state().unwrap().unwrap() == first, "the same was learned");
    let again = renderer.sums().unwrap();
    assert!((0..sums.pixel_count()).all(|pixel| sums.mean(pixel) == again.mean(pixel)));
}

#[test]
fn a_guide_of_another_scene_is_refused_or_mostly_forgotten() {
    let _alone = support::alone();
    let room = scenes::mixed_room();
    let mut teacher = support::renderer(&room, guided(1));
    teacher.render_pass(4).unwrap();
    let state = teacher.guide_state().unwrap().unwrap();
    let mut moved = room.clone();
    for position in &mut moved.geometry.positions[72..] {
        position[1] += 0.2;
    }
    let mut pupil = support::renderer(&moved, guided(1));
    assert!(pupil.restore_guide(&state).unwrap(), "something moved");
    pupil.render_pass(2).unwrap();
    assert_eq!(pupil.totals().camera_rays, 2 * 32 * 24, "no training");
    // A scene is open by its geometry.
    let open = GuideState { is_open: true, ..state.clone() };
    for (scene, stays) in [(&room, true), (&moved, false)] {
        let mut pupil = support::renderer(scene, guided(1));
        pupil.restore_guide(&open).unwrap();
        assert_eq!(pupil.guide_state().unwrap().unwrap().is_open, stays);
    }
    let mut damaged = state.clone();
    damaged.rectangles[3][2] += 1;
    let mut pupil = support::renderer(&room, guided(1));
    assert_error(pupil.restore_guide(&damaged), &["do not fill the map"]);
    // Refuse cells of a face that no cube has, and survive counts that no render has.
    let mut damaged = state.clone();
    damaged.keys[FACE_COUNT] |= 7 << 28;
    assert_error(pupil.restore_guide(&damaged), &["holds no cells"]);
    let mut damaged = state.clone();
    damaged.counts.fill([u32::MAX; 3]);
    pupil.restore_guide(&damaged).unwrap();
    pupil.render_pass(1).unwrap();
    let mut darker = room.clone();
    darker.environment.texels[7] *= 0.5;
    let mut pupil = support::renderer(&darker, guided(1));
    assert_error(pupil.restore_guide(&state), &["another environment"]);
    let mut mis = support::renderer(&room, Settings::default());
    assert!(mis.restore_guide(&state).is_err() && mis.guide_state().unwrap().is_none());
}

#[test]
fn in_the_open_it_samples_as_mis_does() {
    let _alone = support::alone();
    let scene = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5)), scenes::plastic(0.2)]);
    let render = |settings: Settings| {
        let mut renderer = support::renderer(&scene, settings);
        renderer.render_pass(6).unwrap();
        (renderer.sums().unwrap(), renderer.totals().camera_rays)
    };
    let (mis, rays) = render(Settings::default());
    let (guided, guided_rays) = render(guided(4));
    assert_eq!(guided_rays, rays + rays / 6 / 8, "one sweep over an eighth of the pixels");
    for pixel in 0..mis.pixel_count() {
        assert_eq!(mis.mean(pixel), guided.mean(pixel), "pixel {pixel}");
    }
}

#[test]
fn rays_of_training_are_counted_and_more_rays_are_visible() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let share = |settings: Settings| {
        let mut renderer = support::renderer(&scene, settings);
        renderer.render_pass(16).unwrap();
        let totals = renderer.totals();
        (totals.camera_rays, totals.shadow_rays_visible as f64 / totals.shadow_rays_traced as f64)
    };
    let (cameras, mis) = share(Settings::default());
    let (guided_cameras, guided) = share(guided(1));
    assert_eq!(guided_cameras, cameras / 16 * 17, "the training looks at every pixel once");
    assert!(guided > 1.5 * mis, "visible: {guided} of guided rays, {mis} of mis");
}

/// Grey diffuse surfaces respond by reflectance / π · cosine whatever the light's colour, and to no
/// ray by more than at normal incidence. Most surfaces that point up belong to the floor, where the
/// cosine is that of the region; the rest belong to the sphere.
#[test]
fn visible_rays_teach_how_surfaces_respond() {
    let _alone = support::alone();
    let scene = scenes::room(vec![scenes::diffuse(Vec3::splat(0.6))]);
    let units = 0.6 / std::f64::consts::PI * f64::from(GUIDE_RESPONSE_UNITS);
    for candidates in [1, 4] {
        let mut renderer = support::renderer(&scene, guided(candidates));
        renderer.render_pass(16).unwrap();
        let state = renderer.guide_state().unwrap().unwrap();
        let partition =
            Partition::new(&scene.environment, 16).with_rectangles(&state.rectangles).unwrap();
        let regions = partition.regions.len();
        let (mut found, mut expected) = (0.0, 0.0);
        for (cell, key) in state.keys.iter().enumerate().skip(FACE_COUNT) {
            let counts = &state.counts[cell * regions..][..regions];
            for ([_, hits, response], region) in counts.iter().zip(&partition.regions) {
                let hits = f64::from(*hits) / PARTS_PER_RAY as f64;
                let response = f64::from(*response);
                // Splitting counts over new regions rounds them.
                assert!(response <= (units + 0.5) * hits + units, "{response} of {hits} rays");
                if face_normal(CellKey(*key).face()) == Vec3::Y {
                    found += response;
                    expected += units * hits * region.direction.y.max(0.0);
                }
            }
        }
        assert!(expected > 300.0 * units, "{expected}");
        assert!((0.9..1.2).contains(&(found / expected)), "{candidates}: {found} {expected}");
    }
    support::assert_silent();
}

/// A look at a pixel teaches the guide, so that rays of the picture must not meet its numbers again.
#[test]
fn a_look_at_a_pixel_draws_numbers_of_its_own() {
    let _alone = support::alone();
    let scene = small(scenes::mixed_room());
    let mut renderer = support::renderer(&scene, guided(1));
    renderer.render_pass(1).unwrap();
    let at = [8, 8];
    let rays = |renderer: &mut Renderer, of: Option<u32>| {
        let explained = match of {
            Some(seed) => renderer.explain_learned(seed, at, 40),
            None => renderer.inspect_pixel(at),
        };
        explained.unwrap().unwrap().numbers()["rays"].clone()
    };
    let seed = renderer.settings().seed;
    let own = rays(&mut renderer, Some(seed));
    assert_eq!(rays(&mut renderer, Some(seed)), own);
    let looked = rays(&mut renderer, None);
    assert_eq!(looked.as_array().map(Vec::len), Some(40));
    assert!(looked.as_array().unwrap().iter().all(|ray| !own.as_array().unwrap().contains(ray)));
    assert_eq!(rays(&mut renderer, None), looked);
    support::assert_silent();
}

#[test]
fn visible_rays_teach_the_share_of_the_brdf() {
    let _alone = support::alone();
    let state_after = |candidates: u32| {
        let mut renderer = support::renderer(&scenes::mixed_room(), guided(candidates));
        renderer.render_pass(7).unwrap();
        renderer.guide_state().unwrap().unwrap()
    };
    // The last sample came after a rebuild, so each of its visible rays is in both counts.
    let state = state_after(1);
    let visible: u64 = state.pending.iter().map(|[_, hits, _]| u64::from(*hits)).sum();
    let pairs = || state.pending_shares.chunks_exact(2);
    let rays: u64 = pairs().map(|pair| u64::from(pair[0])).sum();
    let from_brdf: u64 = pairs().map(|pair| u64::from(pair[1])).sum();
    assert!(visible > 100, "{visible}");
    assert_eq!(rays, visible);
    assert!((1..256 * rays).contains(&from_brdf), "{from_brdf} of {rays}");
    assert!(state.shares.chunks_exact(2).any(|pair| pair[0] > 0));
    // Resampling learns no share.
    let state = state_after(4);
    assert!(state.shares.iter().chain(&state.pending_shares).all(|word| *word == 0));
    support::assert_silent();
}

/// Loads a guide into renders with the very seeds that taught it. Their numbers must be others: the
/// outcomes of these numbers shaped the densities. The same guide taken as if the film had just begun
/// keeps the numbers, and shows the bias. Means of the image against `mis` with many rays and the same
/// camera rays; |z| > 5 has a chance of 6e-7.
#[test]
fn a_guide_loaded_with_its_own_seed_is_unbiased() {
    let _alone = support::alone();
    const SEEDS: u32 = 100;
    const SAMPLES: u32 = 4;
    let mut scene = scenes::mixed_room();
    (scene.film.width, scene.film.height) = (16, 8);
    let mut settings = Settings { shadow_rays: 1, ..guided(1) };
    settings.parameters.guided.regions = 64;
    let mean = |renderer: &Renderer| {
        let sums = renderer.sums().unwrap();
        let pixels = 0..sums.pixel_count();
        pixels.map(|pixel| sums.mean(pixel).iter().sum::<f64>()).sum::<f64>()
    };
    let mut reference =
        support::renderer(&scene, Settings { shadow_rays: 64, ..Settings::default() });
    let mut teacher = support::renderer(&scene, settings.clone());
    let mut student = support::renderer(&scene, settings);
    let mut truth = 0.0;
    let (mut loaded, mut replayed) = (Vec::new(), Vec::new());
    for seed in 0..SEEDS {
        reference.restart(seed).unwrap();
        reference.render_pass(SAMPLES).unwrap();
        let expected = mean(&reference);
        truth += expected / f64::from(SEEDS);
        teacher.restart(seed).unwrap();
        teacher.render_pass(SAMPLES).unwrap();
        let state = teacher.guide_state().unwrap().unwrap();
        for (samples, differences) in [(u32::MAX, &mut loaded), (0, &mut replayed)] {
            student.restart(seed).unwrap();
            let state = GuideState { samples, rebuilt_at: 0, ..state.clone() };
            student.restore_guide(&state).unwrap();
            student.render_pass(SAMPLES).unwrap();
            differences.push(mean(&student) - expected);
        }
    }
    let [loaded_z, replayed_z] = [&loaded, &replayed].map(|values| z_of_mean(values, 0.0));
    let bias = |values: &[f64]| values.iter().sum::<f64>() / f64::from(SEEDS) / truth;
    eprintln!(
        "loaded: {:+.4}, z {loaded_z:.2}; replayed: {:+.4}, z {replayed_z:.2}",
        bias(&loaded),
        bias(&replayed)
    );
    assert!(loaded_z.abs() < 5.0, "z = {loaded_z}");
    assert!(replayed_z < -5.0, "replayed numbers: z = {replayed_z}");
}
