//! Rules that end a render, and how far it is from them.

use super::{DEFAULT_SPP, QUICK_SPP, RenderJob};
use crate::{
    command::{interrupt::Interrupt, progress::Standing},
    session::Renderer,
};

/// Rule that ended a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    Spp,
    Time,
    Error,
    /// The seed has no more samples.
    LastSample,
    Interrupt,
}

impl StopReason {
    pub fn name(self) -> &'static str {
        match self {
            Self::Spp => "spp",
            Self::Time => "time",
            Self::Error => "error",
            Self::LastSample => "last-sample",
            Self::Interrupt => "interrupt",
        }
    }

    pub fn explain(self) -> &'static str {
        match self {
            Self::Spp => "stopped by --spp",
            Self::Time => "stopped by --time",
            Self::Error => "stopped by --error (stopping by the data is slightly biased)",
            Self::LastSample => "stopped at the last sample of the seed",
            Self::Interrupt => "interrupted",
        }
    }
}

impl RenderJob<'_> {
    pub(super) fn seconds(&self) -> f64 {
        self.earlier_seconds + self.elapsed.as_secs_f64()
    }

    /// Returns the target of `--spp`, or the default if no stop rule is given.
    pub(super) fn target_spp(&self) -> Option<u32> {
        let none = self.arguments.time.is_none() && self.arguments.error.is_none();
        let default = if self.arguments.quick { QUICK_SPP } else { DEFAULT_SPP };
        self.arguments.spp.or_else(|| none.then_some(default))
    }

    /// Returns the samples per pixel up to the last of the seed, whose index is below 2³².
    pub(super) fn most_samples(&self) -> u32 {
        u32::MAX - self.arguments.sample_offset
    }

    pub(super) fn time_left(&self) -> Option<f64> {
        self.arguments.time.map(|time| time.as_secs_f64() - self.seconds())
    }

    pub(super) fn stop_reason(
        &self,
        renderer: &Renderer,
        interrupt: &Interrupt,
    ) -> Option<StopReason> {
        let samples = renderer.sample_count();
        if interrupt.is_raised() && samples > 0 {
            return Some(StopReason::Interrupt);
        }
        if self.target_spp().is_some_and(|spp| samples >= spp) {
            return Some(StopReason::Spp);
        }
        if samples >= self.most_samples() {
            return Some(StopReason::LastSample);
        }
        if samples > 0 && self.time_left().is_some_and(|left| left <= 0.0) {
            return Some(StopReason::Time);
        }
        let reached = |limit: f64| samples > 1 && self.relative_error.is_some_and(|e| e <= limit);
        if self.arguments.error.is_some_and(reached) {
            return Some(StopReason::Error);
        }
        None
    }

    pub(super) fn standing(&self, renderer: &Renderer) -> Standing {
        let totals = renderer.totals();
        let rays = totals.camera_rays + totals.bounce_rays + totals.shadow_rays_traced;
        let share = |done: f64, target: f64| (done / target).clamp(0.0, 1.0);
        let by_spp =
            self.target_spp().map(|spp| share(f64::from(renderer.sample_count()), f64::from(spp)));
        let by_time = self.arguments.time.map(|time| share(self.seconds(), time.as_secs_f64()));
        // The error falls with the square root of the work.
        let by_error = self.arguments.error.zip(self.relative_error).map(|(target, error)| {
            if error > 0.0 { share((target / error).powi(2), 1.0) } else { 0.0 }
        });
        let fraction = [by_spp, by_time, by_error].into_iter().flatten().fold(0.0, f64::max);
        Standing {
            fraction,
            samples: renderer.sample_count(),
            rays_per_second: rays as f64 / self.elapsed.as_secs_f64().max(1e-9),
            relative_error: self.relative_error,
        }
    }
}
