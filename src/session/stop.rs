//! Rules that end a run, and how far it is from them.

use std::{
    fmt,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

/// A flag that is raised to interrupt a run. Its clones are raised with it.
#[derive(Clone, Debug, Default)]
pub struct Flag(Arc<AtomicBool>);

impl Flag {
    /// Raises the flag; returns true if it was raised before.
    pub fn raise(&self) -> bool {
        self.0.swap(true, Ordering::SeqCst)
    }

    /// True once the flag is raised.
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// When a run ends, at the first rule that is met, and what happens on its way. Without any rule it ends
/// at the last sample of the seed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rules {
    /// Camera paths per pixel, those of earlier runs included.
    pub samples: Option<u32>,
    /// Wall time of the passes, those of earlier runs included, seconds.
    pub seconds: Option<f64>,
    /// Mean relative standard error. Slightly biased, since the data decide when to stop; a black film has
    /// no error and never stops.
    pub error: Option<f64>,
    /// True to look at the film about once a second, for the error and [`Event::Look`](super::Event).
    pub looks: bool,
    /// File and interval of checkpoints.
    pub checkpoints: Option<(PathBuf, Duration)>,
}

/// Named stop rules for a picture to show: a time that suits its purpose, and samples beyond which nobody
/// sees a difference. None is by error, which would bias the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Quality {
    /// 10 s: light and view, at most 64 samples per pixel.
    Preview,
    /// 50 s, so that the picture is on disk within a minute; at most 1024 samples per pixel.
    Good,
    /// 10 min, at most 16384 samples per pixel.
    Final,
}

impl Quality {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Preview => "preview",
            Self::Good => "good",
            Self::Final => "final",
        }
    }

    /// Returns the rules.
    pub fn rules(self) -> Rules {
        let (seconds, samples) = match self {
            Self::Preview => (10.0, 64),
            Self::Good => (50.0, 1024),
            Self::Final => (600.0, 16_384),
        };
        Rules { seconds: Some(seconds), samples: Some(samples), ..Rules::default() }
    }
}

/// Limit of a stop rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// Camera paths per pixel.
    Samples(u32),
    /// Wall time of the passes, seconds.
    Seconds(f64),
    /// Mean relative standard error.
    Error(f64),
}

impl fmt::Display for Limit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Samples(samples) => write!(formatter, "{samples} spp"),
            Self::Seconds(seconds) if seconds < 120.0 => write!(formatter, "{seconds} s"),
            Self::Seconds(seconds) => write!(formatter, "{} min", seconds / 60.0),
            Self::Error(error) => write!(formatter, "error {}%", 100.0 * error),
        }
    }
}

/// Rule that ended a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The film has the samples.
    Samples,
    /// The passes have taken the time.
    Time,
    /// The error is small enough.
    Error,
    /// The seed has no more samples.
    LastSample,
    /// The observer interrupts the run.
    Interrupt,
}

impl StopReason {
    /// Name in statistics.
    pub fn name(self) -> &'static str {
        match self {
            Self::Samples => "spp",
            Self::Time => "time",
            Self::Error => "error",
            Self::LastSample => "last-sample",
            Self::Interrupt => "interrupt",
        }
    }
}

/// State of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// Fraction done, 0…1, by the stop rule that will be met first.
    pub fraction: f64,
    /// Limit of that rule, if there is one.
    pub limit: Option<Limit>,
    /// Wall time until it is met, by the rate of the latter part of the run, seconds; `None` if unknown.
    pub seconds_left: Option<f64>,
    /// Camera paths per pixel so far.
    pub samples: u32,
    /// Rays per second so far; 0 if unknown.
    pub rays_per_second: f64,
    /// Mean relative standard error, if known.
    pub relative_error: Option<f64>,
}

impl fmt::Display for Standing {
    /// Formats "64 spp, 3.21 Mrays/s, error 4.20%", leaving out zeros and unknowns.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let error = self.relative_error.filter(|error| error.is_finite());
        let parts = [
            (self.samples > 0).then(|| format!("{} spp", self.samples)),
            (self.rays_per_second > 0.0)
                .then(|| format!("{:.2} Mrays/s", self.rays_per_second * 1e-6)),
            error.map(|error| format!("error {:.2}%", 100.0 * error)),
        ];
        formatter.write_str(&parts.into_iter().flatten().collect::<Vec<_>>().join(", "))
    }
}

/// Parses `500ms`, `30s`, `5m`, `1h`, or plain seconds.
pub fn parse_duration(text: &str) -> Result<Duration, String> {
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let factor = match unit {
        "ms" => 1e-3,
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => {
            return Err(format!(
                "expected a duration such as 30s, 500ms, 5m or 1h, found {text:?}"
            ));
        }
    };
    number
        .trim()
        .parse::<f64>()
        .ok()
        .filter(|number| *number > 0.0)
        .and_then(|number| Duration::try_from_secs_f64(number * factor).ok())
        .filter(|duration| !duration.is_zero())
        .ok_or_else(|| format!("expected a positive duration such as 30s, found {text:?}"))
}

/// Rate of the latter part of a run. A technique that learns is slow at first, so the mean since the start
/// would promise too much time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    /// Seconds of passes and samples of three moments: the last two that doubled the time, and now.
    marks: [(f64, u32); 3],
    /// Wall time for each second of passes: looks and checkpoints take theirs.
    pub wall_share: f64,
}

impl Rate {
    /// Starts at a film of `samples` samples per pixel.
    pub(super) fn from(samples: u32) -> Self {
        Self { marks: [(0.0, samples); 3], wall_share: 1.0 }
    }

    /// Takes note of `samples` per pixel after so many seconds of passes.
    pub(super) fn note(&mut self, seconds: f64, samples: u32) {
        let [_, last, now] = &mut self.marks;
        *now = (seconds, samples);
        if seconds >= 2.0 * last.0 {
            self.marks = [*last, *now, *now];
        }
    }

    /// Predicts the wall time of `samples` more, seconds; `None` if nothing is known yet.
    pub(super) fn seconds_of(&self, samples: f64) -> Option<f64> {
        let [(start, before), _, (end, after)] = self.marks;
        let each = (end - start) / f64::from(after.checked_sub(before).filter(|count| *count > 0)?);
        Some(samples * each * self.wall_share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_units() {
        assert_eq!(parse_duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(parse_duration("30s"), Ok(Duration::from_secs(30)));
        assert_eq!(parse_duration("30"), Ok(Duration::from_secs(30)));
        assert_eq!(parse_duration("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(parse_duration("1h"), Ok(Duration::from_secs(3600)));
        for wrong in ["", "s", "0s", "-1s", "1d", "1e400s", "nan", "NaNs"] {
            assert!(parse_duration(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn qualities_end_by_time_or_samples() {
        for (quality, seconds, samples) in [
            (Quality::Preview, 10.0, 64),
            (Quality::Good, 50.0, 1024),
            (Quality::Final, 600.0, 16_384),
        ] {
            let expected =
                Rules { seconds: Some(seconds), samples: Some(samples), ..Rules::default() };
            assert_eq!(quality.rules(), expected, "{}", quality.name());
        }
    }

    #[test]
    fn standing_leaves_out_what_is_unknown() {
        let mut standing = Standing { samples: 64, ..Standing::default() };
        assert_eq!(standing.to_string(), "64 spp");
        standing.rays_per_second = 3.21e6;
        standing.relative_error = Some(0.042);
        assert_eq!(standing.to_string(), "64 spp, 3.21 Mrays/s, error 4.20%");
        standing.relative_error = Some(f64::INFINITY);
        assert_eq!(standing.to_string(), "64 spp, 3.21 Mrays/s");
        let limits =
            [Limit::Samples(64), Limit::Seconds(90.0), Limit::Seconds(600.0), Limit::Error(0.02)];
        let found = limits.map(|limit| limit.to_string());
        assert_eq!(found, ["64 spp", "90 s", "10 min", "error 2%"]);
    }

    /// A run whose first 8 samples take a second each, later ones a quarter.
    #[test]
    fn the_forecast_forgets_a_slow_start() {
        let mut rate = Rate::from(0);
        assert_eq!(rate.seconds_of(1.0), None);
        let mut told_of_looks = Rate::from(0);
        told_of_looks.note(2.0, 4);
        told_of_looks.wall_share = 1.5;
        assert_eq!(told_of_looks.seconds_of(8.0), Some(6.0), "looks take half as long as passes");
        let seconds =
            |samples: u32| f64::from(samples.min(8)) + 0.25 * f64::from(samples.saturating_sub(8));
        let mut told = Vec::new();
        for samples in 1..=256 {
            rate.note(seconds(samples), samples);
            let left = seconds(256) - seconds(samples);
            let is_late = seconds(samples) >= 0.25 * seconds(256);
            if is_late && samples < 256 {
                told.push(
                    rate.seconds_of(f64::from(256 - samples)).map_or(0.0, |told| told / left),
                );
            }
        }
        assert!(told.iter().all(|ratio| (0.67..1.5).contains(ratio)), "{told:?}");
    }
}
