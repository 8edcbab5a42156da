//! Spectra of a scene description → linear Rec.709.
//!
//! `rgb` is taken as it is: pbrt makes a smooth spectrum of it whose colour is the same. Other spectra
//! are integrated against the CIE 1931 observer: reflectances under D65, so that grey stays grey,
//! lights alone, with luminance 1, as pbrt-v4 normalises every light before its `scale`.

use glam::{DVec3, Vec3};

use super::parameters::{Kind, Log, Parameter, Values};
use crate::{
    error::Result,
    features, files,
    import::{clipped, media},
    spectrum::{self, Samples, light_color, planck},
};

/// Types of parameters that are spectra.
pub(super) const KINDS: [Kind; 3] = [Kind::Rgb, Kind::Spectrum, Kind::Blackbody];

/// Meaning of a spectrum.
enum Source<'a> {
    Color(DVec3),
    Samples(Samples),
    Temperature(f64),
    Name(&'a str),
}

fn source<'a>(parameter: &'a Parameter, log: &Log) -> Result<Source<'a>> {
    let error = |message: String| {
        parameter.place.error(format!("parameter `{}`: {message}", parameter.name))
    };
    let samples = |numbers: &[f64]| {
        let expected = "expected pairs of wavelength and value in increasing order of wavelength";
        let (pairs, rest) = numbers.as_chunks();
        let found = rest.is_empty().then(|| Samples::new(pairs.to_vec())).flatten();
        found.map(Source::Samples).ok_or_else(|| error(expected.to_owned()))
    };
    match (parameter.kind, &parameter.values) {
        (Kind::Rgb, Values::Numbers(numbers)) => match numbers[..] {
            [red, green, blue] => Ok(Source::Color(DVec3::new(red, green, blue))),
            _ => Err(error(format!("expected 3 numbers, found {}", numbers.len()))),
        },
        (Kind::Blackbody, Values::Numbers(numbers)) => match numbers[..] {
            [kelvin] if kelvin > 0.0 => Ok(Source::Temperature(kelvin)),
            _ => Err(error("expected one temperature above 0 K".to_owned())),
        },
        (_, Values::Numbers(numbers)) => samples(numbers),
        _ => {
            let name = parameter.text();
            let path = match log.folder.file(name) {
                Ok(path) if path.exists() || name.ends_with(".spd") => path,
                Err(message) if name.ends_with(".spd") => return Err(error(message)),
                _ => return Ok(Source::Name(name)),
            };
            let text = files::read_text(&path).map_err(|e| error(e.to_string()))?;
            let lines = text.lines().map(|line| line.split('#').next().unwrap_or(""));
            let words = lines.flat_map(str::split_ascii_whitespace);
            let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
            samples(&numbers.unwrap_or_default())
        }
    }
}

fn unknown(parameter: &Parameter, expected: &str) -> crate::error::Error {
    let found = parameter.text();
    parameter.place.error(format!(
        "parameter `{}`: expected {expected}, found the unknown spectrum `{found}`",
        parameter.name
    ))
}

/// Reflectance, 0…1.
pub(super) fn reflectance(parameter: &Parameter, log: &mut Log) -> Result<Vec3> {
    let color = match source(parameter, log)? {
        Source::Color(color) => color,
        Source::Samples(samples) => {
            let color = spectrum::reflectance(|nm| samples.at(nm));
            let place = || parameter.place.describe(log.main);
            clipped(color, features::PBRT_GAMUT, &mut log.ignored, place)
        }
        Source::Temperature(kelvin) => blackbody(kelvin),
        Source::Name(_) => return Err(unknown(parameter, "rgb or pairs of wavelength and value")),
    };
    Ok(color.clamp(DVec3::ZERO, DVec3::ONE).as_vec3())
}

/// Colour of a light; that of `rgb` as given, others with luminance 1.
pub(super) fn light(parameter: &Parameter, log: &Log) -> Result<Vec3> {
    let color = match source(parameter, log)? {
        Source::Color(color) => color,
        Source::Samples(samples) => light_color(|nm| samples.at(nm)).unwrap_or(DVec3::ZERO),
        Source::Temperature(kelvin) => blackbody(kelvin),
        Source::Name(name) => media::illuminant(name)
            .ok_or_else(|| unknown(parameter, "an illuminant such as stdillum-D65"))?,
    };
    Ok(color.max(DVec3::ZERO).as_vec3())
}

/// Refractive index or extinction coefficient.
pub(super) fn index(parameter: &Parameter, log: &Log) -> Result<Vec3> {
    let color = match source(parameter, log)? {
        Source::Color(color) => color,
        Source::Samples(samples) => spectrum::reflectance(|nm| samples.at(nm)),
        Source::Temperature(_) => return Err(unknown(parameter, "a refractive index")),
        Source::Name(name) => media::index(name).ok_or_else(|| {
            unknown(parameter, "a metal such as metal-Cu-eta or a glass such as glass-BK7")
        })?,
    };
    Ok(color.max(DVec3::ZERO).as_vec3())
}

/// Colour of a black body with luminance 1 \[Planck 1901\].
fn blackbody(kelvin: f64) -> DVec3 {
    light_color(|nm| planck(nm, kelvin)).unwrap_or(DVec3::ZERO)
}
