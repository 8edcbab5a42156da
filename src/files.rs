//! Reading and atomic writing of files, and the user's cache folder.

use std::{
    env,
    fs::{self, File, OpenOptions},
    io::{BufWriter, Write},
    path::{Path, PathBuf},
    process,
    time::Duration,
};

use serde::Serialize;

use crate::error::{Error, Result};

/// Start of the names of temporary files; the id of the process that writes them follows.
const TEMPORARY_PREFIX: &str = ".fenestra-";
const TEMPORARY_SUFFIX: &str = ".tmp";
/// Age from which a temporary file of a dead process is swept: one of a process on another machine
/// that shares the folder is younger, since that process still writes it.
const LEFTOVER_AGE: Duration = Duration::from_secs(60);

/// Returns `fenestra/<kind>` in the user's cache folder (`$XDG_CACHE_HOME`, else `~/.cache`), or
/// `None` if neither is set. The folder may not exist yet.
pub fn cache_folder(kind: &str) -> Option<PathBuf> {
    let set = |name| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let base = set("XDG_CACHE_HOME").or_else(|| Some(set("HOME")?.join(".cache")))?;
    Some(base.join("fenestra").join(kind))
}

/// Returns the extension of `path` in lower case; empty if it has none.
pub fn extension(path: &Path) -> String {
    path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Formats bytes, such as those of a hash, in lower-case hexadecimal.
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Reads a whole file.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|source| Error::io(path, "read", source))
}

/// Reads a file of UTF-8 text; an error names the first byte that is not.
pub fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(read(path)?).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        Error::format(path, format!("not a text file: byte {offset} is not UTF-8"))
    })
}

/// Returns the folder that holds `path`.
pub fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Tests whether `path` exists and is neither a file nor a folder (`/dev/null`, a pipe).
pub fn is_special_file(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// Checks, before long work, that [`write_atomically`] can write `path`: creates the parent
/// folders, and creates and removes a temporary file beside it.
///
/// # Errors
/// [`Error::Io`] with `path` and the cause.
pub fn check_writable(path: &Path) -> Result<()> {
    if is_special_file(path) {
        return Ok(());
    }
    let parent = parent_of(path);
    fs::create_dir_all(parent).map_err(|source| Error::io(parent, "create folder", source))?;
    let attempt = || {
        if path.is_dir() {
            return Err(std::io::ErrorKind::IsADirectory.into());
        }
        tempfile::tempfile_in(parent).map(drop)
    };
    attempt().map_err(|source| Error::io(path, "write", source))
}

/// Writes a file so that it appears complete or not at all.
///
/// Creates the parent folders, lets `write` fill a temporary file in the same folder, renames it to
/// `path`, replacing an older file, and waits until both have reached the disk. On failure the
/// temporary file is removed and the older file is untouched. A special file (`/dev/stdout`, a pipe)
/// is written directly.
///
/// # Errors
/// [`Error::Io`] with `path` and the cause (no permission, full disk, …).
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<()> {
    let parent = parent_of(path);
    let fill = |file: File| -> std::io::Result<File> {
        let mut writer = BufWriter::with_capacity(1 << 16, file);
        write(&mut writer)?;
        writer.flush()?;
        writer.into_inner().map_err(std::io::IntoInnerError::into_error)
    };
    if is_special_file(path) {
        return OpenOptions::new()
            .write(true)
            .open(path)
            .and_then(fill)
            .map(drop)
            .map_err(|source| Error::io(path, "write", source));
    }
    fs::create_dir_all(parent).map_err(|source| Error::io(parent, "create folder", source))?;
    let mut builder = tempfile::Builder::new();
    let prefix = format!("{TEMPORARY_PREFIX}{}-", process::id());
    builder.prefix(&prefix).suffix(TEMPORARY_SUFFIX);
    // Temporary files are private by default; give the result the permissions of any new file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let attempt = || -> std::io::Result<()> {
        let (file, temporary) = builder.tempfile_in(parent)?.into_parts();
        fill(file)?.sync_all()?;
        temporary.persist(path).map_err(|error| error.error)?;
        sync_folder(parent)
    };
    attempt().map_err(|source| Error::io(path, "write", source))
}

/// Waits until the names in a folder have reached the disk. Does nothing where the folder cannot be
/// opened (no permission to read it, Windows) or its file system does not know how.
fn sync_folder(folder: &Path) -> std::io::Result<()> {
    use std::io::ErrorKind::{InvalidInput, Unsupported};
    let Ok(folder) = File::open(folder) else { return Ok(()) };
    match folder.sync_all() {
        Err(error) if !matches!(error.kind(), InvalidInput | Unsupported) => Err(error),
        _ => Ok(()),
    }
}

/// Removes a file that may be missing and waits until this has reached the disk.
///
/// # Errors
/// [`Error::Io`] with `path` and the cause.
pub fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        result => result
            .and_then(|()| sync_folder(parent_of(path)))
            .map_err(|source| Error::io(path, "remove", source)),
    }
}

/// Removes the temporary files that killed processes left beside `path`, once they are older than
/// [`LEFTOVER_AGE`]. Needs `/proc` to know which processes live, and does nothing without it.
pub fn sweep_leftovers(path: &Path) {
    let Ok(entries) = fs::read_dir(parent_of(path)) else { return };
    if !Path::new("/proc/self").exists() {
        return;
    }
    for entry in entries.flatten() {
        let name = entry.file_name();
        let process = name
            .to_str()
            .and_then(|name| name.strip_prefix(TEMPORARY_PREFIX)?.strip_suffix(TEMPORARY_SUFFIX))
            .and_then(|name| name.split_once('-')?.0.parse::<u32>().ok());
        let is_dead = process.is_some_and(|id| !Path::new("/proc").join(id.to_string()).exists());
        let age = || entry.metadata().ok()?.modified().ok()?.elapsed().ok();
        if is_dead && age().is_some_and(|age| age > LEFTOVER_AGE) {
            match fs::remove_file(entry.path()) {
                Ok(()) => log::info!("removed {} of a killed process", entry.path().display()),
                Err(error) => log::warn!("{}: cannot remove: {error}", entry.path().display()),
            }
        }
    }
}

/// Writes a text file as [`write_atomically`] does.
pub fn write_text(path: &Path, text: &str) -> Result<()> {
    write_atomically(path, |file| file.write_all(text.as_bytes()))
}

/// Writes a value as indented JSON, as [`write_atomically`] does.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    write_atomically(path, |file| {
        serde_json::to_writer_pretty(&mut *file, value)?;
        file.write_all(b"\n")
    })
}
