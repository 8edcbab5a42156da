//! Parameters of `tiles`.

use crate::sampler::{
    guided::MAX_REGIONS,
    knob::{self, Knob},
};

/// Parameters of `tiles`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TilesParameters {
    /// `environment-tiles`: rectangles into which the environment is split.
    pub environment_tiles: u32,
    /// `pilot-samples`: samples of every pixel that the cache learns from.
    pub pilot_samples: u32,
    /// `sector-jitter`: true if a hit reads a sector at random among those around it.
    pub sector_jitter: bool,
    /// `sector-pixels`: width of a sector at the centre of the picture, pixels.
    pub sector_pixels: u32,
    /// `tile-floor`: share of the probability that follows the map alone.
    pub tile_floor: f64,
}

impl Default for TilesParameters {
    fn default() -> Self {
        Self {
            environment_tiles: 128,
            pilot_samples: 8,
            sector_jitter: false,
            sector_pixels: 8,
            tile_floor: 0.1,
        }
    }
}

impl TilesParameters {
    pub(in crate::sampler) const KNOBS: &'static [Knob<Self>] = &[
        Knob {
            key: "environment-tiles",
            set: |own, value| {
                knob::number(&mut own.environment_tiles, value, 8..=MAX_REGIONS as u32)
            },
            get: |own| own.environment_tiles.to_string(),
        },
        Knob {
            key: "pilot-samples",
            set: |own, value| knob::number(&mut own.pilot_samples, value, 1..=64),
            get: |own| own.pilot_samples.to_string(),
        },
        Knob {
            key: "sector-jitter",
            set: |own, value| knob::choice(&mut own.sector_jitter, value, knob::ON_OR_OFF),
            get: |own| knob::name_of(&own.sector_jitter, knob::ON_OR_OFF),
        },
        Knob {
            key: "sector-pixels",
            set: |own, value| knob::number(&mut own.sector_pixels, value, 1..=256),
            get: |own| own.sector_pixels.to_string(),
        },
        Knob {
            key: "tile-floor",
            set: |own, value| knob::number(&mut own.tile_floor, value, 0.001..=1.0),
            get: |own| own.tile_floor.to_string(),
        },
    ];
}
