//! Every number a fit depends on. A change here must come with a new [`VERSION`].

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
/// Starts by k-means++ of which the best is taken.
pub const STARTS: u64 = 6;
/// Steps of expectation maximization of each start.
pub const START_STEPS: usize = 20;
/// Steps of expectation maximization after each split.
pub const GROWTH_STEPS: usize = 10;
/// Fall of the divergence per step, nats, at which growing goes on.
pub const GROWTH_TOLERANCE: f64 = 1e-4;
/// Rounds of the last stage, each of [`FINAL_STEPS`].
pub const FINAL_ROUNDS: usize = 10;
/// Steps of a round of the last stage.
pub const FINAL_STEPS: usize = 10;
/// Fall of the divergence per step, nats, at which a round ends.
pub const FINAL_TOLERANCE: f64 = 1e-6;
/// Distance of a split lobe's halves from its axis, in standard deviations along the split.
pub const SPLIT_OFFSET: f64 = 0.7;

/// Patches of an environment map per lobe of its fit …
pub const PATCHES_PER_LOBE: usize = 80;
/// … at least …
pub const MIN_PATCHES: usize = 8192;
/// … and at most.
pub const MAX_PATCHES: usize = 65_536;
/// Steps of expectation maximization that give the lobes their colours.
pub const COLOUR_STEPS: usize = 10;
/// Share of a uniform density in the sampling density that χ² judges.
pub const DEFENSIVE_SHARE: f64 = 0.1;

/// Steps of L-BFGS at most (method `l2`).
pub const L2_STEPS: usize = 300;
/// Relative fall of the squared error over ten steps at which L-BFGS ends.
pub const L2_TOLERANCE: f64 = 1e-4;

/// Cells of the hemisphere per view of a BRDF, four samples each.
pub const HEMISPHERE_CELLS: usize = 4000;
/// Subdivisions forced toward the mirror direction.
pub const PEAK_DEPTH: u32 = 6;
/// Steps of expectation maximization at a view that starts from its neighbour's lobes.
pub const VIEW_STEPS: usize = 80;
/// Fall of the divergence per step, nats, at which a view ends.
pub const VIEW_TOLERANCE: f64 = 1e-6;
/// Bandwidth from which on lobes move with the mirror direction from view to view: half the way at
/// this one.
pub const FOLLOWING_BANDWIDTH: f64 = 20.0;
/// Largest angle of view from the normal, degrees, of the summarized figures: what grazing views make
/// of a fit is listed apart.
pub const SUMMARY_ANGLE_DEG: f64 = 60.0;
