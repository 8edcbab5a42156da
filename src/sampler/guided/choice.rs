//! Measures what candidates per shadow ray cost and bring, for `guided` with `candidates=auto`.
//!
//! The same pixels are rendered by 1 and by 4 candidates in turns, with the guide as the first sample
//! of the picture will find it; where 4 are worth it, by 4 and by 8. These rays are counted as rays
//! and as time. Nothing of them is in the picture, and nothing is learned from them, so that the
//! picture depends on what was measured by the number that is chosen and by nothing else.

use std::{collections::BTreeMap, time::Instant};

use super::{
    buffers::GuideBuffers,
    cost::{
        PixelSpread, choose_by_comparison, is_largest_clearly_worse, relative_variances,
        upper_median,
    },
    epoch::{TRAINING_SEED, with_epoch},
    steps::GuidedSteps,
};
use crate::{
    error::Result,
    film::statistics::CandidateCost,
    gpu::DescriptorSet,
    math::colour::luminance,
    pass::{Passes, Progress, Runner, Steps},
    shader::structs::{PathState, Wave},
};

/// Tells the random numbers of measurements from those of the training and of the picture.
const MEASURING_SEED: u32 = 0x2c1b_3c6d;
/// Most waves of each number of candidates in a comparison, in turns and over other pixels. The
/// comparison ends early where more candidates lose clearly, since not to take them is never wrong by
/// much.
const MOST_ROUNDS: u32 = 4;
/// Pixels from one to the next in film order, at least: one row or column of each of its blocks.
const STRIDE: u32 = 8;
/// Most pixels in a wave; a larger film needs no more to tell which number is better.
const MEASURED_PIXELS: u32 = 4096;
/// Measured pixels in a row that are a block of [`PixelSpread`]: enough that the logarithm of a block's
/// variance does not mistake a distribution with few large values for a narrow one.
const PIXELS_PER_BLOCK: usize = 32;
/// Samples of each pixel in a wave, to see how they differ.
const FEWEST_SAMPLES: u32 = 4;
/// More where they take less than [`LEAST_MS`].
const MOST_SAMPLES: u32 = 64;
/// Device milliseconds of a wave below which it is too short to be timed, or to fill the device.
const LEAST_MS: f64 = 10.0;

/// From how many candidates `guided` chooses, and why.
#[derive(Clone, Debug, Default)]
pub(super) struct Choice {
    /// The number; absent where it is not decided, and for other samplers.
    pub(super) candidates: Option<u32>,
    /// What was measured for it; empty where it was not.
    pub(super) costs: Vec<CandidateCost>,
    /// Wall milliseconds that the measurement took.
    pub(super) ms: f64,
}

/// Waves of one number of candidates.
#[derive(Default)]
struct Measured {
    /// Of the first wave for the fewest candidates. For more it is that of fewer times a ratio of
    /// waves that followed each other, since other work may slow all of them down.
    ms_per_path: Option<f64>,
    spread: PixelSpread,
}

/// The passes of `guided`, with the number of candidates under trial.
pub(super) struct Trial<'a> {
    pub(super) buffers: &'a GuideBuffers,
    pub(super) steps: GuidedSteps,
    /// Tag of the guides that this one went on from.
    pub(super) tag: u32,
}

impl Passes for Trial<'_> {
    fn steps(&self) -> &dyn Steps {
        &self.steps
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(self.buffers.set())
    }
}

impl Trial<'_> {
    /// Measures and chooses. The counts since the last rebuild are forgotten.
    pub(super) fn choose(mut self, runner: &mut Runner, progress: &Progress) -> Result<Choice> {
        let start = Instant::now();
        let mut measured = BTreeMap::new();
        let mut round = 0;
        let (chosen, costs) = choose_by_comparison(|chosen, more| {
            if runner.settings().shadow_rays == 0 {
                return Ok(Vec::new());
            }
            let samples = self.samples_to_measure(runner, progress, chosen)?;
            let mut ratios = Vec::new();
            let mut costs = Vec::new();
            for _ in 0..MOST_ROUNDS {
                let mut turn = [chosen, more];
                turn.rotate_left(round as usize % 2);
                let mut ms = BTreeMap::new();
                for candidates in turn {
                    let (wave_ms, paths) =
                        self.measure(runner, progress, candidates, round, samples)?;
                    ms.insert(candidates, wave_ms / paths.len() as f64);
                    let known: &mut Measured = measured.entry(candidates).or_default();
                    known.add(&paths, samples);
                }
                round += 1;
                ratios.push(ms[&more] / ms[&chosen]);
                let ms_of_chosen = measured
                    .get_mut(&chosen)
                    .map_or(f64::NAN, |known| *known.ms_per_path.get_or_insert(ms[&chosen]));
                if let Some(known) = measured.get_mut(&more) {
                    known.ms_per_path = Some(ms_of_chosen * upper_median(&ratios));
                }
                costs = costs_of(&measured, runner.film().padded_pixels());
                if is_largest_clearly_worse(&costs) {
                    break;
                }
            }
            Ok(costs)
        })?;
        self.buffers.clear_counts()?;
        runner.take_counters()?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let figures: Vec<String> = costs.iter().map(ToString::to_string).collect();
        log::info!("candidates={chosen} by measurement in {ms:.0} ms: {}", figures.join("; "));
        Ok(Choice { candidates: Some(chosen), costs, ms })
    }

    /// Samples of each pixel for a wave of at least [`LEAST_MS`], if there is room. What is traced to
    /// find this out also wakes the device and is not used.
    fn samples_to_measure(
        &mut self,
        runner: &mut Runner,
        progress: &Progress,
        candidates: u32,
    ) -> Result<u32> {
        let room = runner.waves().capacity() / measured_pixels(runner).1;
        let most = MOST_SAMPLES.min(room);
        let mut samples = 1;
        while self.measure(runner, progress, candidates, 0, samples)?.0 < LEAST_MS && samples < most
        {
            samples = (2 * samples).min(most);
        }
        Ok(samples.max(FEWEST_SAMPLES))
    }

    /// Renders a wave and reads it back: device milliseconds and the paths, sample after sample.
    fn measure(
        &mut self,
        runner: &mut Runner,
        progress: &Progress,
        candidates: u32,
        round: u32,
        samples: u32,
    ) -> Result<(f64, Vec<PathState>)> {
        let (pixel_stride, pixel_count) = measured_pixels(runner);
        let first_sample = progress.next_sample();
        let wave = Wave {
            first_pixel: round % STRIDE,
            pixel_count,
            first_sample,
            sample_count: samples,
            seed: progress.seed ^ TRAINING_SEED ^ MEASURING_SEED,
            pixel_stride,
            is_training: 1,
            ..Wave::default()
        };
        self.steps.candidates = candidates;
        runner.warm_up(self)?;
        let depth = runner.settings().depth;
        let times = runner.run(self, with_epoch(wave, first_sample, self.tag), depth)?;
        let paths = runner.waves().paths().download((pixel_count * samples) as usize)?;
        Ok((times.values().sum(), paths))
    }
}

/// Pixels from one to the next, and their number.
fn measured_pixels(runner: &Runner) -> (u32, u32) {
    let pixels = runner.film().padded_pixels();
    let most = MEASURED_PIXELS.min(runner.waves().capacity() / FEWEST_SAMPLES);
    // An odd multiple does not always meet the same place in the blocks of the film.
    let stride = STRIDE * (pixels.div_ceil(STRIDE * most) | 1);
    (stride, (pixels / stride).max(1))
}

impl Measured {
    /// Adds a wave of `samples` per pixel.
    fn add(&mut self, paths: &[PathState], samples: u32) {
        let pixel_count = paths.len() / samples as usize;
        for pixel in 0..pixel_count {
            let of_pixel = || paths[pixel..].iter().step_by(pixel_count);
            // Blocks of the film reach beyond its edge.
            if of_pixel().any(|path| path.rays_traced == 0) {
                continue;
            }
            let samples: Vec<f64> =
                of_pixel().map(|path| f64::from(luminance(path.radiance.into()))).collect();
            let has_rays = of_pixel().any(|path| path.shadow_rays_traced > 0);
            self.spread.add(pixel / PIXELS_PER_BLOCK, &samples, has_rays);
        }
    }
}

/// What samples of a film of so many pixels cost, in ascending order; empty where no variance could
/// be measured.
fn costs_of(measured: &BTreeMap<u32, Measured>, pixels: u32) -> Vec<CandidateCost> {
    let spreads: Vec<&PixelSpread> = measured.values().map(|measured| &measured.spread).collect();
    let variances = relative_variances(&spreads).unwrap_or_default();
    let cost = |((candidates, measured), (variance, error)): ((&u32, &Measured), (f64, f64))| {
        CandidateCost {
            candidates: *candidates,
            ms_per_sample: measured.ms_per_path.unwrap_or(f64::NAN) * f64::from(pixels),
            relative_variance: variance,
            log_variance_error: error,
        }
    };
    measured.iter().zip(variances).map(cost).collect()
}
