//! The one error type of the library.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use crate::memory::Shortage;

/// Result with Fenestra's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can go wrong. Messages say where, what was expected and what was found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused to read or write a file.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// File or folder concerned.
        path: PathBuf,
        /// Attempted action: "read", "write", …
        action: &'static str,
        /// The system's own error.
        source: std::io::Error,
    },
    /// A text file does not parse; line and column count from 1 (0 where unknown).
    #[error("{}:{line}:{column}: {message}", path.display())]
    Parse {
        /// File concerned.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Expected and found.
        message: String,
    },
    /// A file that can be read does not hold what it should.
    #[error("{}: {message}", path.display())]
    Format {
        /// File concerned.
        path: PathBuf,
        /// Expected and found.
        message: String,
    },
    /// A scene that parses but cannot be rendered.
    #[error("{}: {message}", path.display())]
    Scene {
        /// Scene file.
        path: PathBuf,
        /// Expected and found, naming the object or material.
        message: String,
    },
    /// A Vulkan call failed.
    #[error("Vulkan: {call} failed: {result}")]
    Vulkan {
        /// Name of the call and of the pass or resource.
        call: String,
        /// The result code, or the allocator's message.
        result: String,
    },
    /// No device, none that meets the requirements, or a device that is lost.
    #[error("{reason}")]
    Device {
        /// Required and found.
        reason: String,
        /// Advice to the user.
        help: String,
    },
    /// The denoiser's library is missing or fails.
    #[error("{reason}")]
    Denoiser {
        /// Expected and found.
        reason: String,
        /// Advice to the user.
        help: Option<&'static str>,
    },
    /// The memory that the process may use, or that of the device, does not suffice.
    #[error("{message}")]
    Memory {
        /// Who asks for how much, and how much there is.
        message: String,
        /// Advice to the user, where the message has none.
        help: Option<&'static str>,
    },
    /// Options that contradict each other or are out of range.
    #[error("{message}")]
    Usage {
        /// Option, value, allowed values.
        message: String,
    },
    /// A fit with spherical radial basis functions cannot be made.
    #[error("fit of {what}: {message}")]
    Fit {
        /// The map or material.
        what: String,
        /// Expected and found.
        message: String,
    },
    /// Two pictures that cannot be compared.
    #[error("cannot compare: {message}")]
    Comparison {
        /// Expected and found.
        message: String,
    },
    /// A metric is beyond its threshold.
    #[error("{message}")]
    Threshold {
        /// Metric, value and threshold.
        message: String,
    },
    /// The user interrupted the command; partial results have been written.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// Creates an [`Error::Io`] for `path`.
    pub fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), action, source }
    }

    /// Creates an [`Error::Parse`] for `path`.
    pub fn parse(path: &Path, line: usize, column: usize, message: impl Into<String>) -> Self {
        Self::Parse { path: path.to_path_buf(), line, column, message: message.into() }
    }

    /// Creates an [`Error::Format`] for `path`.
    pub fn format(path: &Path, message: impl Into<String>) -> Self {
        Self::Format { path: path.to_path_buf(), message: message.into() }
    }

    /// Creates an [`Error::Scene`] for `path`.
    pub fn scene(path: &Path, message: impl Into<String>) -> Self {
        Self::Scene { path: path.to_path_buf(), message: message.into() }
    }

    /// Creates an [`Error::Memory`] of a refused request.
    pub fn memory(shortage: Shortage) -> Self {
        Self::Memory { message: shortage.to_string(), help: None }
    }

    /// Creates an [`Error::Usage`].
    pub fn usage(message: impl Into<String>) -> Self {
        Self::Usage { message: message.into() }
    }

    /// Creates an [`Error::Comparison`].
    pub fn comparison(message: impl Into<String>) -> Self {
        Self::Comparison { message: message.into() }
    }

    /// Exit status: 2 for wrong usage, 3 for a metric beyond its threshold, 75 (`EX_TEMPFAIL`) where another
    /// machine or a later try may succeed, 130 interrupted, else 1.
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Usage { .. } => 2,
            Self::Threshold { .. } => 3,
            Self::Vulkan { .. } | Self::Device { .. } => 75,
            Self::Io { source, .. } if is_passing(source) => 75,
            Self::Interrupted => 130,
            _ => 1,
        }
    }
}

/// True for faults of disks and networks that are no fault of a name or a right.
fn is_passing(error: &std::io::Error) -> bool {
    use std::io::ErrorKind as Kind;
    const INPUT_OUTPUT_ERROR: i32 = 5;
    let passing = [
        Kind::StorageFull,
        Kind::QuotaExceeded,
        Kind::StaleNetworkFileHandle,
        Kind::TimedOut,
        Kind::HostUnreachable,
        Kind::NetworkUnreachable,
        Kind::NetworkDown,
    ];
    passing.contains(&error.kind())
        || (cfg!(unix) && error.raw_os_error() == Some(INPUT_OUTPUT_ERROR))
}

/// Message about a range of a text's bytes, before its file is known.
#[derive(Debug)]
pub struct TextError {
    /// The range.
    pub span: Range<usize>,
    /// Expected and found.
    pub message: String,
}

impl TextError {
    /// Converts to an [`Error::Parse`] of the file `path`, which holds `text`.
    pub fn locate(self, path: &Path, text: &str) -> Error {
        let (line, column) = line_and_column(text, self.span.start);
        Error::parse(path, line, column, self.message)
    }
}

impl From<toml::de::Error> for TextError {
    fn from(error: toml::de::Error) -> Self {
        Self { span: error.span().unwrap_or(0..0), message: error.message().to_owned() }
    }
}

/// Line and column of a byte offset, both from 1; columns count characters.
pub(crate) fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}
