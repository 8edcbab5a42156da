//! Block means of an image's independent replicates, for the z-tests of `statistics`.

use std::ops::Range;

use fenestra::{
    film::Sums,
    scene::Scene,
    session::{Renderer, Settings},
};
use glam::DVec3;

use super::statistics::{Comparison, Estimate, estimates};

/// Replicates on either side of a comparison.
pub const REPLICATES: u32 = 8;

/// Side of a block in pixels.
pub const BLOCK: u32 = 8;

/// Largest |t| allowed. A value of 8 + 8 replicates exceeds it with a chance of 3e-6.
pub const LIMIT: f64 = 7.5;

/// Averages radiance over every block of `edge` pixels, channels innermost, and over the whole film.
pub fn block_means(sums: &Sums, edge: u32) -> Vec<f64> {
    let blocks_per_row = sums.width / edge;
    let mut means = vec![0.0; 3 * (blocks_per_row * (sums.height / edge)) as usize];
    for pixel in 0..sums.pixel_count() {
        let (x, y) = (pixel as u32 % sums.width, pixel as u32 / sums.width);
        let block = (y / edge * blocks_per_row + x / edge) as usize;
        for (channel, value) in sums.mean(pixel).into_iter().enumerate() {
            means[3 * block + channel] += value / f64::from(edge * edge);
        }
    }
    means.push(means.iter().sum::<f64>() / means.len() as f64);
    means
}

/// Renders a picture per seed, each from nothing learned but what `prepare` gives the renderer, and
/// returns their means over blocks of `edge` pixels, the last over all.
pub fn rows(
    scene: &Scene,
    settings: &Settings,
    seeds: Range<u32>,
    samples: u32,
    edge: u32,
    prepare: impl Fn(&mut Renderer),
) -> Vec<Vec<f64>> {
    let mut renderer = super::renderer(scene, settings.clone());
    let rows = seeds
        .map(|seed| {
            renderer.restart(seed).unwrap();
            prepare(&mut renderer);
            renderer.render_pass(samples).unwrap();
            assert_eq!(renderer.totals().dropped_samples, 0);
            block_means(&renderer.sums().unwrap(), edge)
        })
        .collect();
    super::assert_silent();
    rows
}

/// Estimates the means over blocks and film from [`REPLICATES`] pictures with the seeds from `first_seed` on.
pub fn replicates(
    scene: &Scene,
    settings: &Settings,
    first_seed: u32,
    samples: u32,
) -> Vec<Estimate> {
    let seeds = first_seed..first_seed + REPLICATES;
    estimates(&rows(scene, settings, seeds, samples, BLOCK, |_| {}))
}

/// Averages the radiance of the film.
pub fn film_mean(sums: &Sums) -> DVec3 {
    let pixels = 0..sums.pixel_count();
    pixels.map(|pixel| DVec3::from(sums.mean(pixel))).sum::<DVec3>() / sums.pixel_count() as f64
}

/// Estimates the film's mean and its standard error from pictures with the seeds 0 to `seeds` − 1.
pub fn mean_and_error(scene: &Scene, settings: &Settings, samples: u32, seeds: u32) -> [DVec3; 2] {
    let mut renderer = super::renderer(scene, settings.clone());
    let mean = |seed| {
        renderer.restart(seed).unwrap();
        renderer.render_pass(samples).unwrap();
        let totals = renderer.totals();
        assert_eq!((totals.dropped_samples, totals.traversal_overruns), (0, 0));
        film_mean(&renderer.sums().unwrap()).to_array().to_vec()
    };
    let channels = estimates(&(0..seeds).map(mean).collect::<Vec<_>>());
    super::assert_silent();
    [|channel: &Estimate| channel.mean, Estimate::error]
        .map(|part| DVec3::from_array([0, 1, 2].map(|index| part(&channels[index]))))
}

/// Fails if estimates differ from those of a reference, or their sums by `tolerance` of the reference's.
pub fn assert_near(name: &str, values: &[Estimate], reference: &[Estimate], tolerance: f64) {
    let compared = Comparison::new(values, reference);
    eprintln!("{name}: {compared:?}");
    assert!(compared.largest_t < LIMIT, "{name}: {compared:?}");
    assert!((compared.ratio - 1.0).abs() < tolerance, "{name}: {compared:?}");
}

/// Fails if estimates differ from those of a reference, or if too much noise hides an error of a tenth and
/// their sums differ by more than `tolerance` of the reference's.
pub fn assert_same(name: &str, values: &[Estimate], reference: &[Estimate], tolerance: f64) {
    let compared = Comparison::new(values, reference);
    eprintln!("{name}: {compared:?}");
    assert!(compared.largest_t < LIMIT, "{name}: {compared:?}");
    let is_judged =
        compared.largest_t_with_bias > LIMIT || (compared.ratio - 1.0).abs() < tolerance;
    assert!(is_judged, "{name}: too noisy to judge, {compared:?}");
}
