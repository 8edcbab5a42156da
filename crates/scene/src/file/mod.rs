//! Scene text → entries: the TOML of a scene file with its defaults, before its values are checked.
//!
//! Every table rejects unknown keys; errors carry the line and column of the key or value.

mod material;
mod read;
mod value;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::Deserialize;
use toml::Spanned;

pub(crate) use material::{MaterialEntry, MaterialKeys, MaterialKindEntry};
pub(crate) use value::{NumberOrVector, TextureEntry, Textured};

use super::{
    FilmSettings,
    environment::{CourtParameters, DaylightParameters, SkyParameters},
    shapes::Shape,
};
use crate::{error::Result, lamp::SpotFalloff};

/// The tables that have no kinds, and entries of arrays of tables, which are read one by one.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneFile {
    pub camera: CameraEntry,
    #[serde(default)]
    pub film: FilmSettings,
    /// `[environment]`; black without.
    pub environment: Option<EnvironmentEntry>,
    #[serde(skip)]
    pub keyframes: Vec<Entry<KeyframeEntry>>,
    #[serde(skip)]
    pub lamps: Vec<LampEntry>,
    #[serde(skip)]
    pub portals: Vec<Entry<PortalKeys>>,
    #[serde(skip)]
    pub materials: Vec<MaterialEntry>,
    #[serde(skip)]
    pub objects: Vec<ObjectEntry>,
    #[serde(skip)]
    pub includes: Vec<Entry<IncludeKeys>>,
}

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
    /// Place of the image's centre right of and above `look_at`, in heights of the image.
    #[serde(default)]
    pub shift: [f32; 2],
    /// Shows the mirror image, left for right.
    #[serde(default)]
    pub mirrored: bool,
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

/// Entry of an array of tables.
#[derive(Clone, Debug)]
pub(crate) struct Entry<K, V = ()> {
    /// Line of the entry, from 1.
    pub line: usize,
    /// Keys of all kinds.
    pub keys: K,
    /// Kind with its own keys.
    pub kind: V,
}

pub(crate) type ObjectEntry = Entry<ObjectKeys, ObjectSource>;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ObjectKeys {
    /// Name, for messages.
    pub name: Option<String>,
    /// PLY, OBJ, glTF or GLB file; this or `shape`.
    pub mesh: Option<PathBuf>,
    /// Procedural shape.
    pub shape: Option<Spanned<String>>,
    /// Name of a material; may be absent where the mesh file brings its own.
    pub material: Option<String>,
    /// Factor along each axis, or one for all; applied first.
    #[serde(default)]
    pub scale: NumberOrVector,
    /// Rotations about X, then Y, then Z, degrees.
    #[serde(default)]
    pub rotate_deg: [f32; 3],
    /// Translation, metres, applied last.
    #[serde(default)]
    pub translate: [f32; 3],
    /// Group of the light that it emits. Default: lamps.
    pub light_group: Option<String>,
}

#[derive(Debug)]
pub(crate) enum ObjectSource {
    Mesh(PathBuf),
    Shape { name: String, shape: Box<dyn Shape> },
}

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
    /// Group of all its light. Default: lamps.
    pub light_group: Option<String>,
}

pub(crate) type LampEntry = Entry<LampKeys, LampKindEntry>;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LampKeys {
    /// Name, for messages.
    pub name: Option<String>,
    /// Kind.
    pub r#type: Spanned<String>,
    /// Group of its light, for `--aov LightGroups`. Default: lamps.
    pub light_group: Option<String>,
}

/// Keys of a `[[lamp]]` that depend on its `type`.
#[derive(Clone, Debug)]
pub(crate) enum LampKindEntry {
    Point(PointEntry),
    Spot(SpotEntry),
    /// `directional`.
    Directional(DirectionalEntry),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PointEntry {
    /// Place, metres.
    pub position: [f32; 3],
    /// Radiant intensity per steradian.
    pub intensity: [f32; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SpotEntry {
    /// Place, metres.
    pub position: [f32; 3],
    /// Axis of the cone, away from the lamp, of any length.
    pub direction: [f32; 3],
    /// Radiant intensity along the axis, per steradian.
    pub intensity: [f32; 3],
    /// Angle to the axis where the light begins to fall off, degrees.
    #[serde(default)]
    pub inner_angle_deg: f32,
    /// Angle to the axis from which there is no light, degrees, above the inner one, at most 180.
    #[serde(default = "default_outer_angle_deg")]
    pub outer_angle_deg: f32,
    /// Course of the light between these angles.
    #[serde(default)]
    pub falloff: SpotFalloff,
}

fn default_outer_angle_deg() -> f32 {
    45.0
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DirectionalEntry {
    /// Direction in which the light travels, of any length.
    pub direction: [f32; 3],
    /// Irradiance on a surface that faces the light.
    pub irradiance: [f32; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PortalKeys {
    /// Name, for messages.
    pub name: Option<String>,
    /// One corner of the rectangle, metres.
    pub corner: [f32; 3],
    /// Edge from that corner, metres.
    pub first_edge: [f32; 3],
    /// Other edge from that corner, metres, perpendicular to the first.
    pub second_edge: [f32; 3],
}

impl SceneFile {
    /// Parses the text of a scene file; `path` is for messages only. Fails with [`crate::Error::Parse`] with
    /// line and column.
    pub(crate) fn parse(path: &Path, text: &str) -> Result<Self> {
        read::read_root(text).map_err(|failure| failure.locate(path, text))
    }
}
