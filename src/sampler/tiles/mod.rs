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
//! - Choice: sectors with few rays lean on their surroundings.
//! - Choice: what is dim or hardly seen is left to the BRDF, by subtracting a part of the mean. One of
//!   theirs can do so too.
//! - Choice: a share of the probability follows the map alone, so that no tile with light is lost.

mod buffers;
mod cache;
mod grid;
mod parameters;

use std::{collections::BTreeMap, time::Instant};

pub use buffers::TileBuffers;
pub use cache::{Entry, TileCache};
pub use grid::SectorGrid;
pub use parameters::TilesParameters;

use super::{
    Context, Parameters, Room, basic, knob::Knobs, pilot::Piloted, rays::RaySteps,
    regions::Partition,
};
use crate::{
    error::Result,
    pass::{Surfaces, Technique},
    shader::rooms::tiles::{CONSTANT_TILES, CONSTANT_TILES_LEARN},
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
        let surfaces = runner.settings.surfaces;
        let steps = [true, false].map(|learns| steps(cache.tiles(), learns, surfaces));
        let buffers = TileBuffers::new(&runner.device, &partition, grid, cache)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let prepare_ms = [("environment tiles".to_owned(), ms)].into();
        Ok(Box::new(Piloted::new(buffers, steps, own.pilot_samples, prepare_ms)))
    }
}

/// Returns the steps of the picture, or of the pilot, which `learns`, for so many tiles.
pub fn steps(tiles: usize, learns: bool, surfaces: Surfaces) -> RaySteps {
    let tiles = (CONSTANT_TILES, tiles as u32);
    let constants = [tiles, (CONSTANT_TILES_LEARN, u32::from(learns))];
    let steps = RaySteps::new("sample_tiles", &constants, surfaces);
    if learns { steps.learning("count_tiles", &[tiles]) } else { steps }
}
