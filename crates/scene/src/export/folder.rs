//! The folder beside a scene file, and the names in it.

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::{
    parts::Part,
    ply::{self, Attributes},
};
use crate::{error::Result, files, picture::write_colors};

/// Folder of the same name beside the scene file.
pub(super) struct Folder {
    pub(super) path: PathBuf,
    /// Name, as the scene file calls it.
    pub(super) name: String,
}

impl Folder {
    /// Folder beside `scene`; `escaped` makes its name a text of the format.
    pub(super) fn beside(scene: &Path, escaped: fn(&str) -> String) -> Self {
        let path = scene.with_extension("");
        let name = escaped(&path.file_name().unwrap_or_default().to_string_lossy());
        Self { path, name }
    }

    /// Path of a file in the folder, as the scene file calls it.
    pub(super) fn relative(&self, file: &str) -> String {
        Path::new(&self.name).join(file).display().to_string()
    }

    /// Writes a mesh; returns its path as the scene file calls it.
    pub(super) fn write_mesh(
        &self,
        name: &str,
        part: &Part,
        is_flat: bool,
        attributes: Attributes,
    ) -> Result<String> {
        files::write_atomically(&self.path.join(name), |file| {
            ply::write(file, part, is_flat, attributes)
        })?;
        Ok(self.relative(name))
    }

    /// Writes the environment by its radiance in columns and rows; returns its path as the scene file
    /// calls it.
    pub(super) fn write_environment(
        &self,
        size: [usize; 2],
        radiance: impl Fn(usize, usize) -> Vec3 + Sync,
    ) -> Result<String> {
        let color = |column: usize, row: usize| radiance(column, row).to_array();
        write_colors(&self.path.join(ENVIRONMENT), size, color)?;
        Ok(self.relative(ENVIRONMENT))
    }
}

pub(super) const ENVIRONMENT: &str = "environment.exr";

/// Returns an identifier that all formats and file systems take: `m00_name`, other characters as `_`.
pub(super) fn identifier(index: usize, name: &str) -> String {
    format!("m{index:02}_{}", safe_name(name))
}

/// As [`safe_name`], of a file without its extension.
pub(super) fn safe_stem(path: impl AsRef<Path>) -> String {
    safe_name(&path.as_ref().file_stem().unwrap_or_default().to_string_lossy())
}

/// Name of letters and digits, other characters as `_`.
fn safe_name(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    name.chars().take(60).map(safe).collect()
}
