#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![warn(clippy::print_stderr, clippy::print_stdout)]

mod beside;
pub mod coat;
pub mod environment;
pub mod error;
pub mod export;
pub mod features;
mod file;
pub mod files;
pub mod geometry;
mod hash;
mod import;
pub mod instance;
mod instances;
pub mod lamp;
pub mod light_group;
pub mod load;
pub mod material;
pub mod math;
pub mod measured;
pub mod memory;
pub mod mesh;
mod mitsuba;
mod pbrt;
pub mod picture;
mod quadrics;
mod shapes;
mod spectrum;
pub mod stage;
mod strands;
pub mod texture;
pub mod transform;
mod triangulate;

use std::path::PathBuf;

use glam::Vec3;
use serde::Deserialize;

pub use environment::EnvironmentMap;
pub use error::{Error, Result};
pub use geometry::Geometry;
pub use hash::{environment_hash, geometry_hash, still_hash};
pub use instance::Instance;
pub use lamp::Lamp;
pub use material::Material;

/// Largest width and height of the film, pixels.
pub const MAX_FILM_SIDE: u32 = 16_384;

/// Smallest GGX width; single precision cannot sample the near-mirror highlight of a smaller one.
pub const MIN_ALPHA: f32 = 1e-3;

/// Reconstruction filter, importance-sampled so that every sample belongs to one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// Box one pixel wide.
    Box,
    /// Gaussian with a standard deviation of ½ pixel, cut off at 1.5 pixels.
    Gaussian,
}

/// Image plane: `[film]` of a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FilmSettings {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Reconstruction filter.
    pub filter: Filter,
}

impl Default for FilmSettings {
    fn default() -> Self {
        Self { width: 640, height: 480, filter: Filter::Gaussian }
    }
}

/// Settings of a render that a file asks for, beside its film.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// Samples per pixel.
    pub samples: Option<u32>,
    /// Vertices of a path that are lit, at most [`Asked::MAX_DEPTH`].
    pub depth: Option<u32>,
    /// First vertex, from 0 on, at which Russian roulette may end a path.
    pub roulette_depth: Option<u32>,
}

impl Asked {
    /// Most vertices that are asked for; paths that may go on for ever have so many.
    pub const MAX_DEPTH: u32 = 64;
}

/// Validated scene in world space.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Stem of the file, or the name of its folder if the stem is `scene`.
    pub name: String,
    /// Path of the scene file.
    pub path: PathBuf,
    /// Viewer.
    pub camera: Camera,
    /// Image plane.
    pub film: FilmSettings,
    /// Light.
    pub environment: EnvironmentMap,
    /// Lights without a surface.
    pub lamps: Vec<Lamp>,
    /// Openings that the sampler `portal` knows.
    pub portals: Vec<Portal>,
    /// Materials; [`Geometry::materials`] indexes them. Never empty.
    pub materials: Vec<Material>,
    /// All triangles, in world space.
    pub geometry: Geometry,
    /// Files that the scene was read from; empty for a scene made in memory.
    pub inputs: Vec<PathBuf>,
    /// Variants of the materials by name; [`variant`](load::LoadOptions::variant) may choose one of them.
    pub variants: Vec<String>,
    /// Settings of the render that the file asks for.
    pub asked: Asked,
    /// Warnings from loading, repairs among them, for the log.
    pub warnings: Vec<String>,
    /// SHA-256 of everything that changes the picture: camera, film, environment texels, materials
    /// with their tables, geometry. Lower-case hexadecimal.
    pub hash: String,
}

/// Right-handed perspective camera that looks from `position` to `look_at`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Centre of projection, metres.
    pub position: Vec3,
    /// Point at the centre of the image, metres.
    pub look_at: Vec3,
    /// Direction that points up in the image; need not be orthogonal to the view.
    pub up: Vec3,
    /// Angle between the bottom and top edges of the image, degrees.
    pub vertical_fov_deg: f32,
    /// Radius of the thin lens, metres; 0 for a pinhole.
    pub aperture_radius: f32,
    /// Distance along the view axis from the lens to the plane of focus, metres.
    pub focus_distance: f32,
    /// Place of the image's centre right of and above `look_at`, in heights of the image: a shifted lens,
    /// which keeps lines parallel that run along the film.
    pub shift: [f32; 2],
    /// True if the picture is the mirror image of what the camera sees, left for right.
    pub mirrored: bool,
}

impl Camera {
    /// Unit vectors to the right of the image, up in it and along the view.
    pub fn axes(&self) -> [Vec3; 3] {
        let forward = (self.look_at - self.position).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(self.up).normalize_or(Vec3::X);
        [if self.mirrored { -right } else { right }, right.cross(forward), forward]
    }
}

/// Most portals of a scene: every shadow ray goes through all of them.
pub(crate) const MAX_PORTALS: usize = 256;

/// Rectangle that light of the environment comes through. It serves sampling alone: neither the picture
/// nor what rays meet depends on it. Both sides count.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// Name in the file; may be empty.
    pub name: String,
    /// One corner, metres.
    pub corner: Vec3,
    /// Unit vectors along the edges from there, perpendicular to each other.
    pub axes: [Vec3; 2],
    /// Lengths of these edges, metres.
    pub size: [f32; 2],
}
