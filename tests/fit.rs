//! Fits: planted mixtures are recovered, more lobes fit better, the same input gives the same bytes,
//! the cache survives damage, and bad input is refused or answered honestly.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{f32::consts::PI, fs, path::Path, sync::Arc};

use fenestra::{
    brdf::MaterialTables,
    fit::{
        BrdfFit, BrdfOptions, Cache, EnvironmentFit, EnvironmentOptions, Fit, Method, brdf_lobes,
        config, describe, environment_lobes, read_fit, write_fit,
    },
    math::frame::direction_from_lat_long,
    scene::{
        EnvironmentMap,
        material::{ConductorFresnel, Material, MaterialKind, Principled},
        measured::MeasuredTable,
    },
    srbf::{Lobe, lobe_value},
};
use glam::{Vec2, Vec3};

use crate::{
    support::{assert_error, scenes},
    twin::srbf::{Mixture, lobe_integral},
};

/// Tabulates a function of the direction as a map.
fn map(width: u32, function: impl Fn(Vec3) -> Vec3) -> EnvironmentMap {
    EnvironmentMap { rotation_rad: 0.0, ..scenes::environment(width, function) }
}

fn fit_map(map: &EnvironmentMap, lobes: usize, method: Method) -> EnvironmentFit {
    environment_lobes(map, EnvironmentOptions { lobes, method }, None, &mut |_| ()).unwrap()
}

/// Makes a sky with a gradient, a window and a sun of one texel that holds a tenth of the light.
fn sunny(width: u32) -> EnvironmentMap {
    let sun = Vec3::new(0.5, 0.6, -0.62).normalize();
    let radius = PI / width as f32;
    map(width, |d| {
        let sky = Vec3::new(0.4, 0.6, 1.0) * (0.3 + 0.7 * d.y.max(0.0));
        let window = if d.x > 0.7 && d.y.abs() < 0.3 { 6.0 } else { 0.0 };
        let sun = if d.distance(sun) < radius { 0.1 / (radius * radius) } else { 0.0 };
        sky + Vec3::splat(window) + Vec3::new(1.0, 0.9, 0.7) * sun
    })
}

fn material(kind: MaterialKind) -> MaterialTables {
    MaterialTables::new(&[Material::new("test", kind)]).unwrap()
}

fn conductor(alpha: f32) -> MaterialTables {
    let fresnel = ConductorFresnel::Schlick { reflectance: Vec3::splat(0.9) };
    material(MaterialKind::Conductor { alpha, fresnel })
}

fn fit_brdf(tables: &MaterialTables, lobes: usize, views: usize) -> BrdfFit {
    let options = BrdfOptions { lobes, views, method: Method::Em };
    brdf_lobes(tables, 0, "test", options, None, &mut |_| ()).unwrap()
}

/// Lists the files of `folder` beside the checkout with one of the extensions, if it is there.
fn shared(folder: &str, extensions: &[&str]) -> Vec<std::path::PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(folder);
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let has =
        |path: &Path| path.extension().is_some_and(|found| extensions.iter().any(|e| found == *e));
    let mut files: Vec<_> = entries.map(|entry| entry.path()).filter(|path| has(path)).collect();
    files.sort();
    files
}

#[test]
fn planted_mixtures_are_recovered() {
    let planted = [
        Lobe { axis: Vec3::new(0.0, 0.6, -0.8), bandwidth: 40.0, amplitude: 3.0 },
        Lobe { axis: Vec3::X, bandwidth: 12.0, amplitude: 1.0 },
        Lobe { axis: Vec3::new(-0.8, -0.6, 0.0), bandwidth: 200.0, amplitude: 20.0 },
        Lobe { axis: Vec3::Z, bandwidth: 6.0, amplitude: 0.5 },
    ];
    let colours = [Vec3::new(1.0, 0.5, 0.2), Vec3::ONE, Vec3::new(0.1, 0.3, 1.0), Vec3::Y];
    let target = map(512, |d| {
        let value = |(lobe, colour): (&Lobe, &Vec3)| *colour * lobe_value(lobe, d);
        planted.iter().zip(&colours).map(value).sum()
    });
    for method in [Method::Em, Method::L2] {
        let fit = fit_map(&target, planted.len(), method);
        assert_eq!(fit.lobes.len(), planted.len());
        assert!(fit.errors.relative_l2 < 0.03, "{method:?}: {:?}", fit.errors);
        assert!(fit.errors.kullback_leibler.abs() < 2e-3, "{method:?}: {:?}", fit.errors);
        assert!((fit.errors.energy_captured - 1.0).abs() < 5e-3, "{method:?}: {:?}", fit.errors);
        for (lobe, colour) in planted.iter().zip(&colours) {
            let near = |a: &&fenestra::fit::EnvironmentLobe| Vec3::from(a.axis).distance(lobe.axis);
            let found = fit.lobes.iter().min_by(|a, b| near(a).total_cmp(&near(b))).unwrap();
            assert!(near(&found) < 0.01, "{method:?}: {lobe:?} {found:?}");
            assert!((found.bandwidth / lobe.bandwidth - 1.0).abs() < 0.05, "{lobe:?} {found:?}");
            let expected = lobe.amplitude * *colour;
            let error = (Vec3::from(found.colour) - expected).abs().max_element();
            assert!(error < 0.05 * expected.max_element(), "{method:?}: {expected} {found:?}");
        }
    }
}

#[test]
fn more_lobes_are_better_with_a_sun_too() {
    let target = sunny(512);
    let mut last = f64::INFINITY;
    for lobes in [6, 12, 25, 50, 100] {
        let fit = fit_map(&target, lobes, Method::Em);
        assert_eq!(fit.lobes.len(), lobes);
        let divergence = fit.errors.kullback_leibler;
        assert!(divergence < 1.01 * last, "{lobes}: {divergence} after {last}");
        assert!(divergence > 0.0 && fit.errors.chi_squared > 0.0, "{:?}", fit.errors);
        assert!((fit.errors.energy_captured - 1.0).abs() < 0.02, "{:?}", fit.errors);
        last = divergence;
    }
    assert!(last < 0.05, "{last}");
}

#[test]
fn squared_error_is_lower_by_its_own_method() {
    let target = sunny(256);
    let (em, l2) = (fit_map(&target, 12, Method::Em), fit_map(&target, 12, Method::L2));
    assert!(l2.errors.relative_l2 < em.errors.relative_l2, "{:?} {:?}", em.errors, l2.errors);
    assert!(em.errors.kullback_leibler < l2.errors.kullback_leibler);
}

#[test]
fn errors_are_those_of_the_lobes() {
    // Compute χ² and divergence again from the lobes alone, by brute force.
    let target = sunny(512);
    let fit = fit_map(&target, 20, Method::Em);
    let mixture = Mixture { lobes: fit.lobes.iter().map(|lobe| lobe.lobe()).collect() };
    let luminance = fenestra::math::colour::luminance;
    // Four times as fine as the map, bilinear as the renderer looks it up.
    let (width, height) = (2048_u32, 1024_u32);
    let (mut energy, mut square, mut divergence) = (0.0_f64, 0.0_f64, 0.0_f64);
    for y in 0..height {
        let theta = std::f64::consts::PI * (f64::from(y) + 0.5) / f64::from(height);
        let cell = 2.0 * std::f64::consts::PI.powi(2) / f64::from(width * height) * theta.sin();
        for x in 0..width {
            let u = (x as f32 + 0.5) / width as f32;
            let d = direction_from_lat_long(Vec2::new(u, (y as f32 + 0.5) / height as f32));
            let value = f64::from(luminance(target.radiance(d)));
            let density = f64::from(mixture.pdf(d)).max(1e-300);
            energy += cell * value;
            square += cell * value * value / (0.9 * density + 0.1 / (4.0 * std::f64::consts::PI));
            divergence += cell * value * (value / density).max(1e-300).ln();
        }
    }
    let chi_squared = square / (energy * energy) - 1.0;
    let divergence = divergence / energy - energy.ln();
    let errors = fit.errors;
    assert!((errors.chi_squared / chi_squared - 1.0).abs() < 0.05, "{chi_squared} {errors:?}");
    assert!((errors.kullback_leibler / divergence - 1.0).abs() < 0.05, "{divergence} {errors:?}");
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let target = sunny(256);
    let tables = conductor(0.2);
    let mut files = Vec::new();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (map, brdf) =
            pool.install(|| (fit_map(&target, 30, Method::Em), fit_brdf(&tables, 5, 8)));
        for (name, fit) in [("map", Fit::Environment(map)), ("brdf", Fit::Brdf(brdf))] {
            let path = folder.path().join(format!("{name}{threads}.fit"));
            write_fit(&path, &fit).unwrap();
            files.push(fs::read(path).unwrap());
        }
    }
    assert_eq!(files[0], files[2]);
    assert_eq!(files[1], files[3]);
}

#[test]
fn files_hold_what_was_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deep/map.fit");
    let fit =
        Fit::Environment(EnvironmentFit { seconds: 0.0, ..fit_map(&sunny(128), 9, Method::Em) });
    write_fit(&path, &fit).unwrap();
    assert_eq!(read_fit(&path).unwrap(), fit);
    let description = describe(&path).unwrap();
    assert!(description.lines.iter().any(|line| line.contains("9 of 9")), "{description:?}");

    // Damage is noticed wherever it is.
    let bytes = fs::read(&path).unwrap();
    for position in (0..bytes.len()).step_by(bytes.len() / 40) {
        let mut damaged = bytes.clone();
        damaged[position] ^= 1;
        fs::write(&path, &damaged).unwrap();
        assert_error(read_fit(&path), &["map.fit"]);
        fs::write(&path, &bytes[..position]).unwrap();
        assert!(read_fit(&path).is_err());
    }
}

#[test]
fn the_cache_is_used_and_survives_damage() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::at(folder.path().join("fits"));
    let target = sunny(128);
    let fit = |target: &EnvironmentMap, lobes: usize| {
        let options = EnvironmentOptions { lobes, method: Method::Em };
        environment_lobes(target, options, Some(&cache), &mut |_| ()).unwrap()
    };
    let files = || -> Vec<_> {
        fs::read_dir(folder.path().join("fits")).unwrap().map(|f| f.unwrap().path()).collect()
    };
    let first = fit(&target, 8);
    assert!(!first.is_cached);
    let second = fit(&target, 8);
    assert!(second.is_cached);
    assert_eq!(first.lobes, second.lobes);

    // The map's name and rotation do not matter; its content and the options do.
    let renamed = EnvironmentMap { source: "other".into(), rotation_rad: 1.0, ..target.clone() };
    let third = fit(&renamed, 8);
    assert!(third.is_cached && third.source == "other");
    assert!(!fit(&target, 9).is_cached);
    let mut brighter = target.clone();
    brighter.texels[77] *= 1.01;
    assert!(!fit(&brighter, 8).is_cached);
    assert_eq!(files().len(), 3);

    for content in [&b""[..], b"nonsense", b"{\"format\":\"fenestra-fit\"}\n"] {
        for file in files() {
            fs::write(file, content).unwrap();
        }
        let again = fit(&target, 8);
        assert!(!again.is_cached);
        assert_eq!(again.lobes, first.lobes);
        assert!(fit(&target, 8).is_cached);
    }

    let tables = conductor(0.3);
    let is_cached = |method| {
        let options = BrdfOptions { lobes: 2, views: 2, method };
        brdf_lobes(&tables, 0, "metal", options, Some(&cache), &mut |_| ()).unwrap().is_cached
    };
    assert_eq!([Method::Em, Method::Em, Method::L2].map(is_cached), [false, true, false]);

    // A cache that cannot be written does no harm.
    let blocked = folder.path().join("file");
    fs::write(&blocked, "").unwrap();
    let options = EnvironmentOptions { lobes: 4, method: Method::Em };
    let nowhere = Cache::at(blocked.join("fits"));
    assert!(environment_lobes(&target, options, Some(&nowhere), &mut |_| ()).is_ok());
}

#[test]
fn two_at_once_share_a_cache() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::at(folder.path().to_path_buf());
    let target = sunny(128);
    let options = EnvironmentOptions { lobes: 12, method: Method::Em };
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                environment_lobes(&target, options, Some(&cache), &mut |_| ()).unwrap();
            });
        }
    });
    let fit = environment_lobes(&target, options, Some(&cache), &mut |_| ()).unwrap();
    assert!(fit.is_cached);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary files are left");
}

#[test]
fn turned_maps_turn_their_lobes() {
    let target = EnvironmentMap { rotation_rad: 0.7, ..sunny(128) };
    let fit = fit_map(&target, 10, Method::Em);
    // At its turned axis, a lobe meets the radiance that it meets in the unturned map.
    for lobe in fit.world_lobes(target.rotation_rad) {
        let axis = Vec3::from(lobe.axis);
        let unturned = EnvironmentMap { rotation_rad: 0.0, ..target.clone() };
        let original = fit.lobes.iter().find(|l| l.amplitude == lobe.amplitude).unwrap();
        let expected = unturned.radiance(Vec3::from(original.axis));
        let difference = (target.radiance(axis) - expected).abs().max_element();
        assert!(difference < 0.05 * expected.max_element() + 0.05, "{lobe:?}");
    }
}

#[test]
fn hopeless_maps_are_refused_and_odd_ones_fitted() {
    let options = |lobes| EnvironmentOptions { lobes, method: Method::Em };
    let fit =
        |map: &EnvironmentMap, lobes| environment_lobes(map, options(lobes), None, &mut |_| ());
    let constant = map(64, |_| Vec3::splat(2.0));
    assert_error(fit(&map(64, |_| Vec3::ZERO), 10), &["black"]);
    assert_error(fit(&constant, 0), &["0 lobes asked for; expected 1 to 4096"]);
    assert_error(fit(&constant, 100_000), &["100000 lobes"]);
    for wrong in [f32::NAN, f32::INFINITY, -1.0] {
        let mut damaged = constant.clone();
        damaged.texels[70].y = wrong;
        assert_error(fit(&damaged, 10), &["texel (6, 1)"]);
    }

    for lobes in [1, 7, 100] {
        let fit = fit(&constant, lobes).unwrap();
        assert!(fit.errors.chi_squared < 2e-3, "{lobes}: {:?}", fit.errors);
        assert!(fit.errors.relative_l2 < 0.03, "{lobes}: {:?}", fit.errors);
    }

    // One bright texel, and nothing else.
    let mut sun = map(1024, |_| Vec3::ZERO);
    sun.texels[200 * 1024 + 300] = Vec3::new(1e5, 9e4, 8e4);
    let one = fit(&sun, 100).unwrap();
    assert!(one.lobes.len() < 100 && !one.notes.is_empty(), "{:?}", one.notes);
    assert!(one.errors.chi_squared < 1.0, "{:?}", one.errors);
    assert!((one.errors.energy_captured - 1.0).abs() < 0.05, "{:?}", one.errors);

    // A map of two texels, and numbers near both ends of single precision.
    let mut tiny = map(2, |_| Vec3::ONE);
    tiny.texels[1] = Vec3::splat(3.0);
    assert!(fit(&tiny, 4).unwrap().errors.chi_squared < 0.1);
    for scale in [1e-20, 1e15] {
        let mut scaled = sunny(128);
        for texel in &mut scaled.texels {
            *texel *= scale;
        }
        let fit = fit(&scaled, 10).unwrap();
        assert!(fit.errors.chi_squared.is_finite() && fit.errors.chi_squared < 5.0);
        assert!(fit.lobes.iter().all(|lobe| lobe.amplitude.is_finite()));
    }
}

#[test]
fn analytic_materials_fit_and_interpolate() {
    let diffuse = material(MaterialKind::Diffuse { reflectance: Vec3::splat(0.6) });
    let plastic =
        material(MaterialKind::Plastic { diffuse: Vec3::splat(0.5), alpha: 0.1, ior: 1.5 });
    let principled = |metallic, roughness| {
        let base_color = Vec3::splat(0.5);
        let own = Principled { base_color, metallic, roughness, ..Principled::default() };
        material(MaterialKind::Principled(own))
    };
    for (name, tables) in [
        ("diffuse", diffuse),
        ("plastic", plastic),
        ("metal", conductor(0.1)),
        ("principled", principled(0.0, 0.3)),
        ("principled metal", principled(1.0, 0.4)),
    ] {
        let (few, many) = (fit_brdf(&tables, 8, 32), fit_brdf(&tables, 20, 32));
        for fit in [&few, &many] {
            let summary = fit.summary;
            assert!(summary.largest_chi_squared < 0.15, "{name}: {summary:?}");
            assert!(summary.largest_chi_squared_between < 0.15, "{name}: {summary:?}");
            assert!((summary.mean.energy_captured - 1.0).abs() < 0.03, "{name}: {summary:?}");
            assert!(fit.views.iter().all(|view| view.lobes.len() == fit.requested_lobes));
            let is_sound = |lobe: &Lobe| {
                lobe.axis.is_normalized() && lobe.bandwidth > 0.0 && lobe.amplitude >= 0.0
            };
            assert!(fit.views.iter().flat_map(|view| &view.lobes).all(is_sound));
        }
        let [few, many] = [few, many].map(|fit| fit.summary.mean);
        assert!(many.chi_squared < 1.01 * few.chi_squared, "{name}: {few:?} {many:?}");
        assert!(many.kullback_leibler < few.kullback_leibler, "{name}");
    }
}

#[test]
fn narrow_highlights_move_with_the_view() {
    // At alpha 0.02 the highlight is narrower than the step from view to view.
    let fit = fit_brdf(&conductor(0.02), 8, 32);
    assert!(fit.summary.largest_chi_squared_between < 0.2, "{:?}", fit.summary);
    let theta = 0.611_f32;
    let lobes = fit.lobes_at(theta);
    let mirror = Vec3::new(-theta.sin(), 0.0, theta.cos());
    let largest =
        lobes.iter().max_by(|a, b| lobe_integral(a).total_cmp(&lobe_integral(b))).unwrap();
    assert!(largest.axis.distance(mirror) < 0.02, "{largest:?}");
    // Beyond the first and last views, their lobes apply.
    assert_eq!(fit.lobes_at(0.0).len(), 8);
    assert_eq!(fit.lobes_at(PI / 2.0).len(), 8);
}

#[test]
fn hopeless_materials_are_refused() {
    let black = material(MaterialKind::Diffuse { reflectance: Vec3::ZERO });
    let options = BrdfOptions { lobes: 8, views: 4, method: Method::Em };
    assert_error(brdf_lobes(&black, 0, "black", options, None, &mut |_| ()), &["reflects nothing"]);
    // No light is sampled at glass and mirrors, and nothing there is to be fitted.
    let white = Vec3::ONE;
    for kind in [
        MaterialKind::Mirror { reflectance: white },
        MaterialKind::glass(1.5, 0.2),
        MaterialKind::pane(1.5, white),
    ] {
        assert_error(
            brdf_lobes(&material(kind), 0, "glass", options, None, &mut |_| ()),
            &["a mirror or glass"],
        );
    }
    let grey = material(MaterialKind::Diffuse { reflectance: Vec3::splat(0.5) });
    for (lobes, views) in [(0, 4), (100_000, 4), (8, 0), (8, 100_000)] {
        let options = BrdfOptions { lobes, views, method: Method::Em };
        let error = brdf_lobes(&grey, 0, "grey", options, None, &mut |_| ()).unwrap_err();
        assert_eq!(error.exit_status(), 2, "{error}");
    }
    assert_eq!(fit_brdf(&grey, 3, 1).views.len(), 1);
}

#[test]
fn squared_error_works_for_materials() {
    let tables = conductor(0.3);
    let options = |method| BrdfOptions { lobes: 4, views: 4, method };
    let fit = |method| brdf_lobes(&tables, 0, "t", options(method), None, &mut |_| ()).unwrap();
    let (em, l2) = (fit(Method::Em).summary.mean, fit(Method::L2).summary.mean);
    assert!(l2.relative_l2 < em.relative_l2, "{em:?} {l2:?}");
}

#[test]
fn real_maps_reach_their_quality() {
    for path in shared("scenes/env", &["hdr"]).iter().chain(&shared("data/env", &["hdr"])) {
        let target = EnvironmentMap::load(path, 1.0, &mut Vec::new()).unwrap();
        let is_uffizi = path.to_string_lossy().contains("uffizi");
        let mut last = f64::INFINITY;
        for (lobes, limit) in [(25, 10.0), (50, 10.0), (100, 0.25)] {
            let fit = fit_map(&target, lobes, Method::Em);
            let errors = fit.errors;
            assert!(errors.kullback_leibler < 1.01 * last, "{path:?} {lobes}: {errors:?}");
            last = errors.kullback_leibler;
            if is_uffizi {
                assert!(errors.chi_squared < limit, "{lobes}: {errors:?}");
            }
        }
    }
}

#[test]
fn measured_tables_reach_their_quality() {
    for path in shared("scenes/brdf", &["binary"]) {
        let table = Arc::new(MeasuredTable::load(&path).unwrap());
        let tables = material(MaterialKind::Measured { path: path.clone(), table });
        let few = fit_brdf(&tables, 8, 32).summary;
        let many = fit_brdf(&tables, 20, 32).summary;
        assert!(few.largest_chi_squared < 0.15, "{path:?}: {few:?}");
        assert!(many.largest_chi_squared < 1.01 * few.largest_chi_squared, "{path:?}: {many:?}");
    }
}

#[test]
fn limits_are_the_documented_ones() {
    assert_eq!((config::MAX_LOBES, config::MAX_VIEWS), (4096, 1024));
}
