//! A pilot: samples that teach a technique before the first sample of the picture.
//!
//! It has random numbers of its own, so the picture's samples are independent of what it teaches. It depends
//! on scene, film, crop window and seed alone: a render that goes on from its sums, and one of later
//! samples, repeat it.

use crate::{
    error::Result,
    pass::{Passes, Progress, Runner},
    shader::{constants::TRAINING_WAVE, structs::Wave},
};

/// Tells the random numbers of the pilot from those of the picture.
const PILOT_SEED: u32 = 0x3a91_0c57;

/// Shoots `samples` samples of every pixel, which add nothing to the film. Returns false if the render was
/// stopped meanwhile. Fails if the device does.
pub fn shoot(
    passes: &dyn Passes,
    runner: &mut Runner,
    progress: &Progress,
    samples: u32,
) -> Result<bool> {
    let wave = Wave {
        sample_count: samples,
        seed: progress.seed ^ PILOT_SEED,
        pixel_stride: 1,
        is_training: TRAINING_WAVE,
        ..Wave::default()
    };
    runner.sweep(passes, wave, runner.film().padded_pixels())?;
    runner.take_counters()?;
    Ok(!runner.is_stopped())
}
