//! Going on where another renderer stopped: the film's sums, and what the sampler `guided` has learned.

use super::{GuideBuffers, Renderer};
use crate::{
    error::{Error, Result},
    film::Sums,
    sampler::guided::GuideState,
};

impl Renderer {
    /// Continues from sums that an earlier renderer with the same settings left.
    ///
    /// # Errors
    /// [`Error::Usage`] if the window or the layers differ, or if pixels keep visibility caches, which
    /// sums do not hold; [`Error::Vulkan`] if the device fails.
    pub fn restore(&mut self, sums: &Sums) -> Result<()> {
        if self.waves.keeps_caches() && sums.sample_count > 0 {
            return Err(Error::usage(format!(
                "--resume with --set cache=pixel: the {} samples per pixel of the checkpoint taught \
                 visibility caches that it does not hold, so the image would not be that of one \
                 render; render without --resume, or with --sample-offset {} and merge the two, or \
                 use cache=hit",
                sums.sample_count,
                self.settings.first_sample.saturating_add(sums.sample_count)
            )));
        }
        if sums.film_size != self.film_size
            || sums.origin != [self.window.x, self.window.y]
            || [sums.width, sums.height] != [self.window.width, self.window.height]
        {
            return Err(Error::usage(format!(
                "the checkpoint holds pixels {}x{} from {:?} of a film of {:?}, expected {}x{} from \
                 {:?} of {:?}",
                sums.width,
                sums.height,
                sums.origin,
                sums.film_size,
                self.window.width,
                self.window.height,
                [self.window.x, self.window.y],
                self.film_size
            )));
        }
        self.film.upload(sums)?;
        self.sample_count = sums.sample_count;
        Ok(())
    }

    /// What the sampler `guided` has learned; `None` for the others.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the device fails.
    pub fn guide_state(&self) -> Result<Option<GuideState>> {
        let state = self.guide.as_ref().map(GuideBuffers::state).transpose()?;
        Ok(state.map(|state| GuideState {
            samples: self.sample_count,
            rebuilt_at: self.rebuilt_at,
            is_open: self.is_open,
            candidates: self.candidates(),
            ..state
        }))
    }

    /// Goes on from what an earlier renderer learned, without training. With as many samples in the
    /// film as the state was taken at, this continues that renderer to the bit. Under `candidates=auto` the
    /// number that one chose is taken too. Returns whether the
    /// geometry is another, so that most was forgotten.
    ///
    /// # Errors
    /// [`Error::Usage`] if the environment or the regions differ, or if this sampler learns nothing;
    /// [`Error::Vulkan`] if the device fails.
    pub fn restore_guide(&mut self, state: &GuideState) -> Result<bool> {
        let Some(guide) = &mut self.guide else {
            return Err(Error::usage(format!(
                "the sampler {} learns nothing; a guide is for --sampler guided",
                self.settings.sampler.name()
            )));
        };
        let has_moved = guide.restore(state)?;
        self.is_open = state.is_open && !has_moved;
        if state.samples == self.sample_count {
            self.rebuilt_at = state.rebuilt_at;
        } else {
            guide.rebuild(false)?;
            self.rebuilt_at = self.sample_count;
        }
        self.is_trained = true;
        if let Some(candidates) = state.candidates {
            self.take_choice(candidates)?;
        }
        Ok(has_moved)
    }
}
