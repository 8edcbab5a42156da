//! How far a run is from the rules that end it.

use super::{Limit, Rules, Session, Standing, StopReason};

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

    /// Half the seconds of a sample in the last pass, unless that was the first, which also learns: a run by
    /// time ends with the sample whose end is nearest.
    fn half_sample(&self) -> f64 {
        let later = self.last_pass.filter(|(count, _)| *count < self.renderer.sample_count());
        later.map_or(0.0, |(count, took)| 0.5 * took / f64::from(count))
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
        if samples > 0 && self.seconds_left(rules) <= self.half_sample() {
            return Some(StopReason::Time);
        }
        // Below two samples it is infinite.
        let reached = |limit: f64| self.relative_error.is_some_and(|error| error <= limit);
        rules.error.is_some_and(reached).then_some(StopReason::Error)
    }

    /// Returns how far the run is: by the rule that the rate so far meets first, or as long as that is
    /// unknown, by the one that is nearest to its limit.
    pub fn standing(&self, rules: &Rules) -> Standing {
        let samples = self.renderer.sample_count();
        let left = |count: f64| self.rate.seconds_of(count).map(|seconds| seconds.max(0.0));
        let by_samples = rules.samples.map(|target| {
            let (done, all) = (f64::from(samples), f64::from(target));
            (Limit::Samples(target), done / all, left(all - done))
        });
        let by_time = rules.seconds.map(|seconds| {
            let left = self.seconds_left(rules).max(0.0) * self.rate.wall_share;
            (Limit::Seconds(seconds), self.seconds() / seconds, Some(left))
        });
        let is_usable = |error: &f64| error.is_finite() && *error > 0.0;
        let by_error = rules.error.map(|target| {
            // The error falls with the square root of the samples.
            let share = self.relative_error.filter(is_usable).map(|error| (target / error).powi(2));
            let left = share.and_then(|share| left(f64::from(samples) * (1.0 / share - 1.0)));
            (Limit::Error(target), share.unwrap_or(0.0), left)
        });
        let rules = [by_samples, by_time, by_error].into_iter().flatten();
        let nearest = rules.min_by(|(_, done, left), (_, other_done, other_left)| {
            let by_left = left.zip(*other_left).map(|(left, other)| left.total_cmp(&other));
            by_left.unwrap_or_else(|| other_done.total_cmp(done))
        });
        Standing {
            fraction: nearest.map_or(0.0, |(_, done, _)| done.clamp(0.0, 1.0)),
            limit: nearest.map(|(limit, ..)| limit),
            seconds_left: nearest.and_then(|(.., left)| left),
            samples,
            rays_per_second: self.renderer.totals().rays() as f64 / self.own_seconds.max(1e-9),
            relative_error: self.relative_error,
        }
    }
}
