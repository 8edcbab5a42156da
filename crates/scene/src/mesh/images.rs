//! Images of a mesh file.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::Vec4;

use crate::texture::{Channels, Encoding, Texels, Texture, TextureCache, TextureUse};

/// Texels that tell of an image whether it holds normals.
const TEXELS_LOOKED_AT: usize = 4096;

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

/// Opacity of a colour image, if any texel lets light through.
pub(super) fn opacity_of(color: &TextureUse) -> Option<TextureUse> {
    let (channels, encoding) = (Channels::Alpha, Encoding::Linear);
    has_alpha(&color.texture).then(|| TextureUse { channels, encoding, ..color.clone() })
}

/// Tests for texels that are vectors of about unit length, along +z on the mean, as those of normal maps.
pub(super) fn holds_normals(texture: &Texture) -> bool {
    let count = texture.width as usize * texture.height as usize;
    let step = count.div_ceil(TEXELS_LOOKED_AT);
    let normals = (0..count).step_by(step).map(|texel| {
        let texel = Vec4::from(texture.linear_texel(Encoding::Linear, texel)).truncate();
        let normal = 2.0 * texel - 1.0;
        normal.extend((normal.length() - 1.0).abs())
    });
    let mean = normals.sum::<Vec4>() / count.div_ceil(step) as f32;
    mean.x.abs().max(mean.y.abs()) < 0.25 && mean.z > 0.5 && mean.w < 0.2
}
