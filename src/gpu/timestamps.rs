//! Device time per pass, from timestamp queries.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use ash::vk;

use super::{Called, device::Device};
use crate::error::Result;

/// Device time by pass name, milliseconds.
pub(crate) type PassTimes = BTreeMap<String, f64>;

/// Most invocations of a pass without timestamps on a software device: each wakes the threads of its
/// rasteriser, which takes longer than such a pass.
const FEW_INVOCATIONS: u32 = 256;

/// Queries around the passes of one command buffer: the end of one is the start of the next.
pub(super) struct Timestamps {
    pool: vk::QueryPool,
    commands: vk::CommandBuffer,
    /// Timed passes, each with the query of its start. That of its end follows.
    timed: Vec<(String, u32)>,
    /// Passes without queries.
    untimed: Vec<String>,
    /// Number of queries that are written.
    written: u32,
    /// True unless passes without queries, or commands that are no pass, follow the last query.
    is_current: bool,
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
        Ok(Self {
            pool,
            commands,
            timed: Vec::new(),
            untimed: Vec::new(),
            written: 0,
            is_current: false,
            capacity,
            device: Arc::clone(device),
        })
    }

    /// Begins the pass `name`, whose commands follow.
    pub(super) fn start(&mut self, name: &str, invocations: u32) {
        if self.device.capabilities().is_software() && invocations <= FEW_INVOCATIONS {
            self.interrupt();
            self.untimed.push(name.to_owned());
            return;
        }
        if !self.is_current {
            self.write();
        }
        self.timed.push((name.to_owned(), self.written - 1));
    }

    /// Ends the pass that was begun last.
    pub(super) fn stop(&mut self) {
        if self.is_current {
            self.write();
        }
    }

    /// Leaves out commands that are no pass.
    pub(super) fn interrupt(&mut self) {
        self.is_current = false;
    }

    /// Records the time at which all work so far is complete.
    fn write(&mut self) {
        assert!(self.written < 2 * self.capacity, "too many timed passes");
        // SAFETY: recording; the query lies within the pool and is written once after its reset.
        unsafe {
            self.device.raw.cmd_write_timestamp(
                self.commands,
                vk::PipelineStageFlags::COMPUTE_SHADER,
                self.pool,
                self.written,
            );
        }
        self.written += 1;
        self.is_current = true;
    }

    /// Reads milliseconds per pass name, summed over passes of one name. Passes without queries share what
    /// the submission `took` beside the others. Call after the fence.
    pub(super) fn read(&self, took: Duration) -> Result<PassTimes> {
        let mut ticks = vec![0_u64; self.written as usize];
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
        for (name, start) in &self.timed {
            let start = *start as usize;
            let elapsed = ticks[start + 1].wrapping_sub(ticks[start]) & mask;
            *times.entry(name.clone()).or_default() +=
                elapsed as f64 * f64::from(capabilities.timestamp_period) * 1e-6;
        }
        let left = (took.as_secs_f64() * 1e3 - times.values().sum::<f64>()).max(0.0);
        for name in &self.untimed {
            *times.entry(name.clone()).or_default() += left / self.untimed.len() as f64;
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
