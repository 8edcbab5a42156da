//! Writers of scenes for other renderers: validated [`crate::Scene`] → files.
//!
//! A format is a folder with a function `export`. Differences that it forces are [`Export::warnings`], each
//! with the name of the material or lamp. `parts` alone reads the geometry; `subject` translates
//! materials as far as all formats share it.

mod folder;
pub mod gltf;
mod images;
pub mod mitsuba;
mod parts;
pub mod pbrt;
mod subject;

use std::path::{Path, PathBuf};

use glam::Vec3;

use crate::{
    Scene,
    error::Result,
    light_group::{ENVIRONMENT, LAMPS, LightGroups},
    material::MaterialKind,
};

/// Settings of the render that are not part of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Path vertices lit by the environment; 1 is direct light.
    pub depth: u32,
    /// Samples per pixel.
    pub samples: u32,
}

/// A scene translated to a format, before it is written.
pub struct Export<'a> {
    /// Differences that the format forces, one message for each material or lamp concerned.
    pub warnings: Vec<String>,
    write: Box<dyn Fn() -> Result<()> + 'a>,
}

impl<'a> Export<'a> {
    fn new(warnings: Vec<String>, write: impl Fn() -> Result<()> + 'a) -> Self {
        Self { warnings, write: Box::new(write) }
    }

    /// The warnings with one line for each kind: of those that differ in the material and in numbers alone,
    /// the first with a count.
    pub fn summary(&self) -> Vec<String> {
        let mut kinds: Vec<(String, &str, usize)> = Vec::new();
        for warning in &self.warnings {
            let difference = warning.split_once("`: ").map_or(warning.as_str(), |(_, rest)| rest);
            let is_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | 'e' | '-');
            let kind = difference.replace(is_number, "");
            match kinds.iter_mut().find(|(known, ..)| *known == kind) {
                Some((_, _, count)) => *count += 1,
                None => kinds.push((kind, warning, 1)),
            }
        }
        let line = |(_, first, count): (String, &str, usize)| match count {
            1 => first.to_owned(),
            count => format!("{first} ({} others likewise)", count - 1),
        };
        kinds.into_iter().map(line).collect()
    }

    /// Writes the scene file and the folder of the same name beside it.
    ///
    /// # Errors
    /// [`crate::Error::Io`] for a file that cannot be written.
    pub fn write(&self) -> Result<()> {
        (self.write)()
    }
}

/// Warnings about the portals and the groups of lights of `scene`, which no export has, and about exports to
/// other formats that the one at `path` spoils.
fn left_out(scene: &Scene, path: &Path) -> Vec<String> {
    let mut warnings = Vec::new();
    let others = ["xml", "pbrt", "gltf"].map(|extension| path.with_extension(extension));
    let is_export =
        |other: &&PathBuf| *other != path && other.exists() && other.with_extension("").is_dir();
    if let Some(other) = others.iter().find(is_export) {
        warnings.push(format!(
            "{}: its meshes and images lie in the same folder as those of this export, which replace \
             them; formats need names of their own",
            other.display()
        ));
    }
    if let Some(first) = scene.portals.first() {
        let first = if first.name.is_empty() { "the first" } else { &first.name };
        warnings.push(format!(
            "portals: left out, {} in all, `{first}` among them; they change the noise of a picture, \
             not what it shows",
            scene.portals.len()
        ));
    }
    let groups = LightGroups::new(scene);
    let is_named = |name: &&String| ![ENVIRONMENT, LAMPS].contains(&name.as_str());
    if let Some(first) = groups.names.iter().find(is_named) {
        warnings.push(format!(
            "light groups: left out, `{first}` among them; the picture does not depend on them"
        ));
    }
    warnings
}

/// Tests for insides that absorb, for which other renderers need an integrator of their own.
fn has_media(scene: &Scene) -> bool {
    scene.materials.iter().any(|material| material.kind.absorption().is_some())
}

/// Tests for panes, which the light of lamps goes straight through.
fn has_panes(scene: &Scene) -> bool {
    let is_pane =
        |kind: &MaterialKind| matches!(kind, MaterialKind::ThinDielectric { alpha: 0.0, .. });
    scene.materials.iter().any(|material| is_pane(&material.kind))
}

/// Number of a value in a list, to which it is added unless one `is_same`.
fn number_of<T>(list: &mut Vec<T>, value: T, is_same: impl Fn(&T, &T) -> bool) -> usize {
    list.iter().position(|other| is_same(other, &value)).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

/// Three numbers with commas.
fn triple(vector: Vec3) -> String {
    format!("{}, {}, {}", vector.x, vector.y, vector.z)
}
