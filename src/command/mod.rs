//! Subcommands, one per file: orchestration only, no mathematics, no Vulkan.

pub mod bench;
pub mod compare;
pub mod devices;
pub mod fit;
mod guide;
pub mod info;
pub mod merge;
pub mod options;
pub mod progress;
pub mod render;
pub mod study;

use std::io::Write;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, Result};

/// Starts the worker threads. Where the system allows no more threads, returns a pool that makes the
/// calling thread do all work as long as it lives.
///
/// # Errors
/// A pool of one thread cannot be made either.
pub fn start_threads() -> Result<Option<ThreadPool>> {
    let Err(refused) = ThreadPoolBuilder::new().build_global() else {
        return Ok(None);
    };
    log::warn!("the system refuses more threads ({refused}): working with one");
    ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build()
        .map(Some)
        .map_err(|error| Error::usage(format!("cannot work with one thread: {error}")))
}

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
