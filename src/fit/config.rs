//! Every number a fit depends on, and its options. A change of a number requires a new [`VERSION`].

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Version of the fitting procedure and of the fit files; part of the cache key.
pub(crate) const VERSION: u32 = 2;
/// Seed of the k-means++ start.
pub(crate) const SEED: u64 = 0x5eed;
/// Most lobes a fit may have.
pub const MAX_LOBES: usize = 4096;
/// Most view elevations of a BRDF fit.
pub const MAX_VIEWS: usize = 1024;

/// Lobes placed by k-means++; larger mixtures grow by splitting.
pub(crate) const FIRST_LOBES: usize = 16;
/// Starts by k-means++; the best one is kept.
pub(crate) const STARTS: u64 = 6;
/// Steps of expectation maximization per start.
pub(crate) const START_STEPS: usize = 20;
/// Steps of expectation maximization after each split.
pub(crate) const GROWTH_STEPS: usize = 10;
/// Fall of the divergence per step, nats, below which growth steps end.
pub(crate) const GROWTH_TOLERANCE: f64 = 1e-4;
/// Rounds of the last stage, [`FINAL_STEPS`] steps each.
pub(crate) const FINAL_ROUNDS: usize = 10;
/// Steps per round of the last stage.
pub(crate) const FINAL_STEPS: usize = 10;
/// Fall of the divergence per step, nats, below which a round ends.
pub(crate) const FINAL_TOLERANCE: f64 = 1e-6;
/// Distance of a split lobe's halves from its axis, in standard deviations along the split.
pub(crate) const SPLIT_OFFSET: f64 = 0.7;

/// Patches of an environment map per lobe of its fit.
pub(crate) const PATCHES_PER_LOBE: usize = 80;
pub(crate) const MIN_PATCHES: usize = 8192;
pub(crate) const MAX_PATCHES: usize = 65_536;
/// Steps of expectation maximization that colour the lobes.
pub(crate) const COLOUR_STEPS: usize = 10;
/// Share of the uniform density in the sampling density that χ² judges.
pub(crate) const DEFENSIVE_SHARE: f64 = 0.1;

/// Most steps of L-BFGS (method `l2`).
pub(crate) const L2_STEPS: usize = 300;
/// Relative fall of the squared error over ten steps below which L-BFGS ends.
pub(crate) const L2_TOLERANCE: f64 = 1e-4;

/// Cells of the hemisphere per view of a BRDF, four samples each.
pub(crate) const HEMISPHERE_CELLS: usize = 4000;
/// Depth to which cells toward the mirror direction are always subdivided.
pub(crate) const PEAK_DEPTH: u32 = 6;
/// Steps of expectation maximization for a view that starts from its neighbour's lobes.
pub(crate) const VIEW_STEPS: usize = 80;
/// Fall of the divergence per step, nats, below which a view ends.
pub(crate) const VIEW_TOLERANCE: f64 = 1e-6;
/// Bandwidth at which a lobe follows the mirror direction half the way from view to view; narrower
/// lobes follow further.
pub(crate) const FOLLOWING_BANDWIDTH: f64 = 20.0;
/// Largest angle between normal and view, degrees, in summary figures. Grazing views are listed separately.
pub(crate) const SUMMARY_ANGLE_DEG: f64 = 60.0;

/// Objective of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Kullback-Leibler divergence, by expectation maximization: suits a sampling density.
    #[default]
    Em,
    /// Squared error, by projected L-BFGS from the result of `em`: the fits of \[Tsai et al. 2008\].
    L2,
}

/// Checks that a number, such as that of lobes, is from 1 to `most`.
pub(crate) fn check_count(count: usize, what: &str, most: usize) -> Result<()> {
    if (1..=most).contains(&count) {
        return Ok(());
    }
    Err(Error::usage(format!("{count} {what} asked for; expected 1 to {most}")))
}
