//! Reading and atomic writing of files, and the user's cache folder.

use std::{
    borrow::Cow,
    env,
    fs::{self, File, FileType, OpenOptions},
    io::{self, BufRead, BufReader, BufWriter, Read, Write},
    path::{Path, PathBuf},
    process,
    time::Duration,
};

use flate2::read::MultiGzDecoder;
use serde::Serialize;

use crate::{
    error::{Error, Result},
    memory, stage,
};

/// Start of the names of temporary files; the id of the process that writes them follows.
const TEMPORARY_PREFIX: &str = ".fenestra-";
const TEMPORARY_SUFFIX: &str = ".tmp";
/// Age from which a temporary file of a dead process is swept: one of a process on another machine
/// that shares the folder is younger, since that process still writes it.
const LEFTOVER_AGE: Duration = Duration::from_secs(60);

/// Returns `fenestra/<kind>` in the user's cache folder (`$XDG_CACHE_HOME`, else `~/.cache`), or
/// `None` if neither is set. The folder may not exist yet.
pub fn cache_folder(kind: &str) -> Option<PathBuf> {
    user_folder("XDG_CACHE_HOME", ".cache", kind)
}

/// Returns `fenestra/<kind>` in the user's data folder (`$XDG_DATA_HOME`, else `~/.local/share`), or
/// `None` if neither is set. The folder may not exist.
pub fn data_folder(kind: &str) -> Option<PathBuf> {
    user_folder("XDG_DATA_HOME", ".local/share", kind)
}

fn user_folder(variable: &str, default: &str, kind: &str) -> Option<PathBuf> {
    let set = |name| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let base = set(variable).or_else(|| Some(set("HOME")?.join(default)))?;
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

/// Unsigned number of up to eight bytes in little endian.
pub(crate) fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// Reads a whole regular file.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut file = open_regular(path)?;
    let length = file.metadata().map_or(0, |metadata| metadata.len());
    memory::check(path.display(), length).map_err(Error::memory)?;
    let read = file.read_to_end(&mut bytes);
    read.map(|_| bytes).map_err(|source| Error::io(path, "read", source))
}

/// Mark before text of UTF-8, as programs on Windows write it.
pub(crate) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads a file of UTF-8 text; an error names the first byte that is not.
pub fn read_text(path: &Path) -> Result<String> {
    let mut bytes = read(path)?;
    if bytes.starts_with(BYTE_ORDER_MARK) {
        bytes.drain(..BYTE_ORDER_MARK.len());
    }
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        Error::format(path, format!("not a text file: byte {offset} is not UTF-8"))
    })
}

/// Text in UTF-8, else in Latin-1, in which other bytes are other characters.
pub(crate) fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    let latin_1 = || bytes.iter().map(|byte| char::from(*byte)).collect();
    std::str::from_utf8(bytes).map_or_else(|_| Cow::Owned(latin_1()), Cow::Borrowed)
}

/// Returns the folder that holds `path`.
pub fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Tests whether `path` exists and is neither a file nor a folder (`/dev/null`, a pipe), or names an
/// open standard stream (`/dev/stdout`).
pub fn is_special_file(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
        || standard_stream(path).is_some()
}

/// Checks, before long work, that [`write_atomically`] can write `path`: creates the parent
/// folders, and creates and removes a temporary file beside it.
///
/// # Errors
/// [`Error::Io`] with `path` and the cause.
pub fn check_writable(path: &Path) -> Result<()> {
    if is_special_file(path) {
        return open_special(path).map(drop);
    }
    let parent = parent_of(path);
    fs::create_dir_all(parent).map_err(|source| Error::io(parent, "create folder", source))?;
    let attempt = || {
        if path.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        tempfile::tempfile_in(parent).map(drop)
    };
    attempt().map_err(|source| Error::io(path, "write", source))
}

/// Writes a file so that it appears complete or not at all.
///
/// Creates the parent folders, lets `write` fill a temporary file in the same folder, renames it to
/// `path`, replacing an older file, and waits until both have reached the disk. On failure the
/// temporary file is removed and the older file is untouched. A device or standard stream
/// (`/dev/stdout`) is written directly.
///
/// # Errors
/// [`Error::Io`] with `path` and the cause (no permission, full disk, …).
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<()> {
    let parent = parent_of(path);
    let fill = |file: File| -> io::Result<File> {
        let mut writer = BufWriter::with_capacity(1 << 16, file);
        write(&mut writer)?;
        writer.flush()?;
        writer.into_inner().map_err(io::IntoInnerError::into_error)
    };
    if is_special_file(path) {
        let file = open_special(path)?;
        return fill(file).map(drop).map_err(|source| Error::io(path, "write", source));
    }
    fs::create_dir_all(parent).map_err(|source| Error::io(parent, "create folder", source))?;
    let mut builder = tempfile::Builder::new();
    let prefix = format!("{TEMPORARY_PREFIX}{}-", process::id());
    builder.prefix(&prefix).suffix(TEMPORARY_SUFFIX);
    // Temporary files are private by default; give the result the permissions of any new file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let attempt = || -> io::Result<()> {
        let (file, temporary) = builder.tempfile_in(parent)?.into_parts();
        fill(file)?.sync_all()?;
        temporary.persist(path).map_err(|error| error.error)?;
        sync_folder(parent)
    };
    attempt().map_err(|source| Error::io(path, "write", source))
}

/// Waits until the names in a folder have reached the disk. Does nothing where the folder cannot be
/// opened (no permission to read it, Windows) or its file system does not know how.
fn sync_folder(folder: &Path) -> io::Result<()> {
    use io::ErrorKind::{InvalidInput, Unsupported};
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
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        result => result
            .and_then(|()| sync_folder(parent_of(path)))
            .map_err(|source| Error::io(path, "remove", source)),
    }
}

/// Removes the temporary files that killed processes left beside `path`, once they are older than
/// a minute. Needs `/proc` to know which processes live, and does nothing without it.
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

/// Opens a regular file for reading, without waiting. Reading from a pipe or device could last for ever.
/// Fails for a folder, a pipe, a socket, a device, and a file that cannot be read.
pub(crate) fn open_regular(path: &Path) -> Result<File> {
    let io_error = |source| Error::io(path, "read", source);
    // Look before opening, which waits for the writer of a pipe.
    let kind = fs::metadata(path).map_err(io_error)?.file_type();
    if kind.is_dir() {
        return Err(io_error(io::ErrorKind::IsADirectory.into()));
    }
    if !kind.is_file() {
        let message = format!("expected a regular file, found {}", name_of(kind));
        return Err(Error::format(path, message));
    }
    stage::enter(format_args!("reading {}", path.display()));
    File::open(path).map_err(io_error)
}

/// Opens a regular file for reading after its byte order mark, decompressed by gzip if its extension is
/// `gz`; returns the most bytes that it may hold too.
pub(crate) fn open_unpacked(path: &Path) -> Result<(BufReader<Box<dyn Read>>, u64)> {
    let file = open_regular(path)?;
    let bytes = file.metadata().map_err(|source| Error::io(path, "read", source))?.len();
    let (reader, bytes): (Box<dyn Read>, u64) = match extension(path).as_str() {
        "gz" => (Box::new(MultiGzDecoder::new(file)), bytes.saturating_mul(DEFLATE_LARGEST_RATIO)),
        _ => (Box::new(file), bytes),
    };
    let mut reader = BufReader::with_capacity(1 << 16, reader);
    // A file that cannot be read fails where it is read.
    if reader.fill_buf().is_ok_and(|start| start.starts_with(BYTE_ORDER_MARK)) {
        reader.consume(BYTE_ORDER_MARK.len());
    }
    Ok((reader, bytes))
}

/// Opens a device or standard stream for writing.
///
/// Refuses other pipes, whose opening waits for a reader, except those in `/dev/fd`, which are open
/// already.
fn open_special(path: &Path) -> Result<File> {
    if let Some(stream) = standard_stream(path) {
        return Ok(stream);
    }
    let io_error = |source| Error::io(path, "write", source);
    let kind = fs::metadata(path).map_err(io_error)?.file_type();
    if is_pipe_or_socket(kind) && !path.starts_with("/dev/fd") {
        let found = name_of(kind);
        let message = format!("expected a file to write, /dev/stdout or a device, found {found}");
        return Err(Error::format(path, message));
    }
    OpenOptions::new().write(true).open(path).map_err(io_error)
}

/// Duplicates standard output or standard error if `path` leads to it. Opening the path again would
/// start at the first byte of a file and fail for a socket.
#[cfg(unix)]
fn standard_stream(path: &Path) -> Option<File> {
    use std::os::{fd::AsFd, unix::fs::MetadataExt};
    let named = fs::metadata(path).ok()?;
    let duplicates =
        [io::stdout().as_fd().try_clone_to_owned(), io::stderr().as_fd().try_clone_to_owned()];
    duplicates.into_iter().flatten().map(File::from).find(|stream| {
        stream.metadata().is_ok_and(|open| (open.dev(), open.ino()) == (named.dev(), named.ino()))
    })
}

#[cfg(not(unix))]
fn standard_stream(_: &Path) -> Option<File> {
    None
}

#[cfg(unix)]
fn is_pipe_or_socket(kind: FileType) -> bool {
    use std::os::unix::fs::FileTypeExt;
    kind.is_fifo() || kind.is_socket()
}

#[cfg(not(unix))]
fn is_pipe_or_socket(_: FileType) -> bool {
    false
}

/// Names a file type that is neither a file nor a folder.
fn name_of(kind: FileType) -> &'static str {
    if is_pipe_or_socket(kind) { "a pipe or socket" } else { "a device" }
}

/// Identity of a file, by whatever path it is reached. A file that is not there yet has the
/// folder in which it would lie, and its name.
fn identity(path: &Path) -> Option<(PathBuf, [u64; 2])> {
    #[cfg(unix)]
    if let Ok(metadata) = fs::metadata(path) {
        use std::os::unix::fs::MetadataExt;
        return Some((PathBuf::new(), [metadata.dev(), metadata.ino()]));
    }
    let canonical = path
        .canonicalize()
        .ok()
        .or_else(|| Some(parent_of(path).canonicalize().ok()?.join(path.file_name()?)));
    canonical.map(|path| (path, [0; 2]))
}

/// Tests whether two paths lead to the same file: through links, and also where it is not there yet.
pub(crate) fn is_same_file(one: &Path, other: &Path) -> bool {
    one == other || identity(one).is_some_and(|found| identity(other) == Some(found))
}

/// Checks that none of the `outputs`, each with the option that asks for it, would replace one of the
/// `inputs` or another output.
///
/// # Errors
/// [`Error::Usage`] if one would.
pub fn check_replaces_nothing(outputs: &[(&str, &Path)], inputs: &[&Path]) -> Result<()> {
    for (index, (name, path)) in outputs.iter().enumerate() {
        if is_special_file(path) {
            continue;
        }
        let message = |what: &str| {
            Err(Error::usage(format!("{name} {} would replace {what}", path.display())))
        };
        if let Some(input) = inputs.iter().find(|input| is_same_file(input, path)) {
            return message(&format!("{}, which is read", input.display()));
        }
        let before = &outputs[..index];
        if let Some((other, _)) = before.iter().find(|(_, other)| is_same_file(other, path)) {
            return message(&format!("the file of {other}"));
        }
    }
    Ok(())
}

/// Checks that none of the `inputs` lies in a folder of outputs, which is called `name`.
///
/// # Errors
/// [`Error::Usage`] if one does.
pub fn check_replaces_nothing_in(name: &str, folder: &Path, inputs: &[&Path]) -> Result<()> {
    let Ok(canonical) = folder.canonicalize() else { return Ok(()) };
    let lies_in =
        |input: &&&Path| input.canonicalize().is_ok_and(|path| path.starts_with(&canonical));
    inputs.iter().find(lies_in).map_or(Ok(()), |input| {
        Err(Error::usage(format!(
            "{name} {} would replace {}, which is read",
            folder.display(),
            input.display()
        )))
    })
}

/// Largest compression of real pixels by OpenEXR's lossless methods; a header that promises more
/// than this times the file's size is corrupt, and trusting it would exhaust memory.
pub(crate) const EXR_LARGEST_RATIO: u64 = 4096;

/// Largest compression of gzip, zlib and PNG, which bounds what a compressed file may promise.
pub(crate) const DEFLATE_LARGEST_RATIO: u64 = 1032;

/// Checks that a file of `file_bytes` bytes can hold the pixels that its header states, before
/// memory is allocated for them.
///
/// `ratio` is the largest compression of the format. Returns the message of an error.
pub(crate) fn check_promise(
    [width, height]: [u64; 2],
    bytes_per_pixel: u64,
    file_bytes: u64,
    ratio: u64,
) -> Result<(), String> {
    let promised = width.saturating_mul(height).saturating_mul(bytes_per_pixel);
    if promised / ratio > file_bytes {
        return Err(format!(
            "its header promises {width}x{height} pixels ({promised} bytes), the file has \
             {file_bytes} bytes"
        ));
    }
    Ok(())
}
