//! Recording and submission of command buffers.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use ash::vk;

use super::{
    Called,
    buffer::Buffer,
    descriptors::DescriptorSet,
    device::Device,
    labels,
    pipeline::Pipeline,
    timestamps::{PassTimes, Timestamps},
    vulkan_error,
};
use crate::error::{Error, Result};
use crate::shader::constants::WORKGROUP_SIZE;

/// Most invocations of a dispatch over a picture: every device allows 65,535 groups of 64.
pub(crate) const MOST_INVOCATIONS: u32 = 1 << 21;
/// Waits for one submission before it is given up; dispatches are sized to take about a tenth of a
/// second. The clock of a wait goes on while the process is stopped or the machine sleeps, so that
/// one long wait would end then.
const SUBMISSION_WAITS: u32 = 120;
/// Length of each of them.
const SUBMISSION_WAIT: Duration = Duration::from_secs(1);

/// A command buffer that is recorded, submitted once and dropped.
pub struct Commands {
    pool: vk::CommandPool,
    pub(super) raw: vk::CommandBuffer,
    fence: vk::Fence,
    timestamps: Option<Timestamps>,
    last_pass: String,
    device: Arc<Device>,
}

impl Commands {
    /// Starts recording.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails.
    pub fn begin(device: &Arc<Device>) -> Result<Self> {
        let raw_device = &device.raw;
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.queue_family())
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the family belongs to the device.
        let pool = unsafe { raw_device.create_command_pool(&pool_info, None) }
            .called("vkCreateCommandPool")?;
        // From here on `Drop` cleans up.
        let mut commands = Self {
            pool,
            raw: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            timestamps: None,
            last_pass: "none".into(),
            device: Arc::clone(device),
        };
        let allocate = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        let begin = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let _changes = labels::lock();
        // SAFETY: the pool was just created and nothing else uses it.
        unsafe {
            commands.raw = raw_device
                .allocate_command_buffers(&allocate)
                .called("vkAllocateCommandBuffers")?[0];
            commands.fence = raw_device
                .create_fence(&vk::FenceCreateInfo::default(), None)
                .called("vkCreateFence")?;
            raw_device.begin_command_buffer(commands.raw, &begin).called("vkBeginCommandBuffer")?;
        }
        Ok(commands)
    }

    /// Starts recording with room for `capacity` timed passes.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails.
    pub fn begin_timed(device: &Arc<Device>, capacity: u32) -> Result<Self> {
        let mut commands = Self::begin(device)?;
        commands.timestamps = Some(Timestamps::new(device, commands.raw, capacity)?);
        Ok(commands)
    }

    /// Records one pass: a compute dispatch of at least `invocations` invocations that sees all writes of
    /// earlier passes. It is labelled with the pipeline's name and, in a timed command buffer, timed.
    ///
    /// Binds those of `sets` that the shader uses; `push_constants` may be empty.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails.
    ///
    /// # Panics
    /// If the dispatch exceeds the device's workgroup count or the push constants exceed 128 bytes.
    /// Callers size their waves by [`Capabilities`](super::Capabilities).
    pub fn dispatch(
        &mut self,
        pipeline: &Pipeline,
        sets: &[&DescriptorSet],
        push_constants: &[u8],
        invocations: u32,
    ) -> Result<()> {
        let groups = invocations.div_ceil(WORKGROUP_SIZE).max(1);
        assert!(
            groups <= self.device.capabilities().max_workgroup_count,
            "{}: {groups} workgroups are too many",
            pipeline.name
        );
        assert!(push_constants.len() <= 128, "{}: too many push constants", pipeline.name);
        let used = sets.iter().filter_map(|set| Some((set, pipeline.used(set)?)));
        let seen = used.map(|(set, numbers)| Ok((set.index(), set.with(numbers)?)));
        let seen = seen.collect::<Result<Vec<_>>>()?;
        let raw = &self.device.raw;
        labels::begin(&self.device, self.raw, &pipeline.name);
        self.barrier(
            vk::PipelineStageFlags::COMPUTE_SHADER,
            vk::AccessFlags::SHADER_READ | vk::AccessFlags::SHADER_WRITE,
        );
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.start(&pipeline.name, invocations);
        }
        // SAFETY: the command buffer is recording; pipeline, layout and sets belong to the device
        // and the caller keeps them alive until the submission has been waited for.
        unsafe {
            raw.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::COMPUTE, pipeline.made.raw);
            for (index, set) in seen {
                raw.cmd_bind_descriptor_sets(
                    self.raw,
                    vk::PipelineBindPoint::COMPUTE,
                    pipeline.made.layout,
                    index,
                    &[set],
                    &[],
                );
            }
            if !push_constants.is_empty() {
                raw.cmd_push_constants(
                    self.raw,
                    pipeline.made.layout,
                    vk::ShaderStageFlags::COMPUTE,
                    0,
                    push_constants,
                );
            }
            raw.cmd_dispatch(self.raw, groups, 1, 1);
        }
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.stop();
        }
        labels::end(&self.device, self.raw);
        pipeline.name.clone_into(&mut self.last_pass);
        Ok(())
    }

    /// Fills a whole buffer with a repeated 32-bit word.
    pub(crate) fn fill(&mut self, buffer: &Buffer, word: u32) {
        self.fill_start(buffer, vk::WHOLE_SIZE, word);
    }

    /// Fills the first `bytes`, a positive multiple of 4, with a repeated word, after earlier use.
    pub(crate) fn fill_start(&mut self, buffer: &Buffer, bytes: u64, word: u32) {
        self.interrupt_times();
        self.barrier(vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE);
        // SAFETY: recording; the buffer has transfer usage and the caller keeps it alive.
        unsafe {
            self.device.raw.cmd_fill_buffer(self.raw, buffer.raw(), 0, bytes, word);
        }
    }

    /// Copies `size` bytes from one buffer to another.
    pub(crate) fn copy(
        &mut self,
        from: &Buffer,
        from_offset: u64,
        to: &Buffer,
        to_offset: u64,
        size: u64,
    ) {
        self.interrupt_times();
        self.barrier(
            vk::PipelineStageFlags::TRANSFER,
            vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::TRANSFER_WRITE,
        );
        let region =
            vk::BufferCopy::default().src_offset(from_offset).dst_offset(to_offset).size(size);
        // SAFETY: recording; both buffers have transfer usage and the caller keeps them alive.
        unsafe { self.device.raw.cmd_copy_buffer(self.raw, from.raw(), to.raw(), &[region]) };
    }

    /// Makes everything written so far readable by the host once the submission has finished.
    pub(crate) fn make_visible_to_host(&mut self) {
        self.barrier(vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_READ);
    }

    /// Keeps the commands that follow out of the time of any pass.
    fn interrupt_times(&mut self) {
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.interrupt();
        }
    }

    /// Lets everything written so far be seen by `access` in the stages `next`.
    fn barrier(&self, next: vk::PipelineStageFlags, access: vk::AccessFlags) {
        let writers = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
        let barrier = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(access);
        let flags = vk::DependencyFlags::empty();
        let raw = &self.device.raw;
        // SAFETY: the command buffer is recording.
        unsafe { raw.cmd_pipeline_barrier(self.raw, writers, next, flags, &[barrier], &[], &[]) };
    }

    /// Submits, waits, and returns the device time per pass (empty if not timed).
    ///
    /// # Errors
    /// [`Error::Vulkan`] if a call fails, [`Error::Device`] if the device is lost; both name the last
    /// pass of the submission.
    pub fn submit_and_wait(self) -> Result<PassTimes> {
        let raw = &self.device.raw;
        let failed = |call: &str, result| {
            vulkan_error(&format!("{call} (last pass {})", self.last_pass), result)
        };
        // Held until the work is done: see `Device::queue`.
        let queue = self.device.queue();
        let start = Instant::now();
        // SAFETY: recording ends here, the queue is locked, and the callers keep every object that
        // the commands use alive until the wait ends.
        unsafe {
            raw.end_command_buffer(self.raw)
                .map_err(|result| failed("vkEndCommandBuffer", result))?;
            let buffers = [self.raw];
            let submit = vk::SubmitInfo::default().command_buffers(&buffers);
            raw.queue_submit(*queue, &[submit], self.fence)
                .map_err(|result| failed("vkQueueSubmit", result))?;
            let timeout = u64::try_from(SUBMISSION_WAIT.as_nanos()).unwrap_or(u64::MAX);
            let mut waits = (0..SUBMISSION_WAITS)
                .map(|_| raw.wait_for_fences(&[self.fence], true, timeout))
                .skip_while(|outcome| *outcome == Err(vk::Result::TIMEOUT));
            match waits.next().unwrap_or(Err(vk::Result::TIMEOUT)) {
                Ok(()) => {}
                Err(vk::Result::TIMEOUT) => {
                    // The commands may still use the callers' objects, so the device must be idle
                    // before this returns.
                    raw.device_wait_idle().map_err(|result| failed("vkDeviceWaitIdle", result))?;
                    let seconds = SUBMISSION_WAITS * SUBMISSION_WAIT.as_secs() as u32;
                    return Err(Error::Vulkan {
                        call: format!("pass {}", self.last_pass),
                        result: format!("took longer than {seconds} s"),
                    });
                }
                Err(result) => return Err(failed("vkWaitForFences", result)),
            }
        }
        let took = start.elapsed();
        drop(queue);
        self.timestamps.as_ref().map_or_else(|| Ok(PassTimes::new()), |times| times.read(took))
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        let _changes = labels::lock();
        // SAFETY: either never submitted or waited for; destroying null handles is allowed.
        unsafe {
            self.device.raw.destroy_fence(self.fence, None);
            self.device.raw.destroy_command_pool(self.pool, None);
        }
    }
}
