//! A check of the reference by an independent picture: another sampler, or another renderer.
//!
//! Samplers are judged by the reference, so a bias of the reference's own sampler would pass for
//! their error. The check renders the scene once more by a sampler that shares as little as it can
//! with the reference's, within [`TIME_SHARE`] of the reference's time, and compares the means of
//! the pictures and of blocks of pixels in standard errors. It can show a disagreement or how
//! closely the two agree; it cannot prove the reference right.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::reference::{Reference, read_checked};
use crate::{
    error::{Error, Result},
    film::RgbImage,
    scene::Scene,
};

/// Time of a check by another sampler, as a share of the reference's.
pub(crate) const TIME_SHARE: f64 = 0.1;
/// Inflation of the blocks' variance above which neighbours are taken to share paths; for independent
/// pixels it is 1 ± 0.2.
const SHARED_FROM: f64 = 2.0;
/// Blocks across and down, at most.
const GRID: [usize; 2] = [8, 6];
/// Least side of a block in pixels, so that its own pixels tell how noisy it is.
const LEAST_BLOCK: usize = 8;
/// Standard errors between the means beyond which the pictures disagree.
pub(crate) const MEAN_LIMIT: f64 = 4.0;
/// Standard errors in one block beyond which they disagree; there are up to 48 blocks.
pub(crate) const BLOCK_LIMIT: f64 = 5.0;
/// Relative standard error of the difference of the means above which nothing can be told.
pub(crate) const NOISE_LIMIT: f64 = 0.02;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No difference stands out of the noise, which is below [`NOISE_LIMIT`].
    Agrees,
    /// The means or a block differ by more than noise explains.
    Disagrees,
    /// The check is too noisy to tell.
    TooNoisy,
}

/// Differences of the check's picture from the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCheck {
    /// Origin of the check's picture.
    pub description: String,
    /// Samples per pixel of both halves, if known.
    pub spp: Option<u64>,
    /// Seconds of passes of both halves, if known.
    pub seconds: Option<f64>,
    /// Mean of the check over that of the reference, less 1.
    pub mean_difference: f64,
    /// Standard error of that difference.
    pub mean_standard_error: f64,
    /// The difference in its standard errors.
    pub mean_deviation: f64,
    pub blocks: usize,
    /// Largest difference of a block in its standard errors.
    pub block_deviation: f64,
    /// Difference of that block relative to the reference there.
    pub block_difference: f64,
    /// Left, top, width and height of that block in pixels.
    pub block: [u32; 4],
    pub verdict: Verdict,
}

impl ReferenceCheck {
    /// Compares two pictures, each in two independent halves. A picture without noise is given
    /// twice. Fails for pictures of different sizes or without pixels, and for a black reference.
    pub(crate) fn of(
        reference: [&RgbImage; 2],
        check: [&RgbImage; 2],
        description: String,
    ) -> Result<Self> {
        let size = [reference[0].width as usize, reference[0].height as usize];
        let sides = [Side::of(reference, size)?, Side::of(check, size)?];
        let [ours, theirs] = &sides;
        let mean = ours.mean();
        if mean <= 0.0 {
            return Err(Error::comparison("the reference is black: nothing can be checked"));
        }
        let error = (ours.variance() + theirs.variance()).sqrt();
        let difference = theirs.mean() - mean;
        let deviations =
            ours.blocks.iter().zip(&theirs.blocks).map(|(ours_block, theirs_block)| {
                let variance =
                    ours.block_variance(ours_block) + theirs.block_variance(theirs_block);
                deviation(theirs_block.mean - ours_block.mean, variance.sqrt())
            });
        let worst = deviations.enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (index, block_deviation) = worst.unwrap_or((0, 0.0));
        let (block, other) = (&ours.blocks[index], &theirs.blocks[index]);
        let mean_deviation = deviation(difference, error);
        let relative_error = error / mean;
        let verdict = if mean_deviation.abs() > MEAN_LIMIT || block_deviation.abs() > BLOCK_LIMIT {
            Verdict::Disagrees
        } else if relative_error > NOISE_LIMIT {
            Verdict::TooNoisy
        } else {
            Verdict::Agrees
        };
        Ok(Self {
            description,
            spp: None,
            seconds: None,
            mean_difference: difference / mean,
            mean_standard_error: relative_error,
            mean_deviation,
            blocks: ours.blocks.len(),
            block_deviation,
            block_difference: if block.mean > 0.0 { other.mean / block.mean - 1.0 } else { 0.0 },
            block: block.area,
            verdict,
        })
    }

    /// One sentence: "agrees with mis, 256 spp: its mean is +0.10% ± 0.12% off, …".
    pub(crate) fn describe(&self) -> String {
        let [left, top, width, height] = self.block;
        let figures = format!(
            "its mean differs by {:+.2}% ± {:.2}% ({:+.1} standard errors), the worst of {} blocks, \
             {width}x{height} pixels at {left},{top}, by {:+.1}% ({:+.1} standard errors)",
            100.0 * self.mean_difference,
            100.0 * self.mean_standard_error,
            self.mean_deviation,
            self.blocks,
            100.0 * self.block_difference,
            self.block_deviation
        );
        let verdict = match self.verdict {
            Verdict::Agrees => "agrees with the reference",
            Verdict::Disagrees => "DISAGREES with the reference, one of the two is biased",
            Verdict::TooNoisy => "is too noisy to check the reference",
        };
        format!("{} {verdict}: {figures}", self.description)
    }
}

/// A difference in its standard errors; 0 for no difference, infinite for one without noise.
fn deviation(difference: f64, error: f64) -> f64 {
    if difference == 0.0 { 0.0 } else { (difference / error).clamp(-1e6, 1e6) }
}

/// One picture's blocks.
struct Side {
    blocks: Vec<Block>,
    /// Factor by which blocks vary more than independent pixels would: samplers may share paths
    /// between neighbours.
    inflation: f64,
    /// Least variance of a block over its squared mean: where neighbours share paths a block is
    /// one witness or a few, too few to say how noisy it is.
    floor: f64,
}

struct Block {
    /// Left, top, width and height in pixels.
    area: [u32; 4],
    /// Mean over pixels and channels.
    mean: f64,
    /// Variance of that mean if the pixels are independent.
    variance: f64,
}

impl Side {
    fn of(halves: [&RgbImage; 2], [width, height]: [usize; 2]) -> Result<Self> {
        for half in halves {
            if [half.width as usize, half.height as usize] != [width, height] || width * height == 0
            {
                return Err(Error::comparison(format!(
                    "the reference has {width}x{height} pixels, its check {}x{}",
                    half.width, half.height
                )));
            }
        }
        let grey = |half: &RgbImage, index: usize| {
            half.pixels[index].iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0
        };
        let counts =
            [(width / LEAST_BLOCK).clamp(1, GRID[0]), (height / LEAST_BLOCK).clamp(1, GRID[1])];
        let mut blocks = Vec::new();
        let mut ratios = Vec::new();
        for row in 0..counts[1] {
            for column in 0..counts[0] {
                let edge = |index: usize, axis: usize| index * [width, height][axis] / counts[axis];
                let columns = edge(column, 0)..edge(column + 1, 0);
                let rows = edge(row, 1)..edge(row + 1, 1);
                let (mut sums, mut squares) = ([0.0; 2], 0.0);
                for index in rows.clone().flat_map(|y| columns.clone().map(move |x| y * width + x))
                {
                    let values = halves.map(|half| grey(half, index));
                    sums = [sums[0] + values[0], sums[1] + values[1]];
                    squares += (0.5 * (values[0] - values[1])).powi(2);
                }
                let count = (columns.len() * rows.len()) as f64;
                let variance = squares / (count * count);
                let half_difference = 0.5 * (sums[0] - sums[1]) / count;
                if variance > 0.0 {
                    ratios.push(half_difference * half_difference / variance);
                }
                let area = [columns.start, rows.start, columns.len(), rows.len()];
                blocks.push(Block {
                    area: area.map(|value| u32::try_from(value).unwrap_or(u32::MAX)),
                    mean: 0.5 * (sums[0] + sums[1]) / count,
                    variance,
                });
            }
        }
        let inflation = ratios.iter().sum::<f64>() / (ratios.len() as f64).max(1.0);
        let relative = blocks.iter().filter(|block| block.mean > 0.0);
        let relative: Vec<f64> =
            relative.map(|block| block.variance / (block.mean * block.mean)).collect();
        let pooled = relative.iter().sum::<f64>() / (relative.len() as f64).max(1.0);
        let floor = if inflation > SHARED_FROM { pooled } else { 0.0 };
        Ok(Self { blocks, inflation: inflation.max(1.0), floor })
    }

    /// Variance of a block's mean.
    fn block_variance(&self, block: &Block) -> f64 {
        self.inflation * block.variance.max(self.floor * block.mean * block.mean)
    }

    /// Sums a value of the blocks, weighted by `weight` of their share of the pixels.
    fn weighted(&self, value: impl Fn(&Block) -> f64, weight: impl Fn(f64) -> f64) -> f64 {
        let size = |block: &Block| f64::from(block.area[2]) * f64::from(block.area[3]);
        let total: f64 = self.blocks.iter().map(size).sum();
        self.blocks.iter().map(|block| weight(size(block) / total) * value(block)).sum()
    }

    fn mean(&self) -> f64 {
        self.weighted(|block| block.mean, |share| share)
    }

    fn variance(&self) -> f64 {
        self.inflation * self.weighted(|block| block.variance, |share| share * share)
    }
}

/// Compares a reference with a picture from a file. Fails if that shows something else.
pub(super) fn read(path: &Path, scene: &Scene, reference: &Reference) -> Result<ReferenceCheck> {
    let image = read_checked(path, scene)?.rgb(path)?;
    let description = format!("{}, taken as free of noise,", path.display());
    ReferenceCheck::of([&reference.first, &reference.second], [&image, &image], description)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 64×48 pixels around 1 with noise of `spread`, `seed` its random numbers, times
    /// `gain` of the pixel.
    fn picture(seed: u64, spread: f64, gain: impl Fn(usize, usize) -> f64) -> RgbImage {
        // Multiplier and increment of Knuth's MMIX generator; the upper bits are used.
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let pixels = (0..64 * 48)
            .map(|index| {
                let noise = 12.0_f64.sqrt() * (random() - 0.5) * spread;
                [((1.0 + noise) * gain(index % 64, index / 64)) as f32; 3]
            })
            .collect();
        RgbImage { width: 64, height: 48, pixels }
    }

    fn check(
        seed: u64,
        spreads: [f64; 2],
        gain: impl Fn(usize, usize) -> f64 + Copy,
    ) -> ReferenceCheck {
        let plain = |_, _| 1.0;
        let ours = [0, 1].map(|half| picture(4 * seed + half, spreads[0], plain));
        let theirs = [2, 3].map(|half| picture(4 * seed + half, spreads[1], gain));
        ReferenceCheck::of([&ours[0], &ours[1]], [&theirs[0], &theirs[1]], "mis".into()).unwrap()
    }

    #[test]
    fn equal_pictures_agree_within_their_noise() {
        let checks: Vec<_> = (0..100).map(|seed| check(seed, [0.1, 0.4], |_, _| 1.0)).collect();
        assert!(checks.iter().all(|check| check.verdict == Verdict::Agrees));
        // √(0.1² + 0.4²) / √(2 · 64 · 48).
        let error = checks[0].mean_standard_error;
        assert!((error / 5.26e-3 - 1.0).abs() < 0.2, "{error}");
        let squares: f64 = checks.iter().map(|check| check.mean_deviation.powi(2)).sum();
        // 100 squares of normal deviates, a little narrowed by the inflation.
        assert!((50.0..140.0).contains(&squares), "{squares}");
    }

    #[test]
    fn a_biased_mean_is_found() {
        let found = check(7, [0.1, 0.2], |_, _| 1.02);
        assert_eq!(found.verdict, Verdict::Disagrees);
        assert!((found.mean_difference - 0.02).abs() < 0.01, "{found:?}");
        assert!(found.describe().contains("DISAGREES"), "{}", found.describe());
    }

    #[test]
    fn a_bias_of_one_block_is_found() {
        // One of 48 blocks is a fifth too dark, which the mean of all hardly shows.
        let is_dark = |x, y| (16..24).contains(&x) && (32..40).contains(&y);
        let found = check(8, [0.1, 0.2], |x, y| if is_dark(x, y) { 0.8 } else { 1.0 });
        assert_eq!((found.verdict, found.block), (Verdict::Disagrees, [16, 32, 8, 8]));
        assert!((found.block_difference + 0.2).abs() < 0.1, "{found:?}");
        assert!(found.mean_deviation.abs() < MEAN_LIMIT);
    }

    #[test]
    fn noise_tells_nothing() {
        assert_eq!(check(9, [0.1, 4.0], |_, _| 1.0).verdict, Verdict::TooNoisy);
    }

    #[test]
    fn pixels_that_share_paths_are_no_independent_witnesses() {
        // Eight by eight pixels with one and the same noise: deviations of an eighth are expected.
        let shared = |seed| {
            let noise = picture(seed, 0.1, |_, _| 1.0).pixels;
            let at = |index: usize| noise[(index / 64 / 8) * 64 + index % 64 / 8];
            let pixels = (0..64 * 48).map(at).collect();
            RgbImage { width: 64, height: 48, pixels }
        };
        let [a, b, c, d] = [1, 2, 3, 4].map(shared);
        let found = ReferenceCheck::of([&a, &b], [&c, &d], "shared".into()).unwrap();
        assert_ne!(found.verdict, Verdict::Disagrees, "{found:?}");
    }

    #[test]
    fn pictures_that_cannot_be_compared_are_refused() {
        let [white, black] = [1.0_f32, 0.0].map(|value| RgbImage {
            width: 2,
            height: 1,
            pixels: vec![[value; 3]; 2],
        });
        let small = RgbImage { width: 1, height: 1, pixels: vec![[1.0; 3]] };
        let refuse = |ours: &RgbImage, theirs: &RgbImage| {
            ReferenceCheck::of([ours; 2], [theirs; 2], String::new()).unwrap_err().to_string()
        };
        assert!(refuse(&black, &white).contains("black"));
        assert!(refuse(&white, &small).contains("2x1"));
        let same = ReferenceCheck::of([&white; 2], [&white; 2], String::new()).unwrap();
        assert_eq!((same.verdict, same.mean_deviation), (Verdict::Agrees, 0.0));
        let other = ReferenceCheck::of([&white; 2], [&black; 2], String::new()).unwrap();
        assert_eq!(other.verdict, Verdict::Disagrees);
    }
}
