//! `product` and `visibility` with parameters other than their defaults: images are those of `mis`,
//! counters are those that scenes call for, and impossible parameters are refused.
//!
//! Images are compared by 12 block means × 3 channels of 8 + 8 replicates, as in `unbiased.rs`. |t| >
//! 7.5 has a chance of 3e-6, so the 10 comparisons raise a false alarm once in 900 runs.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::{
    sampler::{
        Parameters, Sampler,
        product::{LobeOrder, ProductParameters},
        visibility::{CacheScope, Threshold},
    },
    scene::Scene,
    session::Settings,
};
use glam::Vec3;

use crate::support::{
    self, assert_error, render, renderer, replicates, scenes, statistics::Estimate,
};

/// Applies `--set` assignments on top of few lobes.
fn parameters(assignments: &[&str]) -> Parameters {
    // A preset comes first, and the numbers of lobes after it.
    let (presets, others): (Vec<&str>, Vec<&str>) =
        assignments.iter().partition(|assignment| assignment.starts_with("preset="));
    let few = ["environment-lobes=40", "brdf-lobes=8", "views=16", "lobes=32"];
    support::parameters(&[&presets[..], &few, &others].concat())
}

fn settings(sampler: Sampler, assignments: &[&str]) -> Settings {
    Settings { sampler, parameters: parameters(assignments), ..Settings::default() }
}

/// Renders replicates with the sampler's own seeds.
fn replicates(scene: &Scene, settings: &Settings, samples: u32) -> Vec<Estimate> {
    replicates::replicates(scene, settings, 500 * settings.sampler as u32, samples)
}

/// Compares each sampler and its list of assignments with `mis`.
fn agree(scene: &Scene, samples: u32, cases: &[(Sampler, &[&str])]) {
    let mis = Settings { shadow_rays: 16, ..Settings::default() };
    let reference = replicates(scene, &mis, 4 * samples);
    for (sampler, assignments) in cases {
        let values = replicates(scene, &settings(*sampler, assignments), samples);
        let name = format!("{} {} {assignments:?}", scene.name, sampler.name());
        replicates::assert_same(&name, &values, &reference, 0.03);
    }
}

#[test]
fn parameters_change_no_image_in_a_room() {
    let _alone = support::alone();
    let scene = scenes::room(vec![
        scenes::diffuse(Vec3::splat(0.6)),
        scenes::copper(0.2),
        scenes::plastic(0.3),
    ]);
    agree(
        &scene,
        12,
        &[
            (Sampler::Visibility, &["preset=strict"]),
            (Sampler::Visibility, &["cache=pixel"]),
            (Sampler::Visibility, &["cache=pixel", "cache-capacity=2", "k=4"]),
            (Sampler::Visibility, &["tau=2"]),
            (Sampler::Visibility, &["threshold=fixed", "cache-capacity=2", "k=4"]),
            (Sampler::Visibility, &["lobes=1"]),
            (Sampler::Product, &["order=coefficient", "lobes=1", "brdf-share=0.5"]),
        ],
    );
}

#[test]
fn parameters_change_no_image_of_glossy_things_in_the_open() {
    let _alone = support::alone();
    let scene = scenes::open(vec![
        scenes::diffuse(Vec3::new(0.5, 0.4, 0.3)),
        scenes::plastic(0.05),
        scenes::copper(0.08),
    ]);
    agree(
        &scene,
        8,
        &[
            (Sampler::Visibility, &["order=coefficient", "cache=pixel"]),
            (Sampler::Visibility, &["preset=strict", "brdf-lobes=2", "views=1"]),
            (Sampler::Product, &["environment-lobes=1", "brdf-lobes=1", "lobes=1"]),
        ],
    );
}

/// Puts a box around the camera, which blocks every direction from every hit.
fn closed_box() -> Scene {
    let mut scene = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5))]);
    scenes::add_box(&mut scene.geometry, Vec3::new(0.0, 1.0, 0.0), Vec3::splat(9.0), 0);
    scene
}

const PIXELS: u64 = 32 * 24;

#[test]
fn where_everything_is_blocked_all_rays_but_the_last_are_learned_from() {
    let _alone = support::alone();
    let scene = closed_box();
    for (cache, recorded) in [("cache=hit", 4), ("cache=pixel", 5)] {
        let (sums, totals) = render(&scene, settings(Sampler::Visibility, &[cache]), 3);
        assert!((0..sums.pixel_count()).all(|pixel| sums.mean(pixel) == [0.0; 3]));
        assert_eq!(totals.product_hits, 3 * PIXELS);
        assert_eq!(totals.shadow_rays_visible, 0);
        // Directions below the horizon are drawn too, but bring nothing and are not traced. The last
        // ray of a hit is of use only to the next sample of its pixel.
        let traced = totals.shadow_rays_traced as f64 / (15 * PIXELS) as f64;
        let entries = totals.cache_entries as f64 / totals.shadow_rays_traced as f64;
        assert!((0.7..=1.0).contains(&traced), "{cache}: {traced} traced");
        let expected = f64::from(recorded) / 5.0;
        assert!((entries - expected).abs() < 0.01, "{cache}: {entries}, expected {expected}");
        if cache == "cache=hit" {
            assert_eq!(totals.cdf_rebuilds, totals.cache_entries, "one rebuild for every entry");
        }
        let statistics = totals.sampler_statistics();
        let per_hit = totals.cache_entries as f64 / totals.product_hits as f64;
        assert_eq!(statistics["cache_entries_per_hit"], per_hit);
        assert!(totals.lobes_kept <= 32 * totals.product_hits);
        assert!(statistics["energy_kept"] > 0.0 && statistics["energy_kept"] <= 1.0);
    }
}

/// The share of the product that its lobes keep grows with their number, up to all of it.
#[test]
fn more_lobes_keep_more_of_the_product() {
    let _alone = support::alone();
    let kept = [2, 8, 32, 320].map(|lobes| {
        let settings = settings(Sampler::Product, &[&format!("lobes={lobes}")]);
        let (_, totals) = render(&closed_box(), settings, 1);
        let statistics = totals.sampler_statistics();
        // Lobes of the sky below the horizon have no product.
        let most = if lobes == 320 { 319.0 } else { f64::from(lobes) };
        assert!(statistics["lobes_per_hit"] <= most, "{statistics:?}");
        statistics["energy_kept"]
    });
    eprintln!("{kept:.3?}");
    assert!(kept[0] < 0.2 && kept[3] > 0.8, "{kept:?}");
    assert!(kept.is_sorted_by(|one, other| *one + 0.01 < *other), "{kept:?}");
}

#[test]
fn where_nothing_is_blocked_nothing_is_learned() {
    let _alone = support::alone();
    let scene = scenes::plane(Vec3::splat(0.5), scenes::sky());
    let pixels = u64::from(scene.film.width * scene.film.height);
    let (guided, totals) = render(&scene, settings(Sampler::Visibility, &[]), 4);
    assert_eq!(totals.product_hits, 4 * pixels, "the plane fills the image");
    assert_eq!((totals.cache_entries, totals.cdf_rebuilds), (0, 0));
    assert_eq!(totals.shadow_rays_visible, totals.shadow_rays_traced);
    // Then k has no effect.
    let (same, _) = render(&scene, settings(Sampler::Visibility, &["k=7", "tau=3"]), 4);
    for pixel in 0..guided.pixel_count() {
        assert_eq!(guided.mean(pixel), same.mean(pixel), "pixel {pixel}");
    }
    // Pixels without a surface have no product.
    let scene = scenes::convex_furnace(scenes::diffuse(Vec3::splat(0.5)), Vec3::ONE);
    let (sums, totals) = render(&scene, settings(Sampler::Product, &[]), 2);
    let empty = (0..sums.pixel_count()).filter(|pixel| sums.mean(*pixel) == [1.0; 3]).count();
    assert!(empty > 0 && totals.product_hits < 2 * sums.pixel_count() as u64);
    assert!(totals.product_hits >= 2 * (sums.pixel_count() - empty - 40) as u64);
    assert_eq!((totals.cache_entries, totals.cdf_rebuilds), (0, 0), "product keeps no cache");
}

#[test]
fn darkness_is_black_and_a_black_surface_too() {
    let _alone = support::alone();
    let mut dark = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5)), scenes::plastic(0.2)]);
    dark.environment = scenes::environment(16, |_| Vec3::ZERO);
    let mut black = scenes::open(vec![scenes::diffuse(Vec3::ZERO)]);
    black.environment = scenes::environment(16, |_| Vec3::ONE);
    for sampler in [Sampler::Product, Sampler::Visibility] {
        let (sums, totals) = render(&dark, settings(sampler, &[]), 2);
        assert_eq!((totals.product_hits, totals.dropped_samples), (0, 0), "no fit, no lobes");
        assert!((0..sums.pixel_count()).all(|pixel| sums.mean(pixel) == [0.0; 3]));
        let (sums, totals) = render(&black, settings(sampler, &["cache-capacity=1"]), 2);
        assert_eq!((totals.product_hits, totals.dropped_samples), (0, 0), "no fit, no lobes");
        for pixel in 0..sums.pixel_count() {
            let mean = sums.mean(pixel);
            assert!(mean == [0.0; 3] || mean[0] <= 1.0 && mean[0] > 0.0, "{mean:?}");
        }
        assert_eq!(sums.mean(sums.pixel_count() - 1), [0.0; 3], "the ground is black");
    }
    // Surfaces beside a black one keep their lobes.
    let mixed = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5)), scenes::diffuse(Vec3::ZERO)]);
    let (_, totals) = render(&mixed, settings(Sampler::Visibility, &[]), 2);
    assert!(totals.product_hits > 0 && totals.product_hits < 2 * PIXELS);
}

#[test]
fn without_shadow_rays_there_is_what_the_camera_sees() {
    let _alone = support::alone();
    let scene = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5))]);
    let none = |sampler| Settings { shadow_rays: 0, ..settings(sampler, &[]) };
    let (expected, _) = render(&scene, none(Sampler::Mis), 2);
    for sampler in [Sampler::Product, Sampler::Visibility] {
        let (sums, totals) = render(&scene, none(sampler), 2);
        assert_eq!((totals.product_hits, totals.shadow_rays_traced), (0, 0));
        for pixel in 0..sums.pixel_count() {
            assert_eq!(sums.mean(pixel), expected.mean(pixel), "pixel {pixel}");
        }
    }
}

#[test]
fn one_ray_teaches_nothing_but_the_pixel() {
    let _alone = support::alone();
    let scene = closed_box();
    let one = |assignments: &[&str]| {
        let settings = Settings { shadow_rays: 1, ..settings(Sampler::Visibility, assignments) };
        render(&scene, settings, 4).1
    };
    let hit = one(&[]);
    assert_eq!((hit.cache_entries, hit.cdf_rebuilds), (0, 0));
    let pixel = one(&["cache=pixel"]);
    assert_eq!(pixel.cache_entries, pixel.shadow_rays_traced);
    assert!(pixel.cdf_rebuilds > 2 * PIXELS && pixel.cdf_rebuilds <= 3 * PIXELS);
}

#[test]
fn grouping_of_passes_changes_nothing_where_pixels_keep_caches() {
    let _alone = support::alone();
    let scene = scenes::room(vec![scenes::diffuse(Vec3::splat(0.6)), scenes::copper(0.3)]);
    let render = |passes: &[u32]| {
        let settings = settings(Sampler::Visibility, &["cache=pixel"]);
        let mut renderer = renderer(&scene, settings);
        for samples in passes {
            renderer.render_pass(*samples).unwrap();
        }
        let first = renderer.sums().unwrap();
        // After a restart, the renderer begins with empty caches.
        renderer.restart(0).unwrap();
        renderer.render_pass(passes.iter().sum()).unwrap();
        (first, renderer.sums().unwrap())
    };
    let (whole, again) = render(&[6]);
    let (parts, _) = render(&[1, 3, 2]);
    for pixel in 0..whole.pixel_count() {
        assert_eq!(whole.mean(pixel), parts.mean(pixel), "pixel {pixel}");
        assert_eq!(whole.mean(pixel), again.mean(pixel), "pixel {pixel} after a restart");
    }
}

#[test]
fn sums_taught_by_caches_that_are_gone_are_not_continued() {
    let _alone = support::alone();
    let scene = scenes::plane(Vec3::splat(0.5), scenes::sky());
    let settings = |cache| settings(Sampler::Visibility, &[cache]);
    let new = |cache| renderer(&scene, settings(cache));
    let mut first = new("cache=pixel");
    let empty = first.sums().unwrap();
    first.render_pass(3).unwrap();
    let sums = first.sums().unwrap();
    let parts = ["--resume", "cache=pixel", "3 samples", "--sample-offset 3", "cache=hit"];
    assert_error(new("cache=pixel").restore(&sums), &parts);
    new("cache=pixel").restore(&empty).unwrap();
    new("cache=hit").restore(&sums).unwrap();
}

#[test]
fn presets_are_the_parameters_they_name() {
    let strict = {
        let mut parameters = Parameters::default();
        parameters.set("preset=strict").unwrap();
        parameters
    };
    assert_eq!(strict.product, ProductParameters::strict());
    assert_eq!(strict.product.order, LobeOrder::Coefficient);
    let visibility = strict.visibility;
    assert_eq!((visibility.cache, visibility.threshold), (CacheScope::Hit, Threshold::Sigma));
    assert!(strict.product.brdf_share > 0.0, "something must cover the hemisphere");
}

#[test]
fn every_range_is_named_where_it_is_left() {
    let mut keys = Parameters::keys();
    for (key, bad, range) in [
        ("environment-lobes", ["0", "1001"], "1 to 1000"),
        ("brdf-lobes", ["0", "65"], "1 to 64"),
        ("views", ["0", "257"], "1 to 256"),
        ("lobes", ["0", "513"], "1 to 512"),
        ("order", ["", "size"], "integral or coefficient"),
        ("brdf-share", ["0", "1.01"], "0.001 to 1"),
        ("environment-share", ["-0.1", "1"], "0 to 0.999"),
        ("k", ["-1", "inf"], "0 to 16"),
        ("tau", ["-1", "NaN"], "0 to 100"),
        ("threshold", ["0", "angle"], "sigma or fixed"),
        ("cache", ["scene", "Hit"], "hit or pixel"),
        ("cache-capacity", ["0", "65"], "1 to 64"),
        ("elevation", ["walk", "0"], "inverse or metropolis"),
        ("preset", ["none", "thesis"], "default or strict"),
        ("bounce-candidates", ["0", "17"], "1 to 16"),
        (
            "candidates",
            ["0", "3"],
            "auto, 2, 4, 6 or 8 for ris and control-variates, auto, 1, 4 or 8 for guided",
        ),
        ("guide-memory", ["1", "x"], "1MiB or more"),
        ("later-rays", ["0", "4097"], "auto, or 1 to 4096"),
        ("open-rays", ["0", "4097"], "auto, or 1 to 4096"),
        ("portal-share", ["-0.1", "1.01"], "0 to 1"),
        ("haar-level", ["2", "6"], "3 to 5"),
        ("haar-cache", ["", "hit"], "on or off"),
        ("control-share", ["-0.1", "1.01"], "0 to 1"),
        ("control-bits", ["", "1"], "on or off"),
        ("control-choice", ["", "light"], "on or off"),
        ("record-side", ["3", "33"], "4 to 32"),
        ("record-pixels", ["0", "257"], "1 to 256"),
        ("environment-tiles", ["7", "1025"], "8 to 1024"),
        ("pilot-samples", ["0", "65"], "1 to 64"),
        ("sector-pixels", ["0", "257"], "1 to 256"),
        ("tile-floor", ["0", "1.01"], "0.001 to 1"),
        ("regions", ["15", "1025"], "16 to 1024"),
        ("compensation", ["", "no"], "on or off"),
        ("share-paths", ["3", "16"], "auto or off or 2 or 4 or 8"),
    ] {
        assert!(keys.contains(&key), "{key}");
        keys.retain(|other| *other != key);
        for value in bad {
            let set = Parameters::default().set(&format!("{key}={value}"));
            assert_error(set, &[&format!("--set {key}={value}: expected {range}")]);
        }
    }
    // Parameters of other rooms are tested with them.
    for key in keys {
        let set = Parameters::default().set(&format!("{key}=?"));
        assert_error(set, &[&format!("--set {key}=?: expected ")]);
    }
}

#[test]
fn the_walk_is_named_biased() {
    let named = Sampler::Product.describe(&parameters(&["elevation=metropolis"]));
    assert_eq!(named["elevation"], "metropolis (biased)");
    assert_eq!(Sampler::Visibility.describe(&parameters(&[]))["elevation"], "inverse");
}
