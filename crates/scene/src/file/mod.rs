//! Scene text → entries: the TOML of a scene file with its defaults, before its values are checked.
//!
//! Every table rejects unknown keys; errors carry the line and column of the key or value.

mod lamp;
mod material;
mod portal;
mod read;
mod value;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::Deserialize;

pub(crate) use lamp::{LampEntry, LampKindEntry};
pub(crate) use material::{ConductorEntry, MaterialEntry, MaterialKeys, MaterialKindEntry};
pub(crate) use portal::PortalEntry;
pub(crate) use value::{ChannelEntry, NumberOrVector, TextureEntry, Textured};

use super::{
    FilmSettings,
    environment::{CourtParameters, DaylightParameters, SkyParameters},
    shapes::Shape,
};
use crate::error::Result;

/// Scene file as written.
#[derive(Debug)]
pub(crate) struct SceneFile {
    /// `[camera]`.
    pub camera: CameraEntry,
    /// Every `[[camera.keyframe]]`, in file order.
    pub keyframes: Vec<KeyframeEntry>,
    /// `[film]`.
    pub film: FilmSettings,
    /// `[environment]`; black without.
    pub environment: Option<EnvironmentEntry>,
    /// Every `[[lamp]]`, in file order.
    pub lamps: Vec<LampEntry>,
    /// Every `[[portal]]`, in file order.
    pub portals: Vec<PortalEntry>,
    /// Every `[[material]]`, in file order.
    pub materials: Vec<MaterialEntry>,
    /// Every `[[object]]`, in file order.
    pub objects: Vec<ObjectEntry>,
    /// Every `[[include]]`, in file order.
    pub includes: Vec<IncludeEntry>,
}

/// `[camera]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CameraEntry {
    /// Centre of projection, metres.
    pub position: [f32; 3],
    /// Point at the centre of the image, metres.
    pub look_at: [f32; 3],
    /// Direction that points up in the image.
    #[serde(default = "default_up")]
    pub up: [f32; 3],
    /// Angle between the bottom and top edges of the image, degrees.
    pub vertical_fov_deg: f32,
    /// Radius of the thin lens, metres; 0 for a pinhole.
    #[serde(default)]
    pub aperture_radius: f32,
    /// Distance to the plane of focus, metres; required with an aperture.
    pub focus_distance: Option<f32>,
}

/// One `[[camera.keyframe]]`; what it leaves out is that of `[camera]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct KeyframeEntry {
    /// Time at which the camera is here, seconds.
    pub time: f32,
    /// Centre of projection, metres.
    pub position: Option<[f32; 3]>,
    /// Point at the centre of the image, metres.
    pub look_at: Option<[f32; 3]>,
    /// Direction that points up in the image.
    pub up: Option<[f32; 3]>,
    /// Angle between the bottom and top edges of the image, degrees.
    pub vertical_fov_deg: Option<f32>,
    /// Radius of the thin lens, metres.
    pub aperture_radius: Option<f32>,
    /// Distance to the plane of focus, metres.
    pub focus_distance: Option<f32>,
}

fn default_up() -> [f32; 3] {
    [0.0, 1.0, 0.0]
}

/// `[environment]`; exactly one of `map`, `constant`, `court`, `sky` and `daylight`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct EnvironmentEntry {
    /// Lat-long image file.
    pub map: Option<PathBuf>,
    /// Radiance that is the same in every direction.
    pub constant: Option<[f32; 3]>,
    /// Procedural courtyard.
    pub court: Option<CourtParameters>,
    /// Procedural sky.
    pub sky: Option<SkyParameters>,
    /// Measured sky and sun.
    pub daylight: Option<DaylightParameters>,
    /// Factor applied to every radiance.
    #[serde(default = "default_environment_scale")]
    pub scale: f32,
    /// Rotation about +Y, degrees, counter-clockwise seen from above.
    #[serde(default)]
    pub rotation_deg: f32,
}

fn default_environment_scale() -> f32 {
    1.0
}

/// One `[[object]]`.
#[derive(Debug)]
pub(crate) struct ObjectEntry {
    /// Line of the entry, from 1.
    pub line: usize,
    /// Name, for messages.
    pub name: Option<String>,
    /// Material; optional where the mesh file brings its own colours.
    pub material: Option<String>,
    /// Factor along each axis, applied first.
    pub scale: [f32; 3],
    /// Rotations about X, then Y, then Z, degrees.
    pub rotate_deg: [f32; 3],
    /// Translation, metres, applied last.
    pub translate: [f32; 3],
    /// Group of the light that it emits.
    pub light_group: Option<String>,
    /// Source of its triangles.
    pub source: ObjectSource,
}

/// Source of an object's triangles.
#[derive(Debug)]
pub(crate) enum ObjectSource {
    /// A mesh file.
    Mesh(PathBuf),
    /// A procedural shape.
    Shape {
        /// Name in the file.
        name: String,
        /// Its parameters.
        shape: Box<dyn Shape>,
    },
}

/// One `[[include]]`.
#[derive(Debug)]
pub(crate) struct IncludeEntry {
    /// Line of the entry, from 1.
    pub line: usize,
    /// Its keys.
    pub keys: IncludeKeys,
}

/// Keys of `[[include]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct IncludeKeys {
    /// glTF or OBJ file with everything in it but its cameras.
    pub file: PathBuf,
    /// Factor along each axis, or one for all; applied first. Intensities of lamps grow with its
    /// square.
    #[serde(default)]
    pub scale: NumberOrVector,
    /// Rotations about X, then Y, then Z, degrees.
    #[serde(default)]
    pub rotate_deg: [f32; 3],
    /// Translation, metres, applied last.
    #[serde(default)]
    pub translate: [f32; 3],
    /// Materials of the scene in place of materials of the file: `{ glass = "pane" }`.
    #[serde(default)]
    pub materials: BTreeMap<String, String>,
}

impl SceneFile {
    /// Parses the text of a scene file; `path` is for messages only.
    ///
    /// # Errors
    /// [`crate::Error::Parse`] with line and column.
    pub(crate) fn parse(path: &Path, text: &str) -> Result<Self> {
        read::read_root(text).map_err(|failure| failure.locate(path, text))
    }
}
