//! Image files by path, each decoded once.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
    sync::Arc,
};

use rayon::prelude::*;

use super::Texture;
use crate::error::Result;

/// Textures that are loaded, by the path of their file.
#[derive(Debug, Default)]
pub struct TextureCache {
    textures: BTreeMap<PathBuf, Arc<Texture>>,
}

impl TextureCache {
    /// Decodes the files among `paths` that are not there yet, on all cores. Adds the warnings of
    /// [`Texture::load`] in the order of the paths.
    ///
    /// # Errors
    /// Those of [`Texture::load`], for the first file in alphabetical order that fails.
    pub fn load_all(
        &mut self,
        paths: impl IntoIterator<Item = PathBuf>,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        // A file that is named in two ways is one texture.
        let mut missing = BTreeMap::new();
        for path in paths {
            let key = key(&path);
            if !self.textures.contains_key(&key) {
                missing.entry(key).or_insert(path);
            }
        }
        let decoded: Vec<_> = missing
            .into_par_iter()
            .map(|(key, path)| {
                let mut own = Vec::new();
                Texture::load(&path, &mut own).map(|texture| (key, Arc::new(texture), own))
            })
            .collect();
        for result in decoded {
            let (key, texture, own) = result?;
            self.textures.insert(key, texture);
            warnings.extend(own);
        }
        Ok(())
    }

    /// Returns the texture of a file, which it decodes if it is not there yet.
    ///
    /// # Errors
    /// Those of [`Texture::load`].
    pub fn load(&mut self, path: &Path, warnings: &mut Vec<String>) -> Result<Arc<Texture>> {
        let key = key(path);
        if let Some(texture) = self.textures.get(&key) {
            return Ok(Arc::clone(texture));
        }
        let texture = Arc::new(Texture::load(path, warnings)?);
        self.textures.insert(key, Arc::clone(&texture));
        Ok(texture)
    }

    /// Adds a texture that is in no file, under the path of one.
    pub(crate) fn insert(&mut self, path: &Path, texture: Texture) {
        self.textures.insert(key(path), Arc::new(texture));
    }

    /// Paths of the textures, for the inputs of a scene.
    pub fn files(&self) -> BTreeSet<PathBuf> {
        self.textures.values().map(|texture| PathBuf::from(&texture.name)).collect()
    }
}

fn key(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}
