//! Descriptor set 1 of `control-variates`: counts of the pilot, and what they let expect.

use std::{collections::BTreeMap, sync::Arc};

use super::records::RecordGrid;
use crate::{
    error::Result,
    gpu::{Buffer, Commands, DescriptorSet, Device},
    shader::rooms::control_variates,
};

/// The visibility records on a device.
pub struct RecordBuffers {
    device: Arc<Device>,
    set: DescriptorSet,
    grid: RecordGrid,
    counts: Buffer,
    visibilities: Buffer,
}

impl RecordBuffers {
    /// Allocates records of undefined content. Fails if the device does or its limits are exceeded.
    pub fn new(device: &Arc<Device>, grid: RecordGrid) -> Result<Self> {
        let entries = grid.entries() as u64;
        let counts = Buffer::new(device, "record counts", 8 * entries)?;
        let visibilities = Buffer::new(device, "record visibilities", 4 * entries)?;
        let bound = [
            (control_variates::RECORD_COUNTS, &counts),
            (control_variates::RECORD_VISIBILITIES, &visibilities),
        ];
        let set = DescriptorSet::new(device, &control_variates::TABLE, &bound)?;
        Ok(Self { device: Arc::clone(device), set, grid, counts, visibilities })
    }

    /// Descriptor set 1.
    pub fn set(&self) -> &DescriptorSet {
        &self.set
    }

    /// Empties the counts. Fails if the device does.
    pub fn clear(&self) -> Result<()> {
        let mut commands = Commands::begin(&self.device)?;
        commands.fill(&self.counts, 0);
        commands.submit_and_wait().map(drop)
    }

    /// Reads rays and visible rays of every entry. Fails if the device does.
    pub fn counts(&self) -> Result<Vec<[u32; 2]>> {
        self.counts.download(self.grid.entries())
    }

    /// Turns the counts into expected visibilities for the passes to come. Fails if the device does.
    pub fn freeze(&self) -> Result<()> {
        let expected = self.grid.expected(&self.counts()?);
        self.visibilities.upload(bytemuck::cast_slice(&expected))
    }

    /// Bytes by buffer name.
    pub fn buffer_bytes(&self) -> BTreeMap<String, u64> {
        [&self.counts, &self.visibilities]
            .map(|buffer| (buffer.name().to_owned(), buffer.size()))
            .into()
    }
}
