//! Spectra → linear Rec.709 by the CIE 1931 standard observer: reflectances under illuminant D65, lights by
//! themselves.

use glam::{DMat3, DVec3, DVec4, Vec4Swizzles, dvec3, dvec4};

/// First wavelength of [`OBSERVER`], nm.
const FIRST_NM: f64 = 360.0;
/// Spacing of its rows, nm.
const STEP_NM: f64 = 10.0;

/// Linear Rec.709 from CIE XYZ, by columns.
const RGB_FROM_XYZ: DMat3 = DMat3::from_cols(
    dvec3(3.240479, -0.969256, 0.055648),
    dvec3(-1.537150, 1.875991, -0.204043),
    dvec3(-0.498535, 0.041556, 1.057311),
);

/// Cone responses from CIE XYZ \[Lam 1985\], by columns.
const CONES_FROM_XYZ: DMat3 = DMat3::from_cols(
    dvec3(0.8951, -0.7502, 0.0389),
    dvec3(0.2664, 1.7135, -0.0685),
    dvec3(-0.1614, 0.0367, 1.0296),
);

/// Second constant of Planck's law hc/k, metre kelvins, and the first for radiance, 2hc², W m².
const PLANCK_SECOND: f64 = 1.438_776_877e-2;
const PLANCK_FIRST: f64 = 1.191_042_972e-16;

/// Spectrum by values at wavelengths in nm: linear between them, 0 beyond.
pub(crate) struct Samples(Vec<[f64; 2]>);

impl Samples {
    /// Takes pairs of wavelength and value; none without any, and where wavelengths do not rise.
    pub(crate) fn new(pairs: Vec<[f64; 2]>) -> Option<Self> {
        let rises = pairs.windows(2).all(|pair| pair[0][0] < pair[1][0]);
        (rises && !pairs.is_empty()).then_some(Self(pairs))
    }

    pub(crate) fn at(&self, wavelength_nm: f64) -> f64 {
        let next = self.0.partition_point(|sample| sample[0] < wavelength_nm);
        match (next.checked_sub(1).map(|before| self.0[before]), self.0.get(next)) {
            (_, Some(&[own, value])) if own == wavelength_nm => value,
            (Some([low, from]), Some(&[high, to])) => {
                from + (to - from) * (wavelength_nm - low) / (high - low)
            }
            _ => 0.0,
        }
    }
}

/// Row of the table at a wavelength, linear between rows; 0 outside them.
fn observer(wavelength_nm: f64) -> DVec4 {
    let position = (wavelength_nm - FIRST_NM) / STEP_NM;
    let last = OBSERVER.len() - 1;
    if !(0.0..=last as f64).contains(&position) {
        return DVec4::ZERO;
    }
    let row = (position as usize).min(last - 1);
    OBSERVER[row] + (OBSERVER[row + 1] - OBSERVER[row]) * (position - row as f64)
}

/// Linear Rec.709 from CIE XYZ.
pub(crate) fn rgb_from_xyz(xyz: DVec3) -> DVec3 {
    RGB_FROM_XYZ * xyz
}

/// XYZ of a spectrum nanometre by nanometre; `weight` is that of each row of the observer.
fn xyz(spectrum: impl Fn(f64) -> f64, weight: impl Fn(DVec4) -> f64) -> DVec3 {
    let wavelengths = (0..(OBSERVER.len() - 1) * STEP_NM as usize).map(|nm| FIRST_NM + nm as f64);
    let parts = wavelengths.map(|nm| {
        let row = observer(nm);
        row.xyz() * weight(row) * spectrum(nm)
    });
    parts.sum()
}

/// Colour of a reflectance, or of another property of a medium, under D65: a constant is grey.
pub(crate) fn reflectance(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    let under_d65 = |row: DVec4| row.w;
    rgb_from_xyz(xyz(spectrum, under_d65)) / rgb_from_xyz(xyz(|_| 1.0, under_d65))
}

/// Colour of light of a spectral power. A power of 1 has luminance 1 and is not white.
pub(crate) fn light(power: impl Fn(f64) -> f64) -> DVec3 {
    rgb_from_xyz(xyz(power, |_| 1.0)) / xyz(|_| 1.0, |_| 1.0).y
}

/// As [`light`], scaled to luminance 1. `None` if nothing of it is visible.
pub(crate) fn light_color(power: impl Fn(f64) -> f64) -> Option<DVec3> {
    let xyz = xyz(power, |_| 1.0);
    (xyz.y > 0.0 && xyz.is_finite()).then(|| rgb_from_xyz(xyz) / xyz.y)
}

/// Radiance of a black body, W m⁻² sr⁻¹ nm⁻¹ \[Planck 1901\].
pub(crate) fn planck(wavelength_nm: f64, kelvin: f64) -> f64 {
    let metres = wavelength_nm * 1e-9;
    1e-9 * PLANCK_FIRST / (metres.powi(5) * (PLANCK_SECOND / (metres * kelvin)).exp_m1())
}

/// Matrix of linear Rec.709 colours that makes white of light of a temperature, in the cone responses of
/// \[Lam 1985\]: daylight \[CIE 015:2018\] from 4000 K, a black body below.
pub(crate) fn white_balance(kelvin: f64) -> DMat3 {
    // The scale of temperatures has moved since the illuminants were defined.
    let kelvin = kelvin * 1.4388 / 1.438;
    let white = if kelvin < 4000.0 {
        let found = xyz(|nm| planck(nm, kelvin), |_| 1.0);
        found / found.y
    } else {
        let [a, b, c, d] = match kelvin {
            ..=7000.0 => [-4.607e9, 2.9678e6, 99.11, 0.244063],
            _ => [-2.0064e9, 1.9018e6, 247.48, 0.23704],
        };
        let x = ((a / kelvin + b) / kelvin + c) / kelvin + d;
        let y = (2.87 - 3.0 * x) * x - 0.275;
        dvec3(x / y, 1.0, (1.0 - x - y) / y)
    };
    let cones_from_rgb = CONES_FROM_XYZ * RGB_FROM_XYZ.inverse();
    let gains = cones_from_rgb * DVec3::ONE / (CONES_FROM_XYZ * white);
    cones_from_rgb.inverse() * DMat3::from_diagonal(gains) * cones_from_rgb
}

/// Weights w such that Σ w_j·s(λ_j) is the linear sRGB colour of a reflectance spectrum s sampled
/// at increasing wavelengths: ∫ s·D65·(x̄, ȳ, z̄) dλ / ∫ D65·ȳ dλ by the trapezoid rule, converted
/// to sRGB. `None` if no wavelength is visible.
///
/// Deviation: pbrt-v2 integrates without an illuminant, which turns a grey reflectance into (1.20,
/// 0.95, 0.91) of its value. Scene lights are colours whose white is D65, so a grey surface must
/// stay grey.
pub(crate) fn srgb_weights(wavelengths_nm: &[f64]) -> Option<Vec<DVec3>> {
    let count = wavelengths_nm.len();
    let weighted: Vec<DVec3> = (0..count)
        .map(|index| {
            let before = wavelengths_nm[index.saturating_sub(1)];
            let after = wavelengths_nm[(index + 1).min(count - 1)];
            let width = if count == 1 { 1.0 } else { 0.5 * (after - before) };
            let row = observer(wavelengths_nm[index]);
            row.xyz() * row.w * width
        })
        .collect();
    let luminous: f64 = weighted.iter().map(|xyz| xyz.y).sum();
    (luminous > 0.0).then(|| weighted.into_iter().map(|xyz| rgb_from_xyz(xyz / luminous)).collect())
}

/// x̄, ȳ, z̄ of the CIE 1931 observer \[CIE 015:2018\] from 360 nm in steps of 10 nm, and CIE illuminant
/// D65 \[ISO/CIE 11664-2:2022\] divided by the sum that makes its luminance 1.
#[rustfmt::skip]
const OBSERVER: [DVec4; 48] = [
    dvec4(0.00013, 0.000004, 0.000606, 0.471106),
    dvec4(0.000415, 0.000012, 0.001946, 0.526166),
    dvec4(0.001368, 0.000039, 0.00645, 0.504816),
    dvec4(0.004243, 0.00012, 0.02005, 0.552016),
    dvec4(0.01431, 0.000396, 0.06785, 0.83593),
    dvec4(0.04351, 0.00121, 0.2074, 0.924125),
    dvec4(0.13438, 0.004, 0.6456, 0.94378),
    dvec4(0.2839, 0.0116, 1.3856, 0.875602),
    dvec4(0.34828, 0.023, 1.74706, 1.05927),
    dvec4(0.3362, 0.038, 1.77211, 1.18193),
    dvec4(0.2908, 0.06, 1.6692, 1.190051),
    dvec4(0.19536, 0.09098, 1.28764, 1.160242),
    dvec4(0.09564, 0.13902, 0.81295, 1.17097),
    dvec4(0.03201, 0.20802, 0.46518, 1.09913),
    dvec4(0.0049, 0.323, 0.272, 1.104615),
    dvec4(0.0093, 0.503, 0.1582, 1.088938),
    dvec4(0.06327, 0.71, 0.07825, 1.058512),
    dvec4(0.1655, 0.862, 0.04216, 1.087796),
    dvec4(0.2904, 0.954, 0.0203, 1.054623),
    dvec4(0.43345, 0.99495, 0.00875, 1.050997),
    dvec4(0.5945, 0.995, 0.0039, 1.010127),
    dvec4(0.7621, 0.952, 0.0021, 0.973098),
    dvec4(0.9163, 0.87, 0.00165, 0.967581),
    dvec4(1.0263, 0.757, 0.0011, 0.895837),
    dvec4(1.0622, 0.631, 0.0008, 0.909177),
    dvec4(1.0026, 0.503, 0.00034, 0.905065),
    dvec4(0.85445, 0.381, 0.00019, 0.885869),
    dvec4(0.6424, 0.265, 0.00005, 0.841321),
    dvec4(0.4479, 0.175, 0.00002, 0.845469),
    dvec4(0.2835, 0.107, 0.0, 0.808373),
    dvec4(0.1649, 0.061, 0.0, 0.81027),
    dvec4(0.0874, 0.032, 0.0, 0.831111),
    dvec4(0.04677, 0.017, 0.0, 0.79077),
    dvec4(0.0227, 0.00821, 0.0, 0.704274),
    dvec4(0.011359, 0.004102, 0.0, 0.723343),
    dvec4(0.00579, 0.002091, 0.0, 0.75102),
    dvec4(0.002899, 0.001047, 0.0, 0.622279),
    dvec4(0.00144, 0.00052, 0.0, 0.705934),
    dvec4(0.00069, 0.000249, 0.0, 0.758474),
    dvec4(0.000332, 0.00012, 0.0, 0.642367),
    dvec4(0.000166, 0.00006, 0.0, 0.468883),
    dvec4(0.000083, 0.00003, 0.0, 0.67482),
    dvec4(0.000042, 0.000015, 0.0, 0.640247),
    dvec4(0.000021, 0.000007, 0.0, 0.649552),
    dvec4(0.00001, 0.000004, 0.0, 0.60054),
    dvec4(0.000005, 0.000002, 0.0, 0.524852),
    dvec4(0.000003, 0.000001, 0.0, 0.580223),
    dvec4(0.000001, 0.0, 0.0, 0.609233),
];

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn light_of_the_illuminant_is_white() {
        let color = light_color(|nm| observer(nm).w);
        assert!((color.unwrap() - DVec3::ONE).abs().max_element() < 5e-3, "{color:?}");
        assert!(light_color(|_| 0.0).is_none());
        assert!((reflectance(|_| 0.4) - DVec3::splat(0.4)).abs().max_element() < 1e-6);
    }

    #[test]
    fn the_first_and_the_last_of_sampled_wavelengths_count_by_half() {
        let weighted = [(500.0, 0.5), (550.0, 1.0), (600.0, 0.5)].map(|(nm, share)| {
            let row = observer(nm);
            row.xyz() * row.w * share
        });
        let luminous: f64 = weighted.iter().map(|xyz| xyz.y).sum();
        let found = srgb_weights(&[500.0, 550.0, 600.0]).unwrap();
        for (found, xyz) in found.into_iter().zip(weighted) {
            assert!(found.abs_diff_eq(rgb_from_xyz(xyz / luminous), 1e-9), "{found}");
        }
    }

    #[test]
    fn samples_end_at_their_ends() {
        let samples = Samples::new(vec![[500.0, 1.0], [600.0, 3.0]]);
        let found =
            samples.map(|samples| [499.0, 500.0, 525.0, 600.0, 601.0].map(|nm| samples.at(nm)));
        assert_eq!(found, Some([0.0, 1.0, 1.5, 3.0, 0.0]));
        assert!(Samples::new(vec![[500.0, 1.0], [400.0, 1.0]]).is_none());
        assert!(Samples::new(Vec::new()).is_none());
    }
}
