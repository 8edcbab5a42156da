//! Looks at a scene through a camera that moves.

use std::sync::Arc;

use super::Renderer;
use crate::{
    error::Result,
    film::sums::Ahead,
    gpu::DescriptorSet,
    pass::{SceneBuffers, Watch},
    scene::Camera,
};

impl Renderer {
    /// Empties the film to render through another camera, on a film of `size` pixels: the one that the
    /// renderer was made for, or a smaller one. `seed` must be new: what was learned stays, and numbers
    /// that it was learned from must not meet it again. What was counted since the last rebuild is used
    /// at once if `learns`, which takes time, else later. Fails if the device does.
    ///
    /// # Panics
    /// If the renderer has a crop window, or the film is larger than that.
    pub fn look(&mut self, camera: &Camera, size: [u32; 2], seed: u32, learns: bool) -> Result<()> {
        assert!(self.settings.window.is_none(), "a camera moves with the whole film");
        self.runner.look(camera, size)?;
        self.technique.look(&mut self.runner, learns)?;
        self.settings.seed = seed;
        self.film_size = size;
        self.sample_count = 0;
        self.ahead = Ahead::default();
        Ok(())
    }

    /// Calls `watch` after waves from now on. Where it returns true, [`Renderer::render_pass`] returns
    /// early, and some pixels may have more samples than others.
    pub fn set_watch(&mut self, watch: Watch) {
        self.runner.set_watch(watch);
    }

    /// True if the watch has stopped a pass since [`Renderer::look`].
    pub fn is_stopped(&self) -> bool {
        self.runner.is_stopped()
    }

    /// Width and height of the film in use, pixels.
    pub fn film_size(&self) -> [u32; 2] {
        self.film_size
    }

    /// Descriptor set 3 of every page of the film, its first pixel and its number of pixels.
    pub fn film_pages(&self) -> impl Iterator<Item = (&DescriptorSet, u32, u32)> {
        self.runner.film().pages()
    }

    /// The scene on the device, for [`Renderer::with_scene_buffers`].
    pub fn scene_buffers(&self) -> Arc<SceneBuffers> {
        Arc::clone(&self.runner.scene)
    }
}
