//! Image files by path, each decoded once.

use std::{
    collections::{BTreeMap, BTreeSet, HashSet},
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
    unreadable: HashSet<PathBuf>,
}

type Decoded = (Arc<Texture>, Vec<String>);

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
        for (key, decoded) in self.decode(paths) {
            let (texture, own) = decoded?;
            self.textures.insert(key, texture);
            warnings.extend(own);
        }
        Ok(())
    }

    /// As [`TextureCache::load_all`], for files that may be asked for. Leaves those that fail and those with
    /// warnings to [`TextureCache::load`].
    pub fn load_early(&mut self, paths: impl IntoIterator<Item = PathBuf>) {
        for (key, decoded) in self.decode(paths) {
            if let Ok((texture, own)) = decoded
                && own.is_empty()
            {
                self.textures.insert(key, texture);
            }
        }
    }

    /// Decodes the files that are not there yet, each with its warnings.
    fn decode(&self, paths: impl IntoIterator<Item = PathBuf>) -> Vec<(PathBuf, Result<Decoded>)> {
        // A file that is named in two ways is one texture.
        let mut missing = BTreeMap::new();
        for path in paths {
            let key = key(&path);
            if !self.textures.contains_key(&key) {
                missing.entry(key).or_insert(path);
            }
        }
        let decode = |path: PathBuf| {
            let mut own = Vec::new();
            Texture::load(&path, &mut own).map(|texture| (Arc::new(texture), own))
        };
        missing.into_par_iter().map(|(key, path)| (key, decode(path))).collect()
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

    /// As [`TextureCache::load`]; a file that is missing or no image is one warning and no texture. `place`
    /// says who names it.
    pub(crate) fn load_readable(
        &mut self,
        path: &Path,
        place: &str,
        warnings: &mut Vec<String>,
    ) -> Option<Arc<Texture>> {
        if self.unreadable.contains(path) {
            return None;
        }
        self.load(path, warnings)
            .inspect_err(|error| {
                warnings.push(format!("{error}; rendered without this texture ({place})"));
                self.unreadable.insert(path.to_owned());
            })
            .ok()
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
