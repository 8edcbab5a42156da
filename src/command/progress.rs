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
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

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
            // Text beyond the width of the terminal is cut, so that the line never wraps.
            let template = "[{bar:12}] {elapsed:>3} {wide_msg}";
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_message(label.clone());
            bar.enable_steady_tick(Duration::from_secs(1));
            Output::Bar(bar)
        } else {
            Output::Lines { last: Instant::now(), interval: FIRST_INTERVAL }
        };
        Self { label, start: Instant::now(), output }
    }

    /// Updates the display; call it as often as convenient.
    pub(crate) fn update(&mut self, standing: &Standing) {
        let elapsed = self.start.elapsed();
        match &mut self.output {
            Output::Bar(bar) => {
                bar.set_position((standing.fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
                // The name of the scene comes last, where a narrow terminal cuts it.
                bar.set_message(format!("{}  {}", message(standing, elapsed), self.label));
            }
            Output::Lines { last, interval } => {
                if last.elapsed() >= *interval {
                    *last = Instant::now();
                    *interval = (*interval * 2).min(LONGEST_INTERVAL);
                    say!("{}: {}", self.label, message(standing, elapsed));
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

/// Tells a standing: "42% of 50 s, 29 s left, 118 spp, 3.21 Mrays/s, error 4.20%".
fn message(standing: &Standing, elapsed: Duration) -> String {
    let percent = 100.0 * standing.fraction.clamp(0.0, 1.0);
    let share = match standing.limit {
        Some(limit) => format!("{percent:.0}% of {limit}"),
        None => format!("{percent:.0}%"),
    };
    let left = match standing.limit {
        Some(_) => standing.seconds_left.and_then(|left| Duration::try_from_secs_f64(left).ok()),
        None => remaining(elapsed, standing.fraction),
    };
    let left = left.map(|time| format!("{} left", duration_text(time))).unwrap_or_default();
    let mut parts = vec![share, left, standing.to_string()];
    parts.retain(|part| !part.is_empty());
    parts.join(", ")
}

/// Formats a duration as "29 s", "3 min 05 s" or "2 h 03 min".
fn duration_text(duration: Duration) -> String {
    let seconds = duration.as_secs_f64().round() as u64;
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
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
    use crate::session::Limit;

    #[test]
    fn remaining_time_follows_the_rate_so_far() {
        let time = |seconds| Duration::from_secs(seconds);
        assert_eq!(remaining(time(10), 0.25), Some(time(30)));
        assert_eq!(remaining(time(10), 0.0), None);
        assert_eq!(remaining(time(10), 1.0), None);
        assert_eq!(remaining(time(10), f64::NAN), None);
    }

    #[test]
    fn the_message_begins_with_the_share_of_the_rule_and_the_time_left() {
        let elapsed = Duration::from_secs(10);
        let mut standing = Standing { fraction: 0.42, samples: 118, ..Standing::default() };
        assert_eq!(message(&standing, elapsed), "42%, 14 s left, 118 spp");
        standing.limit = Some(Limit::Seconds(50.0));
        assert_eq!(message(&standing, elapsed), "42% of 50 s, 118 spp");
        standing.seconds_left = Some(185.0);
        assert_eq!(message(&standing, elapsed), "42% of 50 s, 3 min 05 s left, 118 spp");
        standing.limit = Some(Limit::Error(0.02));
        standing.seconds_left = Some(7380.0);
        assert_eq!(message(&standing, elapsed), "42% of error 2%, 2 h 03 min left, 118 spp");
    }
}
