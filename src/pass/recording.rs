//! Passes on their way to the device: one submission, or several where passes ask the host in between.

use std::{sync::Arc, time::Instant};

use super::{
    host_tracer::{HostTracer, has_rays},
    kernel::{Pass, Question},
};
use crate::{
    error::Result,
    gpu::{Commands, DescriptorSet, Device, PassTimes},
    shader::structs::Wave,
};

/// Passes over a wave, in their order.
pub struct Recording<'a> {
    device: &'a Arc<Device>,
    pub(super) commands: Commands,
    /// Passes of one submission, at most.
    most_passes: u32,
    times: PassTimes,
    host: Option<&'a HostTracer>,
    ends: bool,
    /// Most paths of the lists from here on: those whose rays the vertex began with.
    most_listed: Option<u32>,
}

impl<'a> Recording<'a> {
    /// Starts recording at most `most_passes` passes. Those of a scene that the host traces need `host`,
    /// which looks for the end of all paths if the wave `ends` with them.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if a call fails.
    pub fn begin(
        device: &'a Arc<Device>,
        most_passes: u32,
        host: Option<&'a HostTracer>,
        ends: bool,
    ) -> Result<Self> {
        let commands = Commands::begin_timed(device, most_passes)?;
        let times = PassTimes::new();
        Ok(Self { device, commands, most_passes, times, host, ends, most_listed: None })
    }

    /// Adds a pass. If it asks the host, waits for all before and lets the host answer first, in those of
    /// `sets` that come first: of the scene and of the wave. Returns false, and adds nothing, if the host
    /// finds that no path has a ray left.
    ///
    /// # Errors
    /// As [`Commands::submit_and_wait`].
    pub fn add(&mut self, pass: &Pass, sets: &[&DescriptorSet], wave: &Wave) -> Result<bool> {
        if let (Some(question), Some(host)) = (pass.kernel.question, self.host) {
            let next = Commands::begin_timed(self.device, self.most_passes)?;
            let mut before = std::mem::replace(&mut self.commands, next);
            before.make_visible_to_host();
            add_times(&mut self.times, &before.submit_and_wait()?);
            let start = Instant::now();
            // Cohorts need the first two vertices of all paths.
            let may_end = self.ends && question == Question::Closest && wave.vertex > 1;
            if may_end && !has_rays(wave, sets[1])? {
                return Ok(false);
            }
            let walked = host.answer(question, wave, [sets[0], sets[1]])?;
            if question == Question::Closest {
                self.most_listed = Some(walked);
            }
            let ms = start.elapsed().as_secs_f64() * 1e3;
            *self.times.entry(pass.kernel.shader.to_owned()).or_default() += ms;
        }
        pass.record(&mut self.commands, sets, wave, self.most_listed)?;
        Ok(true)
    }

    /// Submits, waits, and returns the time by pass, that of the host included.
    ///
    /// # Errors
    /// As [`Commands::submit_and_wait`].
    pub fn finish(self) -> Result<PassTimes> {
        let mut times = self.times;
        add_times(&mut times, &self.commands.submit_and_wait()?);
        Ok(times)
    }
}

pub(super) fn add_times(times: &mut PassTimes, more: &PassTimes) {
    for (pass, ms) in more {
        *times.entry(pass.clone()).or_default() += ms;
    }
}
