//! Measures what candidates per shadow ray cost and bring, for `guided` with `candidates=auto`.
//!
//! The same pixels are rendered by 1 and by 4 candidates in turns, with the guide as the first sample
//! of the picture will find it; where 4 are worth it, by 4 and by 8. These rays are counted as rays
//! and as time. Nothing of them is in the picture, and nothing is learned from them, so that the
//! picture depends on what was measured by the number that is chosen and by nothing else.

use std::{collections::BTreeMap, time::Instant};

use super::{Renderer, TRAINING_SEED, with_epoch};
use crate::{
    error::Result,
    gpu::Commands,
    math::colour::luminance,
    sampler::{
        CandidateCost, GUIDED_CANDIDATES, Spread, climb, is_most_a_clear_loss, relative_variances,
        upper_median,
    },
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
/// Measured pixels in a row that are a block of [`Spread`]: enough that the logarithm of a block's
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
    spread: Spread,
}

impl Renderer {
    /// Candidates that the sampler `guided` chooses each shadow ray from; absent for other samplers,
    /// where `auto` has not been decided yet, and in open scenes.
    pub fn candidates(&self) -> Option<u32> {
        self.choice.candidates.filter(|_| !self.is_open)
    }

    /// What was measured before [`Renderer::candidates`] was chosen; empty where nothing was.
    pub fn candidate_costs(&self) -> &[CandidateCost] {
        &self.choice.costs
    }

    /// Undoes the choice, if it is this renderer's to make, and has the passes ready to learn and to
    /// measure.
    pub(super) fn forget_choice(&mut self) -> Result<()> {
        let given = self.guide.as_ref().and(self.settings.parameters.candidates);
        self.choice = Choice { candidates: given, ..Choice::default() };
        if self.guide.is_some() && given.is_none() {
            for candidates in [GUIDED_CANDIDATES[1], GUIDED_CANDIDATES[0]] {
                self.use_candidates(candidates)?;
            }
        }
        Ok(())
    }

    /// Takes `candidates` that an earlier renderer chose, if the choice is this renderer's to make.
    pub(super) fn take_choice(&mut self, candidates: u32) -> Result<()> {
        if self.settings.parameters.candidates.is_none() {
            self.choice = Choice { candidates: Some(candidates), ..Choice::default() };
            self.use_candidates(candidates)?;
            if let Some(guided) = self.passes.guided() {
                guided.drop_others();
            }
        }
        Ok(())
    }

    /// Measures and chooses. The counts since the last rebuild are forgotten.
    pub(super) fn choose_candidates(&mut self) -> Result<()> {
        let start = Instant::now();
        let mut measured = BTreeMap::new();
        let mut round = 0;
        let (chosen, costs) = climb(|chosen, more| {
            if self.settings.shadow_rays == 0 {
                return Ok(Vec::new());
            }
            let samples = self.samples_to_measure(chosen)?;
            let mut ratios = Vec::new();
            let mut costs = Vec::new();
            for _ in 0..MOST_ROUNDS {
                let mut turn = [chosen, more];
                turn.rotate_left(round as usize % 2);
                let mut ms = BTreeMap::new();
                for candidates in turn {
                    let (wave_ms, paths) = self.measure(candidates, round, samples)?;
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
                costs = costs_of(&measured, self.film.padded_pixels());
                if is_most_a_clear_loss(&costs) {
                    break;
                }
            }
            Ok(costs)
        })?;
        if let Some(guide) = &self.guide {
            guide.clear_counts()?;
        }
        self.take_counters()?;
        self.take_choice(chosen)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let figures: Vec<String> = costs.iter().map(ToString::to_string).collect();
        log::info!("candidates={chosen} by measurement in {ms:.0} ms: {}", figures.join("; "));
        self.choice = Choice { candidates: Some(chosen), costs, ms };
        Ok(())
    }

    /// Samples of each pixel for a wave of at least [`LEAST_MS`], if there is room. What is traced to
    /// find this out also wakes the device and is not used.
    fn samples_to_measure(&mut self, candidates: u32) -> Result<u32> {
        let room = self.waves.capacity() / self.measured_pixels().1;
        let most = MOST_SAMPLES.min(room);
        let mut samples = 1;
        while self.measure(candidates, 0, samples)?.0 < LEAST_MS && samples < most {
            samples = (2 * samples).min(most);
        }
        Ok(samples.max(FEWEST_SAMPLES))
    }

    /// Pixels from one to the next, and their number.
    fn measured_pixels(&self) -> (u32, u32) {
        let pixels = self.film.padded_pixels();
        let most = MEASURED_PIXELS.min(self.waves.capacity() / FEWEST_SAMPLES);
        // An odd multiple does not always meet the same place in the blocks of the film.
        let stride = STRIDE * (pixels.div_ceil(STRIDE * most) | 1);
        (stride, (pixels / stride).max(1))
    }

    /// Renders a wave and reads it back: device milliseconds and the paths, sample after sample.
    fn measure(
        &mut self,
        candidates: u32,
        round: u32,
        samples: u32,
    ) -> Result<(f64, Vec<PathState>)> {
        let (pixel_stride, pixel_count) = self.measured_pixels();
        let first_sample = self.settings.first_sample.wrapping_add(self.sample_count);
        let wave = Wave {
            first_pixel: round % STRIDE,
            pixel_count,
            first_sample,
            sample_count: samples,
            seed: self.settings.seed ^ TRAINING_SEED ^ MEASURING_SEED,
            pixel_stride,
            is_training: 1,
            ..Wave::default()
        };
        self.use_candidates(candidates)?;
        let mut commands = Commands::begin_timed(&self.device, self.passes.dispatches_per_wave())?;
        self.passes.record(&mut commands, &self.sets(), with_epoch(wave, first_sample));
        let mut total = 0.0;
        for (pass, ms) in commands.submit_and_wait()? {
            total += ms;
            *self.totals.gpu_ms.entry(pass).or_default() += ms;
        }
        Ok((total, self.read_all("paths", (pixel_count * samples) as usize)?))
    }

    /// Has the passes choose from `candidates`, compiled where they are not yet.
    fn use_candidates(&mut self, candidates: u32) -> Result<()> {
        let start = Instant::now();
        let Some(guided) = self.passes.guided() else { return Ok(()) };
        if guided.use_candidates(candidates)? {
            // Over nothing, which makes drivers that compile late compile now.
            let mut commands = Commands::begin(&self.device)?;
            self.passes.record(&mut commands, &self.sets(), Wave::default());
            commands.submit_and_wait()?;
            let ms = start.elapsed().as_secs_f64() * 1e3;
            *self.compile_ms.entry("sample_guided".to_owned()).or_default() += ms;
        }
        Ok(())
    }
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
    let spreads: Vec<&Spread> = measured.values().map(|measured| &measured.spread).collect();
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
