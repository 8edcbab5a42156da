//! Parameters of `tiles`.

use crate::sampler::{knob::parameters, regions::MAX_REGIONS};

parameters! {
    /// Parameters of `tiles`.
    pub struct TilesParameters {
        /// `environment-tiles`: rectangles into which the environment is split.
        "environment-tiles" environment_tiles: u32 = 128, 8..=MAX_REGIONS as u32;
        /// `pilot-samples`: samples of every pixel that the cache learns from.
        "pilot-samples" pilot_samples: u32 = 8, 1..=64;
        /// `sector-pixels`: width of a sector at the centre of the picture, pixels.
        "sector-pixels" sector_pixels: u32 = 8, 1..=256;
        /// `tile-floor`: share of the probability that follows the map alone.
        "tile-floor" tile_floor: f64 = 0.1, 0.001..=1.0;
    }
}
