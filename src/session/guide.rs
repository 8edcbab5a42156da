//! Continues from what a technique learned in an earlier render.

use std::{io::Write, path::Path};

use super::Renderer;
use crate::{
    error::Result,
    files::{self, write_atomically},
    pass::Saved,
};

impl Renderer {
    /// Returns what the sampler has learned, as the content of a file; `None` for samplers that learn
    /// nothing. Fails if the device does.
    pub fn guide(&self) -> Result<Option<Vec<u8>>> {
        self.technique.save(self.sample_count)
    }

    /// Continues from what an earlier renderer learned, as [`Technique::load`](crate::pass::Technique::load).
    pub fn take_guide(&mut self, saved: Saved<'_>) -> Result<bool> {
        let progress = self.progress();
        self.technique.load(&mut self.runner, &progress, saved)
    }

    /// Starts from the guide of an earlier render, such as another frame of an animation. Warns if it was
    /// learned in another geometry.
    ///
    /// # Errors
    /// A file that cannot be read or belongs to another environment; a failing device.
    pub fn load_guide(&mut self, path: &Path) -> Result<()> {
        let bytes = files::read(path)?;
        if self.take_guide(Saved { path, bytes: &bytes, continues: false })? {
            let path = path.display();
            log::warn!("{path} was learned in another geometry: most of it counts no more");
        }
        Ok(())
    }

    /// Writes the guide, if the sampler learns one.
    ///
    /// # Errors
    /// A failing device or disk.
    pub fn save_guide(&self, path: &Path) -> Result<()> {
        let write = |bytes: Vec<u8>| write_atomically(path, |file| file.write_all(&bytes));
        self.guide()?.map_or(Ok(()), write)
    }
}
