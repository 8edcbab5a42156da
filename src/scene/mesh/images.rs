//! Images of a mesh file: files are read once, and texels looked at.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::texture::{Channels, Encoding, Texels, Texture, TextureUse};

/// Images that have been read so far.
#[derive(Debug, Default)]
pub(super) struct Images {
    read: HashMap<PathBuf, Option<Arc<Texture>>>,
}

impl Images {
    /// Reads an image file, or returns it again. A file that is missing or no image is one warning
    /// and no texture; `place` says who names it.
    pub(super) fn load(
        &mut self,
        path: &Path,
        place: &str,
        warnings: &mut Vec<String>,
    ) -> Option<Arc<Texture>> {
        if let Some(found) = self.read.get(path) {
            return found.clone();
        }
        let texture = match Texture::load(path) {
            Ok(texture) => Some(Arc::new(texture)),
            Err(error) => {
                warnings.push(format!("{error}; rendered without this texture ({place})"));
                None
            }
        };
        self.read.insert(path.to_owned(), texture.clone());
        texture
    }

    /// Files that have been read.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let mut files: Vec<_> = self
            .read
            .iter()
            .filter(|(_, texture)| texture.is_some())
            .map(|(path, _)| path.clone())
            .collect();
        files.sort();
        files
    }
}

/// Tests whether any texel lets light through.
pub(super) fn has_alpha(texture: &Texture) -> bool {
    match &texture.texels {
        Texels::Bytes(texels) => texels.iter().any(|texel| texel[3] < u8::MAX),
        Texels::Shorts(texels) => texels.iter().any(|texel| texel[3] < u16::MAX),
        Texels::Halves(texels) => texels.iter().any(|texel| texel[3].to_f32() < 1.0),
    }
}

/// Mean of a channel over all texels, taken as linear.
pub(super) fn mean(texture: &Arc<Texture>, channel: usize) -> f32 {
    let channels = [Channels::Red, Channels::Green, Channels::Blue, Channels::Alpha][channel];
    let used = TextureUse::new(Arc::clone(texture));
    TextureUse { channels, encoding: Encoding::Linear, ..used }.mean()[0]
}
