//! The user's cache folder: `fenestra/fits` and `fenestra/pipelines` in it.

use std::{env, path::PathBuf};

/// Folder `fenestra/<kind>` in the user's cache folder (`$XDG_CACHE_HOME`, else `~/.cache`), or
/// `None` where neither is set. The folder may not exist yet.
pub fn folder(kind: &str) -> Option<PathBuf> {
    let set = |name| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let base = set("XDG_CACHE_HOME").or_else(|| Some(set("HOME")?.join(".cache")))?;
    Some(base.join("fenestra").join(kind))
}
