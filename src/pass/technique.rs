//! A sampler at work in a render: learning between passes, and the figures it reports.

use std::{any::Any, collections::BTreeMap, path::Path};

use serde_json::Value;

use super::{
    explanation::{Explanation, PixelReadback},
    runner::Runner,
    steps::Passes,
};
use crate::{
    error::{Error, Result},
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
    pub(crate) fn next_sample(&self) -> u32 {
        self.first_sample.wrapping_add(self.sample_count)
    }
}

/// Figures that a technique adds to statistics and metadata.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Host milliseconds by stage.
    pub host_ms: BTreeMap<String, f64>,
    /// Hash of each fit by what was fitted.
    pub fit_hashes: BTreeMap<String, String>,
    /// Candidates per shadow ray, for techniques that choose their number.
    pub candidates: Option<u32>,
    /// Says in one sentence what was chosen by measurement, and why.
    pub choice: Option<String>,
    /// Further figures for statistics, by name.
    pub figures: BTreeMap<String, Value>,
}

/// Knowledge that the technique of an earlier render saved.
#[derive(Clone, Copy, Debug)]
pub struct Saved<'a> {
    /// File that holds it, for messages.
    pub path: &'a Path,
    /// Content of the file.
    pub bytes: &'a [u8],
    /// True if it belongs to the samples in the film, so that the render continues bit for bit; else it
    /// counts as learned before the first sample, whatever film it came from.
    pub continues: bool,
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

    /// Returns what was learned in a film of `samples` samples per pixel, as the content of a file; `None`
    /// if nothing outlives the render. Fails if the device does.
    fn save(&self, _samples: u32) -> Result<Option<Vec<u8>>> {
        Ok(None)
    }

    /// Continues from what an earlier render saved, without training. Returns true if the geometry
    /// differs, so that most was forgotten. Fails with [`Error::Format`] for other content, with
    /// [`Error::Usage`] if it belongs to another scene or if this sampler learns nothing.
    fn load(&mut self, _runner: &mut Runner, _: &Progress, saved: Saved<'_>) -> Result<bool> {
        let path = saved.path.display();
        Err(Error::usage(format!("{path}: this sampler learns nothing; expected --sampler guided")))
    }

    /// Adds what the technique knows at the first path of the last wave, which was one block, once its
    /// last shadow ray is traced. Fails if the device does.
    fn explain(&self, _pixel: &mut PixelReadback) -> Result<()> {
        Ok(())
    }

    /// Explains film pixel `at` by `rays` shadow rays in whole samples after those in the film, for
    /// techniques whose choices depend on the whole picture. Counts them for learning. `None` if no camera
    /// ray hits anything, and for all other techniques. Fails if the device does. Panics if the pixel is
    /// outside the window.
    fn explain_learned(
        &self,
        _runner: &mut Runner,
        _progress: &Progress,
        _at: [u32; 2],
        _rays: u32,
    ) -> Result<Option<Box<dyn Explanation>>> {
        Ok(None)
    }

    /// Returns figures for statistics and metadata.
    fn report(&self) -> Report {
        Report::default()
    }
}
