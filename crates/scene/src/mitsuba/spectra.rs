//! Colours and spectra → linear Rec.709.

use std::fs;

use glam::Vec3;

use super::{
    document::Node,
    parameters::{Parameters, float, number, numbers, value},
};
use crate::{
    error::Result,
    features::{self, Ignored},
    files,
    import::clipped,
    math::colour::srgb_to_linear,
    spectrum::{self, Samples},
};

const MAX_NUMBERS: usize = 1 << 14;
/// Meaning of a spectrum, on which its colour depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Factor of light: under D65, as sRGB's white is.
    Reflectance,
    /// Light by itself: equal energy is not white.
    Light,
    /// Property of a medium, as a refractive index: under D65.
    Index,
}

/// Colour of a parameter, if it is there.
pub(super) fn parameter(
    parameters: &Parameters<'_>,
    name: &str,
    role: Role,
) -> Result<Option<Vec3>> {
    parameters.any(name)?.map(|node| color(node, role)).transpose()
}

/// Colour of an element that is no texture.
pub(super) fn color(node: Node<'_>, role: Role) -> Result<Vec3> {
    let color = match node.tag() {
        "float" | "integer" => Vec3::splat(float(node)?),
        "rgb" | "srgb" | "color" => rgb(node, value(node)?, node.tag() == "srgb")?,
        "spectrum" => color_of_kind(node, role)?,
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
    Ok(color.max(Vec3::ZERO))
}

/// Colour of a reflectance, 0…1; that of a spectrum is clipped. Fails as [`color`], and for colours that are
/// no spectrum and above 1.
pub(super) fn reflectance(node: Node<'_>, ignored: &mut Ignored) -> Result<Vec3> {
    if node.tag() == "spectrum" {
        let color = color_of_kind(node, Role::Reflectance)?.as_dvec3();
        return Ok(clipped(color, features::MI_GAMUT, ignored, || node.place()).as_vec3());
    }
    let color = color(node, Role::Reflectance)?;
    if color.max_element() > 1.0 + 1e-4 {
        let name = node.name();
        return Err(node.error(format!("`{name}`: expected 0 to 1, found {color}")));
    }
    Ok(color.min(Vec3::ONE))
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
        return Ok(Vec3::from_array([r, g, b].map(|byte| srgb_to_linear(f32::from(byte) / 255.0))));
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
    Ok(Vec3::from_array(if is_encoded { color.map(srgb_to_linear) } else { color }))
}

/// Colour of a spectrum by its type, as that of a texture may be too.
pub(super) fn color_of_kind(node: Node<'_>, role: Role) -> Result<Vec3> {
    let parameters = Parameters::new(node);
    match node.kind() {
        "blackbody" => {
            let kelvin = parameters.required("temperature", parameters.float("temperature")?)?;
            let scale = parameters.float("scale")?.unwrap_or(1.0);
            return Ok(blackbody(node, f64::from(kelvin))? * scale);
        }
        // Mitsuba 3.9.1 takes equal energy of this type for white, though not that of one number.
        "uniform" => return Ok(Vec3::splat(parameters.float("value")?.unwrap_or(1.0))),
        "d65" | "srgb" | "rgb" => {
            let scale = parameters.float("scale")?.unwrap_or(1.0);
            let own = parameters.any("color")?.or(parameters.any("value")?);
            return Ok(scale * own.map_or(Ok(Vec3::ONE), |own| color(own, role))?);
        }
        kind @ ("regular" | "irregular") => {
            let list = |name: &str| numbers(node, parameters.string(name)?.unwrap_or_default());
            let values = list("values")?;
            let wavelengths = if kind == "irregular" {
                list("wavelengths")?
            } else {
                let [least, most] = ["wavelength_min", "wavelength_max"]
                    .map(|name| parameters.required(name, parameters.float(name)?));
                let (least, most) = (f64::from(least?), f64::from(most?));
                let step = (most - least) / (values.len() as f64 - 1.0);
                (0..values.len()).map(|place| least + step * place as f64).collect()
            };
            if wavelengths.len() != values.len() {
                let message = "irregular: expected as many values as wavelengths";
                return Err(node.error(message));
            }
            return integrate(
                node,
                wavelengths.into_iter().zip(values).map(|(nm, value)| [nm, value]).collect(),
                role,
            );
        }
        _ => {}
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
                [wavelength, value] => list.push([wavelength, value]),
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
            // Deviation: Mitsuba 3.9.1 takes this for equal energy in files of all versions.
            [all] if role == Role::Light && node.version() >= 2.0 => Ok(rgb_of(|_| all, role)),
            [all] => Ok(Vec3::splat(all as f32)),
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
        list.push([number(node, wavelength)?, number(node, value)?]);
    }
    integrate(node, list, role)
}

/// Colour of values at wavelengths in nanometres, linear between them and 0 beyond.
fn integrate(node: Node<'_>, list: Vec<[f64; 2]>, role: Role) -> Result<Vec3> {
    let count = list.len();
    let samples = (2..=MAX_NUMBERS).contains(&count).then(|| Samples::new(list)).flatten();
    let samples = samples.ok_or_else(|| {
        node.error(format!(
            "expected 2 to {MAX_NUMBERS} values at rising wavelengths, found {count}"
        ))
    })?;
    Ok(rgb_of(|nm| samples.at(nm), role))
}

fn rgb_of(spectrum: impl Fn(f64) -> f64, role: Role) -> Vec3 {
    match role {
        Role::Light => spectrum::light(spectrum),
        Role::Reflectance | Role::Index => spectrum::reflectance(spectrum),
    }
    .as_vec3()
}

/// Radiance of a black body as a spectrum.
fn blackbody(node: Node<'_>, kelvin: f64) -> Result<Vec3> {
    if !(1.0..=1e6).contains(&kelvin) {
        let message = format!("temperature: expected 1 to 1e6 kelvins, found {kelvin}");
        return Err(node.error(message));
    }
    Ok(rgb_of(|nm| spectrum::planck(nm, kelvin), Role::Light))
}
