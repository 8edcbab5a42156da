//! Progress on standard error: a bar on a terminal, plain lines that back off otherwise.

use std::{
    io::IsTerminal,
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

use crate::{
    session::Standing,
    stage,
    terminal::{escaped, say},
};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Resolution of the bar, steps.
const STEPS: u64 = 10_000;
/// First interval between plain lines; it doubles up to [`LONGEST_INTERVAL`].
const FIRST_INTERVAL: Duration = Duration::from_secs(1);
/// Longest interval between plain lines.
const LONGEST_INTERVAL: Duration = Duration::from_secs(60);

/// Interval between the words of [`Patience`]; it doubles.
const PATIENCE: Duration = Duration::from_secs(2);

/// Says what takes long before the first pass, until it is dropped.
pub(crate) struct Patience {
    /// Ends the thread by closing.
    end: Option<mpsc::Sender<()>>,
    thread: Option<thread::JoinHandle<()>>,
}

impl Patience {
    /// Starts the clock; `quiet` says nothing. So does a system that allows no more threads.
    pub(crate) fn new(label: &str, quiet: bool) -> Self {
        let (end, closed) = mpsc::channel::<()>();
        let label = label.to_owned();
        let watch = move || {
            let start = Instant::now();
            let mut interval = PATIENCE;
            while closed.recv_timeout(interval) == Err(mpsc::RecvTimeoutError::Timeout) {
                say!("{label}: {:.0} s, {}", start.elapsed().as_secs_f64(), stage::current());
                interval = (interval * 2).min(LONGEST_INTERVAL);
            }
        };
        let thread = if quiet { None } else { thread::Builder::new().spawn(watch).ok() };
        Self { end: Some(end), thread }
    }
}

impl Drop for Patience {
    fn drop(&mut self) {
        drop(self.end.take());
        if let Some(Err(_)) = self.thread.take().map(thread::JoinHandle::join) {
            log::warn!("the thread that shows the progress of loading has failed");
        }
    }
}

enum Output {
    Bar(ProgressBar),
    Lines { last: Instant, interval: Duration },
    Quiet,
}

/// Progress of one run.
pub(crate) struct Progress {
    label: String,
    start: Instant,
    output: Output,
}

impl Progress {
    /// Starts the clock. `quiet` shows nothing.
    pub(crate) fn new(label: impl Into<String>, quiet: bool) -> Self {
        // A line of its own would pass for the program's.
        let label = escaped(&label.into()).replace('\n', "\\u000a");
        let output = if quiet {
            Output::Quiet
        } else if std::io::stderr().is_terminal() {
            let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
            let template = "{prefix} [{bar:30}] {percent:>3}% {msg}";
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_prefix(label.clone());
            Output::Bar(bar)
        } else {
            Output::Lines { last: Instant::now(), interval: FIRST_INTERVAL }
        };
        Self { label, start: Instant::now(), output }
    }

    /// Updates the display; call it as often as convenient.
    pub(crate) fn update(&mut self, standing: &Standing) {
        let elapsed = self.start.elapsed();
        let message = || {
            let remaining = remaining(elapsed, standing.fraction)
                .map_or_else(String::new, |time| format!(", {} left", HumanDuration(time)));
            let mut parts = vec![standing.to_string(), HumanDuration(elapsed).to_string()];
            parts.retain(|part| !part.is_empty());
            parts.join(", ") + &remaining
        };
        match &mut self.output {
            Output::Bar(bar) => {
                bar.set_position((standing.fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
                bar.set_message(message());
            }
            Output::Lines { last, interval } => {
                if last.elapsed() >= *interval {
                    *last = Instant::now();
                    *interval = (*interval * 2).min(LONGEST_INTERVAL);
                    let percent = 100.0 * standing.fraction.clamp(0.0, 1.0);
                    say!("{}: {percent:.0}%, {}", self.label, message());
                }
            }
            Output::Quiet => {}
        }
    }

    /// Prints a permanent line above the bar (a warning, a file written).
    pub(crate) fn print(&self, line: &str) {
        match &self.output {
            Output::Bar(bar) => bar.suspend(|| say!("{line}")),
            Output::Lines { .. } => say!("{line}"),
            Output::Quiet => {}
        }
    }

    /// Removes the bar and prints a last line: the final state and why the run ended.
    pub(crate) fn finish(self, standing: &Standing, reason: &str) {
        if let Output::Bar(bar) = &self.output {
            bar.finish_and_clear();
        }
        if !matches!(self.output, Output::Quiet) {
            let elapsed = self.start.elapsed().as_secs_f64();
            let mut parts = vec![standing.to_string(), format!("in {elapsed:.1} s ({reason})")];
            parts.retain(|part| !part.is_empty());
            say!("{}: {}", self.label, parts.join(" "));
        }
    }
}

/// Estimates the time left from the rate so far; `None` at the start and if the end is unknown.
fn remaining(elapsed: Duration, fraction: f64) -> Option<Duration> {
    if !(0.001..1.0).contains(&fraction) {
        return None;
    }
    Duration::try_from_secs_f64(elapsed.as_secs_f64() * (1.0 - fraction) / fraction).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remaining_time_follows_the_rate_so_far() {
        let time = |seconds| Duration::from_secs(seconds);
        assert_eq!(remaining(time(10), 0.25), Some(time(30)));
        assert_eq!(remaining(time(10), 0.0), None);
        assert_eq!(remaining(time(10), 1.0), None);
        assert_eq!(remaining(time(10), f64::NAN), None);
    }
}
