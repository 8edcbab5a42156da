//! Parts of a scene in memory, by the names that its text gives in place of files.

use std::{collections::BTreeMap, path::PathBuf};

use crate::{mesh::Mesh, picture::RgbImage};

/// Meshes and images for [`Scene::parse_with`](crate::Scene::parse_with).
#[derive(Clone, Debug, Default)]
pub struct Arrays {
    /// Meshes of objects. They bring no materials.
    pub meshes: BTreeMap<PathBuf, Mesh>,
    /// Linear Rec.709 images, for `environment.map` and for textures.
    pub images: BTreeMap<PathBuf, RgbImage>,
}

/// Arrays of a scene that is in files alone.
pub(super) static NONE: Arrays = Arrays { meshes: BTreeMap::new(), images: BTreeMap::new() };
