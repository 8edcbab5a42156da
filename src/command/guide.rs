//! Guide files: saves and restores the state that the sampler `guided` has learned.

use std::path::Path;

use crate::{
    error::{Error, Result},
    sampler::{Sampler, guided::GuideState},
    session::Renderer,
};

/// Rejects guide options for samplers that do not learn.
///
/// # Errors
/// [`Error::Usage`].
pub fn check(sampler: Sampler, save: Option<&Path>, load: Option<&Path>) -> Result<()> {
    for (name, path) in [("--save-guide", save), ("--load-guide", load)] {
        if let Some(path) = path
            && sampler != Sampler::Guided
        {
            return Err(Error::usage(format!(
                "{name} {}: the sampler {} learns nothing; expected --sampler guided",
                path.display(),
                sampler.name()
            )));
        }
    }
    Ok(())
}

/// Starts from the guide of an earlier render, such as another frame of an animation.
///
/// # Errors
/// A file that cannot be read or belongs to another environment; a failing device.
pub fn load(renderer: &mut Renderer, path: &Path) -> Result<()> {
    let state = GuideState::read(path)?;
    // Treat it as learned before the first sample, whatever film it came from.
    let state = GuideState { samples: u32::MAX, ..state };
    if renderer.restore_guide(&state)? {
        log::warn!("{} was learned in another geometry: most of it counts no more", path.display());
    }
    Ok(())
}

/// Restores the guide that lies at `path` beside a checkpoint, so that the render continues exactly.
///
/// # Errors
/// Bytes that are no guide or one of another moment; a failing device.
pub fn resume(renderer: &mut Renderer, path: &Path, bytes: &[u8]) -> Result<()> {
    let state = GuideState::from_bytes(bytes, path)?;
    if state.samples != renderer.sample_count() {
        return Err(Error::format(
            path,
            format!(
                "what was learned belongs to {} samples per pixel, the checkpoint holds {}",
                state.samples,
                renderer.sample_count()
            ),
        ));
    }
    if renderer.restore_guide(&state)? {
        return Err(Error::format(path, "it was learned in another geometry".to_owned()));
    }
    Ok(())
}

/// Writes the guide, if the sampler learns one.
///
/// # Errors
/// A failing device or disk.
pub fn save(renderer: &Renderer, path: &Path) -> Result<()> {
    renderer.guide_state()?.map_or(Ok(()), |state| state.write(path))
}
