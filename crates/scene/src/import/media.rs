//! Media and illuminants by the names that Mitsuba and pbrt-v4 give them.

use glam::{DVec3, Vec3, dvec3};

use crate::spectrum::rgb_from_xyz;

/// Refractive index of a dielectric.
pub(crate) fn dielectric(name: &str) -> Option<f32> {
    let name = name.to_lowercase();
    DIELECTRICS.iter().find(|(own, _)| *own == name).map(|(_, index)| *index)
}

/// Real part of the refractive index and extinction coefficient of a metal or other absorbing medium.
pub(crate) fn conductor(name: &str) -> Option<(DVec3, DVec3)> {
    // The name may tell the source of the measurement, as `Cu_palik`.
    let name = name.strip_suffix("_palik").unwrap_or(name);
    let found = CONDUCTORS.iter().find(|(own, _)| *own == name);
    found.map(|(_, [eta, k])| (DVec3::from(*eta), DVec3::from(*k)))
}

/// Refractive index or extinction coefficient by pbrt's names `metal-…-eta`, `metal-…-k` and of glasses.
pub(crate) fn index(name: &str) -> Option<DVec3> {
    if let Some((_, ior)) = GLASSES.iter().find(|(glass, _)| *glass == name) {
        return Some(DVec3::splat(*ior));
    }
    let (metal, part) = name.strip_prefix("metal-")?.split_once('-')?;
    let (eta, k) = conductor(metal)?;
    match part {
        "eta" => Some(eta),
        "k" => Some(k),
        _ => None,
    }
}

/// Absorption and reduced scattering coefficients of a medium below a surface, by pbrt's name.
pub(crate) fn scattering(name: &str) -> Option<[Vec3; 2]> {
    let found = SCATTERING.iter().find(|(own, _)| *own == name)?;
    Some(found.1.map(Vec3::from_array))
}

/// Linear Rec.709 colour of an illuminant with luminance 1, by pbrt's name.
pub(crate) fn illuminant(name: &str) -> Option<DVec3> {
    let (_, x, y) = ILLUMINANTS.iter().find(|(known, ..)| *known == name)?;
    Some(rgb_from_xyz(dvec3(x / y, 1.0, (1.0 - x - y) / y)))
}

/// As documented for Mitsuba's `dielectric`.
#[rustfmt::skip]
pub(crate) const DIELECTRICS: [(&str, f32); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000036),
    ("hydrogen", 1.000132),
    ("air", 1.000277),
    ("carbon dioxide", 1.00045),
    ("water", 1.3330),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.52045),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.470),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.5750),
    ("diamond", 2.419),
];

/// η and k of metals and other absorbing media as Rec.709 colours, from the measurements of luxpop.com.
///
/// For Ag, Al, Au, Cu, CuZn, MgO and TiO2, η is the mean under D65, and k gives the colour of the reflectance
/// at normal incidence, at most 0.98. The others are what Mitsuba 3.9.1 renders in RGB, cut off at 0.
#[rustfmt::skip]
pub(crate) const CONDUCTORS: [(&str, [[f64; 3]; 2]); 38] = [
    ("a-C", [[2.94405, 2.22714, 1.96816], [0.887465, 0.799299, 0.81529]]),
    ("Ag", [[0.128, 0.124, 0.151], [4.049, 3.343, 2.393]]),
    ("Al", [[1.407, 0.927, 0.584], [7.655, 6.611, 5.296]]),
    ("AlAs", [[3.6053, 3.23294, 2.21632], [0.000679437, 0.0, 0.00751271]]),
    ("AlSb", [[0.0, 4.13937, 4.66925], [0.0, 0.0940091, 1.30057]]),
    ("Au", [[0.080, 0.405, 1.560], [3.851, 2.342, 1.716]]),
    ("Be", [[4.18501, 3.18503, 2.78406], [3.83547, 3.01012, 2.86899]]),
    ("Cr", [[4.36967, 2.91651, 1.6549], [5.20655, 4.23131, 3.7547]]),
    ("CsI", [[2.1449, 1.70232, 1.66243], [0.0, 0.0, 0.0]]),
    ("Cu", [[0.104, 0.978, 1.204], [2.828, 2.625, 2.357]]),
    ("CuZn", [[0.444, 0.527, 1.094], [3.695, 2.765, 1.829]]),
    ("Cu2O", [[3.55177, 2.94987, 2.75188], [0.114207, 0.193897, 0.606134]]),
    ("CuO", [[3.24754, 2.44781, 2.21022], [0.52109, 0.570031, 0.722179]]),
    ("d-C", [[2.70872, 2.31883, 2.2289], [0.0, 0.0, 0.0]]),
    ("Hg", [[2.39894, 1.44003, 0.90957], [6.32759, 4.37192, 3.42176]]),
    ("HgTe", [[4.77904, 3.2312, 2.6599], [1.63161, 1.58081, 1.72929]]),
    ("Ir", [[3.0863, 2.08219, 1.61791], [5.59215, 4.06709, 3.26731]]),
    ("K", [[0.0640432, 0.0464098, 0.0381849], [2.1042, 1.34894, 0.913126]]),
    ("Li", [[0.265791, 0.195618, 0.220949], [3.54015, 2.31112, 1.66861]]),
    ("MgO", [[1.733, 1.742, 1.752], [0.0, 0.0, 0.0]]),
    ("Mo", [[4.48397, 3.52513, 2.77631], [4.11144, 3.42083, 3.15061]]),
    ("Na", [[0.0602694, 0.0561409, 0.0619884], [3.17927, 2.11249, 1.57904]]),
    ("Nb", [[3.42007, 2.79009, 2.39563], [3.44139, 2.73767, 2.57975]]),
    ("Ni", [[2.3673, 1.66337, 1.46708], [4.49881, 3.05015, 2.34544]]),
    ("Rh", [[2.58579, 1.86022, 1.55426], [6.78226, 4.70299, 3.97607]]),
    ("Se", [[4.05831, 2.84294, 2.82085], [0.75405, 0.638444, 0.521808]]),
    ("SiC", [[3.17234, 2.52597, 2.47937], [0.0, 0.0, 0.0000101925]]),
    ("SnTe", [[4.52425, 1.98164, 1.28159], [0.0, 0.0, 0.0]]),
    ("Ta", [[2.06272, 2.39294, 2.62793], [2.40836, 1.74149, 1.94703]]),
    ("Te", [[7.39023, 4.4821, 2.63711], [3.25602, 3.52706, 3.29205]]),
    ("ThF4", [[1.83071, 1.44223, 1.38765], [0.0, 0.0, 0.0]]),
    ("TiC", [[3.70053, 2.83742, 2.58229], [3.26564, 2.35159, 2.17279]]),
    ("TiN", [[1.64845, 1.15052, 1.37982], [3.36833, 1.9435, 1.10207]]),
    ("TiO2", [[2.858, 2.959, 3.183], [0.0, 0.0, 0.0]]),
    ("V", [[4.27758, 3.51295, 2.76107], [3.4913, 2.88945, 3.11152]]),
    ("VC", [[3.65757, 2.75274, 2.53267], [3.0683, 2.19869, 1.96319]]),
    ("VN", [[2.8656, 2.11919, 1.94009], [3.03224, 2.05612, 1.61631]]),
    ("W", [[4.37082, 3.30025, 2.99841], [3.50064, 2.60487, 2.27323]]),
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

/// Absorption and reduced scattering coefficients, per millimetre \[Jensen et al. 2001\].
const SCATTERING: [(&str, [[f32; 3]; 2]); 12] = [
    ("Apple", [[0.003, 0.0034, 0.046], [2.29, 2.39, 1.97]]),
    ("Chicken1", [[0.015, 0.077, 0.19], [0.15, 0.21, 0.38]]),
    ("Chicken2", [[0.018, 0.088, 0.2], [0.19, 0.25, 0.32]]),
    ("Cream", [[0.0002, 0.0028, 0.0163], [7.38, 5.47, 3.15]]),
    ("Ketchup", [[0.061, 0.97, 1.45], [0.18, 0.07, 0.03]]),
    ("Marble", [[0.0021, 0.0041, 0.0071], [2.19, 2.62, 3.0]]),
    ("Potato", [[0.0024, 0.009, 0.12], [0.68, 0.7, 0.55]]),
    ("Skimmilk", [[0.0014, 0.0025, 0.0142], [0.7, 1.22, 1.9]]),
    ("Skin1", [[0.032, 0.17, 0.48], [0.74, 0.88, 1.01]]),
    ("Skin2", [[0.013, 0.07, 0.145], [1.09, 1.59, 1.79]]),
    ("Spectralon", [[0.0, 0.0, 0.0], [11.6, 20.4, 14.9]]),
    ("Wholemilk", [[0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77]]),
];
