//! Goes on from what a technique learned in an earlier render.

use super::Renderer;
use crate::{
    error::{Error, Result},
    sampler::guided::{GuideState, Guided},
};

impl Renderer {
    /// What the sampler `guided` has learned; `None` for the others.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the device fails.
    pub fn guide_state(&self) -> Result<Option<GuideState>> {
        self.technique::<Guided>().map(|guided| guided.state(self.sample_count)).transpose()
    }

    /// Goes on from what an earlier renderer learned, without training. With as many samples in the
    /// film as the state was taken at, this continues that renderer to the bit. Returns true if the
    /// geometry is another, so that most was forgotten.
    ///
    /// # Errors
    /// [`Error::Usage`] if the environment or the regions differ, or if this sampler learns nothing;
    /// [`Error::Vulkan`] if the device fails.
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
