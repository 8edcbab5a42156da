//! Resumes from what a technique learned in an earlier render.

use super::Renderer;
use crate::{
    error::{Error, Result},
    sampler::guided::{GuideState, Guided},
};

impl Renderer {
    /// Returns what `guided` has learned, or `None` for other samplers. Fails if the device does.
    pub fn guide_state(&self) -> Result<Option<GuideState>> {
        self.technique::<Guided>().map(|guided| guided.state(self.sample_count)).transpose()
    }

    /// Continues from what an earlier renderer learned, without training: bit for bit, if the film
    /// holds as many samples as it did when the state was taken. Returns true if the geometry
    /// differs, so that most was forgotten.
    ///
    /// # Errors
    /// [`Error::Usage`] if the environment or the regions differ, or if this sampler learns
    /// nothing; [`Error::Vulkan`] if the device fails.
    pub fn restore_guide(&mut self, state: &GuideState) -> Result<bool> {
        let restore = |guided: &mut Guided, runner: &mut _, progress: &_| {
            guided.restore(runner, progress, state)
        };
        self.with_technique(restore).unwrap_or_else(|| {
            Err(Error::usage(format!(
                "the sampler {} learns nothing; a guide is for --sampler guided",
                self.settings.sampler.name()
            )))
        })
    }
}
