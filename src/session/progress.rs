//! How far a run is from the rules that end it.

use super::{Rules, Session, Standing, StopReason};

impl Session {
    /// Samples per pixel at which a run ends for sure: those asked for, or the last of the seed, whose
    /// index is below 2³².
    pub(super) fn last_sample(&self, rules: &Rules) -> u32 {
        let most = u32::MAX - self.renderer.settings().first_sample;
        rules.samples.unwrap_or(most).min(most)
    }

    /// Seconds of passes until the time is over; infinite without such a rule.
    pub(super) fn seconds_left(&self, rules: &Rules) -> f64 {
        rules.seconds.map_or(f64::INFINITY, |seconds| seconds - self.seconds())
    }

    /// Returns the rule that is met, if any. A run by time or error renders at least one sample.
    pub fn met(&self, rules: &Rules) -> Option<StopReason> {
        let samples = self.renderer.sample_count();
        if rules.samples.is_some_and(|target| samples >= target) {
            return Some(StopReason::Samples);
        }
        if samples >= self.last_sample(rules) {
            return Some(StopReason::LastSample);
        }
        if samples > 0 && self.seconds_left(rules) <= 0.0 {
            return Some(StopReason::Time);
        }
        let reached = |limit: f64| samples > 1 && self.relative_error.is_some_and(|e| e <= limit);
        rules.error.is_some_and(reached).then_some(StopReason::Error)
    }

    /// Returns how far the run is.
    pub fn standing(&self, rules: &Rules) -> Standing {
        let samples = self.renderer.sample_count();
        let share = |done: f64, target: f64| (done / target).clamp(0.0, 1.0);
        let by_samples = rules.samples.map(|target| share(f64::from(samples), f64::from(target)));
        let by_time = rules.seconds.map(|seconds| share(self.seconds(), seconds));
        // The error falls with the square root of the work.
        let by_error = rules.error.zip(self.relative_error).map(|(target, error)| {
            if error > 0.0 { share((target / error).powi(2), 1.0) } else { 0.0 }
        });
        let fraction = [by_samples, by_time, by_error].into_iter().flatten().fold(0.0, f64::max);
        Standing {
            fraction,
            samples,
            rays_per_second: self.renderer.totals().rays() as f64 / self.own_seconds().max(1e-9),
            relative_error: self.relative_error,
        }
    }
}
