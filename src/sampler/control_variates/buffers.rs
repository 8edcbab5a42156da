//! Descriptor set 1 of `control-variates`: counts of the pilot, and what they let expect.

use std::sync::Arc;

use super::records::RecordGrid;
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    sampler::pilot::Tables,
    shader::rooms::control_variates,
};

/// The visibility records on a device.
pub struct RecordBuffers {
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
        Ok(Self { set, grid, counts, visibilities })
    }
}

impl Tables for RecordBuffers {
    const STAGE: &'static str = "visibility records";

    fn set(&self) -> &DescriptorSet {
        &self.set
    }

    fn forget(&self) -> Result<()> {
        self.counts.clear()
    }

    fn freeze(&self) -> Result<()> {
        let expected = self.grid.expected(&self.counts.download(self.grid.entries())?);
        self.visibilities.upload(bytemuck::cast_slice(&expected))
    }
}
