//! Scenes whose picture is known in closed form, rendered with every sampler.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

mod support;

use fenestra::{film::Sums, pass::Roulette, renderer::Settings, sampler::Sampler, scene::Scene};
use glam::{DVec3, Vec3};
use support::{
    scenes::{self, diffuse},
    statistics::{Estimate, estimates},
};

fn render(scene: &Scene, settings: Settings, samples: u32) -> Sums {
    let (sums, totals) = support::render(scene, settings, samples);
    assert_eq!(totals.dropped_samples, 0);
    sums
}

fn image_mean(sums: &Sums) -> DVec3 {
    (0..sums.pixel_count()).map(|pixel| DVec3::from(sums.mean(pixel))).sum::<DVec3>()
        / sums.pixel_count() as f64
}

/// Estimates the image's mean and its standard error, per channel, from independent renders.
fn mean_and_error(scene: &Scene, settings: &Settings, samples: u32, seeds: u32) -> [DVec3; 2] {
    let mut renderer = support::renderer(scene, settings.clone());
    let means: Vec<Vec<f64>> = (0..seeds)
        .map(|seed| {
            renderer.restart(seed).unwrap();
            renderer.render_pass(samples).unwrap();
            image_mean(&renderer.sums().unwrap()).to_array().to_vec()
        })
        .collect();
    support::assert_silent();
    let channels = estimates(&means);
    [|channel: &Estimate| channel.mean, Estimate::error]
        .map(|part| DVec3::from_array([0, 1, 2].map(|index| part(&channels[index]))))
}

#[test]
fn without_shadow_rays_only_the_environment_is_seen() {
    let _alone = support::alone();
    let scene = scenes::convex_furnace(diffuse(Vec3::splat(0.5)), Vec3::new(1.0, 2.0, 3.0));
    let sums = render(&scene, Settings { shadow_rays: 0, ..Settings::default() }, 1);
    let background = sums.mean(0);
    assert!((DVec3::from(background) - DVec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-5);
    assert_eq!(sums.mean(sums.pixel_count() / 2 + 12), [0.0; 3]);
}

#[test]
fn a_convex_diffuse_body_in_a_furnace_is_its_reflectance() {
    let _alone = support::alone();
    let reflectance = Vec3::new(0.2, 0.5, 1.0);
    let radiance = Vec3::new(3.0, 2.0, 1.0);
    let scene = scenes::convex_furnace(diffuse(reflectance), radiance);
    // Samplers proportional to the cosine have no variance here, in any pixel with any seed.
    for sampler in [Sampler::Cosine, Sampler::Brdf] {
        let sums = render(&scene, Settings { sampler, ..Settings::default() }, 2);
        let expected = (reflectance * radiance).as_dvec3();
        for pixel in 0..sums.pixel_count() {
            let mean = DVec3::from(sums.mean(pixel));
            let is_background = (mean - radiance.as_dvec3()).abs().max_element() < 1e-4;
            let is_body = (mean - expected).abs().max_element() < 1e-4;
            // A pixel on the silhouette is the mean of both, by a box filter over two samples.
            let is_edge =
                (mean - 0.5 * (expected + radiance.as_dvec3())).abs().max_element() < 1e-4;
            assert!(is_background || is_body || is_edge, "{} {pixel}: {mean}", sampler.name());
        }
        assert!((DVec3::from(sums.mean(8 * 24 + 12)) - expected).abs().max_element() < 1e-4);
    }
}

#[test]
fn irradiance_of_a_plane_is_the_integral_of_the_map() {
    let _alone = support::alone();
    // Integrate the map itself in f64, bilinear as the renderer sees it.
    let reflectance = Vec3::new(0.3, 0.6, 0.9);
    let scene = scenes::plane(reflectance, scenes::sky());
    let steps = 1024;
    let mut irradiance = DVec3::ZERO;
    for i in 0..steps {
        for j in 0..steps {
            let cos_theta = ((f64::from(i) + 0.5) / f64::from(steps)).sqrt();
            let phi = std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(steps);
            let sin_theta = (1.0 - cos_theta * cos_theta).sqrt();
            let direction = DVec3::new(sin_theta * phi.cos(), cos_theta, sin_theta * phi.sin());
            irradiance += scene.environment.radiance(direction.as_vec3()).as_dvec3();
        }
    }
    irradiance *= std::f64::consts::PI / f64::from(steps * steps);
    let expected = reflectance.as_dvec3() * irradiance / std::f64::consts::PI;
    for &sampler in Sampler::ALL {
        let settings = Settings { sampler, ..Settings::default() };
        let [mean, error] = mean_and_error(&scene, &settings, 16, 12);
        let z = (mean - expected) / error;
        // 27 comparisons with 11 degrees of freedom: |t| > 7 has a chance of 6e-4 in all. The
        // quadrature is good to 1e-4.
        let close = (mean / expected - 1.0).abs().max_element() < 2e-4;
        assert!(
            z.abs().max_element() < 7.0 || close,
            "{}: {mean} against {expected}, z {z}",
            sampler.name()
        );
        let relative_error = (error / expected).max_element();
        assert!(relative_error < 0.03, "{}: error {relative_error}", sampler.name());
    }
}

#[test]
fn a_concave_white_body_vanishes_in_the_furnace() {
    let _alone = support::alone();
    let scene = scenes::concave_furnace();
    let settings = Settings { depth: 24, roulette: Roulette::NEVER, ..Settings::default() };
    for sampler in [Sampler::Cosine, Sampler::Mis, Sampler::Ris] {
        let sums = render(&scene, Settings { sampler, ..settings.clone() }, 64);
        let mean = image_mean(&sums);
        // The crevice between sphere and box holds a little light beyond 24 vertices.
        assert!((mean - 1.0).abs().max_element() < 4e-3, "{}: {mean}", sampler.name());
        for pixel in 0..sums.pixel_count() {
            let value = sums.mean(pixel)[1];
            assert!((0.7..1.3).contains(&value), "{} pixel {pixel}: {value}", sampler.name());
        }
    }
    // With direct light alone the crevice is dark, so the test above depends on bounces.
    let direct = image_mean(&render(&scene, Settings::default(), 64));
    assert!(direct.x < 0.99, "{direct}");
}

#[test]
fn roulette_keeps_the_mean() {
    let _alone = support::alone();
    let scene = scenes::concave_furnace();
    let settings = Settings {
        depth: 24,
        roulette: Roulette { vertex: 2, throughput: 1.0 },
        ..Settings::default()
    };
    let mut scene = scene;
    scene.materials = vec![diffuse(Vec3::splat(0.7))];
    let [with, with_error] = mean_and_error(&scene, &settings, 32, 8);
    let without = Settings { roulette: Roulette::NEVER, ..settings };
    let [without, without_error] = mean_and_error(&scene, &without, 32, 8);
    let z = (with.x - without.x) / with_error.x.hypot(without_error.x);
    assert!(z.abs() < 6.0, "{with} against {without}, z {z}");
}

/// A million samples per pixel in a film of 4×4: sums of floats that did not carry their rounding
/// errors would drift by 1e-3 and stop growing at 2²⁴ times a sample.
#[test]
#[ignore = "takes minutes: cargo test --release --test closed_form -- --ignored --nocapture"]
fn a_million_samples_do_not_drift() {
    const MILLION: u32 = 1_000_000;
    let _alone = support::alone();
    let reflectance = Vec3::new(0.2, 0.5, 0.9);
    let mut scene = scenes::plane(reflectance, scenes::environment(16, |_| Vec3::ONE));
    (scene.film.width, scene.film.height) = (4, 4);
    // No variance: what differs from the reflectance is rounding.
    let sums =
        render(&scene, Settings { sampler: Sampler::Cosine, ..Settings::default() }, MILLION);
    let expected = reflectance.as_dvec3();
    let drift = (0..sums.pixel_count())
        .map(|pixel| (DVec3::from(sums.mean(pixel)) / expected - 1.0).abs().max_element())
        .fold(0.0, f64::max);
    eprintln!("cosine, constant map: largest drift {drift:.1e}");
    assert!(drift < 1e-6, "{drift}");
    // Pixels see the same plane: their spread is that of independent means of a million samples.
    for sampler in [Sampler::Mis, Sampler::Guided] {
        let sums = render(&scene, Settings { sampler, ..Settings::default() }, MILLION);
        let means: Vec<DVec3> =
            (0..sums.pixel_count()).map(|pixel| DVec3::from(sums.mean(pixel)) / expected).collect();
        let mean = means.iter().sum::<DVec3>() / means.len() as f64;
        let square = means.iter().map(|found| (*found - mean).powf(2.0)).sum::<DVec3>();
        let error = (square / (means.len() * (means.len() - 1)) as f64).map(f64::sqrt);
        let z = (mean - 1.0) / error;
        eprintln!("{}: mean {mean} ± {error}, z {z:.2}", sampler.name());
        // Two samplers of three channels with 15 degrees of freedom: |t| > 6 has a chance of 2e-4.
        // Floats of a sample's weight are good to 1e-6.
        let is_close = (mean - 1.0).abs().max_element() < 1e-6;
        assert!(z.abs().max_element() < 6.0 || is_close, "{}: {mean}, z {z}", sampler.name());
    }
}
