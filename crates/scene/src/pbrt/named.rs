//! Spectra that pbrt-v4 knows by name.

use glam::{DVec3, dvec3};

/// η and k of metals and oxides as Rec.709 colours.
///
/// From the spectra that pbrt takes from the same measurements as Mitsuba (luxpop.com): η is their
/// mean under D65 by the weights of [`srgb_weights`](crate::spectrum::srgb_weights), and k
/// gives the colour of the reflectance at normal incidence, at most 0.98. Brass is sampled at 650, 550
/// and 450 nm.
const METALS: [(&str, DVec3, DVec3); 7] = [
    ("Ag", dvec3(0.128, 0.124, 0.151), dvec3(4.049, 3.343, 2.393)),
    ("Al", dvec3(1.407, 0.927, 0.584), dvec3(7.655, 6.611, 5.296)),
    ("Au", dvec3(0.080, 0.405, 1.560), dvec3(3.851, 2.342, 1.716)),
    ("Cu", dvec3(0.104, 0.978, 1.204), dvec3(2.828, 2.625, 2.357)),
    ("CuZn", dvec3(0.444, 0.527, 1.094), dvec3(3.695, 2.765, 1.829)),
    ("MgO", dvec3(1.733, 1.742, 1.752), DVec3::ZERO),
    ("TiO2", dvec3(2.858, 2.959, 3.183), DVec3::ZERO),
];

/// Refractive indices at 587.6 nm, from the makers' sheets.
const GLASSES: [(&str, f64); 7] = [
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.6700),
    ("glass-FK51A", 1.4866),
    ("glass-LASF9", 1.8503),
    ("glass-F5", 1.6727),
    ("glass-F10", 1.7283),
    ("glass-F11", 1.7847),
];

/// Chromaticities x, y of illuminants for the 1931 observer \[CIE 015:2018\].
const ILLUMINANTS: [(&str, f64, f64); 16] = [
    ("stdillum-A", 0.447_58, 0.407_45),
    ("stdillum-D50", 0.345_67, 0.358_51),
    ("stdillum-D65", 0.312_72, 0.329_03),
    ("illum-acesD60", 0.321_68, 0.337_67),
    ("stdillum-F1", 0.3131, 0.3371),
    ("stdillum-F2", 0.3721, 0.3751),
    ("stdillum-F3", 0.4091, 0.3941),
    ("stdillum-F4", 0.4402, 0.4031),
    ("stdillum-F5", 0.3138, 0.3452),
    ("stdillum-F6", 0.3779, 0.3882),
    ("stdillum-F7", 0.3129, 0.3292),
    ("stdillum-F8", 0.3458, 0.3586),
    ("stdillum-F9", 0.3741, 0.3727),
    ("stdillum-F10", 0.3458, 0.3588),
    ("stdillum-F11", 0.3805, 0.3769),
    ("stdillum-F12", 0.4370, 0.4042),
];

/// Refractive index or extinction coefficient of `metal-…-eta`, `metal-…-k` and glasses.
pub fn index(name: &str) -> Option<DVec3> {
    if let Some((_, ior)) = GLASSES.iter().find(|(glass, _)| *glass == name) {
        return Some(DVec3::splat(*ior));
    }
    let (metal, part) = name.strip_prefix("metal-")?.split_once('-')?;
    let (_, eta, k) = METALS.iter().find(|(known, ..)| *known == metal)?;
    match part {
        "eta" => Some(*eta),
        "k" => Some(*k),
        _ => None,
    }
}

/// Linear Rec.709 colour of an illuminant with luminance 1.
pub fn illuminant(name: &str) -> Option<DVec3> {
    let (_, x, y) = ILLUMINANTS.iter().find(|(known, ..)| *known == name)?;
    // IEC 61966-2-1 with more digits than its matrix gives.
    let rows = [
        dvec3(3.240_970, -1.537_383, -0.498_611),
        dvec3(-0.969_244, 1.875_968, 0.041_555),
        dvec3(0.055_630, -0.203_977, 1.056_972),
    ];
    let xyz = dvec3(x / y, 1.0, (1.0 - x - y) / y);
    Some(DVec3::from_array(rows.map(|row| row.dot(xyz))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_white_of_rec_709_is_white() {
        let white = illuminant("stdillum-D65").unwrap_or_default();
        assert!((white - DVec3::ONE).abs().max_element() < 1e-3, "{white}");
    }

    /// Gold is yellow, copper red, silver and aluminium almost white.
    #[test]
    fn metals_have_their_colours() {
        let reflectance = |metal: &str| {
            let part = |part: &str| index(&format!("metal-{metal}-{part}")).unwrap_or_default();
            let (eta, k) = (part("eta"), part("k"));
            ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k)
        };
        let expected = [
            ("Ag", dvec3(0.97, 0.96, 0.91)),
            ("Al", dvec3(0.91, 0.92, 0.92)),
            ("Au", dvec3(0.98, 0.78, 0.34)),
            ("Cu", dvec3(0.96, 0.64, 0.54)),
        ];
        for (metal, color) in expected {
            let found = reflectance(metal);
            assert!((found - color).abs().max_element() < 0.01, "{metal}: {found}");
        }
        assert_eq!(index("metal-Cu-x"), None);
        assert_eq!(index("glass-BK7"), Some(DVec3::splat(1.5168)));
    }
}
