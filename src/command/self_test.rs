//! `fenestra self-test`: the self-test of a device in a process of its own, which a driver may crash.

use std::{
    io::{Read, Write},
    path::PathBuf,
    process::{Command, ExitStatus, Stdio},
    thread,
    time::{Duration, Instant},
};

use sha2::{Digest, Sha256};

use super::{own_program, print_line};
use crate::{
    error::Result,
    files,
    gpu::{Capabilities, Device, Tracer, lavapipe},
    self_test,
    shader::spirv,
    stage,
    terminal::say,
};

const NAME: &str = "self-test";
/// Output of a process whose device has passed.
const PASSED: &str = "passed";
/// Longest test. Compiling takes most of it: 2 s on an idle machine, a minute was seen on a busy one.
const LONGEST: Duration = Duration::from_secs(300);
const INTERVAL: Duration = Duration::from_millis(5);

/// Arguments of `self-test`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Index of the device.
    #[arg(long, value_name = "INDEX")]
    pub device: String,
}

/// Tests a device and prints the verdict.
///
/// # Errors
/// The device cannot be opened or fails, which is no wrong answer.
pub fn run(arguments: &Arguments) -> Result<()> {
    forbid_core_dumps();
    // The host's tracer needs no test of the driver.
    let device = Device::open_traced(Some(&arguments.device), false, Tracer::Device)?;
    let faults = self_test::faults(&device)?;
    device.save_pipeline_cache();
    print_line(if faults.is_empty() { PASSED.to_owned() } else { faults.join("; ") }.as_str())
}

/// A crash of the driver is an expected answer.
pub(super) fn forbid_core_dumps() {
    #[cfg(unix)]
    {
        use nix::sys::resource::{Resource, setrlimit};
        if let Err(error) = setrlimit(Resource::RLIMIT_CORE, 0, 0) {
            log::debug!("core dumps stay allowed: {error}");
        }
    }
}

/// Prints the device of a command, and the remedy for a slow driver.
pub(crate) fn announce(device: &Device) {
    say!("device: {}", device.describe());
    if let Some(hint) = lavapipe::hint(&device.capabilities().driver) {
        say!("hint: {hint}");
    }
}

/// Tests a device unless it has passed before, with the same driver and settings. Fails with
/// [`crate::Error::Device`] if it does not pass. A test that cannot run says nothing about the device.
pub(crate) fn check(capabilities: &Capabilities) -> Result<()> {
    let record = record(capabilities);
    if record.as_ref().is_some_and(|path| path.exists()) {
        return Ok(());
    }
    stage::enter("testing the device, once");
    match test(capabilities.index, LONGEST) {
        Verdict::Passed => {
            let text = format!("{} ({})\n", capabilities.name, capabilities.driver);
            if let Some(Err(error)) = record
                .map(|path| files::write_atomically(&path, |file| file.write_all(text.as_bytes())))
            {
                log::debug!("the self-test is not remembered: {error}");
            }
            Ok(())
        }
        Verdict::Failed(fault) => Err(self_test::refusal(capabilities, &fault)),
        Verdict::NotRun(reason) => {
            log::debug!("the self-test did not run: {reason}");
            Ok(())
        }
    }
}

#[derive(Debug, PartialEq, Eq)]
enum Verdict {
    Passed,
    Failed(String),
    NotRun(String),
}

/// Returns the file that remembers a passed test of this device, driver, settings and shaders.
fn record(capabilities: &Capabilities) -> Option<PathBuf> {
    let mut digest = Sha256::new();
    let identity = serde_json::to_string(capabilities).ok()?;
    digest.update(identity);
    for setting in lavapipe::settings() {
        digest.update([0]);
        digest.update(setting);
    }
    // Lavapipe keeps buffers in files without a name, and crashes beyond the limit.
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    digest
        .update(limits.lines().find(|line| line.starts_with("Max file size")).unwrap_or_default());
    self_test::PASSES.iter().for_each(|pass| digest.update(spirv::pass(pass)));
    let name = files::hexadecimal(&digest.finalize());
    Some(files::cache_folder("self-tests")?.join(name))
}

/// Runs the program's test of a device.
fn test(index: usize, longest: Duration) -> Verdict {
    let tested = own_program().and_then(|mut command| {
        verdict(command.args([NAME, "--device", &index.to_string()]), longest)
    });
    tested.unwrap_or_else(|error| Verdict::NotRun(error.to_string()))
}

/// Runs a test and judges how it ended. Fails where it cannot be run or watched.
fn verdict(command: &mut Command, longest: Duration) -> std::io::Result<Verdict> {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    let start = Instant::now();
    let mut child = command.spawn()?;
    let status = loop {
        match child.try_wait()? {
            Some(status) => break status,
            None if start.elapsed() < longest => thread::sleep(INTERVAL),
            None => {
                let _ = child.kill().and_then(|()| child.wait().map(drop));
                let seconds = longest.as_secs_f64();
                return Ok(Verdict::Failed(format!("no answer in {seconds} s")));
            }
        }
    };
    let mut output = String::new();
    let read = child.stdout.take().map(|mut pipe| pipe.read_to_string(&mut output));
    Ok(match (crash(status), read, output.trim()) {
        (Some(signal), ..) => Verdict::Failed(format!("the driver crashes ({signal})")),
        (None, Some(Ok(_)), PASSED) if status.success() => Verdict::Passed,
        (None, Some(Ok(_)), fault) if status.success() && !fault.is_empty() => {
            Verdict::Failed(fault.to_owned())
        }
        _ => Verdict::NotRun(status.to_string()),
    })
}

/// Names the signal by which a process has crashed, and not been ended by someone.
#[cfg(unix)]
fn crash(status: ExitStatus) -> Option<&'static str> {
    use nix::sys::signal::Signal;
    use std::os::unix::process::ExitStatusExt;
    let signal = Signal::try_from(status.signal()?).ok()?;
    let crashes = [
        Signal::SIGABRT,
        Signal::SIGBUS,
        Signal::SIGFPE,
        Signal::SIGILL,
        Signal::SIGSEGV,
        Signal::SIGTRAP,
    ];
    crashes.contains(&signal).then(|| signal.as_str())
}

/// Systems without signals report a crash as a status without an output.
#[cfg(not(unix))]
fn crash(_status: ExitStatus) -> Option<&'static str> {
    None
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn of(script: &str, longest: Duration) -> Verdict {
        verdict(Command::new("sh").args(["-c", script]), longest).unwrap()
    }

    #[test]
    fn verdicts_are_those_of_the_process() {
        let minute = Duration::from_secs(60);
        assert_eq!(of("echo passed", minute), Verdict::Passed);
        assert_eq!(of("echo no hit", minute), Verdict::Failed("no hit".into()));
        assert_eq!(
            of("kill -SEGV $$", minute),
            Verdict::Failed("the driver crashes (SIGSEGV)".into())
        );
        assert_eq!(
            of("exec sleep 60", Duration::from_millis(50)),
            Verdict::Failed("no answer in 0.05 s".into())
        );
        for ended in ["kill -TERM $$", "echo passed; exit 1", "true"] {
            assert!(matches!(of(ended, minute), Verdict::NotRun(_)), "{ended}");
        }
    }
}
