//! Runs of a study: interruptible, with a forecast of the time left.

use std::time::Instant;

use crate::{
    error::{Error, Result},
    session::{Event, Flag, Observer, Rules, Session, Standing, StopReason},
};

/// Seconds per camera path until some are measured.
const FIRST_GUESS: f64 = 2e-6;

/// An observer with the forecast of a study.
pub(crate) struct Watch<'a> {
    observer: &'a mut dyn Observer,
    start: Instant,
    /// Camera paths left in runs that end by samples.
    paths_left: f64,
    /// Seconds left in runs that end by time.
    seconds_left: f64,
    measured_paths: f64,
    measured_seconds: f64,
}

impl<'a> Watch<'a> {
    pub(crate) fn new(observer: &'a mut dyn Observer) -> Self {
        Self {
            observer,
            start: Instant::now(),
            paths_left: 0.0,
            seconds_left: 0.0,
            measured_paths: 0.0,
            measured_seconds: 0.0,
        }
    }

    /// Adds expected work; negative values take it back.
    pub(crate) fn expect(&mut self, paths: f64, seconds: f64) {
        self.paths_left += paths;
        self.seconds_left += seconds;
    }

    pub(crate) fn note(&mut self, line: &str) {
        self.observer.notice(&Event::Note(line));
    }

    /// Fails if the observer interrupts the study.
    pub(crate) fn check(&self) -> Result<()> {
        if self.observer.interrupt().is_raised() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Accounts for a pass.
    fn count(&mut self, paths: f64, seconds: f64, by_time: bool) {
        self.measured_paths += paths;
        self.measured_seconds += seconds;
        if by_time {
            self.seconds_left = (self.seconds_left - seconds).max(0.0);
        } else {
            self.paths_left = (self.paths_left - paths).max(0.0);
        }
    }

    /// Renders until a rule is met. The forecast counts the run in seconds where `by_time`, else in camera
    /// paths.
    pub(crate) fn run(
        &mut self,
        session: &mut Session,
        rules: &Rules,
        by_time: bool,
    ) -> Result<()> {
        self.check()?;
        let pixels = session.renderer.film_size.map(f64::from);
        let mut run = WatchedRun { watch: self, pixels: pixels[0] * pixels[1], by_time };
        match session.run(rules, &mut run)? {
            StopReason::Interrupt if session.met(rules).is_none() => Err(Error::Interrupted),
            _ => Ok(()),
        }
    }

    fn fraction(&self, elapsed: f64) -> f64 {
        let cost = if self.measured_paths > 0.0 {
            self.measured_seconds / self.measured_paths
        } else {
            FIRST_GUESS
        };
        let left = self.paths_left * cost + self.seconds_left;
        if left > 0.0 { elapsed / (elapsed + left) } else { 1.0 }
    }
}

/// One run of a study, as seen by its session.
struct WatchedRun<'a, 'b> {
    watch: &'a mut Watch<'b>,
    pixels: f64,
    by_time: bool,
}

impl Observer for WatchedRun<'_, '_> {
    fn interrupt(&self) -> Flag {
        self.watch.observer.interrupt()
    }

    fn notice(&mut self, event: &Event<'_>) {
        let Event::Pass { samples, seconds, standing } = *event else { return };
        self.watch.count(self.pixels * f64::from(samples), seconds, self.by_time);
        let fraction = self.watch.fraction(self.watch.start.elapsed().as_secs_f64());
        let rays_per_second = standing.rays_per_second;
        let standing = Standing { fraction, rays_per_second, ..Standing::default() };
        self.watch.observer.notice(&Event::Pass { samples, seconds, standing });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forecast_follows_what_was_measured() {
        let mut silent = |_: &Event<'_>| ();
        let mut watch = Watch::new(&mut silent);
        watch.expect(100.0, 3.0);
        watch.count(50.0, 1.0, false);
        // 50 paths of 1/50 s and 3 s are left.
        assert!((watch.fraction(4.0) - 0.5).abs() < 1e-12);
        watch.count(20.0, 2.0, true);
        assert!((watch.seconds_left - 1.0).abs() < 1e-12);
        watch.expect(-50.0, -1.0);
        assert_eq!(watch.fraction(4.0), 1.0);
    }
}
