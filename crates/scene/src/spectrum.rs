//! Reflectance spectra → linear sRGB by the CIE 1931 standard observer under illuminant D65.

use glam::{DMat3, DVec3, dvec3};

/// First wavelength of [`COLOUR_MATCHING`], nm.
const FIRST_NM: f64 = 380.0;
/// Spacing of its rows, nm.
const STEP_NM: f64 = 10.0;

/// Colour matching functions x̄, ȳ, z̄ of the CIE 1931 standard observer (2°), 380 to 780 nm by 10:
/// \[CIE 015:2018\], table of the 1931 observer.
const COLOUR_MATCHING: [[f64; 3]; 41] = [
    [0.001368, 0.000039, 0.006450],
    [0.004243, 0.000120, 0.020050],
    [0.014310, 0.000396, 0.067850],
    [0.043510, 0.001210, 0.207400],
    [0.134380, 0.004000, 0.645600],
    [0.283900, 0.011600, 1.385600],
    [0.348280, 0.023000, 1.747060],
    [0.336200, 0.038000, 1.772110],
    [0.290800, 0.060000, 1.669200],
    [0.195360, 0.090980, 1.287640],
    [0.095640, 0.139020, 0.812950],
    [0.032010, 0.208020, 0.465180],
    [0.004900, 0.323000, 0.272000],
    [0.009300, 0.503000, 0.158200],
    [0.063270, 0.710000, 0.078250],
    [0.165500, 0.862000, 0.042160],
    [0.290400, 0.954000, 0.020300],
    [0.433450, 0.994950, 0.008750],
    [0.594500, 0.995000, 0.003900],
    [0.762100, 0.952000, 0.002100],
    [0.916300, 0.870000, 0.001650],
    [1.026300, 0.757000, 0.001100],
    [1.062200, 0.631000, 0.000800],
    [1.002600, 0.503000, 0.000340],
    [0.854450, 0.381000, 0.000190],
    [0.642400, 0.265000, 0.000050],
    [0.447900, 0.175000, 0.000020],
    [0.283500, 0.107000, 0.000000],
    [0.164900, 0.061000, 0.000000],
    [0.087400, 0.032000, 0.000000],
    [0.046770, 0.017000, 0.000000],
    [0.022700, 0.008210, 0.000000],
    [0.011359, 0.004102, 0.000000],
    [0.005790, 0.002091, 0.000000],
    [0.002899, 0.001047, 0.000000],
    [0.001440, 0.000520, 0.000000],
    [0.000690, 0.000249, 0.000000],
    [0.000332, 0.000120, 0.000000],
    [0.000166, 0.000060, 0.000000],
    [0.000083, 0.000030, 0.000000],
    [0.000042, 0.000015, 0.000000],
];

/// Relative spectral power of the CIE standard illuminant D65, 380 to 780 nm by 10: \[ISO/CIE
/// 11664-2:2022\].
const ILLUMINANT_D65: [f64; 41] = [
    49.9755, 54.6482, 82.7549, 91.4860, 93.4318, 86.6823, 104.8650, 117.0080, 117.8120, 114.8610,
    115.9230, 108.8110, 109.3540, 107.8020, 104.7900, 107.6890, 104.4050, 104.0460, 100.0000,
    96.3342, 95.7880, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268, 80.2146,
    82.2778, 78.2842, 69.7213, 71.6091, 74.3490, 61.6040, 69.8856, 75.0870, 63.5927, 46.4182,
    66.8054, 63.3828,
];

/// Linear sRGB from XYZ, by columns: the inverse matrix of \[IEC 61966-2-1:1999\].
const SRGB_FROM_XYZ: DMat3 = DMat3::from_cols(
    dvec3(3.2406, -0.9689, 0.0557),
    dvec3(-1.5372, 1.8758, -0.2040),
    dvec3(-0.4986, 0.0415, 1.0570),
);

/// x̄, ȳ, z̄ times the illuminant at a wavelength in nm: linear between rows, 0 outside them.
fn weighted_colour_matching(wavelength_nm: f64) -> DVec3 {
    let position = (wavelength_nm - FIRST_NM) / STEP_NM;
    let last = COLOUR_MATCHING.len() - 1;
    if !(0.0..=last as f64).contains(&position) {
        return DVec3::ZERO;
    }
    let row = (position as usize).min(last - 1);
    let at = |row: usize| DVec3::from(COLOUR_MATCHING[row]) * ILLUMINANT_D65[row];
    at(row).lerp(at(row + 1), position - row as f64)
}

/// Weights w such that Σ w_j·s(λ_j) is the linear sRGB colour of a reflectance spectrum s sampled
/// at increasing wavelengths: ∫ s·D65·(x̄, ȳ, z̄) dλ / ∫ D65·ȳ dλ by the trapezoid rule, converted
/// to sRGB. `None` if no wavelength is visible.
///
/// Deviation: pbrt-v2 integrates without an illuminant, which turns a grey reflectance into (1.20,
/// 0.95, 0.91) of its value. Scene lights are colours whose white is D65, so a grey surface must
/// stay grey.
pub fn srgb_weights(wavelengths_nm: &[f64]) -> Option<Vec<DVec3>> {
    let count = wavelengths_nm.len();
    let weighted: Vec<DVec3> = (0..count)
        .map(|index| {
            let before = wavelengths_nm[index.saturating_sub(1)];
            let after = wavelengths_nm[(index + 1).min(count - 1)];
            let width = if count == 1 { 1.0 } else { 0.5 * (after - before) };
            weighted_colour_matching(wavelengths_nm[index]) * width
        })
        .collect();
    let luminous: f64 = weighted.iter().map(|xyz| xyz.y).sum();
    (luminous > 0.0)
        .then(|| weighted.into_iter().map(|xyz| SRGB_FROM_XYZ * xyz / luminous).collect())
}

/// Linear sRGB colour, of luminance 1, of light whose spectral power at a wavelength in nm is `power`,
/// by sums at every nanometre. `None` if nothing of it is visible.
pub fn light_color(power: impl Fn(f64) -> f64) -> Option<DVec3> {
    let last = COLOUR_MATCHING.len() - 1;
    let xyz: DVec3 = (0..last * STEP_NM as usize)
        .map(|index| {
            let position = index as f64 / STEP_NM;
            let row = position as usize;
            let [low, high] = [row, row + 1].map(|row| DVec3::from(COLOUR_MATCHING[row]));
            low.lerp(high, position - row as f64) * power(FIRST_NM + index as f64)
        })
        .sum();
    (xyz.y > 0.0 && xyz.is_finite()).then(|| SRGB_FROM_XYZ * xyz / xyz.y)
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    /// The white of sRGB is D65: a grey reflectance stays grey, to the digits of the matrix.
    #[test]
    fn constant_spectrum_is_white() {
        let wavelengths: Vec<f64> = (0..41).map(|index| 380.0 + 10.0 * f64::from(index)).collect();
        let colour: DVec3 = srgb_weights(&wavelengths).unwrap().iter().sum();
        assert!((colour - DVec3::ONE).abs().max_element() < 2e-3, "{colour}");
    }

    #[test]
    fn light_of_the_illuminant_is_white() {
        let row = |nm: f64| ((nm - FIRST_NM) / STEP_NM) as usize;
        let color = light_color(|nm| {
            let position = (nm - FIRST_NM) / STEP_NM;
            let [low, high] = [row(nm), row(nm) + 1].map(|row| ILLUMINANT_D65[row]);
            low + (high - low) * position.fract()
        });
        assert!((color.unwrap() - DVec3::ONE).abs().max_element() < 5e-3, "{color:?}");
        assert!(light_color(|_| 0.0).is_none());
    }

    /// A spectrum sampled twice as finely has the same colour.
    #[test]
    fn colour_does_not_depend_on_the_spacing() {
        let spectrum = |nm: f64| 0.2 + 0.1 * ((nm - 400.0) / 60.0).sin();
        let colour = |step: usize| -> DVec3 {
            let wavelengths: Vec<f64> = (400..=700).step_by(step).map(|nm| nm as f64).collect();
            let weights = srgb_weights(&wavelengths).unwrap();
            weights.iter().zip(&wavelengths).map(|(weight, &nm)| *weight * spectrum(nm)).sum()
        };
        let difference = (colour(10) - colour(5)).abs().max_element();
        assert!(difference < 1e-3, "{difference}");
    }

    #[test]
    fn wavelengths_outside_the_visible_range_are_refused() {
        assert!(srgb_weights(&[1000.0, 1100.0]).is_none());
    }
}
