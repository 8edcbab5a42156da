//! ꟻLIP: the difference that a person sees when two pictures take turns on a screen, 0…1.
//!
//! [Andersson et al. 2020], for display pictures (sRGB), seen from 0.7 m on a screen of 0.7 m and
//! 3840 pixels, as the paper's default. Values are those of the authors' implementation.

/// Pixels for each degree of the visual field: 0.7 m · 3840 / 0.7 m · π / 180.
const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;
/// Exponent of colour differences, q_c.
const COLOUR_EXPONENT: f64 = 0.7;
/// Exponent of feature differences, q_f.
const FEATURE_EXPONENT: f64 = 0.5;
/// Share of the largest colour difference, p_c, that is mapped to [`KNEE_VALUE`].
const KNEE: f64 = 0.4;
/// Value at the knee, p_t.
const KNEE_VALUE: f64 = 0.95;
/// Width of the feature detectors, degrees.
const FEATURE_WIDTH: f64 = 0.082;
/// Amplitudes and widths (a, b) of the contrast sensitivity's Gaussians: achromatic, red to green,
/// blue to yellow.
const SENSITIVITY: [[(f64, f64); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];
/// Widest b above, which gives the radius of the filters.
const WIDEST: f64 = 0.04;

type Colour = [f64; 3];

/// Linear Rec.709 to XYZ.
const XYZ: [Colour; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];
/// XYZ to linear Rec.709.
const RGB: [Colour; 3] = [
    [3.241_003_275_503_298_6, -1.537_398_934_307_396_6, -0.498_615_877_014_636_5],
    [-0.969_224_253_364_035_2, 1.875_929_974_156_126_6, 0.041_554_226_142_376_5],
    [0.055_639_419_742_175_9, -0.204_011_201_920_352_6, 1.057_148_971_875_138_8],
];

fn transform(matrix: &[Colour; 3], colour: Colour) -> Colour {
    matrix.map(|row| row[0] * colour[0] + row[1] * colour[1] + row[2] * colour[2])
}

fn white() -> Colour {
    transform(&XYZ, [1.0; 3])
}

fn linear(value: u8) -> f64 {
    let value = f64::from(value) / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// XYZ to the opponent space Y C_x C_z, a linear L*a*b*.
fn opponent(xyz: Colour) -> Colour {
    let white = white();
    let [x, y, z] = [xyz[0] / white[0], xyz[1] / white[1], xyz[2] / white[2]];
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_opponent([lightness, red, blue]: Colour) -> Colour {
    let white = white();
    let y = (lightness + 16.0) / 116.0;
    [(red / 500.0 + y) * white[0], y * white[1], (y - blue / 200.0) * white[2]]
}

/// Linear Rec.709 to L*a*b* with chroma that grows with lightness (the Hunt effect).
fn hunt_lab(rgb: Colour) -> Colour {
    const DELTA: f64 = 6.0 / 29.0;
    let compress = |t: f64| {
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let (xyz, white) = (transform(&XYZ, rgb), white());
    let [x, y, z] = [0, 1, 2].map(|axis| compress(xyz[axis] / white[axis]));
    let lightness = 116.0 * y - 16.0;
    let chroma = 0.01 * lightness;
    [lightness, chroma * 500.0 * (x - y), chroma * 200.0 * (y - z)]
}

/// HyAB distance to the power q_c.
fn colour_distance(a: Colour, b: Colour) -> f64 {
    let distance = (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2]);
    distance.powf(COLOUR_EXPONENT)
}

/// Convolves values, row by row, with `across(x)·down(y)`; the kernels have odd lengths, and pixels at the
/// edge continue beyond it.
fn filtered(values: &[f64], width: usize, across: &[f64], down: &[f64]) -> Vec<f64> {
    let height = values.len() / width;
    let near = |centre: usize, tap: usize, kernel: &[f64], end: usize| {
        (centre + tap).saturating_sub(kernel.len() / 2).min(end - 1)
    };
    let mut rows = vec![0.0; values.len()];
    for (index, value) in rows.iter_mut().enumerate() {
        let row = &values[index / width * width..][..width];
        let taps = across.iter().enumerate();
        *value = taps.map(|(tap, k)| k * row[near(index % width, tap, across, width)]).sum();
    }
    let at = |index: usize| -> f64 {
        let taps = down.iter().enumerate();
        taps.map(|(tap, k)| {
            k * rows[near(index / width, tap, down, height) * width + index % width]
        })
        .sum()
    };
    (0..rows.len()).map(at).collect()
}

/// Kernel of `weight(x)` for x = −radius…radius.
fn kernel(radius: i32, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    (-radius..=radius).map(|x| weight(f64::from(x))).collect()
}

/// Scales positive and negative weights so that each sum to ±1.
fn balanced(mut kernel: Vec<f64>) -> Vec<f64> {
    let sum = |sign: f64| kernel.iter().map(|k| (k * sign).max(0.0)).sum::<f64>();
    let (above, below) = (sum(1.0), sum(-1.0));
    for weight in &mut kernel {
        *weight /= if *weight > 0.0 { above } else { below.max(f64::MIN_POSITIVE) };
    }
    kernel
}

/// A picture as the eye compares it.
struct Seen {
    /// Colours after the contrast sensitivity filter, in [`hunt_lab`].
    colours: Vec<Colour>,
    /// Strength of edges and of points.
    features: Vec<[f64; 2]>,
}

impl Seen {
    fn of(pixels: &[[u8; 3]], width: usize) -> Self {
        let space: Vec<Colour> =
            pixels.iter().map(|pixel| opponent(transform(&XYZ, pixel.map(linear)))).collect();
        let [lightness, red, blue] = [0, 1, 2].map(|channel| {
            let values: Vec<f64> = space.iter().map(|colour| colour[channel]).collect();
            sensed(&values, width, &SENSITIVITY[channel])
        });
        let colours = (0..pixels.len())
            .map(|index| {
                let xyz = from_opponent([lightness[index], red[index], blue[index]]);
                hunt_lab(transform(&RGB, xyz).map(|value| value.clamp(0.0, 1.0)))
            })
            .collect();
        let grey: Vec<f64> = space.iter().map(|colour| (colour[0] + 16.0) / 116.0).collect();
        let sigma = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
        let radius = (3.0 * sigma).ceil() as i32;
        let bell = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
        let smooth = balanced(kernel(radius, bell));
        let strength = |detector: Vec<f64>| -> Vec<f64> {
            let across = filtered(&grey, width, &detector, &smooth);
            let down = filtered(&grey, width, &smooth, &detector);
            across.into_iter().zip(down).map(|(x, y)| x.hypot(y)).collect()
        };
        let edges = strength(balanced(kernel(radius, |x| -x * bell(x))));
        let points =
            strength(balanced(kernel(radius, |x| (x * x / (sigma * sigma) - 1.0) * bell(x))));
        Self { colours, features: edges.into_iter().zip(points).map(|(e, p)| [e, p]).collect() }
    }
}

/// Filters a channel by a sum of Gaussians `a·√(π/b)·exp(−π²·r²/b)`, r in degrees, that sums to 1.
fn sensed(values: &[f64], width: usize, gaussians: &[(f64, f64); 2]) -> Vec<f64> {
    use std::f64::consts::PI;
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let parts: Vec<(f64, Vec<f64>)> = gaussians
        .iter()
        .filter(|(a, _)| *a > 0.0)
        .map(|(a, b)| {
            let bell = kernel(radius, |x| (-(PI * x / PIXELS_PER_DEGREE).powi(2) / b).exp());
            let sum: f64 = bell.iter().sum();
            (a * (PI / b).sqrt() * sum * sum, balanced(bell))
        })
        .collect();
    let total: f64 = parts.iter().map(|(weight, _)| weight).sum();
    let mut result = vec![0.0; values.len()];
    for (weight, bell) in &parts {
        for (sum, value) in result.iter_mut().zip(filtered(values, width, bell, bell)) {
            *sum += weight / total * value;
        }
    }
    result
}

/// Computes ꟻLIP of every pixel of two display pictures of one size, row by row from the top.
///
/// # Panics
/// `width` is 0, or the pictures are not of one size in whole rows.
pub fn flip(picture: &[[u8; 3]], reference: &[[u8; 3]], width: usize) -> Vec<f64> {
    assert!(width > 0 && picture.len().is_multiple_of(width), "whole rows of {width} pixels");
    assert_eq!(picture.len(), reference.len(), "pictures of one size");
    let (ours, theirs) = (Seen::of(picture, width), Seen::of(reference, width));
    let largest = colour_distance(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0]));
    let knee = KNEE * largest;
    let compress = |distance: f64| {
        if distance < knee {
            KNEE_VALUE / knee * distance
        } else {
            KNEE_VALUE + (distance - knee) / (largest - knee) * (1.0 - KNEE_VALUE)
        }
    };
    let at = |index: usize| {
        let colour = compress(colour_distance(ours.colours[index], theirs.colours[index]));
        let [edges, points] =
            [0, 1].map(|kind| (ours.features[index][kind] - theirs.features[index][kind]).abs());
        let feature = (edges.max(points) / std::f64::consts::SQRT_2).powf(FEATURE_EXPONENT);
        colour.powf(1.0 - feature.min(1.0))
    };
    (0..picture.len()).map(at).collect()
}

/// Mean of [`flip`] over the pixels.
pub(crate) fn mean_flip(picture: &[[u8; 3]], reference: &[[u8; 3]], width: usize) -> f64 {
    flip(picture, reference, width).iter().sum::<f64>() / picture.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pictures with edges, points and colours, by integers alone.
    fn pictures() -> [Vec<[u8; 3]>; 2] {
        let pixel = |index: u32, salt: u32| {
            let (x, y) = (index % 32, index / 32);
            let noise = (index * 7919 + salt * 104_729) % 61 * salt;
            let base = if x > 15 { 170 } else { 40 };
            [base + y * 2, 90 + x * 3, 200 - y * 5].map(|value| (value + noise).min(255) as u8)
        };
        [0, 1].map(|salt| (0..32 * 24).map(|index| pixel(index, salt)).collect())
    }

    /// Expected values are of the authors' package flip-evaluator 1.7 (`ppd` 67.0206).
    #[test]
    fn values_are_those_of_the_authors() {
        let [reference, picture] = pictures();
        let map = flip(&picture, &reference, 32);
        for (index, expected) in EXPECTED {
            assert!((map[index] - expected).abs() < 2e-4, "{index}: {} {expected}", map[index]);
        }
        let mean = mean_flip(&picture, &reference, 32);
        assert!((mean - EXPECTED_MEAN).abs() < 1e-4, "{mean}");
    }

    #[test]
    fn flat_pictures_differ_by_the_formula_of_colours() {
        let flat = |pixel| vec![pixel; 20 * 20];
        // The largest distance by definition; black to white is 100 to the power 0.7.
        let largest = mean_flip(&flat([0, 255, 0]), &flat([0, 0, 255]), 20);
        assert!((largest - 1.0).abs() < 1e-6, "{largest}");
        let contrast = mean_flip(&flat([0; 3]), &flat([255; 3]), 20);
        assert!((contrast - EXPECTED_CONTRAST).abs() < 1e-4, "{contrast}");
        assert_eq!(mean_flip(&flat([9, 8, 7]), &flat([9, 8, 7]), 20), 0.0);
    }

    #[test]
    fn order_does_not_matter() {
        let [a, b] = pictures();
        assert_eq!(flip(&a, &b, 32), flip(&b, &a, 32));
    }
    const EXPECTED: [(usize, f64); 6] = [
        (0, 0.58073),
        (47, 0.45009),
        (300, 0.44522),
        (401, 0.43082),
        (555, 0.43978),
        (767, 0.46001),
    ];
    const EXPECTED_MEAN: f64 = 0.415947;
    const EXPECTED_CONTRAST: f64 = 0.967384;
}
