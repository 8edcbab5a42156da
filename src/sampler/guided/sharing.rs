//! Measures what it gains that the pixels of a cohort share paths, for `guided` with `share-paths=auto`.
//!
//! Renders the same blocks of pixels without and with sharing, as `choice.rs` does for candidates.
//! Compares variances alone: what sharing costs is known, and no busy machine can disturb it.

use std::{fmt, time::Instant};

use serde::Serialize;

use super::{
    choice::{FEWEST_SAMPLES, MEASURED_PIXELS, MOST_ROUNDS, Measured, Trial},
    cost::relative_variances,
    parameters::AUTO_COHORT_EDGE,
};
use crate::{
    error::Result,
    pass::{Progress, Runner, film_buffers::BLOCK_PIXELS},
    shader::{constants::MEASURED_WAVE, structs::Wave},
};

/// Ratio of the variances from which sharing pays: with it, a sample takes 1.3 to 1.7 times as long.
const LEAST_RATIO: f64 = 1.6;
/// Standard errors by which the logarithm of the ratio must differ for an early end.
const CONFIDENCE: f64 = 2.0;

/// Measured gain of paths that the pixels of a cohort share.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct SharingGain {
    /// Relative variance without sharing over that with it, as in
    /// [`CandidateCost`](super::cost::CandidateCost).
    pub(super) variance_ratio: f64,
    /// Standard error over the blocks of its logarithm; 1000 if there is only one block.
    pub(super) log_error: f64,
}

impl fmt::Display for SharingGain {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:.2} (±{:.0}%)", self.variance_ratio, 100.0 * self.log_error)
    }
}

/// Edge of the cohorts that `guided` chose, and why.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SharingChoice {
    /// The edge, 1 for none; `None` while undecided.
    pub(super) edge: Option<u32>,
    /// Measurement behind it.
    pub(super) gain: Option<SharingGain>,
    pub(super) ms: f64,
}

impl Trial<'_> {
    /// Measures and chooses. Forgets the counts since the last rebuild.
    pub(super) fn choose_sharing(
        mut self,
        runner: &mut Runner,
        progress: &Progress,
    ) -> Result<SharingChoice> {
        let start = Instant::now();
        let blocks = runner.film().padded_pixels() / BLOCK_PIXELS;
        let most = MEASURED_PIXELS.min(runner.waves().capacity() / FEWEST_SAMPLES) / BLOCK_PIXELS;
        let block_stride = blocks.div_ceil(most.max(1)).max(1);
        let mut measured = [Measured::default(), Measured::default()];
        let mut gain = None;
        for round in 0..MOST_ROUNDS.min(block_stride) {
            let wave = Wave {
                first_pixel: round * block_stride.div_ceil(MOST_ROUNDS) * BLOCK_PIXELS,
                pixel_count: (blocks / block_stride).max(1) * BLOCK_PIXELS,
                sample_count: FEWEST_SAMPLES,
                pixel_stride: 1,
                block_stride,
                is_training: MEASURED_WAVE,
                ..Wave::default()
            };
            for (measured, shares) in measured.iter_mut().zip([false, true]) {
                self.steps = self.steps.with_sharing(shares);
                let (_, paths) = self.run(runner, progress, wave)?;
                measured.add(&paths, FEWEST_SAMPLES);
            }
            let [without, with] = &measured;
            let Some(variances) = relative_variances(&[&without.spread, &with.spread]) else {
                continue;
            };
            let found = SharingGain {
                variance_ratio: variances[0].0 / variances[1].0,
                log_error: variances[1].1,
            };
            gain = Some(found);
            if (found.variance_ratio / LEAST_RATIO).ln().abs() > CONFIDENCE * found.log_error {
                break;
            }
        }
        self.buffers.clear_counts()?;
        runner.take_counters()?;
        let pays = gain.is_some_and(|gain| gain.variance_ratio > LEAST_RATIO);
        let edge = if pays { AUTO_COHORT_EDGE } else { 1 };
        let ms = start.elapsed().as_secs_f64() * 1e3;
        if let Some(gain) = gain {
            log::info!("share-paths={edge} by measurement in {ms:.0} ms: variance {gain} lower");
        }
        Ok(SharingChoice { edge: Some(edge), gain, ms })
    }
}
