//! State that the sampler `guided` has learned, as fields and not as the content of a file.

use std::path::Path;

use fenestra::{
    Error, Result,
    sampler::guided::{GuideState, Guided},
    session::Renderer,
};

/// Access to the guide of a renderer.
pub trait Guide {
    /// Returns what `guided` has learned; `None` for other samplers.
    fn guide_state(&self) -> Result<Option<GuideState>>;

    /// Continues from `state`, exactly if it belongs to the samples in the film. Returns true if the
    /// geometry differs. Fails for other samplers.
    fn restore_guide(&mut self, state: &GuideState) -> Result<bool>;
}

impl Guide for Renderer {
    fn guide_state(&self) -> Result<Option<GuideState>> {
        let state = |bytes: Vec<u8>| GuideState::from_bytes(&bytes, Path::new("guide"));
        self.guide()?.map(state).transpose()
    }

    fn restore_guide(&mut self, state: &GuideState) -> Result<bool> {
        self.with_technique(|guided: &mut Guided, runner, progress| {
            guided.restore(runner, progress, state)
        })
        .unwrap_or_else(|| Err(Error::usage("no guide")))
    }
}
