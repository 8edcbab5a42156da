//! Measures cost and gain of candidates per shadow ray, for `guided` with `candidates=auto`.
//!
//! Renders the same pixels with 1 and with 4 candidates in turns, with the guide as the first sample
//! of the picture will find it, and with 4 and 8 if 4 pay off. These rays count as rays and as time,
//! but add nothing to the picture and teach nothing: only the chosen number depends on them.

use std::{collections::BTreeMap, time::Instant};

use super::{
    buffers::GuideBuffers,
    cost::{
        CandidateCost, PixelSpread, choose_by_comparison, is_largest_clearly_worse,
        relative_variances, upper_median,
    },
    epoch::{TRAINING_SEED, with_epoch},
    steps::GuidedSteps,
};
use crate::{
    error::Result,
    gpu::DescriptorSet,
    math::colour::luminance,
    pass::{Passes, Progress, Runner, Steps},
    shader::{
        constants::TRAINING_WAVE,
        structs::{PathState, Wave},
    },
};

/// Separates the random numbers of measurements from those of the training and of the picture.
const MEASURING_SEED: u32 = 0x2c1b_3c6d;
/// Largest number of waves per number of candidates in a comparison, in turns and over other pixels.
/// The comparison ends early if more candidates clearly lose: declining them is never wrong by much.
pub(super) const MOST_ROUNDS: u32 = 4;
/// Least step between pixels in film order: one row or column of each of its blocks.
const STRIDE: u32 = 8;
/// Most pixels in a wave; a larger film needs no more to tell which number is better.
pub(super) const MEASURED_PIXELS: u32 = 4096;
/// Consecutive measured pixels in a block of [`PixelSpread`]: enough that the logarithm of a
/// block's variance does not mistake a distribution with few large values for a narrow one.
const PIXELS_PER_BLOCK: usize = 32;
/// Samples of each pixel in a wave, to see how they differ.
pub(super) const FEWEST_SAMPLES: u32 = 4;
/// Limit on the samples if fewer take less than [`LEAST_MS`].
const MOST_SAMPLES: u32 = 64;
/// Device milliseconds below which a wave is too short to be timed or to fill the device.
const LEAST_MS: f64 = 10.0;

/// Number of candidates that `guided` chose, and why.
#[derive(Clone, Debug, Default)]
pub(super) struct Choice {
    /// The number; `None` while undecided.
    pub(super) candidates: Option<u32>,
    /// Measurements behind it; empty if there were none.
    pub(super) costs: Vec<CandidateCost>,
    pub(super) ms: f64,
}

/// Measurements for one number of candidates.
#[derive(Default)]
pub(super) struct Measured {
    /// For the fewest candidates from their first wave. For more, that of fewer times a ratio of
    /// consecutive waves, since other work may slow all of them down.
    ms_per_path: Option<f64>,
    pub(super) spread: PixelSpread,
}

/// The passes of `guided` with the numbers under trial.
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
    /// Measures and chooses. Forgets the counts since the last rebuild.
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

    /// Finds the samples per pixel for a wave of at least [`LEAST_MS`], if there is room. The rays
    /// traced to find them also wake the device and are not used.
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

    /// Renders a wave and returns device milliseconds and the paths, sample after sample.
    fn measure(
        &mut self,
        runner: &mut Runner,
        progress: &Progress,
        candidates: u32,
        round: u32,
        samples: u32,
    ) -> Result<(f64, Vec<PathState>)> {
        let (pixel_stride, pixel_count) = measured_pixels(runner);
        let wave = Wave {
            first_pixel: round % STRIDE,
            pixel_count,
            sample_count: samples,
            pixel_stride,
            is_training: TRAINING_WAVE,
            ..Wave::default()
        };
        self.steps.candidates = candidates;
        self.run(runner, progress, wave)
    }

    /// Renders the next samples of the pixels of `wave` with numbers of their own; returns device
    /// milliseconds and the paths, sample after sample.
    pub(super) fn run(
        &self,
        runner: &mut Runner,
        progress: &Progress,
        wave: Wave,
    ) -> Result<(f64, Vec<PathState>)> {
        let first_sample = progress.next_sample();
        let seed = progress.seed ^ TRAINING_SEED ^ MEASURING_SEED;
        let wave = with_epoch(Wave { first_sample, seed, ..wave }, first_sample, self.tag);
        runner.warm_up(self)?;
        let depth = runner.settings().depth;
        let times = runner.run(self, wave, depth)?;
        let count = wave.pixel_count * wave.sample_count;
        Ok((times.values().sum(), runner.waves().paths().download(count as usize)?))
    }
}

/// Returns the step between measured pixels, and their number.
fn measured_pixels(runner: &Runner) -> (u32, u32) {
    let pixels = runner.film().padded_pixels();
    let most = MEASURED_PIXELS.min(runner.waves().capacity() / FEWEST_SAMPLES);
    // An odd multiple does not always meet the same place in the blocks of the film.
    let stride = STRIDE * (pixels.div_ceil(STRIDE * most) | 1);
    (stride, (pixels / stride).max(1))
}

impl Measured {
    /// Adds a wave of `samples` per pixel.
    pub(super) fn add(&mut self, paths: &[PathState], samples: u32) {
        let pixel_count = paths.len() / samples as usize;
        for pixel in 0..pixel_count {
            let of_pixel = || paths[pixel..].iter().step_by(pixel_count);
            // Skip pixels in blocks beyond the edge of the film.
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

/// Returns the cost of a sample of `pixels` pixels by candidates; empty without any variance.
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
