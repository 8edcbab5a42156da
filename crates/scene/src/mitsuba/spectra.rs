//! Colours and spectra → linear Rec.709.

use std::fs;

use glam::{DMat3, DVec3, Vec3};

use super::{
    document::Node,
    parameters::Parameters,
    values::{float, number, numbers, value},
};
use crate::{error::Result, files};

/// Most numbers of a spectrum.
const MAX_NUMBERS: usize = 1 << 14;
/// First wavelength and step of [`OBSERVER`], nanometres.
const FIRST_NM: f64 = 360.0;
const STEP_NM: f64 = 10.0;
/// Linear Rec.709 from CIE XYZ, as columns.
const RGB_FROM_XYZ: [f64; 9] =
    [3.240479, -0.969256, 0.055648, -1.537150, 1.875991, -0.204043, -0.498535, 0.041556, 1.057311];
/// Second constant of Planck's law hc/k, metre kelvins, and the first for radiance, 2hc², W m².
const PLANCK_SECOND: f64 = 1.438_776_877e-2;
const PLANCK_FIRST: f64 = 1.191_042_972e-16;

/// Meaning of a spectrum, on which its colour depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Factor of light: under D65, as sRGB's white is.
    Reflectance,
    /// Light by itself: equal energy is not white.
    Light,
    /// Property of a medium, as a refractive index: under D65.
    Index,
}

/// Colour of a parameter, if it is there.
///
/// # Errors
/// As [`color`].
pub fn parameter(parameters: &Parameters<'_>, name: &str, role: Role) -> Result<Option<Vec3>> {
    parameters.any(name)?.map(|node| color(node, role)).transpose()
}

/// Colour of an element that is no texture.
///
/// # Errors
/// [`crate::Error::Parse`] for another element, and for text that holds no numbers.
pub fn color(node: Node<'_>, role: Role) -> Result<Vec3> {
    let color = match node.tag() {
        "float" | "integer" => Vec3::splat(float(node)?),
        "rgb" | "srgb" | "color" => rgb(node, value(node)?, node.tag() == "srgb")?,
        "spectrum" => spectrum(node, role)?,
        "blackbody" => {
            let attribute = |name: &str| node.attribute(name).map(|text| number(node, text));
            let Some(kelvin) = node.attribute("temperature") else {
                return Err(node.error("blackbody: expected the attribute `temperature`"));
            };
            let kelvin = number(node, kelvin.trim_end_matches(['K', 'k']))?;
            blackbody(node, kelvin)? * attribute("scale").transpose()?.unwrap_or(1.0) as f32
        }
        "texture" => {
            let kind = node.kind();
            return Err(node.error(format!(
                "`{}`: expected a colour, found a texture of type `{kind}`",
                node.name()
            )));
        }
        found => {
            let name = node.name();
            return Err(node.error(format!("`{name}`: expected a colour, found `{found}`")));
        }
    };
    // Negative channels are outside Rec.709, which no reflection or light is here.
    let color = color.max(Vec3::ZERO);
    if role == Role::Reflectance && color.max_element() > 1.0 + 1e-4 {
        let name = node.name();
        return Err(node.error(format!("`{name}`: expected 0 to 1, found {color}")));
    }
    Ok(if role == Role::Reflectance { color.min(Vec3::ONE) } else { color })
}

/// Colour by three numbers, by one, or by hexadecimal digits, which are encoded as sRGB.
fn rgb(node: Node<'_>, text: &str, is_encoded: bool) -> Result<Vec3> {
    let text = text.trim();
    if let Some(digits) = text.strip_prefix('#') {
        let code = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6);
        let Some(code) = code else {
            return Err(node.error(format!("expected # and 6 hexadecimal digits, found `{text}`")));
        };
        let [_, r, g, b] = code.to_be_bytes();
        return Ok(Vec3::from_array([r, g, b].map(|byte| decode_srgb(f32::from(byte) / 255.0))));
    }
    let color = match numbers(node, text)?[..] {
        [grey] => [grey; 3],
        [r, g, b] => [r, g, b],
        ref found => {
            let message = format!("`{}`: expected 3 numbers, found {}", node.name(), found.len());
            return Err(node.error(message));
        }
    };
    let color = color.map(|channel| channel as f32);
    Ok(Vec3::from_array(if is_encoded { color.map(decode_srgb) } else { color }))
}

/// \[IEC 61966-2-1:1999\].
fn decode_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

fn spectrum(node: Node<'_>, role: Role) -> Result<Vec3> {
    let parameters = Parameters::new(node);
    match node.kind() {
        "" => {}
        "blackbody" => {
            let kelvin = parameters.float("temperature")?;
            let Some(kelvin) = kelvin else {
                return Err(node.error("blackbody: expected the parameter `temperature`"));
            };
            let scale = parameters.float("scale")?.unwrap_or(1.0);
            return Ok(blackbody(node, f64::from(kelvin))? * scale);
        }
        "d65" => return Ok(Vec3::splat(parameters.float("scale")?.unwrap_or(1.0))),
        "uniform" => return Ok(uniform(parameters.float("value")?.unwrap_or(1.0), role)),
        "srgb" | "rgb" => {
            let color = parameters.any("color")?.or(parameters.any("value")?);
            return color.map_or(Ok(Vec3::ONE), |color| rgb(color, value(color)?, false));
        }
        "irregular" => {
            let list = |name: &str| numbers(node, parameters.string(name)?.unwrap_or_default());
            let (wavelengths, values) = (list("wavelengths")?, list("values")?);
            if wavelengths.len() != values.len() {
                let message = "irregular: expected as many values as wavelengths";
                return Err(node.error(message));
            }
            return integrate(node, wavelengths.into_iter().zip(values).collect(), role);
        }
        found => return Err(node.error(format!("unknown spectrum of type `{found}`"))),
    }
    if let Some(name) = node.attribute("filename") {
        let path = node.file(name)?;
        let bytes = fs::metadata(&path).map_or(0, |metadata| metadata.len());
        if bytes > 32 * MAX_NUMBERS as u64 {
            return Err(node.error(format!("`{name}`: expected a small text file of a spectrum")));
        }
        let text = files::read_text(&path)?;
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
        let mut list = Vec::new();
        for line in lines.filter(|line| !line.trim().is_empty()) {
            match numbers(node, line)?[..] {
                [wavelength, value] => list.push((wavelength, value)),
                _ => {
                    let message =
                        format!("`{name}`: expected a wavelength and a value, found `{line}`");
                    return Err(node.error(message));
                }
            }
        }
        return integrate(node, list, role);
    }
    let text = value(node)?;
    if !text.contains(':') {
        return match numbers(node, text)?[..] {
            [all] => Ok(uniform(all as f32, role)),
            // Version 0.6 in its usual build has three bins, which are red, green and blue.
            _ => rgb(node, text, false),
        };
    }
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    let mut list = Vec::new();
    for word in words {
        let Some((wavelength, value)) = word.split_once(':') else {
            let message = format!("expected wavelength:value, found `{word}`");
            return Err(node.error(message));
        };
        list.push((number(node, wavelength)?, number(node, value)?));
    }
    integrate(node, list, role)
}

/// Colour of a spectrum that is the same at all wavelengths.
fn uniform(value: f32, role: Role) -> Vec3 {
    match role {
        Role::Light => rgb_of(|_| f64::from(value), role),
        Role::Reflectance | Role::Index => Vec3::splat(value),
    }
}

/// Colour of values at wavelengths in nanometres, linear between them and 0 beyond.
fn integrate(node: Node<'_>, list: Vec<(f64, f64)>, role: Role) -> Result<Vec3> {
    let is_rising = list.windows(2).all(|pair| pair[0].0 < pair[1].0);
    if list.len() < 2 || list.len() > MAX_NUMBERS || !is_rising {
        let message = format!(
            "expected 2 to {MAX_NUMBERS} values at rising wavelengths, found {}",
            list.len()
        );
        return Err(node.error(message));
    }
    let spectrum = |wavelength: f64| {
        let next = list.partition_point(|(own, _)| *own < wavelength);
        match (next.checked_sub(1).map(|before| list[before]), list.get(next)) {
            (_, Some(&(own, value))) if own == wavelength => value,
            (Some((low, from)), Some(&(high, to))) => {
                from + (to - from) * (wavelength - low) / (high - low)
            }
            _ => 0.0,
        }
    };
    Ok(rgb_of(spectrum, role))
}

/// Integrates a spectrum nanometre by nanometre; a spectrum of 1 has the luminance 1.
fn rgb_of(spectrum: impl Fn(f64) -> f64, role: Role) -> Vec3 {
    let (mut sum, mut white) = (DVec3::ZERO, 0.0);
    let mut white_rgb = DVec3::ZERO;
    for nanometre in 0..(OBSERVER.len() - 1) * STEP_NM as usize {
        let (row, share) = (nanometre / STEP_NM as usize, (nanometre % STEP_NM as usize) as f64);
        let at = |column: usize| {
            let (low, high) = (OBSERVER[row][column], OBSERVER[row + 1][column]);
            low + (high - low) * share / STEP_NM
        };
        let observer = DVec3::new(at(0), at(1), at(2));
        let light = if role == Role::Light { 1.0 } else { at(3) };
        sum += observer * light * spectrum(FIRST_NM + nanometre as f64);
        white += observer.y;
        white_rgb += observer * light;
    }
    let matrix = DMat3::from_cols_array(&RGB_FROM_XYZ);
    let rgb = matrix * (sum / white);
    // Make the sum over the table's steps white under D65, as the exact integral is.
    let rgb = if role == Role::Light { rgb } else { rgb / (matrix * (white_rgb / white)) };
    rgb.as_vec3()
}

/// Radiance of a black body by Planck's law, W m⁻² sr⁻¹ nm⁻¹ as a spectrum.
fn blackbody(node: Node<'_>, kelvin: f64) -> Result<Vec3> {
    if !(1.0..=1e6).contains(&kelvin) {
        let message = format!("temperature: expected 1 to 1e6 kelvins, found {kelvin}");
        return Err(node.error(message));
    }
    let spectrum = |nanometres: f64| {
        let metres = nanometres * 1e-9;
        let denominator = (PLANCK_SECOND / (metres * kelvin)).exp_m1();
        1e-9 * PLANCK_FIRST / (metres.powi(5) * denominator)
    };
    Ok(rgb_of(spectrum, Role::Light))
}

/// x̄, ȳ, z̄ of the CIE 1931 observer \[CIE 015:2018\] from 360 nm in steps of 10 nm, and CIE illuminant
/// D65 \[ISO/CIE 11664-2:2022\] divided by the sum that makes its luminance 1.
#[rustfmt::skip]
const OBSERVER: [[f64; 4]; 48] = [
    [0.00013, 0.000004, 0.000606, 0.471106],
    [0.000415, 0.000012, 0.001946, 0.526166],
    [0.001368, 0.000039, 0.00645, 0.504816],
    [0.004243, 0.00012, 0.02005, 0.552016],
    [0.01431, 0.000396, 0.06785, 0.83593],
    [0.04351, 0.00121, 0.2074, 0.924125],
    [0.13438, 0.004, 0.6456, 0.94378],
    [0.2839, 0.0116, 1.3856, 0.875602],
    [0.34828, 0.023, 1.74706, 1.05927],
    [0.3362, 0.038, 1.77211, 1.18193],
    [0.2908, 0.06, 1.6692, 1.190051],
    [0.19536, 0.09098, 1.28764, 1.160242],
    [0.09564, 0.13902, 0.81295, 1.17097],
    [0.03201, 0.20802, 0.46518, 1.09913],
    [0.0049, 0.323, 0.272, 1.104615],
    [0.0093, 0.503, 0.1582, 1.088938],
    [0.06327, 0.71, 0.07825, 1.058512],
    [0.1655, 0.862, 0.04216, 1.087796],
    [0.2904, 0.954, 0.0203, 1.054623],
    [0.43345, 0.99495, 0.00875, 1.050997],
    [0.5945, 0.995, 0.0039, 1.010127],
    [0.7621, 0.952, 0.0021, 0.973098],
    [0.9163, 0.87, 0.00165, 0.967581],
    [1.0263, 0.757, 0.0011, 0.895837],
    [1.0622, 0.631, 0.0008, 0.909177],
    [1.0026, 0.503, 0.00034, 0.905065],
    [0.85445, 0.381, 0.00019, 0.885869],
    [0.6424, 0.265, 0.00005, 0.841321],
    [0.4479, 0.175, 0.00002, 0.845469],
    [0.2835, 0.107, 0.0, 0.808373],
    [0.1649, 0.061, 0.0, 0.81027],
    [0.0874, 0.032, 0.0, 0.831111],
    [0.04677, 0.017, 0.0, 0.79077],
    [0.0227, 0.00821, 0.0, 0.704274],
    [0.011359, 0.004102, 0.0, 0.723343],
    [0.00579, 0.002091, 0.0, 0.75102],
    [0.002899, 0.001047, 0.0, 0.622279],
    [0.00144, 0.00052, 0.0, 0.705934],
    [0.00069, 0.000249, 0.0, 0.758474],
    [0.000332, 0.00012, 0.0, 0.642367],
    [0.000166, 0.00006, 0.0, 0.468883],
    [0.000083, 0.00003, 0.0, 0.67482],
    [0.000042, 0.000015, 0.0, 0.640247],
    [0.000021, 0.000007, 0.0, 0.649552],
    [0.00001, 0.000004, 0.0, 0.60054],
    [0.000005, 0.000002, 0.0, 0.524852],
    [0.000003, 0.000001, 0.0, 0.580223],
    [0.000001, 0.0, 0.0, 0.609233],
];
