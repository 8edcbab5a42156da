//! Random numbers: stratification, uniformity, independence, and the shader twin bit for bit.

use fenestra::math::random::{random_independent_1d, random_independent_2d};

use crate::{
    support::{
        self,
        statistics::{chi_square_p_value, z_p_value},
    },
    twin::random::{random_1d, random_2d},
};

/// Chance of a false alarm: a test fails by chance for less than one seed in a million.
const FALSE_ALARM: f64 = 1e-6;

#[test]
fn aligned_powers_of_two_are_nets_in_every_elementary_interval() {
    for (pixel, dimension, seed) in [(0, 0, 0), (17, 3, 1), (1 << 21, 40, 9), (u32::MAX, 7, 5)] {
        for bits in 0..=10 {
            let count = 1_u32 << bits;
            for run in [0_u32, 1, 5, (1 << (32 - bits.max(1))) - 1] {
                let points: Vec<[f32; 2]> = (0..count)
                    .map(|i| random_2d(pixel, run.wrapping_mul(count) + i, dimension, seed))
                    .collect();
                for x_bits in 0..=bits {
                    let (columns, rows) = (1_u32 << x_bits, 1_u32 << (bits - x_bits));
                    let mut occupied = vec![false; count as usize];
                    for [x, y] in &points {
                        let column = (x * columns as f32) as u32;
                        let row = (y * rows as f32) as u32;
                        let interval = &mut occupied[(row * columns + column) as usize];
                        assert!(
                            !*interval,
                            "two of {count} samples share an interval of {columns}×{rows}"
                        );
                        *interval = true;
                    }
                }
            }
        }
    }
}

#[test]
fn numbers_are_below_one_and_on_the_grid() {
    for i in 0..200_000_u32 {
        let sample = i.wrapping_mul(0x9e37_79b1);
        for value in
            random_2d(i, sample, 1, 2).into_iter().chain(random_independent_2d(i, sample, 1, 2))
        {
            assert!((0.0..1.0).contains(&value));
            assert_eq!(value * 16_777_216.0, (value * 16_777_216.0).trunc());
        }
        assert_eq!(random_1d(i, sample, 1, 2), random_2d(i, sample, 1, 2)[0]);
        assert_eq!(
            random_independent_1d(i, sample, 1, 2),
            random_independent_2d(i, sample, 1, 2)[0]
        );
    }
}

/// Returns the p-value of χ² for points on a 16×16 grid.
fn grid_p_value(points: impl Iterator<Item = [f32; 2]>) -> f64 {
    let mut counts = vec![0.0; 256];
    for [x, y] in points {
        counts[(y * 16.0) as usize * 16 + (x * 16.0) as usize] += 1.0;
    }
    chi_square_p_value(&counts, &[1.0; 256])
}

#[test]
fn one_sample_of_many_pixels_dimensions_or_seeds_is_uniform() {
    // Any one sample index must be uniform over each key of the scramble: that alone makes an estimate
    // unbiased.
    for sample in [0, 1, 2, 63, 1000, u32::MAX] {
        for kind in [random_2d, random_independent_2d] {
            for p in [
                grid_p_value((0..40_000).map(|pixel| kind(pixel, sample, 0, 0))),
                grid_p_value((0..40_000).map(|dimension| kind(5, sample, dimension, 0))),
                grid_p_value((0..40_000).map(|seed| kind(5, sample, 2, seed))),
            ] {
                assert!(p > FALSE_ALARM, "sample {sample}: p = {p:e}");
            }
        }
    }
    let p = grid_p_value((0..40_000).map(|sample| random_independent_2d(3, sample, 2, 1)));
    assert!(p > FALSE_ALARM, "independent samples of one pixel: p = {p:e}");
}

/// Returns the p-value of the correlation of `pairs`. If their members are independent and uniform,
/// the centred product has mean 0 and variance 1/144.
fn correlation_p_value(pairs: impl Iterator<Item = (f32, f32)>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in pairs {
        sum += (f64::from(a) - 0.5) * (f64::from(b) - 0.5);
        count += 1.0;
    }
    z_p_value(sum * 12.0 / f64::sqrt(count))
}

#[test]
fn neighbouring_pixels_dimensions_seeds_and_samples_are_uncorrelated() {
    let count = 100_000;
    for kind in [random_2d, random_independent_2d] {
        for bit in 0..16 {
            // Compare keys that differ in one bit.
            let step = 1 << bit;
            let cases: [(&str, [u32; 4]); 3] = [
                ("pixels", [step, 0, 0, 0]),
                ("dimensions", [0, 0, step, 0]),
                ("seeds", [0, 0, 0, step]),
            ];
            for (name, [pixel, _, dimension, seed]) in cases {
                for (a, b) in [(0, 0), (0, 1), (1, 1)] {
                    let p = correlation_p_value((0..count).map(|i| {
                        let (first, second) =
                            (kind(i, 3, 5, 7), kind(i ^ pixel, 3, 5 ^ dimension, 7 ^ seed));
                        (first[a], second[b])
                    }));
                    assert!(p > FALSE_ALARM, "{name} that differ by {step}: p = {p:e}");
                }
            }
        }
    }
    for lag in [1, 2, 3, 7, 64] {
        let p =
            correlation_p_value((0..count).map(|i| {
                (random_independent_1d(1, i, 0, 0), random_independent_1d(1, i + lag, 0, 0))
            }));
        assert!(p > FALSE_ALARM, "independent samples {lag} apart: p = {p:e}");
        let p = correlation_p_value((0..count).map(|pixel| {
            (random_independent_1d(pixel, 9, 0, 0), random_independent_1d(pixel, 9 + lag, 0, 0))
        }));
        assert!(p > FALSE_ALARM, "independent samples {lag} apart across pixels: p = {p:e}");
    }
}

#[test]
fn dimensions_of_one_pixel_pair_up_as_independent_points_do() {
    // Pair the first numbers of two dimensions over the samples of single pixels: padded sequences
    // must fill the square, not a diagonal.
    for (a, b) in [(0, 1), (1, 2), (0, 8), (3, 250)] {
        let mut points = Vec::new();
        for pixel in 0..256 {
            points
                .extend((0..256).map(|sample| {
                    [random_1d(pixel, sample, a, 0), random_1d(pixel, sample, b, 0)]
                }));
        }
        let p = grid_p_value(points.into_iter());
        assert!(p > FALSE_ALARM, "dimensions {a} and {b}: p = {p:e}");
    }
}

#[test]
fn the_mean_over_scrambles_is_unbiased_and_converges_faster_than_independent_numbers() {
    // Integrate the indicator of a disc, one replicate of 64 samples per seed.
    let truth = std::f64::consts::FRAC_PI_4;
    let replicates = |kind: fn(u32, u32, u32, u32) -> [f32; 2]| -> Vec<f64> {
        (0..4000)
            .map(|seed| {
                let inside = (0..64).filter(|&sample| {
                    let [x, y] = kind(11, sample, 4, seed);
                    x * x + y * y < 1.0
                });
                inside.count() as f64 / 64.0
            })
            .collect()
    };
    let variance = |values: &[f64]| {
        values.iter().map(|value| (value - truth).powi(2)).sum::<f64>() / values.len() as f64
    };
    let (stratified, independent) = (replicates(random_2d), replicates(random_independent_2d));
    for values in [&stratified, &independent] {
        let z = support::statistics::z_of_mean(values, truth);
        assert!(z_p_value(z) > FALSE_ALARM, "z = {z}");
    }
    // Independent: π/4 (1 − π/4) / 64 = 0.00263. A net is about ten times better here.
    assert!((variance(&independent) / 0.002_633 - 1.0).abs() < 0.15);
    assert!(variance(&stratified) < variance(&independent) / 5.0);
}

#[test]
fn the_shader_draws_the_same_numbers_bit_for_bit() {
    let mut keys: Vec<[u32; 4]> = Vec::new();
    for i in 0..20_000_u32 {
        keys.push(fenestra::math::random::hash_4d([i, 1, 2, 3]));
        keys.push([i % 640, i, i % 37, 1]);
    }
    keys.push([u32::MAX; 4]);
    keys.push([0; 4]);
    let output: Vec<[f32; 6]> = support::run_probe("random", &[], &[], &keys);
    for (&[pixel, sample, dimension, seed], shader) in keys.iter().zip(output) {
        let stratified = random_2d(pixel, sample, dimension, seed);
        let independent = random_independent_2d(pixel, sample, dimension, seed);
        let host = [
            stratified[0],
            stratified[1],
            random_1d(pixel, sample, dimension, seed),
            independent[0],
            independent[1],
            random_independent_1d(pixel, sample, dimension, seed),
        ];
        assert_eq!(
            host.map(f32::to_bits),
            shader.map(f32::to_bits),
            "pixel {pixel}, sample {sample}, dimension {dimension}, seed {seed}"
        );
    }
}
