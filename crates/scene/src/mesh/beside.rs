//! Names of the files that a mesh file uses: they lie in its folder or below.
//!
//! A scene comes from anywhere, so a name in it must not reach another folder. Symbolic links in the
//! folder are followed: whoever may make them may read what they lead to.

use std::path::{Component, Path, PathBuf};

/// Returns the path of the file that a file in `folder` names; `within` is the folder of the naming
/// file relative to `folder`. Slashes and backslashes separate folders.
///
/// # Errors
/// A message for a name that is empty, absolute, or leaves `folder`.
pub(super) fn path_beside(folder: &Path, within: &Path, name: &str) -> Result<PathBuf, String> {
    let refuse = |reason| {
        Err(format!(
            "the file name `{name}` {reason}; expected one in the folder of the scene or below: put \
             the file there and name it relative to the scene"
        ))
    };
    let slashed = name.replace('\\', "/");
    // A colon begins a URI or names a drive.
    if slashed.starts_with('/')
        || slashed.split('/').next().is_some_and(|first| first.contains(':'))
    {
        return refuse("is absolute");
    }
    let mut inside = PathBuf::new();
    for component in within.join(&slashed).components() {
        match component {
            Component::Normal(part) => inside.push(part),
            Component::CurDir => {}
            Component::ParentDir if inside.pop() => {}
            _ => return refuse("leads out of that folder"),
        }
    }
    if inside.as_os_str().is_empty() { refuse("is empty") } else { Ok(folder.join(inside)) }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn names_stay_in_the_folder() {
        let beside = |within: &str, name| path_beside(Path::new("a/b"), Path::new(within), name);
        for (within, name, expected) in [
            ("", "wood.png", "a/b/wood.png"),
            ("", "maps\\oak wood.png", "a/b/maps/oak wood.png"),
            ("", "./maps/../wood.png", "a/b/wood.png"),
            ("materials", "../maps/wood.png", "a/b/maps/wood.png"),
        ] {
            assert_eq!(beside(within, name).as_deref(), Ok(Path::new(expected)));
        }
        for name in [
            "/etc/passwd",
            "\\\\host\\share\\a.png",
            "C:\\a.png",
            "file:///etc/passwd",
            "../a.png",
            "maps/../../a.png",
            "",
            "maps/..",
        ] {
            let message = beside("", name).unwrap_err();
            assert!(message.contains(&format!("`{name}`")), "{message}");
        }
        assert!(beside("materials", "../../a.png").is_err());
    }
}
