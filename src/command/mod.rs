//! Subcommands, one per file: orchestration only, no mathematics, no Vulkan.

pub mod bench;
pub mod compare;
pub mod compile;
pub mod completions;
pub mod convert;
mod denoise;
pub mod devices;
pub mod export;
pub mod fit;
pub mod info;
mod interrupt;
pub mod merge;
pub mod new;
pub mod options;
pub mod progress;
pub mod render;
pub mod self_test;
pub mod study;
pub mod view;

use std::{env, io::Write, process::Command, sync::OnceLock};

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::{
    error::{Error, Result},
    terminal::escaped,
};

/// Blocks signals that would end the process in the wrong way, in this thread and those it starts.
///
/// With SIGXFSZ blocked, a write beyond the limit of a file's size (`ulimit -f`) fails with an error
/// instead. SIGHUP stays ignored where it was when the program started (`nohup`), since the handler
/// of interrupts would take it.
#[cfg(unix)]
fn block_signals() -> nix::Result<()> {
    use nix::sys::signal::{SigSet, Signal};
    let mut blocked = SigSet::empty();
    blocked.add(Signal::SIGXFSZ);
    // Linux lists the ignored signals as a mask whose lowest bit is signal 1.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status
        .lines()
        .find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    if ignored.unwrap_or(0) & 1 << (Signal::SIGHUP as u32 - 1) != 0 {
        blocked.add(Signal::SIGHUP);
    }
    blocked.thread_block()
}

/// Blocks signals, then starts the worker threads. Where the system allows no more threads, returns a
/// pool that makes the calling thread do all work as long as it lives. Fails if that cannot be made either.
pub(crate) fn start_threads() -> Result<Option<ThreadPool>> {
    #[cfg(unix)]
    if let Err(error) = block_signals() {
        log::warn!("signals cannot be blocked: {error}");
    }
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

static PROGRAM: OnceLock<Vec<String>> = OnceLock::new();

/// Names what runs the program, and its first arguments: this process's own, if nobody does.
pub fn set_program(program: Vec<String>) {
    PROGRAM.set(program).ok();
}

/// Returns a command that runs this program in a process of its own. Fails if the system does not say where
/// it lies.
pub(crate) fn own_program() -> std::io::Result<Command> {
    let Some([program, arguments @ ..]) = PROGRAM.get().map(Vec::as_slice) else {
        return env::current_exe().map(Command::new);
    };
    let mut command = Command::new(program);
    command.args(arguments);
    Ok(command)
}

/// Writes `text` and a line break to standard output. A closed pipe (`| head`) is not an error.
pub(crate) fn print_line(text: &str) -> Result<()> {
    let mut output = std::io::stdout().lock();
    match writeln!(output, "{}", escaped(text)).and_then(|()| output.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::io("standard output".as_ref(), "write", error))
        }
        _ => Ok(()),
    }
}
