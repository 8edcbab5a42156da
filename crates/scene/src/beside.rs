//! Names of the files that a scene uses: they lie in its folder or below, or in one that the user allows.
//!
//! A scene comes from anywhere, so a name in it must not reach another folder. Symbolic links in the
//! folder are followed: whoever may make them may read what they lead to.

use std::{
    fs,
    path::{Component, Path, PathBuf, absolute},
};

/// Folder of a scene, in which names of files start.
#[derive(Clone, Debug, Default)]
pub(crate) struct Folder {
    pub(crate) path: PathBuf,
    /// Folder that names may reach beside.
    allowed: Option<PathBuf>,
}

impl Folder {
    /// Folder of the file at `path`, which allows no other.
    pub(crate) fn of(path: &Path) -> Self {
        Self { path: path.parent().unwrap_or(Path::new("")).to_path_buf(), allowed: None }
    }

    /// The same with a further folder that names may reach.
    pub(crate) fn allowing(self, allowed: Option<&Path>) -> Self {
        let allowed = allowed.and_then(|allowed| absolute(allowed).ok());
        Self { allowed: allowed.map(|allowed| without_parents(&allowed)), ..self }
    }

    /// Path of a file by its name. Slashes and backslashes separate folders. Fails for a name that is empty,
    /// absolute, or leaves the folder.
    pub(crate) fn file(&self, name: &str) -> Result<PathBuf, String> {
        self.file_within(Path::new(""), name)
    }

    /// As [`Folder::file`], for a name that is relative to the folder `within` of this one.
    pub(crate) fn file_within(&self, within: &Path, name: &str) -> Result<PathBuf, String> {
        let slashed = name.replace('\\', "/");
        // A colon begins a URI or names a drive.
        let is_absolute = slashed.starts_with('/')
            || slashed.split('/').next().is_some_and(|first| first.contains(':'));
        let relative = without_parents(&within.join(&slashed));
        let reason = match relative.components().next() {
            None => "is empty",
            _ if is_absolute => "is absolute",
            Some(Component::ParentDir) => "leads out of that folder",
            Some(_) => return Ok(self.path.join(relative)),
        };
        let whole = self.path.join(&relative);
        if let Some(allowed) = &self.allowed
            && let Ok(found) = absolute(&whole)
            && reason != "is empty"
            && without_parents(&found).starts_with(allowed)
        {
            return Ok(whole);
        }
        Err(format!(
            "the file name `{name}` {reason}; expected one in the folder of the scene or below: put \
             the file there and name it relative to the scene, or allow its folder by --allow-root"
        ))
    }

    /// As [`Folder::file_within`]; for a file that is not there, one of its name in another case, or one that
    /// lies beside the scene without the folders of its name.
    pub(crate) fn found_within(&self, within: &Path, name: &str) -> Result<PathBuf, String> {
        let found = self.file_within(within, name);
        if found.as_ref().is_ok_and(|path| path.exists()) {
            return found;
        }
        let alone = self.file_within(within, name.rsplit(['/', '\\']).next().unwrap_or_default());
        let others = [found.as_ref().ok(), alone.as_ref().ok()].into_iter().flatten();
        let other = others.filter_map(|path| in_another_case(path)).find(|path| path.is_file());
        other.map_or(found, Ok)
    }
}

/// Takes `..` and the folder before it out of a path; those that lead out of it stay in front.
fn without_parents(path: &Path) -> PathBuf {
    let mut found = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir
                if matches!(found.components().next_back(), Some(Component::Normal(_))) =>
            {
                found.pop();
            }
            other => found.push(other),
        }
    }
    found
}

/// Path of a file that is there with other upper and lower case in its name, or the names of its folders.
pub(crate) fn in_another_case(path: &Path) -> Option<PathBuf> {
    let mut found = PathBuf::new();
    for component in path.components() {
        let next = found.join(component);
        if next.exists() || !matches!(component, Component::Normal(_)) {
            found = next;
            continue;
        }
        let folder = if found.as_os_str().is_empty() { Path::new(".") } else { &found };
        let own = component.as_os_str();
        let mut names: Vec<_> =
            fs::read_dir(folder).ok()?.flatten().map(|e| e.file_name()).collect();
        names.retain(|name| name.eq_ignore_ascii_case(own));
        names.sort_unstable();
        found.push(names.first()?);
    }
    Some(found)
}
