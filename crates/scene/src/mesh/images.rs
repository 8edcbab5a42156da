//! Images of a mesh file.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::texture::{Texels, Texture, TextureCache};

/// Image files, each read once.
#[derive(Debug, Default)]
pub(super) struct Images {
    cache: TextureCache,
    unreadable: HashSet<PathBuf>,
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
        if self.unreadable.contains(path) {
            return None;
        }
        match self.cache.load(path, warnings) {
            Ok(texture) => Some(texture),
            Err(error) => {
                warnings.push(format!("{error}; rendered without this texture ({place})"));
                self.unreadable.insert(path.to_owned());
                None
            }
        }
    }

    pub(super) fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.cache.files().into_iter()
    }
}

/// Tests whether any texel lets light through.
pub(crate) fn has_alpha(texture: &Texture) -> bool {
    match &texture.texels {
        Texels::Bytes(texels) => texels.iter().any(|texel| texel[3] < u8::MAX),
        Texels::Shorts(texels) => texels.iter().any(|texel| texel[3] < u16::MAX),
        Texels::Halves(texels) => texels.iter().any(|texel| texel[3].to_f32() < 1.0),
    }
}
