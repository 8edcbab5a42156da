//! Adaptive environment sampling: tiles of the environment by visibility learned in camera space.
//!
//! \[Atanasov et al. 2018\]. The environment is split into tiles ([`Partition`]), the directions from the
//! camera into sectors ([`SectorGrid`]). A pilot counts in each sector how much light through each tile
//! would reach the surfaces there (`glsl/tiles/count_tiles.comp`). [`TileCache`] makes probabilities of the
//! counts, which then stay as they are: shadow rays go through tiles by these, and to the BRDF's own
//! directions, under the balance heuristic of `mis` (`glsl/tiles/sample_tiles.comp`).
//!
//! The talk's abstract was at hand, not its pages, and two implementations by others that follow it: a grid
//! of directions from the camera, to which later vertices belong as well, and a probability of flux times
//! learned response for each tile are theirs. All else is ours:
//!
//! - Choice: tiles are the rectangles of `guided`, small where the map is bright; theirs have equal size.
//! - Choice: a sector counts squared cosines of visible rays, so that tiles below the horizon lose too, and
//!   probabilities leave least variance; theirs add up luminance.
//! - Choice: the pilot draws tiles half by flux and half alike, from the vertices of its paths.
//! - Choice: sectors with few rays lean on their surroundings. With `sector-jitter=on` a hit reads a sector
//!   at random among those around it; the density is that of the sector it has read.
//! - Choice: what is dim or hardly seen is left to the BRDF, by subtracting a part of the mean. One of
//!   theirs can do so too.
//! - Choice: a share of the probability follows the map alone, so that no tile with light is lost.

mod buffers;
mod cache;
mod density;
mod grid;
mod parameters;
mod steps;

use std::{collections::BTreeMap, time::Instant};

pub use buffers::TileBuffers;
pub use cache::{Entry, TileCache};
pub use density::TileDensity;
pub use grid::SectorGrid;
pub use parameters::TilesParameters;
pub use steps::TileSteps;

use super::{Context, Parameters, Room, basic, guided::Partition, knob::Knobs, pilot};
use crate::{
    error::Result,
    gpu::DescriptorSet,
    pass::{Passes, Progress, Report, Runner, Steps, Technique},
};

pub(super) struct TilesRoom;

impl Room for TilesRoom {
    fn describe(&self, parameters: &Parameters) -> BTreeMap<String, String> {
        let mut named = parameters.tiles.describe();
        named.extend(basic::MIS.describe(parameters));
        named
    }

    fn create(&self, context: Context<'_>) -> Result<Box<dyn Technique>> {
        let Context { scene, parameters, runner } = context;
        let own = &parameters.tiles;
        let start = Instant::now();
        let partition = Partition::new(&scene.environment, own.environment_tiles as usize);
        let cache = TileCache::new(&partition, own.tile_floor, parameters.compensation);
        let grid = SectorGrid::new(scene, own, cache.tiles());
        let steps = TileSteps::new(own, cache.tiles(), runner.settings().surfaces);
        let buffers = TileBuffers::new(runner.device(), &partition, grid, cache)?;
        Ok(Box::new(Tiles {
            pilot: steps.learning(),
            steps,
            buffers,
            pilot_samples: own.pilot_samples,
            has_learned: false,
            tiles_ms: start.elapsed().as_secs_f64() * 1e3,
            freeze_ms: 0.0,
        }))
    }
}

/// `tiles` in one render.
struct Tiles {
    pilot: TileSteps,
    steps: TileSteps,
    buffers: TileBuffers,
    pilot_samples: u32,
    has_learned: bool,
    tiles_ms: f64,
    freeze_ms: f64,
}

impl Passes for Tiles {
    fn steps(&self) -> &dyn Steps {
        if self.has_learned { &self.steps } else { &self.pilot }
    }

    fn other_steps(&self) -> Vec<Box<dyn Steps>> {
        vec![Box::new(self.steps)]
    }

    fn set(&self) -> Option<&DescriptorSet> {
        Some(self.buffers.set())
    }
}

impl Technique for Tiles {
    /// Runs the pilot before the first sample.
    fn learn(&mut self, runner: &mut Runner, progress: &Progress) -> Result<u32> {
        if self.has_learned {
            return Ok(u32::MAX);
        }
        self.buffers.forget()?;
        if !pilot::shoot(self, runner, progress, self.pilot_samples)? {
            return Ok(u32::MAX);
        }
        let start = Instant::now();
        self.buffers.freeze()?;
        self.freeze_ms += start.elapsed().as_secs_f64() * 1e3;
        self.has_learned = true;
        Ok(u32::MAX)
    }

    fn restart(&mut self, _runner: &mut Runner) -> Result<()> {
        self.has_learned = false;
        self.freeze_ms = 0.0;
        Ok(())
    }

    fn report(&self) -> Report {
        let host_ms = [("environment tiles", self.tiles_ms), ("tile cache", self.freeze_ms)];
        Report {
            host_ms: host_ms.map(|(name, ms)| (name.to_owned(), ms)).into(),
            buffer_bytes: self.buffers.buffer_bytes(),
            ..Report::default()
        }
    }
}
