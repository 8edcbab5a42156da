//! A nearly closed room, where few rays see the light: the worst pixels of `guided` are not clearly
//! worse than those of `mis`, and its picture is better.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::path::Path;

use fenestra::{
    film::RgbImage,
    sampler::{Parameters, Sampler},
    scene::Scene,
    session::{Figures, Settings},
    study::metrics,
};

use crate::support;

const SAMPLES: u32 = 64;
const REPLICATES: u32 = 8;

/// Renders pictures with seeds of their own, each learned from nothing, and counts the rays traced.
fn pictures(scene: &Scene, sampler: Sampler, candidates: u32) -> (Vec<RgbImage>, f64) {
    let parameters = Parameters { candidates: Some(candidates), ..Parameters::default() };
    let settings = Settings { sampler, parameters, ..Settings::default() };
    let mut renderer = support::renderer(scene, settings);
    let mut rays = 0;
    let pictures = (0..REPLICATES)
        .map(|seed| {
            renderer.restart(seed).unwrap();
            renderer.render_pass(SAMPLES).unwrap();
            rays += renderer.totals().shadow_rays_traced;
            let sums = renderer.sums().unwrap();
            let pixels = (0..sums.pixel_count())
                .map(|pixel| sums.mean(pixel).map(|value| value as f32))
                .collect();
            RgbImage { width: sums.width, height: sums.height, pixels }
        })
        .collect();
    let share = Figures::of(&renderer, 1.0).statistics.get("guide_rebuild_share").copied();
    assert_eq!(share.is_some_and(|share| share > 0.0), sampler == Sampler::Guided, "{share:?}");
    support::assert_silent();
    (pictures, rays as f64)
}

fn mean(pictures: &[&[RgbImage]]) -> RgbImage {
    let all: Vec<&RgbImage> = pictures.iter().copied().flatten().collect();
    let value = |pixel: usize, channel: usize| {
        let sum: f64 = all.iter().map(|image| f64::from(image.pixels[pixel][channel])).sum();
        (sum / all.len() as f64) as f32
    };
    let pixels = (0..all[0].pixels.len())
        .map(|pixel| std::array::from_fn(|channel| value(pixel, channel)))
        .collect();
    RgbImage { width: all[0].width, height: all[0].height, pixels }
}

/// Returns the relative squared errors of all pictures' pixels in ascending order.
fn errors(pictures: &[RgbImage], reference: &RgbImage) -> Vec<f64> {
    let mut all: Vec<f64> = pictures
        .iter()
        .flat_map(|picture| {
            metrics::relative_squared_errors(picture, reference, reference).unwrap()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all
}

#[test]
fn fireflies_are_no_worse_than_those_of_mis() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/studies/shutters.toml");
    let mut scene = Scene::load(&path).unwrap();
    (scene.film.width, scene.film.height) = (32, 24);
    let (mis, mis_rays) = pictures(&scene, Sampler::Mis, 1);
    let (one, one_rays) = pictures(&scene, Sampler::Guided, 1);
    let (four, four_rays) = pictures(&scene, Sampler::Guided, 4);
    let reference = mean(&[&mis, &one, &four]);
    let figures = |pictures: &[RgbImage]| {
        let errors = errors(pictures, &reference);
        let relmse = errors.iter().sum::<f64>() / errors.len() as f64;
        let kept = errors.len() - errors.len() / 1000;
        (relmse, errors[kept - 1], errors[errors.len() - 1])
    };
    let (relmse, p999, max) = figures(&mis);
    eprintln!("mis: relMSE {relmse:.4}, 99.9% {p999:.2}, largest {max:.1}, {mis_rays} rays");
    for (pictures, rays) in [(&one, one_rays), (&four, four_rays)] {
        let (ours, our_p999, our_max) = figures(pictures);
        eprintln!("guided: {ours:.4}, {our_p999:.2}, {our_max:.1}, {rays} rays");
        // This mean includes all fireflies.
        assert!(ours < relmse, "relMSE {ours} against {relmse}");
        assert!(our_p999 < 2.0 * p999, "99.9% {our_p999} against {p999}");
        assert!(rays < 1.5 * mis_rays, "{rays} against {mis_rays} rays");
    }
}
