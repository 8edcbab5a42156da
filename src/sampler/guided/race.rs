//! Measures the arms of a render: the same pixels by each, in turns, with the guide as the next sample of the
//! picture will find it.
//!
//! These rays count as rays and as time, but add nothing to the picture and teach nothing: the arm alone
//! depends on them. A few pixels of their own are cheaper than samples of the whole picture, whose variance
//! those of an arm that loses would raise.

use std::time::Instant;

use super::{
    arm::{Arm, Arms, Work},
    buffers::{GuideBuffers, guide_schedule},
    cost::{ArmCost, MOST_ROUNDS, race},
    epoch::{TRAINING_SEED, with_epoch},
};
use crate::{
    error::Result,
    film::reconstruction::{filtered, shared_offset},
    gpu::DescriptorSet,
    pass::{BLOCK_PIXELS, Passes, Progress, Runner, Steps},
    shader::{
        bindings::wave::PATHS,
        constants::{FILM_BLOCK, MEASURED_WAVE},
        structs::{PathState, Wave},
    },
};

/// Samples per pixel from which the second race is due; the first one comes before all samples. Another comes
/// whenever the film has four times as many.
const SECOND_RACE: u32 = 16;
/// Most arms of a race.
const MOST_ARMS: u32 = 9;
/// Paths of the film for each that races after the first measure, if they take all rounds.
const FILM_PATHS: u64 = 16;
/// Separates the random numbers of measurements from those of the training and of the picture.
const MEASURING_SEED: u32 = 0x2c1b_3c6d;
/// Most pixels in a wave; a larger film needs no more to tell which arm is better.
const MEASURED_PIXELS: u32 = 1024;
/// Least step between measured blocks, in blocks: a small film is not measured as a whole.
const LEAST_STRIDE: u32 = 8;
/// Samples of each pixel in a wave, to see how they differ.
const SAMPLES: u32 = 4;

/// Returns the samples per pixel from which race number `race` is due in a film of `pixels` pixels. In small
/// films the measured pixels are many, and races come later.
pub(super) fn race_due(race: u32, pixels: u32) -> u32 {
    let Some(again) = race.checked_sub(1) else { return 0 };
    let due = SECOND_RACE.saturating_mul(4_u32.saturating_pow(again));
    let block_paths = u64::from(MOST_ROUNDS * MOST_ARMS * BLOCK_PIXELS * SAMPLES);
    let paths = block_paths * u64::from(race) * u64::from(Blocks::over(pixels, 1).count);
    let affordable = (FILM_PATHS * paths).div_ceil(u64::from(pixels.max(1)));
    // Races need a guide that was just rebuilt.
    due.max(guide_schedule(affordable.min(1 << 30) as u32))
}

/// A race among the arms of a render.
pub(super) struct Race<'a> {
    pub(super) buffers: &'a GuideBuffers,
    pub(super) arms: &'a Arms,
    /// Tag of the guides that this one went on from.
    pub(super) tag: u32,
}

struct Trial<'a> {
    buffers: &'a GuideBuffers,
    steps: Box<dyn Steps>,
}

impl Passes for Trial<'_> {
    fn steps(&self) -> &dyn Steps {
        self.steps.as_ref()
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(&self.buffers.set)
    }
}

/// The blocks of pixels that a wave measures.
#[derive(Clone, Copy)]
struct Blocks {
    count: u32,
    stride: u32,
    /// Number of blocks that the first one can be.
    starts: u32,
}

impl Blocks {
    fn of(runner: &Runner) -> Self {
        Self::over(runner.film.padded_pixels(), runner.film.window.width.div_ceil(FILM_BLOCK))
    }

    /// The blocks of so many pixels in so many columns.
    fn over(pixels: u32, columns: u32) -> Self {
        let all = (pixels / BLOCK_PIXELS).max(1);
        let mut stride = all.div_ceil(MEASURED_PIXELS / BLOCK_PIXELS).max(LEAST_STRIDE).min(all);
        // Without a common divisor, the blocks lie in all columns.
        while greatest_common_divisor(stride, columns) > 1 {
            stride += 1;
        }
        let count = (all / stride).max(1);
        Self { count, stride, starts: stride.min(all - (count - 1) * stride) }
    }
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// Returns the paths of a block, and their columns: pixels beyond the edge of the film have none.
fn inside(block: &[PathState]) -> (Vec<&PathState>, usize) {
    let is_inside = |path: &&PathState| path.rays_traced > 0;
    let width = block[..FILM_BLOCK as usize].iter().take_while(is_inside).count();
    (block.iter().filter(is_inside).collect(), width)
}

impl Work {
    fn add(&mut self, path: &PathState) {
        self.paths += 1.0;
        self.rays += f64::from(path.rays_traced);
        self.shadow_rays += f64::from(path.shadow_rays_traced);
    }
}

impl Race<'_> {
    /// True if a wave has room for a block.
    pub(super) fn fits(runner: &Runner) -> bool {
        runner.waves.capacity >= SAMPLES * BLOCK_PIXELS
    }

    /// Races `contenders`, of which the first is in use. Returns the winner, the costs of all and the
    /// milliseconds it took. Forgets the counts since the last rebuild. Fails if the device does.
    pub(super) fn run(
        self,
        runner: &mut Runner,
        progress: &Progress,
        contenders: &[Arm],
    ) -> Result<(Arm, Vec<ArmCost>, f64)> {
        let start = Instant::now();
        let trials: Vec<Trial<'_>> = contenders
            .iter()
            .map(|arm| Trial { buffers: self.buffers, steps: self.arms.steps(arm) })
            .collect();
        trials.iter().try_for_each(|trial| runner.warm_up(trial))?;
        let blocks = Blocks::of(runner);
        let pixels = f64::from(runner.film.padded_pixels());
        let mut ms = vec![0.0; contenders.len()];
        let mut work = vec![Work::default(); contenders.len()];
        let (chosen, mut costs) = race(contenders.len(), |index, round, spread| {
            let mut round_work = Work::default();
            let mut block = spread.block_count();
            for wave in waves(runner.waves.capacity, progress, blocks, round, self.tag) {
                let depth = runner.settings.depth;
                let times = runner.run(&trials[index], wave, depth, false)?;
                let paths = (wave.pixel_count * SAMPLES) as usize;
                ms[index] +=
                    times.values().sum::<f64>() / f64::from(blocks.count * BLOCK_PIXELS * SAMPLES);
                let paths: Vec<PathState> = runner.waves.set.buffer(PATHS).download(paths)?;
                let filter = runner.scene.filter();
                for first in (0..wave.pixel_count as usize).step_by(BLOCK_PIXELS as usize) {
                    let samples = (0..SAMPLES).zip(paths.chunks(wave.pixel_count as usize));
                    let films = samples.map(|(sample, paths)| {
                        let (paths, width) = inside(&paths[first..][..BLOCK_PIXELS as usize]);
                        paths.iter().for_each(|path| round_work.add(path));
                        let radiance: Vec<[f32; 3]> =
                            paths.iter().map(|path| path.radiance).collect();
                        match shared_offset(filter, wave.first_sample + sample, wave.seed) {
                            Some(offset) => filtered(&radiance, width, offset),
                            None => radiance,
                        }
                    });
                    let films: Vec<Vec<[f32; 3]>> = films.collect();
                    for pixel in 0..films[0].len() {
                        let samples: Vec<[f32; 3]> = films.iter().map(|film| film[pixel]).collect();
                        spread.add(block, &samples);
                    }
                    block += 1;
                }
            }
            work[index] = round_work;
            Ok(self.arms.prices.time(&contenders[index], round_work))
        })?;
        self.buffers.clear_counts()?;
        runner.take_counters()?;
        for (((cost, arm), ms), work) in costs.iter_mut().zip(contenders).zip(ms).zip(work) {
            cost.arm = arm.to_string();
            cost.rays = work.rays / work.paths;
            cost.shadow_rays = work.shadow_rays / work.paths;
            cost.at_samples = progress.sample_count;
            cost.ms_per_sample = ms / f64::from(cost.rounds.max(1)) * pixels;
        }
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let lines: Vec<String> = costs.iter().map(ToString::to_string).collect();
        log::info!("{} by measurement in {ms:.0} ms: {}", contenders[chosen], lines.join("; "));
        Ok((contenders[chosen], costs, ms))
    }
}

/// Returns the waves of a round, as many as the buffers make necessary. No round has numbers of another
/// one, or of the picture.
fn waves(capacity: u32, progress: &Progress, blocks: Blocks, round: u32, tag: u32) -> Vec<Wave> {
    let first_sample = progress.next_sample().wrapping_add(round * SAMPLES);
    let start = round * (blocks.starts / MOST_ROUNDS).max(1) % blocks.starts;
    let together = capacity / SAMPLES / BLOCK_PIXELS;
    let wave = |first: u32| Wave {
        first_pixel: (start + first * blocks.stride) * BLOCK_PIXELS,
        pixel_count: together.min(blocks.count - first) * BLOCK_PIXELS,
        first_sample,
        sample_count: SAMPLES,
        seed: progress.seed ^ TRAINING_SEED ^ MEASURING_SEED,
        pixel_stride: 1,
        block_stride: blocks.stride,
        is_training: MEASURED_WAVE,
        ..Wave::default()
    };
    let waves = (0..blocks.count).step_by(together as usize).map(wave);
    waves.map(|wave| with_epoch(wave, first_sample, tag)).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn blocks_end_at_the_edge_of_the_film() {
        let path = |pixel: u32| PathState {
            rays_traced: u32::from(pixel % FILM_BLOCK < 5 && pixel / FILM_BLOCK < 3),
            ..PathState::default()
        };
        let block: Vec<PathState> = (0..BLOCK_PIXELS).map(path).collect();
        let (paths, width) = inside(&block);
        assert_eq!((paths.len(), width), (15, 5));
    }

    /// Waves of a round measure each of its blocks once, by samples that no other round has.
    #[test]
    fn rounds_have_samples_of_their_own() {
        let progress = Progress { first_sample: 10, sample_count: 6, seed: 3 };
        let blocks = Blocks::over(96 * 64, 12);
        assert!(blocks.count > 4 && blocks.stride > 1, "several blocks, apart");
        let mut samples = BTreeSet::new();
        for round in 0..MOST_ROUNDS {
            let waves = waves(4 * SAMPLES * BLOCK_PIXELS, &progress, blocks, round, 7);
            let measured: BTreeSet<u32> = (waves.iter())
                .flat_map(|wave| {
                    let first = wave.first_pixel / BLOCK_PIXELS;
                    (0..wave.pixel_count / BLOCK_PIXELS)
                        .map(move |at| first + at * wave.block_stride)
                })
                .collect();
            assert_eq!(measured.len(), blocks.count as usize, "{measured:?}");
            assert!(measured.iter().all(|block| *block < 96), "{measured:?}");
            let first = waves[0].first_sample;
            assert!(
                waves.iter().all(|wave| wave.first_sample == first && wave.sample_count == SAMPLES)
            );
            assert!((first..first + SAMPLES).all(|sample| samples.insert(sample)), "round {round}");
        }
        assert_eq!(samples.first(), Some(&16), "the next sample of the picture");
    }

    #[test]
    fn races_become_rare() {
        let due = |pixels| (0..6).map(|race| race_due(race, pixels)).collect::<Vec<u32>>();
        assert_eq!(due(1 << 20), [0, 16, 64, 256, 1024, 4096]);
        assert_eq!(race_due(40, 1 << 20), u32::MAX);
        // An eighth of the pixels, four samples each, nine arms, six rounds: a sixteenth of 432 samples.
        assert_eq!(due(3072)[..3], [0, 512, 1024]);
    }
}
