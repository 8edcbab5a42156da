//! MTL, the material libraries of OBJ files: one line at a time → materials.

use std::path::Path;

use super::{MeshMaterial, MeshSurface};
use crate::{
    error::{Error, Result},
    scene::features::{self, Ignored},
};

/// Refractive index of a glossy material that states none, or one that a coat cannot have.
const DEFAULT_IOR: f32 = 1.5;
/// Refractive indices of a coat.
const IOR_RANGE: std::ops::RangeInclusive<f32> = 1.01..=4.0;

/// Material of a library as far as it has been read.
pub(super) struct LibraryMaterial {
    pub(super) material: MeshMaterial,
    is_glossy: bool,
    /// Model 0 or 1 of `illum`, which has no gloss.
    is_matte: bool,
    exponent: f32,
    ior: f32,
}

impl LibraryMaterial {
    fn new(name: &str) -> Self {
        let material = MeshMaterial {
            name: name.to_owned(),
            base_color: [1.0; 3],
            surface: MeshSurface::Diffuse,
            ignored: Ignored::default(),
        };
        Self { material, is_glossy: false, is_matte: false, exponent: 0.0, ior: DEFAULT_IOR }
    }

    /// Returns the material with its reflection.
    pub(super) fn finish(&self) -> MeshMaterial {
        let mut material = self.material.clone();
        if self.is_glossy && !self.is_matte {
            material.surface = MeshSurface::Plastic {
                diffuse: material.base_color,
                // The width at which GGX and Blinn's cosine power are alike near the normal.
                alpha: (2.0 / (self.exponent + 2.0)).sqrt(),
                ior: if IOR_RANGE.contains(&self.ior) { self.ior } else { DEFAULT_IOR },
            };
        }
        material
    }
}

/// Reads a line into the last material of `library`, or begins one.
///
/// # Errors
/// [`Error::Parse`] with the line for a `Kd` that is no colour.
pub(super) fn read_line(
    library: &mut Vec<LibraryMaterial>,
    path: &Path,
    line: usize,
    text: &str,
) -> Result<()> {
    let text = text.split('#').next().unwrap_or_default().trim();
    let (key, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    if key == "newmtl" {
        library.push(LibraryMaterial::new(rest.trim()));
        return Ok(());
    }
    let Some(entry) = library.last_mut().filter(|_| !key.is_empty()) else { return Ok(()) };
    let numbers: Vec<f32> =
        rest.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
    let number = numbers.first().copied();
    let is_everywhere =
        |value: f32| !numbers.is_empty() && numbers.iter().all(|&found| found == value);
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let name = entry.material.name.clone();
    let mut ignore = |feature: features::Feature, kind: &str| {
        let place = || format!("material `{name}`, {file}:{line}");
        entry.material.ignored.add_named(feature, kind, place);
    };
    match key {
        "Kd" => {
            let color = match numbers[..] {
                [grey] => [grey; 3],
                [red, green, blue, ..] => [red, green, blue],
                _ => [f32::NAN; 3],
            };
            if !color.iter().all(|channel| (0.0..=1.0).contains(channel)) {
                let message =
                    format!("expected `Kd` with three numbers from 0 to 1, found `{text}`");
                return Err(Error::parse(path, line, 1, message));
            }
            entry.material.base_color = color;
        }
        "Ks" => {
            entry.is_glossy = !is_everywhere(0.0);
            if entry.is_glossy {
                ignore(features::MTL_KS_COLOR, features::MTL_KS_COLOR.name);
            }
        }
        "Ns" => entry.exponent = number.filter(|n| n.is_finite() && *n > 0.0).unwrap_or(0.0),
        "Ni" => entry.ior = number.unwrap_or(DEFAULT_IOR),
        "illum" => {
            entry.is_matte = matches!(number, Some(0.0 | 1.0));
            if !matches!(number, Some(0.0 | 1.0 | 2.0)) {
                ignore(features::MTL_ILLUM_MODEL, &format!("`illum {}`", rest.trim()));
            }
        }
        "d" if number == Some(1.0) => {}
        "Tr" if number == Some(0.0) => {}
        "d" | "Tr" => ignore(features::MTL_OPACITY, &format!("`{key}`")),
        "Ke" if is_everywhere(0.0) => {}
        "Ke" => ignore(features::MTL_KE, features::MTL_KE.name),
        "Ka" if is_everywhere(0.0) => {}
        "Ka" => ignore(features::MTL_KA, features::MTL_KA.name),
        "Tf" if is_everywhere(1.0) => {}
        "Tf" => ignore(features::MTL_TF, features::MTL_TF.name),
        _ => ignore(features::MTL_KEY, &format!("`{key}`")),
    }
    Ok(())
}
