//! A sampler at work in a render: learning between passes, and the figures it reports.

use std::{any::Any, collections::BTreeMap};

use super::{runner::Runner, steps::Passes};
use crate::{
    error::Result,
    film::statistics::{CandidateCost, SharingGain},
    shader::structs::Wave,
};

/// Progress of a progressive render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Index of the first sample of every pixel.
    pub first_sample: u32,
    /// Samples per pixel in the film.
    pub sample_count: u32,
    /// Seed of the random numbers.
    pub seed: u32,
}

impl Progress {
    /// Index of the next sample.
    pub fn next_sample(&self) -> u32 {
        self.first_sample.wrapping_add(self.sample_count)
    }
}

/// Figures that a technique adds to statistics and metadata.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Host milliseconds by stage.
    pub host_ms: BTreeMap<String, f64>,
    /// Device memory by buffer, bytes.
    pub buffer_bytes: BTreeMap<String, u64>,
    /// Hash of each fit by what was fitted.
    pub fit_hashes: BTreeMap<String, String>,
    /// Candidates per shadow ray, for techniques that choose their number.
    pub candidates: Option<u32>,
    /// Measurements behind this choice.
    pub candidate_costs: Vec<CandidateCost>,
    /// Edge of the tiles that share paths, 1 for none, for techniques that choose it.
    pub share_tiles: Option<u32>,
    /// Measurement behind this choice.
    pub sharing_gain: Option<SharingGain>,
}

/// A sampler at work in one render.
pub trait Technique: Passes + Any {
    /// Completes the push constants of a wave of the picture.
    fn complete(&self, wave: Wave, _progress: &Progress) -> Wave {
        wave
    }

    /// Learns what is due before the next sample. Returns how many samples may follow before it has to
    /// learn again, which depends on their number, not on their grouping. Fails if the device does.
    fn learn(&mut self, _runner: &mut Runner, _progress: &Progress) -> Result<u32> {
        Ok(u32::MAX)
    }

    /// Forgets everything learned. Fails if the device does.
    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        Ok(())
    }

    /// Goes on under another camera, whose random numbers are new, too. Uses what was counted so far if
    /// `learns`; else that waits. Forgets everything unless it holds for the scene as a whole. Fails if
    /// the device does.
    fn look(&mut self, runner: &mut Runner, _learns: bool) -> Result<()> {
        self.restart(runner)
    }

    /// Returns [`crate::Error::Usage`] if sums alone cannot continue a film of so many `samples`.
    fn check_resume(&self, _samples: u32, _progress: &Progress) -> Result<()> {
        Ok(())
    }

    /// Returns figures for statistics and metadata.
    fn report(&self) -> Report {
        Report::default()
    }
}
