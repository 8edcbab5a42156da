//! Reflectance spectra → linear sRGB by the CIE 1931 standard observer.

use glam::{DMat3, DVec3, dvec3};

/// First wavelength of [`COLOUR_MATCHING`], nm.
const FIRST_NM: f64 = 380.0;
/// Distance of its rows, nm.
const STEP_NM: f64 = 10.0;

/// Colour matching functions x̄, ȳ, z̄ of the CIE 1931 standard observer (2°), 380 to 780 nm by 10:
/// CIE 015:2018, Colorimetry, table of the 1931 observer, every second row.
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

/// Linear sRGB from XYZ: IEC 61966-2-1:1999, rows of the inverse of its matrix, by columns.
const SRGB_FROM_XYZ: DMat3 = DMat3::from_cols(
    dvec3(3.2406, -0.9689, 0.0557),
    dvec3(-1.5372, 1.8758, -0.2040),
    dvec3(-0.4986, 0.0415, 1.0570),
);

/// x̄, ȳ, z̄ at a wavelength in nm, linear between the rows and 0 outside them.
fn colour_matching(wavelength_nm: f64) -> DVec3 {
    let position = (wavelength_nm - FIRST_NM) / STEP_NM;
    let last = COLOUR_MATCHING.len() - 1;
    if !(0.0..=last as f64).contains(&position) {
        return DVec3::ZERO;
    }
    let row = (position as usize).min(last - 1);
    DVec3::from(COLOUR_MATCHING[row])
        .lerp(DVec3::from(COLOUR_MATCHING[row + 1]), position - row as f64)
}

/// Weights w such that Σ w_j·s(λ_j) is the linear sRGB colour of a spectrum s sampled at increasing
/// wavelengths: ∫ s·(x̄, ȳ, z̄) dλ / ∫ ȳ dλ by the trapezoid rule, turned into sRGB. Equal energy
/// is the illuminant, so that a constant spectrum has Y = 1 and is slightly warm in sRGB, whose
/// white is D65. `None` where the wavelengths see no light.
pub fn srgb_weights(wavelengths_nm: &[f64]) -> Option<Vec<DVec3>> {
    let count = wavelengths_nm.len();
    let weighted: Vec<DVec3> = (0..count)
        .map(|index| {
            let before = wavelengths_nm[index.saturating_sub(1)];
            let after = wavelengths_nm[(index + 1).min(count - 1)];
            let width = if count == 1 { 1.0 } else { 0.5 * (after - before) };
            colour_matching(wavelengths_nm[index]) * width
        })
        .collect();
    let luminous: f64 = weighted.iter().map(|xyz| xyz.y).sum();
    (luminous > 0.0)
        .then(|| weighted.into_iter().map(|xyz| SRGB_FROM_XYZ * xyz / luminous).collect())
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    /// The chromaticity of equal energy is (1/3, 1/3), which the table gives to three digits.
    #[test]
    fn constant_spectrum_is_equal_energy_white() {
        let wavelengths: Vec<f64> = (0..41).map(|index| 380.0 + 10.0 * f64::from(index)).collect();
        let colour: DVec3 = srgb_weights(&wavelengths).unwrap().iter().sum();
        let expected = SRGB_FROM_XYZ * DVec3::ONE;
        assert!((colour - expected).abs().max_element() < 2e-3, "{colour} against {expected}");
    }

    /// A spectrum given twice as finely has the same colour.
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
