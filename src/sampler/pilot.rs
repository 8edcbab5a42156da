//! A pilot: samples that teach a technique before the first sample of the picture.
//!
//! It has random numbers of its own, so the picture's samples are independent of what it teaches. It depends
//! on scene, film, crop window and seed alone: a render that goes on from its sums, and one of later
//! samples, repeat it.

use std::{collections::BTreeMap, time::Instant};

use super::rays::RaySteps;
use crate::{
    error::Result,
    gpu::DescriptorSet,
    pass::{Passes, Progress, Report, Runner, Steps, Technique},
    shader::{constants::TRAINING_WAVE, structs::Wave},
};

/// Tells the random numbers of the pilot from those of the picture.
const PILOT_SEED: u32 = 0x3a91_0c57;

/// Tables that the pilot fills.
pub trait Tables: 'static {
    /// Name of [`Self::freeze`] among the stages of the host.
    const STAGE: &'static str;

    /// Descriptor set 1.
    fn set(&self) -> &DescriptorSet;

    /// Forgets everything. Fails if the device does.
    fn forget(&self) -> Result<()>;

    /// Turns what the pilot has counted into tables for the passes to come. Fails if the device does.
    fn freeze(&self) -> Result<()>;
}

/// A technique that learns from a pilot alone.
pub struct Piloted<T> {
    tables: T,
    pilot: RaySteps,
    steps: RaySteps,
    /// Samples of every pixel in the pilot.
    samples: u32,
    has_learned: bool,
    prepare_ms: BTreeMap<String, f64>,
    freeze_ms: f64,
}

impl<T: Tables> Piloted<T> {
    /// Makes the technique; `prepare_ms` are the stages of the host up to here.
    pub fn new(
        tables: T,
        [pilot, steps]: [RaySteps; 2],
        samples: u32,
        prepare_ms: BTreeMap<String, f64>,
    ) -> Self {
        Self { tables, pilot, steps, samples, has_learned: false, prepare_ms, freeze_ms: 0.0 }
    }
}

impl<T: Tables> Passes for Piloted<T> {
    fn steps(&self) -> &dyn Steps {
        if self.has_learned { &self.steps } else { &self.pilot }
    }

    fn other_steps(&self) -> Vec<Box<dyn Steps>> {
        vec![Box::new(self.steps.clone())]
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(self.tables.set())
    }
}

impl<T: Tables> Technique for Piloted<T> {
    /// Runs the pilot before the first sample.
    fn learn(&mut self, runner: &mut Runner, progress: &Progress) -> Result<u32> {
        if self.has_learned {
            return Ok(u32::MAX);
        }
        self.tables.forget()?;
        let wave = Wave {
            sample_count: self.samples,
            seed: progress.seed ^ PILOT_SEED,
            pixel_stride: 1,
            is_training: TRAINING_WAVE,
            ..Wave::default()
        };
        runner.sweep(self, wave, runner.film.padded_pixels())?;
        runner.take_counters()?;
        if runner.is_stopped {
            return Ok(u32::MAX);
        }
        let start = Instant::now();
        self.tables.freeze()?;
        self.freeze_ms += start.elapsed().as_secs_f64() * 1e3;
        self.has_learned = true;
        Ok(u32::MAX)
    }

    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        self.has_learned = false;
        self.freeze_ms = 0.0;
        Ok(())
    }

    fn report(&self) -> Report {
        let mut host_ms = self.prepare_ms.clone();
        host_ms.insert(T::STAGE.to_owned(), self.freeze_ms);
        Report { host_ms, ..Report::default() }
    }
}
