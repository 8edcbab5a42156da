//! Forecast of the time that a run will take.

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
    use super::Rate;

    /// A run whose first 8 samples take a second each, later ones a quarter.
    #[test]
    fn the_forecast_forgets_a_slow_start() {
        let mut rate = Rate::from(0);
        assert_eq!(rate.seconds_of(1.0), None);
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
