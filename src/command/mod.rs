//! Subcommands, one per file: orchestration only, no mathematics, no Vulkan.

pub mod bench;
pub mod compare;
pub mod devices;
pub mod export;
pub mod fit;
mod guide;
pub mod info;
pub mod merge;
pub mod new;
pub mod options;
pub mod progress;
pub mod render;
pub mod study;

use std::io::Write;

use crate::error::{Error, Result};

/// Writes `text` and a line break to standard output. A closed pipe (`| head`) is not an error.
///
/// # Errors
/// Standard output cannot be written.
pub fn print_line(text: &str) -> Result<()> {
    let mut output = std::io::stdout().lock();
    match writeln!(output, "{text}").and_then(|()| output.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::io("standard output".as_ref(), "write", error))
        }
        _ => Ok(()),
    }
}
