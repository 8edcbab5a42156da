//! Scene text → entries: the TOML of a scene file with its defaults, before its values are checked.
//!
//! Every table rejects unknown keys; errors carry the line and column of the key or value.

mod read;

use std::path::{Path, PathBuf};

use serde::{
    Deserialize, Deserializer,
    de::{Visitor, value},
};

use super::{
    FilmSettings,
    environment::{CourtParameters, SkyParameters},
    shapes::Shape,
};
use crate::error::Result;

/// Scene file as written.
#[derive(Debug)]
pub struct SceneFile {
    /// `[camera]`.
    pub camera: CameraEntry,
    /// `[film]`.
    pub film: FilmSettings,
    /// `[environment]`.
    pub environment: EnvironmentEntry,
    /// Every `[[material]]`, in file order.
    pub materials: Vec<MaterialEntry>,
    /// Every `[[object]]`, in file order.
    pub objects: Vec<ObjectEntry>,
}

/// `[camera]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraEntry {
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

fn default_up() -> [f32; 3] {
    [0.0, 1.0, 0.0]
}

/// `[environment]`; exactly one of `map`, `constant`, `court` and `sky`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentEntry {
    /// Lat-long image file, relative to the scene file.
    pub map: Option<PathBuf>,
    /// Radiance that is the same in every direction.
    pub constant: Option<[f32; 3]>,
    /// Procedural courtyard.
    pub court: Option<CourtParameters>,
    /// Procedural sky.
    pub sky: Option<SkyParameters>,
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

/// One `[[material]]`.
#[derive(Clone, Debug)]
pub struct MaterialEntry {
    /// Line of the entry, from 1.
    pub line: usize,
    /// Name that objects refer to.
    pub name: String,
    /// Model and its parameters.
    pub kind: MaterialKindEntry,
}

/// Keys of a `[[material]]` that depend on its `type`.
#[derive(Clone, Debug)]
pub enum MaterialKindEntry {
    /// `diffuse`.
    Diffuse(DiffuseEntry),
    /// `plastic`.
    Plastic(PlasticEntry),
    /// `conductor`.
    Conductor(ConductorEntry),
    /// `measured`.
    Measured(MeasuredEntry),
}

/// Keys of a `diffuse` material.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiffuseEntry {
    /// Albedo, 0…1.
    pub reflectance: [f32; 3],
}

/// Keys of a `plastic` material.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlasticEntry {
    /// Albedo of the base, 0…1.
    pub diffuse: [f32; 3],
    /// GGX width.
    pub alpha: Option<f32>,
    /// √α, an alternative to `alpha`.
    pub roughness: Option<f32>,
    /// Refractive index of the coat.
    #[serde(default = "default_ior")]
    pub ior: f32,
}

fn default_ior() -> f32 {
    1.5
}

/// Keys of a `conductor` material; either `reflectance` or `eta` and `k`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConductorEntry {
    /// GGX width.
    pub alpha: Option<f32>,
    /// √α, an alternative to `alpha`.
    pub roughness: Option<f32>,
    /// Reflectance at normal incidence, 0…1 (Schlick).
    pub reflectance: Option<[f32; 3]>,
    /// Real part of the refractive index (exact Fresnel).
    pub eta: Option<[f32; 3]>,
    /// Extinction coefficient (exact Fresnel).
    pub k: Option<[f32; 3]>,
}

/// Keys of a `measured` material.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredEntry {
    /// MERL or Cornell file, relative to the scene file.
    pub file: PathBuf,
}

/// One `[[object]]`.
#[derive(Debug)]
pub struct ObjectEntry {
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
    /// Source of its triangles.
    pub source: ObjectSource,
}

/// Source of an object's triangles.
#[derive(Debug)]
pub enum ObjectSource {
    /// A mesh file, relative to the scene file.
    Mesh(PathBuf),
    /// A procedural shape.
    Shape {
        /// Name in the file.
        name: String,
        /// Its parameters.
        shape: Box<dyn Shape>,
    },
}

/// One number for all axes, or one per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NumberOrVector(pub [f32; 3]);

impl Default for NumberOrVector {
    fn default() -> Self {
        Self([1.0; 3])
    }
}

impl<'de> Deserialize<'de> for NumberOrVector {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrVectorVisitor;

        impl<'de> Visitor<'de> for NumberOrVectorVisitor {
            type Value = NumberOrVector;

            fn expecting(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
                formatter.write_str("a number or an array of three numbers")
            }

            fn visit_f64<E>(self, number: f64) -> Result<Self::Value, E> {
                Ok(NumberOrVector([number as f32; 3]))
            }

            fn visit_i64<E>(self, number: i64) -> Result<Self::Value, E> {
                Ok(NumberOrVector([number as f32; 3]))
            }

            fn visit_seq<A: serde::de::SeqAccess<'de>>(
                self,
                sequence: A,
            ) -> Result<Self::Value, A::Error> {
                <[f32; 3]>::deserialize(value::SeqAccessDeserializer::new(sequence))
                    .map(NumberOrVector)
            }
        }

        deserializer.deserialize_any(NumberOrVectorVisitor)
    }
}

impl SceneFile {
    /// Parses the text of a scene file; `path` is for messages only.
    ///
    /// # Errors
    /// [`crate::Error::Parse`] with line and column.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        read::read_root(text).map_err(|failure| failure.locate(path, text))
    }
}
