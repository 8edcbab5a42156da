//! Device time per pass, from timestamp queries.

use std::{collections::BTreeMap, sync::Arc};

use ash::vk;

use super::{Called, device::Device};
use crate::error::Result;

/// Device time by pass name, milliseconds.
pub(crate) type PassTimes = BTreeMap<String, f64>;

/// Two queries per timed pass of one command buffer.
pub(super) struct Timestamps {
    pool: vk::QueryPool,
    commands: vk::CommandBuffer,
    names: Vec<String>,
    capacity: u32,
    device: Arc<Device>,
}

impl Timestamps {
    /// Creates queries for `capacity` passes of `commands`, which is in the recording state.
    pub(super) fn new(
        device: &Arc<Device>,
        commands: vk::CommandBuffer,
        capacity: u32,
    ) -> Result<Self> {
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(2 * capacity);
        // SAFETY: the device is alive; the queue family has timestamps (checked at its choice).
        let pool =
            unsafe { device.raw.create_query_pool(&info, None) }.called("vkCreateQueryPool")?;
        // SAFETY: recording, outside of any pass.
        unsafe { device.raw.cmd_reset_query_pool(commands, pool, 0, 2 * capacity) };
        Ok(Self { pool, commands, names: Vec::new(), capacity, device: Arc::clone(device) })
    }

    /// Records the time at which all work before the pass `name` is complete.
    pub(super) fn start(&mut self, name: &str) {
        assert!(self.names.len() < self.capacity as usize, "too many timed passes");
        self.write(2 * self.names.len());
        self.names.push(name.to_owned());
    }

    /// Records the time at which the last started pass is complete.
    pub(super) fn stop(&mut self) {
        self.write(2 * self.names.len() - 1);
    }

    fn write(&self, query: usize) {
        let query = u32::try_from(query).unwrap_or(u32::MAX);
        // SAFETY: recording; the query lies within the pool and is written once after its reset.
        unsafe {
            self.device.raw.cmd_write_timestamp(
                self.commands,
                vk::PipelineStageFlags::COMPUTE_SHADER,
                self.pool,
                query,
            );
        }
    }

    /// Reads milliseconds per pass name, summed over passes of one name. Call after the fence.
    pub(super) fn read(&self) -> Result<PassTimes> {
        let mut ticks = vec![0_u64; 2 * self.names.len()];
        if !ticks.is_empty() {
            // SAFETY: all these queries have been written by a submission that has finished.
            unsafe {
                self.device.raw.get_query_pool_results(
                    self.pool,
                    0,
                    &mut ticks,
                    vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT,
                )
            }
            .called("vkGetQueryPoolResults")?;
        }
        let capabilities = self.device.capabilities();
        let mask = match capabilities.timestamp_valid_bits {
            bits @ 1..64 => (1_u64 << bits) - 1,
            _ => u64::MAX,
        };
        let mut times = PassTimes::new();
        for (name, pair) in self.names.iter().zip(ticks.chunks_exact(2)) {
            let elapsed = pair[1].wrapping_sub(pair[0]) & mask;
            *times.entry(name.clone()).or_default() +=
                elapsed as f64 * f64::from(capabilities.timestamp_period) * 1e-6;
        }
        Ok(times)
    }
}

impl Drop for Timestamps {
    fn drop(&mut self) {
        // SAFETY: the submission that used the pool has been waited for, or never happened.
        unsafe { self.device.raw.destroy_query_pool(self.pool, None) };
    }
}
