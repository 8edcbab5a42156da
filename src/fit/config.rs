//! Every number a fit depends on. A change here requires a new [`VERSION`].

/// Version of the fitting procedure and of the fit files; part of the cache key.
pub const VERSION: u32 = 2;
/// Seed of the k-means++ start.
pub const SEED: u64 = 0x5eed;
/// Most lobes a fit may have.
pub const MAX_LOBES: usize = 4096;
/// Most view elevations of a BRDF fit.
pub const MAX_VIEWS: usize = 1024;

/// Lobes placed by k-means++; larger mixtures grow by splitting.
pub const FIRST_LOBES: usize = 16;
/// Starts by k-means++; the best one is kept.
pub const STARTS: u64 = 6;
/// Steps of expectation maximization per start.
pub const START_STEPS: usize = 20;
/// Steps of expectation maximization after each split.
pub const GROWTH_STEPS: usize = 10;
/// Fall of the divergence per step, nats, below which growth steps end.
pub const GROWTH_TOLERANCE: f64 = 1e-4;
/// Rounds of the last stage, [`FINAL_STEPS`] steps each.
pub const FINAL_ROUNDS: usize = 10;
/// Steps per round of the last stage.
pub const FINAL_STEPS: usize = 10;
/// Fall of the divergence per step, nats, below which a round ends.
pub const FINAL_TOLERANCE: f64 = 1e-6;
/// Distance of a split lobe's halves from its axis, in standard deviations along the split.
pub const SPLIT_OFFSET: f64 = 0.7;

/// Patches of an environment map per lobe of its fit.
pub const PATCHES_PER_LOBE: usize = 80;
/// Fewest patches of an environment map.
pub const MIN_PATCHES: usize = 8192;
/// Most patches of an environment map.
pub const MAX_PATCHES: usize = 65_536;
/// Steps of expectation maximization that colour the lobes.
pub const COLOUR_STEPS: usize = 10;
/// Share of the uniform density in the sampling density that χ² judges.
pub const DEFENSIVE_SHARE: f64 = 0.1;

/// Most steps of L-BFGS (method `l2`).
pub const L2_STEPS: usize = 300;
/// Relative fall of the squared error over ten steps below which L-BFGS ends.
pub const L2_TOLERANCE: f64 = 1e-4;

/// Cells of the hemisphere per view of a BRDF, four samples each.
pub const HEMISPHERE_CELLS: usize = 4000;
/// Depth to which cells toward the mirror direction are always subdivided.
pub const PEAK_DEPTH: u32 = 6;
/// Steps of expectation maximization for a view that starts from its neighbour's lobes.
pub const VIEW_STEPS: usize = 80;
/// Fall of the divergence per step, nats, below which a view ends.
pub const VIEW_TOLERANCE: f64 = 1e-6;
/// Bandwidth at which a lobe follows the mirror direction half the way from view to view; narrower
/// lobes follow further.
pub const FOLLOWING_BANDWIDTH: f64 = 20.0;
/// Largest angle between normal and view, degrees, in summary figures. Grazing views are listed
/// separately.
pub const SUMMARY_ANGLE_DEG: f64 = 60.0;
