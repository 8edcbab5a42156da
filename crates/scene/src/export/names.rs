//! Names of files and objects.

use std::path::{Path, PathBuf};

/// Folder of the same name beside the scene file.
pub(super) fn folder_of(path: &Path) -> PathBuf {
    path.with_extension("")
}

/// Name of that folder, as the scene file calls it.
pub(super) fn folder_name(path: &Path) -> String {
    folder_of(path).file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns an identifier that all formats and file systems take: `m00_name`, other characters as `_`.
pub(super) fn identifier(index: usize, name: &str) -> String {
    format!("m{index:02}_{}", safe_name(name))
}

/// Name of letters and digits, other characters as `_`.
pub(super) fn safe_name(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    name.chars().take(60).map(safe).collect()
}

/// Path of a file in `folder` relative to the scene file.
pub(super) fn relative(folder: &str, name: &str) -> String {
    PathBuf::from(folder).join(name).display().to_string()
}
