//! Descriptor set 1 of `tiles`: counts of the pilot, and the probabilities that come of them.

use std::sync::Arc;

use super::{
    cache::{Entry, TileCache},
    grid::SectorGrid,
};
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    sampler::{pilot::Tables, regions::Partition},
    shader::rooms::tiles,
};

/// The cache on a device.
pub struct TileBuffers {
    set: DescriptorSet,
    grid: SectorGrid,
    cache: TileCache,
    counts: Buffer,
    entries: Buffer,
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
        let counts = Buffer::new(device, "tile counts", bytes)?;
        let entries = Buffer::new(device, "tile entries", bytes)?;
        let (regions, aliases) = partition.tables();
        let regions = Buffer::texels_from_slice(device, "tiles", &regions)?;
        let aliases = Buffer::texels_from_slice(device, "tile aliases", &aliases)?;
        let of_cell = Buffer::texels_from_slice(device, "tile of cell", &partition.region_of_cell)?;
        let bound = [
            (tiles::TILE_COUNTS, &counts),
            (tiles::TILE_ENTRIES, &entries),
            (tiles::TILE_REGIONS, &regions),
            (tiles::TILE_ALIASES, &aliases),
            (tiles::TILE_OF_CELL, &of_cell),
        ];
        let set = DescriptorSet::new(device, &tiles::TABLE, &bound)?;
        Ok(Self { set, grid, cache, counts, entries })
    }

    /// Replaces the entries of all sectors. Fails if the device does.
    pub fn upload(&self, entries: &[Entry]) -> Result<()> {
        self.entries.upload(bytemuck::cast_slice(entries))
    }
}

impl Tables for TileBuffers {
    const STAGE: &'static str = "tile cache";

    fn set(&self) -> &DescriptorSet {
        &self.set
    }

    fn forget(&self) -> Result<()> {
        self.counts.clear()?;
        self.upload(&self.cache.untrained().repeat(self.grid.sectors()))
    }

    fn freeze(&self) -> Result<()> {
        let counts = self.counts.download(self.grid.sectors() * self.cache.tiles())?;
        self.upload(&self.cache.learned(self.grid, &counts))
    }
}
