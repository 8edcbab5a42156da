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
