//! Fit files, and a cache that names them by the content they were fitted to.
//!
//! A fit file is two lines of JSON: a header with format, version and the SHA-256 of the second
//! line, then the fit. Writing is atomic and the name determines the content, so two processes that
//! make the same fit at once do no harm.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{config, fitted::Fit};
use crate::{
    error::{Error, Result},
    files::{self, hexadecimal, write_atomically},
};

pub(crate) const EXTENSION: &str = "fit";
const FORMAT: &str = "fenestra-fit";

#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    version: u32,
    checksum: String,
}

/// Lower-case hexadecimal SHA-256 of the parts, each preceded by its length.
fn digest(parts: &[&[u8]]) -> String {
    let mut hasher = Sha256::new();
    for part in parts {
        hasher.update((part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    hexadecimal(&hasher.finalize())
}

/// Name of a fit in the cache, from everything it depends on and the version of the procedure.
pub fn key(parts: &[&[u8]]) -> String {
    let version = config::VERSION.to_le_bytes();
    let mut all: Vec<&[u8]> = vec![FORMAT.as_bytes(), &version];
    all.extend(parts);
    digest(&all)
}

/// Writes a fit file.
///
/// # Errors
/// [`Error::Io`] where the file cannot be written.
pub fn write_fit(path: &Path, fit: &Fit) -> Result<()> {
    let fail = |error: serde_json::Error| Error::io(path, "write", error.into());
    let content = serde_json::to_vec(fit).map_err(fail)?;
    let header = Header {
        format: FORMAT.to_owned(),
        version: config::VERSION,
        checksum: digest(&[&content]),
    };
    let header = serde_json::to_vec(&header).map_err(fail)?;
    write_atomically(path, |file| {
        file.write_all(&header)?;
        file.write_all(b"\n")?;
        file.write_all(&content)?;
        file.write_all(b"\n")
    })
}

/// Reads a fit file.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Format`] if it is no fit file, of another version or damaged.
pub fn read_fit(path: &Path) -> Result<Fit> {
    let bytes = files::read(path)?;
    let fail = |message: String| Error::format(path, message);
    let no_fit = || fail("not a fit file; expected one written by `fenestra fit`".into());
    let split = bytes.iter().position(|byte| *byte == b'\n').ok_or_else(no_fit)?;
    let header: Header = serde_json::from_slice(&bytes[..split]).map_err(|_| no_fit())?;
    if header.format != FORMAT {
        return Err(no_fit());
    }
    if header.version != config::VERSION {
        return Err(fail(format!(
            "fit file of version {}; this program reads version {}: make the fit again",
            header.version,
            config::VERSION
        )));
    }
    let content = bytes[split + 1..].strip_suffix(b"\n").unwrap_or_default();
    if digest(&[content]) != header.checksum {
        return Err(fail("damaged fit file: its checksum does not match its content".into()));
    }
    serde_json::from_slice(content).map_err(|error| fail(format!("damaged fit file: {error}")))
}

/// A folder of fit files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// The user's cache, `fenestra/fits` in `$XDG_CACHE_HOME` or `~/.cache`; none if neither is set.
    pub(crate) fn user() -> Option<Self> {
        files::cache_folder("fits").map(Self::at)
    }

    /// A cache in a folder that need not exist yet.
    pub fn at(folder: PathBuf) -> Self {
        Self { folder }
    }

    pub(crate) fn path(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{key}.{EXTENSION}"))
    }

    /// Loads the fit named `key` if present. Logs a warning if the file is unsound.
    pub(crate) fn load(&self, key: &str) -> Option<Fit> {
        match read_fit(&self.path(key)) {
            Ok(fit) => Some(fit),
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => {
                log::warn!("{error}; the fit is made again");
                None
            }
        }
    }

    /// Stores a fit. Logs a warning if the cache cannot be written.
    pub(crate) fn store(&self, key: &str, fit: &Fit) {
        if let Err(error) = write_fit(&self.path(key), fit) {
            log::warn!("{error}; the fit is not kept");
        }
    }
}
