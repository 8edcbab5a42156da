//! What the user wrote, turned into a validated [`Scene`]. No GPU types.

pub mod camera;
pub mod environment;
pub mod file;
pub mod geometry;
mod hash;
pub mod load;
pub mod mesh;
pub mod shapes;
pub mod transform;
pub mod triangulate;

use std::path::PathBuf;

use crate::brdf::Material;
pub use camera::Camera;
pub use environment::EnvironmentMap;
pub use geometry::Geometry;
pub use hash::{environment_hash, geometry_hash};

/// Reconstruction filter of the film, importance sampled so that every sample belongs to one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// One pixel wide box.
    Box,
    /// Gaussian of standard deviation ½ pixel, cut off at 1.5 pixels.
    Gaussian,
}

/// Image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmSettings {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Reconstruction filter.
    pub filter: Filter,
}

/// A validated scene in world space.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name: the file's stem, or its folder's name where the file is called `scene`.
    pub name: String,
    /// The scene file.
    pub path: PathBuf,
    /// Viewer.
    pub camera: Camera,
    /// Image plane.
    pub film: FilmSettings,
    /// Light.
    pub environment: EnvironmentMap,
    /// Materials; [`Geometry::materials`] indexes them. Never empty.
    pub materials: Vec<Material>,
    /// Every triangle, in world space.
    pub geometry: Geometry,
    /// What was repaired on the way, for the log.
    pub warnings: Vec<String>,
    /// SHA-256 of everything that changes the picture: camera, film, environment texels, materials
    /// with their tables, geometry. Lower-case hexadecimal.
    pub hash: String,
}
