//! Descriptor set 1 of `control-variates`: counts of the pilot, and what they let expect.

use std::sync::Arc;

use super::records::RecordGrid;
use crate::{
    error::Result,
    gpu::{Buffer, DescriptorSet, Device},
    sampler::pilot::Tables,
    shader::rooms::control_variates::{RECORD_COUNTS, RECORD_VISIBILITIES, TABLE},
};

/// The visibility records on a device.
pub struct RecordBuffers {
    set: DescriptorSet,
    grid: RecordGrid,
}

impl RecordBuffers {
    /// Allocates records of undefined content. Fails if the device does or its limits are exceeded.
    pub fn new(device: &Arc<Device>, grid: RecordGrid) -> Result<Self> {
        let entries = grid.entries() as u64;
        let make = |name, bytes| Buffer::new(device, name, bytes);
        let bound = [
            (RECORD_COUNTS, make("record counts", 8 * entries)?),
            (RECORD_VISIBILITIES, make("record visibilities", 4 * entries)?),
        ];
        let set = DescriptorSet::new(device, &TABLE, &bound)?;
        Ok(Self { set, grid })
    }
}

impl Tables for RecordBuffers {
    const STAGE: &'static str = "visibility records";

    fn set(&self) -> &DescriptorSet {
        &self.set
    }

    fn forget(&self) -> Result<()> {
        self.set.buffer(RECORD_COUNTS).clear()
    }

    fn freeze(&self) -> Result<()> {
        let counts = self.set.buffer(RECORD_COUNTS).download(self.grid.entries())?;
        let expected = self.grid.expected(&counts);
        self.set.buffer(RECORD_VISIBILITIES).upload(bytemuck::cast_slice(&expected))
    }
}
