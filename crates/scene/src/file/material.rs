//! `[[material]]`.

use std::path::PathBuf;

use serde::Deserialize;
use toml::Spanned;

use super::{
    Entry,
    value::{TextureEntry, Textured},
};
use crate::material::Distribution;

pub(crate) type MaterialEntry = Entry<MaterialKeys, MaterialKindEntry>;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MaterialKeys {
    /// Name that objects refer to.
    pub name: String,
    /// Model.
    pub r#type: Spanned<String>,
    /// Red, green and blue, 0…1, stand for −1…1 along u, v and the normal.
    pub normal: Option<TextureEntry>,
    /// Stretches highlights of `conductor` and `principled`, 0…1 ([shading](shading.md)). A texture has
    /// another tangent in red and green, and a factor in blue.
    #[serde(default = "default_anisotropy")]
    pub anisotropy: Textured<f32>,
    /// Angle from the tangent, along u, to where they are widest, or to the x axis of a measurement.
    #[serde(default)]
    pub anisotropy_rotate_deg: f32,
    /// Normals of a rough `conductor`, `plastic` or `dielectric`.
    #[serde(default)]
    pub distribution: Distribution,
    /// Share of light that the surface stops, 0…1; the rest goes straight through. Default: 1.
    pub opacity: Option<Textured<f32>>,
    /// Opacity from which the surface is opaque, and below which it is not there. Default: none.
    pub opacity_cutoff: Option<f32>,
    /// Radiance that the front emits.
    pub emission: Option<Textured<[f32; 3]>>,
    /// Emits on both sides.
    #[serde(default)]
    pub emission_two_sided: bool,
    /// Without, the back of the surface is black.
    #[serde(default = "default_two_sided")]
    pub two_sided: bool,
    /// Multiplies colour and opacity by the vertex colours of the mesh.
    #[serde(default)]
    pub vertex_color: bool,
}

fn default_two_sided() -> bool {
    true
}

fn default_anisotropy() -> Textured<f32> {
    Textured::Uniform(0.0)
}

/// Keys of a `[[material]]` that depend on its `type`.
#[derive(Clone, Debug)]
pub(crate) enum MaterialKindEntry {
    Diffuse(DiffuseEntry),
    DiffuseTransmission(DiffuseTransmissionEntry),
    Plastic(PlasticEntry),
    Conductor(ConductorEntry),
    Principled(PrincipledEntry),
    Mirror(MirrorEntry),
    Dielectric(DielectricEntry),
    ThinDielectric(ThinDielectricEntry),
    Measured(MeasuredEntry),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DiffuseEntry {
    /// Albedo, 0…1.
    pub reflectance: Textured<[f32; 3]>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DiffuseTransmissionEntry {
    /// Share that stays on the side from which light comes, 0…1.
    pub reflectance: Textured<[f32; 3]>,
    /// Share that leaves on the other; both together at most 1. A texture is a factor of both.
    pub transmittance: [f32; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlasticEntry {
    /// Albedo of the base, 0…1.
    pub diffuse: Textured<[f32; 3]>,
    /// GGX width α, 0.001…1; this or `roughness`.
    pub alpha: Option<f32>,
    /// √α, one number.
    pub roughness: Option<Textured<f32>>,
    /// Refractive index of the coat, 1.01…4.
    #[serde(default = "default_ior")]
    pub ior: f32,
}

fn default_ior() -> f32 {
    1.5
}

/// Keys of a `conductor` material; `reflectance`, or `eta` and `k`, or all three.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ConductorEntry {
    /// GGX width α, 0.001…1; this or `roughness`.
    pub alpha: Option<f32>,
    /// √α.
    pub roughness: Option<Textured<f32>>,
    /// Reflectance at normal incidence, 0…1 (Schlick); factor of the reflected light beside `eta` and `k`.
    pub reflectance: Option<Textured<[f32; 3]>>,
    /// Real part of the refractive index (exact Fresnel).
    pub eta: Option<[f32; 3]>,
    /// Extinction coefficient (exact Fresnel).
    pub k: Option<[f32; 3]>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PrincipledEntry {
    /// Albedo of the dielectric's base, and reflectance of the metal at normal incidence, 0…1.
    pub base_color: Textured<[f32; 3]>,
    /// Share of metal, 0…1.
    #[serde(default = "default_metallic")]
    pub metallic: Textured<f32>,
    /// √α, 0…1.
    pub roughness: Textured<f32>,
    /// Refractive index of the dielectric, 1…4.
    #[serde(default = "default_ior")]
    pub ior: f32,
    /// Factor of the dielectric's specular reflection, 0…1.
    #[serde(default = "default_specular")]
    pub specular: f32,
    /// Factor of the dielectric's reflectance at normal incidence.
    #[serde(default = "default_factor")]
    pub specular_color: [f32; 3],
    /// Share below a clear coat of refractive index 1.5, 0…1.
    #[serde(default)]
    pub coat_weight: f32,
    /// √α of the coat, 0…1.
    #[serde(default)]
    pub coat_roughness: f32,
    /// Colour of a rim as cloth has it, 0…1; not below a coat.
    #[serde(default)]
    pub sheen_color: [f32; 3],
    /// √α of the sheen, 0…1.
    #[serde(default = "default_sheen_roughness")]
    pub sheen_roughness: f32,
}

fn default_metallic() -> Textured<f32> {
    Textured::Uniform(0.0)
}

fn default_sheen_roughness() -> f32 {
    0.5
}

fn default_specular() -> f32 {
    1.0
}

fn default_factor() -> [f32; 3] {
    [1.0, 1.0, 1.0]
}

fn default_transmittance() -> Textured<[f32; 3]> {
    Textured::Uniform([1.0, 1.0, 1.0])
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MirrorEntry {
    /// Reflectance in all directions, 0…1.
    pub reflectance: Textured<[f32; 3]>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DielectricEntry {
    /// Refractive index of the inside over that of the outside, 0.2…5.
    #[serde(default = "default_ior")]
    pub ior: f32,
    /// GGX width α, 0.001…1, or 0; this or `roughness`. Default: 0.
    pub alpha: Option<f32>,
    /// √α.
    pub roughness: Option<Textured<f32>>,
    /// Factor of the reflected light, 0…1.
    #[serde(default = "default_factor")]
    pub reflectance: [f32; 3],
    /// Factor of the transmitted light, 0…1.
    #[serde(default = "default_transmittance")]
    pub transmittance: Textured<[f32; 3]>,
    /// Absorption coefficient of the inside, per metre, 0…1e6.
    #[serde(default)]
    pub absorption: [f32; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ThinDielectricEntry {
    /// Refractive index, 1…4.
    #[serde(default = "default_ior")]
    pub ior: f32,
    /// GGX width α, 0.001…1, or 0; this or `roughness`. Default: 0.
    pub alpha: Option<f32>,
    /// √α.
    pub roughness: Option<Textured<f32>>,
    /// Factor of the reflected light, 0…1.
    #[serde(default = "default_factor")]
    pub reflectance: [f32; 3],
    /// Factor of the transmitted light, 0…1.
    #[serde(default = "default_transmittance")]
    pub transmittance: Textured<[f32; 3]>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeasuredEntry {
    /// MERL, Cornell or RGL file.
    pub file: PathBuf,
}

impl MaterialEntry {
    pub(crate) fn textures(&self) -> impl Iterator<Item = &TextureEntry> {
        let keys = &self.keys;
        let (color, roughness, metallic) = match &self.kind {
            MaterialKindEntry::Diffuse(entry) => (entry.reflectance.texture(), None, None),
            MaterialKindEntry::DiffuseTransmission(entry) => {
                (entry.reflectance.texture(), None, None)
            }
            MaterialKindEntry::Plastic(entry) => (entry.diffuse.texture(), None, None),
            MaterialKindEntry::Conductor(entry) => (
                entry.reflectance.as_ref().and_then(Textured::texture),
                entry.roughness.as_ref().and_then(Textured::texture),
                None,
            ),
            MaterialKindEntry::Principled(entry) => {
                (entry.base_color.texture(), entry.roughness.texture(), entry.metallic.texture())
            }
            MaterialKindEntry::Mirror(entry) => (entry.reflectance.texture(), None, None),
            MaterialKindEntry::Dielectric(entry) => (entry.transmittance.texture(), None, None),
            MaterialKindEntry::ThinDielectric(entry) => (entry.transmittance.texture(), None, None),
            MaterialKindEntry::Measured(_) => (None, None, None),
        };
        let opacity = keys.opacity.as_ref().and_then(Textured::texture);
        let emission = keys.emission.as_ref().and_then(Textured::texture);
        let (normal, direction) = (keys.normal.as_ref(), keys.anisotropy.texture());
        let all = [color, roughness, metallic, normal, direction, opacity, emission];
        all.into_iter().flatten()
    }
}
