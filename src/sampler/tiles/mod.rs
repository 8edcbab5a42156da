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

mod cache;

use std::{collections::BTreeMap, f32::consts::PI, sync::Arc, time::Instant};

pub use cache::{Entry, TileCache};

use super::{
    Context, Parameters, Room, basic,
    knob::{Knobs, parameters},
    pilot::{Piloted, Tables},
    rays::RaySteps,
    regions::{MAX_REGIONS, Partition, cell_edges},
};
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    pass::{Surfaces, Technique},
    scene::Scene,
    shader::rooms::tiles::{self, CONSTANT_TILES, CONSTANT_TILES_LEARN},
};

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

/// Most entries of all sectors together: 32 MiB of counts, and as much of probabilities.
const MOST_ENTRIES: usize = 1 << 22;

/// The square of directions from the camera, cut into sectors of equal solid angle, which
/// `glsl/tiles/sectors.glsl` looks up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SectorGrid {
    /// Sectors along each side of the square.
    pub side: u32,
}

impl SectorGrid {
    /// Returns the grid for camera and film of a scene: as fine as the parameters ask for, unless the entries
    /// for `tiles` tiles would be too many.
    pub fn new(scene: &Scene, parameters: &TilesParameters, tiles: usize) -> Self {
        let [angle, _] = cell_edges(scene, parameters.sector_pixels as f32);
        let most = (MOST_ENTRIES / tiles.max(1)).isqrt() as u32;
        let wanted = (4.0 * PI).sqrt() / angle;
        Self { side: (wanted.ceil() as u32).clamp(1, most) }
    }

    /// Number of sectors.
    pub fn sectors(&self) -> usize {
        (self.side * self.side) as usize
    }
}

/// The cache on a device.
pub struct TileBuffers {
    set: DescriptorSet,
    grid: SectorGrid,
    cache: TileCache,
}

impl TileBuffers {
    /// Uploads the tiles. Counts and entries are of undefined content. Fails if the device does or its limits
    /// are exceeded.
    pub fn new(
        device: &Arc<Device>,
        partition: &Partition,
        grid: SectorGrid,
        cache: TileCache,
    ) -> Result<Self> {
        let bytes = 8 * (grid.sectors() * cache.tiles()) as u64;
        let (regions, aliases) = partition.tables();
        let of_cell = &partition.region_of_cell;
        let bound = [
            (tiles::TILE_COUNTS, Buffer::new(device, "tile counts", bytes)?),
            (tiles::TILE_ENTRIES, Buffer::new(device, "tile entries", bytes)?),
            (tiles::TILE_REGIONS, Buffer::texels_from_slice(device, "tiles", &regions)?),
            (tiles::TILE_ALIASES, Buffer::texels_from_slice(device, "tile aliases", &aliases)?),
            (tiles::TILE_OF_CELL, Buffer::texels_from_slice(device, "tile of cell", of_cell)?),
        ];
        let set = DescriptorSet::new(device, &tiles::TABLE, &bound)?;
        Ok(Self { set, grid, cache })
    }

    /// Replaces the entries of all sectors. Fails if the device does.
    pub fn upload(&self, entries: &[Entry]) -> Result<()> {
        self.set.buffer(tiles::TILE_ENTRIES).upload(bytemuck::cast_slice(entries))
    }
}

impl Tables for TileBuffers {
    const STAGE: &'static str = "tile cache";

    fn set(&self) -> &DescriptorSet {
        &self.set
    }

    fn forget(&self) -> Result<()> {
        self.set.buffer(tiles::TILE_COUNTS).clear()?;
        self.upload(&self.cache.untrained().repeat(self.grid.sectors()))
    }

    fn freeze(&self) -> Result<()> {
        let entries = self.grid.sectors() * self.cache.tiles();
        let counts = self.set.buffer(tiles::TILE_COUNTS).download(entries)?;
        self.upload(&self.cache.learned(self.grid, &counts))
    }
}
