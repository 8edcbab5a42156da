//! Shared libraries that are loaded when they are first needed, so that nothing of them is needed to build.

use std::{
    env,
    path::{Path, PathBuf},
};

use libloading::Library;

/// Opens the first library that loads: of those with one of `names` in the folder that the environment
/// variable `variable` names, or the file that it names; without the variable, the system's, then those in
/// the folder `own`. Fails with the reason for the first failure.
pub(super) fn open(
    variable: &str,
    names: &[&str],
    own: Option<&Path>,
) -> Result<(Library, PathBuf), String> {
    let named = env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from);
    let candidates: Vec<PathBuf> = match &named {
        Some(folder) if folder.is_dir() => names.iter().map(|name| folder.join(name)).collect(),
        Some(file) => vec![file.clone()],
        None => {
            let of_system = names.iter().map(PathBuf::from);
            let of_folder = own.iter().flat_map(|own| names.iter().map(|name| own.join(name)));
            of_system.chain(of_folder.filter(|path| path.exists())).collect()
        }
    };
    let mut failures = Vec::new();
    for path in candidates {
        if named.is_some() && !path.exists() {
            continue;
        }
        // SAFETY: loading the library runs its initialisers; the system or the user names it.
        match unsafe { Library::new(&path) } {
            Ok(library) => return Ok((library, path)),
            Err(error) => failures.push(error.to_string()),
        }
    }
    Err(match (&named, failures.into_iter().next()) {
        (Some(place), None) => format!("{variable}={} holds none", place.display()),
        (_, first) => first.unwrap_or_default(),
    })
}

/// Looks up a function, whose type in the library's header is `T`, under the first of its names that is
/// there.
pub(super) fn function<T: Copy>(library: &Library, names: &[&str]) -> Option<T> {
    // SAFETY: the symbol is a function, and callers give its type in the library's header.
    names.iter().find_map(|name| unsafe { library.get::<T>(name.as_bytes()) }.ok().map(|it| *it))
}
