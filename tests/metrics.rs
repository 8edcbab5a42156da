//! Every metric on pictures small enough to work out by hand.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use fenestra::{
    Result,
    film::RgbImage,
    study::metrics::{Metrics, relative_squared_errors},
};

use crate::support::{assert_error, random::Random};

/// Compares a picture with a reference taken as exact.
fn against(picture: &RgbImage, reference: &RgbImage) -> Result<Metrics> {
    Metrics::of_halves(picture, reference, reference)
}

fn picture(width: u32, pixels: &[[f32; 3]]) -> RgbImage {
    let height = u32::try_from(pixels.len()).unwrap() / width;
    RgbImage { width, height, pixels: pixels.to_vec() }
}

/// 2×1 pixels. Reference (1,1,1), (3,3,3); picture off by (1,0,−1) and (0,0,2).
fn example() -> (RgbImage, RgbImage) {
    let reference = picture(2, &[[1.0; 3], [3.0; 3]]);
    (picture(2, &[[2.0, 1.0, 0.0], [3.0, 3.0, 5.0]]), reference)
}

#[test]
fn mse_rmse_mae_and_largest_error() {
    let (x, r) = example();
    let metrics = against(&x, &r).unwrap();
    // (2/3 + 4/3)/2; absolute errors 1, 0, 1, 0, 0, 2 over six.
    assert_eq!(metrics.errors.mse, 1.0);
    assert_eq!(metrics.errors.rmse, 1.0);
    assert_eq!(metrics.mae, 4.0 / 6.0);
    assert_eq!(metrics.max_error, 2.0);
}

#[test]
fn the_absolute_error_does_not_cancel() {
    let metrics =
        against(&picture(2, &[[0.0; 3], [2.0; 3]]), &picture(2, &[[1.0; 3], [1.0; 3]])).unwrap();
    assert_eq!(metrics.mae, 1.0);
    assert_eq!(metrics.mean_ratio, 1.0);
}

#[test]
fn mean_ratio_is_picture_over_reference() {
    let (x, r) = example();
    // (3 + 11)/(3 + 9).
    assert_eq!(against(&x, &r).unwrap().mean_ratio, 14.0 / 12.0);
    let black = picture(2, &[[0.0; 3]; 2]);
    assert_eq!(against(&black, &black).unwrap().mean_ratio, 1.0);
    assert_eq!(against(&x, &black).unwrap().mean_ratio, f64::INFINITY);
}

#[test]
fn psnr_takes_the_peak_of_the_reference() {
    let (x, r) = example();
    // peak 3, mse 1: 10·log₁₀ 9.
    assert!((against(&x, &r).unwrap().psnr - 9.542_425_094_393_248).abs() < 1e-12);
    assert_eq!(against(&r, &r).unwrap().psnr, f64::INFINITY);
}

#[test]
fn relmse_divides_by_the_filtered_reference() {
    let (x, r) = example();
    // Both windows hold both pixels: L = 2 = L̄, and the denominator is 4 + 0.04.
    let expected = (2.0 / 3.0 + 4.0 / 3.0) / 2.0 / 4.04;
    assert!((against(&x, &r).unwrap().errors.relmse - expected).abs() < 1e-15);
    let relative = relative_squared_errors(&x, &r, &r).unwrap();
    // (1 + 0 + 1)/3 and (0 + 0 + 4)/3.
    for (found, squared) in relative.iter().zip([2.0 / 3.0, 4.0 / 3.0]) {
        assert!((found - squared / 4.04).abs() < 1e-15);
    }
}

#[test]
fn relmse_filter_is_five_pixels_wide_and_ends_at_the_border() {
    // A row of seven with one bright pixel of grey 15 at index 3: L̄ = 15/7. Windows of index 0 to
    // 6 hold 3, 4, 5, 5, 5, 4, 3 pixels, and those of 0 and 6 miss the bright one.
    let mut pixels = [[0.0; 3]; 7];
    pixels[3] = [15.0; 3];
    let reference = picture(7, &pixels);
    let shifted: Vec<[f32; 3]> =
        pixels.iter().map(|pixel| pixel.map(|value| value + 1.0)).collect();
    let floor = 0.01 * (15.0_f64 / 7.0).powi(2);
    let local = [0.0, 15.0 / 4.0, 3.0, 3.0, 3.0, 15.0 / 4.0, 0.0_f64];
    let relative = relative_squared_errors(&picture(7, &shifted), &reference, &reference).unwrap();
    for (found, local) in relative.iter().zip(local) {
        let expected = 1.0 / (local * local + floor);
        assert!((found / expected - 1.0).abs() < 1e-14, "{found} against {expected}");
    }
    // The same picture as a column.
    let column = |pixels: &[[f32; 3]]| picture(1, pixels);
    let turned =
        relative_squared_errors(&column(&shifted), &column(&pixels), &column(&pixels)).unwrap();
    assert_eq!(turned, relative);
}

#[test]
fn relmse_of_a_black_reference_is_infinite_unless_the_picture_is_black() {
    let black = picture(1, &[[0.0; 3]]);
    assert_eq!(against(&black, &black).unwrap().errors.relmse, 0.0);
    assert_eq!(against(&picture(1, &[[1.0; 3]]), &black).unwrap().errors.relmse, f64::INFINITY);
}

#[test]
fn trimming_drops_one_pixel_in_a_thousand() {
    // 2000 pixels of reference 1 and error 1, but 10, 20 and 30 in three of them: without the two
    // worst, 1997·1 + 100 over 1998 remain, over the denominator 1.01.
    let reference = picture(50, &[[1.0; 3]; 2000]);
    let mut pixels = [[2.0; 3]; 2000];
    pixels[1234] = [11.0; 3];
    pixels[7] = [21.0; 3];
    pixels[1999] = [31.0; 3];
    let metrics = against(&picture(50, &pixels), &reference).unwrap();
    assert!((metrics.errors.relmse_trimmed - (1997.0 + 100.0) / 1998.0 / 1.01).abs() < 1e-12);
    let all = (1997.0 + 100.0 + 400.0 + 900.0) / 2000.0 / 1.01;
    assert!((metrics.errors.relmse - all).abs() < 1e-12);
    // The third largest of 2000 is the least value that 99.9% do not exceed.
    assert!((metrics.errors.relmse_p999 - 100.0 / 1.01).abs() < 1e-12);
    assert!((metrics.errors.relmse_max - 900.0 / 1.01).abs() < 1e-12);
    // Below a thousand pixels nothing is dropped.
    let (x, r) = example();
    let small = against(&x, &r).unwrap();
    assert_eq!(small.errors.relmse_trimmed, small.errors.relmse);
    assert_eq!([small.errors.relmse_p999, small.errors.relmse_max], [4.0 / 3.0 / 4.04; 2]);
}

#[test]
fn the_percentile_is_the_nearest_rank() {
    // Errors 1, 2, … over 1.01: of 999 none is dropped, of 1000 the largest is.
    let percentile = |count: u16| {
        let values = (1..=count).map(|value| [f32::from(value).sqrt() + 1.0; 3]);
        let pixels: Vec<[f32; 3]> = values.collect();
        let reference = picture(1, &vec![[1.0; 3]; pixels.len()]);
        1.01 * against(&picture(1, &pixels), &reference).unwrap().errors.relmse_p999
    };
    for (count, rank) in [(1, 1.0), (999, 999.0), (1000, 999.0), (1999, 1998.0), (2000, 1998.0)] {
        let found = percentile(count);
        assert!((found - rank).abs() < 1e-2, "{count}: {found}");
    }
}

#[test]
fn two_halves_take_the_product_of_the_differences() {
    // x = 2, r₁ = 1, r₂ = 4: (2 − 1)(2 − 4) = −2; the mean reference is 2.5.
    let [x, first, second] = [2.0, 1.0, 4.0].map(|value| picture(1, &[[value; 3]]));
    let metrics = Metrics::of_halves(&x, &first, &second).unwrap();
    assert_eq!(metrics.errors.mse, -2.0);
    assert_eq!(metrics.errors.rmse, 0.0);
    assert_eq!(metrics.mae, 0.5);
    assert_eq!(metrics.mean_ratio, 0.8);
    assert!((metrics.errors.relmse - -2.0 / (6.25 * 1.01)).abs() < 1e-15);
}

#[test]
fn two_halves_are_free_of_the_references_noise() {
    // Picture exactly 1, halves with independent noise of variance 1/12: the plain error against
    // their mean is 1/24 on average, the product of differences 0.
    let mut random = Random(1);
    let mut grey = || [random.uniform_f32() + 0.5; 3];
    let mut noisy = || picture(100, &(0..10_000).map(|_| grey()).collect::<Vec<_>>());
    let (first, second) = (noisy(), noisy());
    let exact = picture(100, &[[1.0; 3]; 10_000]);
    let halves = Metrics::of_halves(&exact, &first, &second).unwrap();
    let means: Vec<[f32; 3]> = first
        .pixels
        .iter()
        .zip(&second.pixels)
        .map(|(a, b)| std::array::from_fn(|channel| 0.5 * (a[channel] + b[channel])))
        .collect();
    let plain = against(&exact, &picture(100, &means)).unwrap();
    // Standard error of the product's mean is 1/12/√10000 = 8e-4.
    assert!(halves.errors.mse.abs() < 5.0 * 8.4e-4, "{}", halves.errors.mse);
    assert!((plain.errors.mse - 1.0 / 24.0).abs() < 3e-3, "{}", plain.errors.mse);
}

#[test]
fn pictures_that_cannot_be_compared_are_refused_with_both_sides_named() {
    let (x, r) = example();
    let other = picture(1, &[[1.0; 3], [1.0; 3]]);
    assert_error(against(&x, &other), &["2x1", "1x2"]);
    let mut broken = r.clone();
    broken.pixels[1][2] = f32::NAN;
    assert_error(against(&x, &broken), &["1 pixels of the reference", "at 1,0"]);
    assert_error(against(&broken, &r), &["of the picture"]);
    let empty = RgbImage { width: 0, height: 0, pixels: Vec::new() };
    assert_error(against(&empty, &empty), &["no pixels"]);
}
