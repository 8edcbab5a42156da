//! Interruptible rendering: short passes, and a forecast of the time left.

use std::time::{Duration, Instant};

use crate::{
    error::{Error, Result},
    session::Renderer,
};

/// Duration aimed at for a pass, and so the delay until stop rules and Ctrl-C are noticed.
const LOOK_AROUND: Duration = Duration::from_millis(250);
/// Seconds per camera path until some are measured.
const FIRST_GUESS: f64 = 2e-6;

/// Follower of a study's progress.
pub trait Observer {
    /// True if the study should end as soon as it can without losing a finished run.
    fn is_interrupted(&self) -> bool;
    /// Shows the fraction done, 0…1, by time.
    fn update(&mut self, fraction: f64, rays_per_second: f64);
    /// Shows a permanent line.
    fn note(&mut self, line: &str);
}

/// An observer with the forecast of a study.
pub struct Watch<'a> {
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
    /// Starts the clock.
    pub fn new(observer: &'a mut dyn Observer) -> Self {
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
    pub fn expect(&mut self, paths: f64, seconds: f64) {
        self.paths_left += paths;
        self.seconds_left += seconds;
    }

    /// Shows a permanent line.
    pub fn note(&mut self, line: &str) {
        self.observer.note(line);
    }

    /// Fails if the observer interrupts the study.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn check(&self) -> Result<()> {
        if self.observer.is_interrupted() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Accounts for a pass.
    fn count(&mut self, paths: f64, seconds: f64, by_time: bool, rays_per_second: f64) {
        self.measured_paths += paths;
        self.measured_seconds += seconds;
        if by_time {
            self.seconds_left = (self.seconds_left - seconds).max(0.0);
        } else {
            self.paths_left = (self.paths_left - paths).max(0.0);
        }
        let fraction = self.fraction(self.start.elapsed().as_secs_f64());
        self.observer.update(fraction, rays_per_second);
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

/// Passes of one run and their wall time.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    pixels: f64,
    /// True if the forecast counts the run in seconds, not in camera paths.
    by_time: bool,
    pass_samples: u32,
    /// Wall time of the passes so far, seconds.
    pub seconds: f64,
}

impl Pace {
    /// Starts before the first pass over a film of `pixels`; `by_time` makes the forecast count the
    /// run in seconds instead of camera paths.
    pub fn new(pixels: f64, by_time: bool) -> Self {
        Self { pixels, by_time, pass_samples: 1, seconds: 0.0 }
    }

    /// Renders until the film has `target` samples or the passes of this run have taken `limit`
    /// seconds. A limited run renders at least one sample.
    ///
    /// # Errors
    /// [`Error::Interrupted`], or the device fails.
    pub fn advance(
        &mut self,
        renderer: &mut Renderer,
        target: u32,
        limit: Option<f64>,
        watch: &mut Watch<'_>,
    ) -> Result<()> {
        while renderer.sample_count() < target && !self.is_over(limit, renderer) {
            watch.check()?;
            let samples = self.pass_samples.min(target - renderer.sample_count());
            let start = Instant::now();
            renderer.render_pass(samples)?;
            let took = start.elapsed().as_secs_f64();
            self.seconds += took;
            let left = limit.map_or(f64::INFINITY, |limit| limit - self.seconds);
            self.pass_samples = next_pass_samples(samples, took, left);
            let totals = renderer.totals();
            let rays = totals.camera_rays + totals.bounce_rays + totals.shadow_rays_traced;
            let rate = rays as f64 / self.seconds.max(1e-9);
            watch.count(self.pixels * f64::from(samples), took, self.by_time, rate);
        }
        Ok(())
    }

    /// True if the run has reached its time limit.
    pub fn is_over(&self, limit: Option<f64>, renderer: &Renderer) -> bool {
        renderer.sample_count() > 0 && limit.is_some_and(|limit| self.seconds >= limit)
    }
}

/// Samples of the next pass after one of `samples` that took `took` seconds: at most twice as many,
/// to take about a quarter of a second and to end within `left` seconds.
pub fn next_pass_samples(samples: u32, took: f64, left: f64) -> u32 {
    let per_sample = took.max(1e-6) / f64::from(samples);
    let wanted = left.clamp(0.0, LOOK_AROUND.as_secs_f64());
    // At least 1, so that the cast is exact.
    (wanted / per_sample).floor().clamp(1.0, f64::from(samples) * 2.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Silent;

    impl Observer for Silent {
        fn is_interrupted(&self) -> bool {
            false
        }
        fn update(&mut self, _: f64, _: f64) {}
        fn note(&mut self, _: &str) {}
    }

    #[test]
    fn passes_grow_and_end_with_the_time() {
        assert_eq!(next_pass_samples(1, 0.01, f64::INFINITY), 2);
        assert_eq!(next_pass_samples(8, 0.8, f64::INFINITY), 2);
        assert_eq!(next_pass_samples(8, 0.08, 0.03), 3);
        assert_eq!(next_pass_samples(8, 0.08, -1.0), 1);
    }

    #[test]
    fn the_forecast_follows_what_was_measured() {
        let mut silent = Silent;
        let mut watch = Watch::new(&mut silent);
        watch.expect(100.0, 3.0);
        watch.count(50.0, 1.0, false, 0.0);
        // 50 paths of 1/50 s and 3 s are left.
        assert!((watch.fraction(4.0) - 0.5).abs() < 1e-12);
        watch.count(20.0, 2.0, true, 0.0);
        assert!((watch.seconds_left - 1.0).abs() < 1e-12);
        watch.expect(-50.0, -1.0);
        assert_eq!(watch.fraction(4.0), 1.0);
    }
}
