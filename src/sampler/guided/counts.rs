//! Counts of visible rays: as they lie on the device and in files, in fixed point, and in rays.

use super::cells::adds;
use crate::shader::rooms::guided::GUIDE_COUNT_WORDS;

/// Trials, hits and the sum of the responses of the hits, as they lie on the device and in files.
pub type CountWords = [u32; GUIDE_COUNT_WORDS as usize];

/// Units per ray in a [`Count`]: regions that are split divide their counts.
pub const PARTS_PER_RAY: u32 = 16;

/// Upper bound of every word of a [`Count`], whatever a file holds and however regions merge.
pub const MAX_WORD: u32 = 1 << 30;

/// Counts of one region in one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Rays that reached the environment, [`PARTS_PER_RAY`] for each.
    pub hits: u32,
    /// Rays traced, and directions that brought nothing, [`PARTS_PER_RAY`] for each.
    pub trials: u32,
    /// Sum of the responses of the rays that hit.
    pub response: u32,
}

impl Count {
    /// Adds the fraction `share` of another count, rounded to the nearest unit.
    pub fn add_share(&mut self, other: Self, share: f64) {
        let sum = |count: u32, other: u32| {
            (count + (f64::from(other) * share + 0.5) as u32).min(MAX_WORD)
        };
        self.hits = sum(self.hits, other.hits);
        self.trials = sum(self.trials, other.trials);
        self.response = sum(self.response, other.response);
    }
}

/// Counts of one region summed over one or more cells, in rays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Rays that reached the environment.
    pub hits: f32,
    /// Rays traced, and directions that brought nothing.
    pub trials: f32,
    /// Sum of the responses of the rays that hit.
    pub response: f32,
}

impl From<&Count> for Tally {
    fn from(count: &Count) -> Self {
        let rays = 1.0 / PARTS_PER_RAY as f32;
        // Counts are below 2³¹, and signed integers convert to floats faster.
        let float = |count: u32| count as i32 as f32;
        Self {
            hits: float(count.hits) * rays,
            trials: float(count.trials) * rays,
            response: float(count.response),
        }
    }
}

adds!(Tally: hits trials response);

impl Tally {
    /// Visibility, with a prior worth `weight` rays.
    pub fn visibility(self, prior: f32, weight: f32) -> f32 {
        (self.hits + weight * prior) / (self.trials + weight)
    }

    /// Mean response of a hit, with a prior worth `weight` hits.
    pub fn mean_response(self, prior: f32, weight: f32) -> f32 {
        (self.response + weight * prior) / (self.hits + weight)
    }
}
