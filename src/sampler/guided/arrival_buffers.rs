//! Device buffers for light arriving from surfaces: tables for `bounce_guided`, and counts of its rays.

use std::sync::Arc;

use super::{ARRIVAL_DIRECTIONS, ArrivalWords, Snapshot};
use crate::{
    error::Result,
    gpu::{Buffer, Commands, Device},
    shader::{bindings::Binding, rooms::guided},
};

/// Bytes of a cell: by direction the light and two counted words, and its reflected light.
pub const BYTES_PER_CELL: u64 =
    (4 + size_of::<ArrivalWords>() as u64) * ARRIVAL_DIRECTIONS as u64 + 4;

/// Tables and counts of arriving light.
pub struct ArrivalBuffers {
    arriving: Buffer,
    reflected: Buffer,
    pub(super) arrivals: Buffer,
}

impl ArrivalBuffers {
    /// Allocates `cells` cells.
    pub fn new(device: &Arc<Device>, cells: usize) -> Result<Self> {
        let directions = (cells * ARRIVAL_DIRECTIONS) as u64;
        let counted = size_of::<ArrivalWords>() as u64;
        Ok(Self {
            arriving: Buffer::new(device, "guide arriving", 4 * directions)?,
            reflected: Buffer::new(device, "guide reflected", 4 * cells as u64)?,
            arrivals: Buffer::new(device, "guide arrivals", counted * directions)?,
        })
    }

    /// Returns the buffers with their bindings in descriptor set 1.
    pub fn bindings(&self) -> [(Binding, &Buffer); 3] {
        [
            (guided::GUIDE_ARRIVING, &self.arriving),
            (guided::GUIDE_REFLECTED, &self.reflected),
            (guided::GUIDE_ARRIVALS, &self.arrivals),
        ]
    }

    /// Reads the counts of the first `cells` cells.
    pub fn counted(&self, cells: usize) -> Result<Vec<ArrivalWords>> {
        self.arrivals.download(cells * ARRIVAL_DIRECTIONS)
    }

    /// Records the clearing of the counts of the first `cells` cells.
    pub fn record_clear(&self, commands: &mut Commands, cells: usize) {
        let bytes = size_of::<ArrivalWords>() * cells * ARRIVAL_DIRECTIONS;
        commands.fill_start(&self.arrivals, bytes as u64, 0);
    }

    /// Uploads the tables for the next passes.
    pub fn upload(&self, snapshot: &Snapshot) -> Result<()> {
        self.arriving.upload(bytemuck::cast_slice(&snapshot.arriving))?;
        self.reflected.upload(bytemuck::cast_slice(&snapshot.reflected.units))
    }
}
