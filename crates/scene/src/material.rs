//! Validated materials of a scene.

use std::{f32::consts::FRAC_PI_2, path::PathBuf, sync::Arc};

use glam::Vec3;
use serde::Deserialize;

use crate::{math::colour::luminance, measured::MeasuredTable, texture::TextureUse};

/// Named surface material.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the scene file.
    pub name: String,
    /// Reflection model.
    pub kind: MaterialKind,
    /// Textures, opacity and emission.
    pub surface: Surface,
}

impl Material {
    /// Largest colour that the image of the surface makes; the renderer cuts colours off at 1.
    pub(crate) fn largest_color(&self) -> f32 {
        let Some(image) = &self.surface.color else { return 0.0 };
        let most = image.largest();
        let mut kind = self.kind.clone();
        kind.colors().iter().map(|own| (**own * most).max_element()).fold(0.0, f32::max)
    }

    /// Makes an opaque, two-sided material without textures or emission.
    pub fn new(name: impl Into<String>, kind: MaterialKind) -> Self {
        Self { name: name.into(), kind, surface: Surface::default() }
    }

    /// Returns the reflection model with its textures replaced by their means: for fits, which have
    /// one set of lobes for a material.
    pub fn mean_kind(&self) -> MaterialKind {
        let mean = |texture: &Option<TextureUse>| {
            texture.as_ref().map_or(Vec3::ONE, |texture| texture.mean().into())
        };
        let color = mean(&self.surface.color);
        let rough = luminance(mean(&self.surface.roughness));
        let metal = luminance(mean(&self.surface.metallic));
        match self.surface.anisotropy.rounded(self.kind.scaled(color, rough, metal)) {
            // Both sides have the one lobe that is to be fitted.
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                MaterialKind::Diffuse { reflectance: (reflectance + transmittance).min(Vec3::ONE) }
            }
            kind => kind,
        }
    }
}

/// Properties of a material beside its reflection model.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Factor of the model's colour: reflectance, base colour or the diffuse part of a plastic.
    pub color: Option<TextureUse>,
    /// True if the vertex colours of the mesh are a factor of colour and opacity too.
    pub vertex_color: bool,
    /// Factor of the roughness √α.
    pub roughness: Option<TextureUse>,
    /// Factor of the metallic share of a principled material.
    pub metallic: Option<TextureUse>,
    /// Stretch of the highlights of a conductor or a principled material.
    pub anisotropy: Anisotropy,
    /// Normals of the microfacets of a conductor, a plastic or a dielectric.
    pub distribution: Distribution,
    /// Normals in the tangent frame, n = 2 · texel − 1, linear.
    pub normal: Option<TextureUse>,
    /// Factor of the tangential components of `normal`.
    pub normal_scale: f32,
    /// Share of light that the surface stops.
    pub opacity: Opacity,
    /// Light that the surface emits.
    pub emission: Option<Emission>,
    /// Group of that light, as [`Lamp::light_group`](crate::Lamp::light_group).
    pub light_group: Option<String>,
    /// False if the back reflects nothing and lets nothing through; that of glass does both.
    pub two_sided: bool,
}

impl Default for Surface {
    fn default() -> Self {
        Self {
            color: None,
            vertex_color: false,
            roughness: None,
            metallic: None,
            anisotropy: Anisotropy::default(),
            distribution: Distribution::Ggx,
            normal: None,
            normal_scale: 1.0,
            opacity: Opacity::default(),
            emission: None,
            light_group: None,
            two_sided: true,
        }
    }
}

impl Surface {
    /// Uses of textures by colour, roughness, metallic share, normals, opacity and emission.
    pub(crate) fn uses(&self) -> [Option<&TextureUse>; 6] {
        let Self { color, roughness, metallic, normal, opacity, emission, .. } = self;
        let emission = emission.as_ref().map_or(&None, |emission| &emission.texture);
        [color, roughness, metallic, normal, &opacity.texture, emission].map(Option::as_ref)
    }

    /// Every use of a texture.
    pub fn textures(&self) -> impl Iterator<Item = &TextureUse> {
        self.uses().into_iter().flatten().chain(&self.anisotropy.direction)
    }

    /// Set of texture coordinates along whose u the tangents lie; none if nothing reads them.
    pub fn tangent_uv_set(&self) -> Option<u32> {
        let Anisotropy { strength, direction, .. } = &self.anisotropy;
        let stretched = (*strength > 0.0).then(|| direction.as_ref().map_or(0, |used| used.uv_set));
        self.normal.as_ref().map(|normal| normal.uv_set).or(stretched)
    }

    /// True if a mesh needs texture coordinates.
    pub(crate) fn reads_uvs(&self) -> bool {
        self.tangent_uv_set().is_some() || self.textures().next().is_some()
    }
}

/// Distribution of the normals of microfacets, of a width α.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// \[Walter et al. 2007\] Eq. 33.
    #[default]
    Ggx,
    /// Eq. 25 there, which has no long tails.
    Beckmann,
}

/// Widths of GGX that differ by direction, as `KHR_materials_anisotropy` has them: the material's is the
/// smaller.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Anisotropy {
    /// Strength s, 0…1: the larger width is α + (1 − α) s².
    pub strength: f32,
    /// Angle from the tangent, toward the bitangent, to where that width lies, radians.
    pub rotation: f32,
    /// Red and green, 0…1, are another tangent, −1…1; blue is a factor of the strength.
    pub direction: Option<TextureUse>,
}

impl Anisotropy {
    /// Larger and smaller width of a material of width `alpha`.
    pub fn widths(&self, alpha: f32) -> [f32; 2] {
        [alpha + (1.0 - alpha) * self.strength * self.strength, alpha]
    }

    /// Mean of both.
    pub fn mean_width(&self, alpha: f32) -> f32 {
        0.5 * self.widths(alpha).iter().sum::<f32>()
    }

    /// Width of a material, and its anisotropy, from the widths along tangent and bitangent.
    pub(crate) fn of_widths([along_u, along_v]: [f32; 2]) -> (f32, Self) {
        let (least, most) = (along_u.min(along_v), along_u.max(along_v));
        let strength = if most > least { ((most - least) / (1.0 - least)).sqrt() } else { 0.0 };
        let rotation = if along_v > along_u { FRAC_PI_2 } else { 0.0 };
        (least, Self { strength, rotation, direction: None })
    }

    /// The material with the mean of its widths for all directions.
    pub(crate) fn rounded(&self, mut kind: MaterialKind) -> MaterialKind {
        match &mut kind {
            _ if self.strength == 0.0 => {}
            MaterialKind::Conductor { alpha, .. } => *alpha = self.mean_width(*alpha),
            MaterialKind::Principled(own) => {
                own.roughness = self.mean_width(own.roughness * own.roughness).sqrt();
            }
            _ => {}
        }
        kind
    }
}

/// Share of light that a surface stops; the rest goes straight through.
#[derive(Clone, Debug, PartialEq)]
pub struct Opacity {
    /// Opacity, 0…1.
    pub factor: f32,
    /// Factor by place.
    pub texture: Option<TextureUse>,
    /// Opacity from which the surface is opaque, and below which it is not there; none blends.
    pub cutoff: Option<f32>,
}

impl Default for Opacity {
    fn default() -> Self {
        Self { factor: 1.0, texture: None, cutoff: None }
    }
}

/// Light that a surface emits, the same in all directions of a side.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Radiance, linear Rec.709.
    pub radiance: Vec3,
    /// Factor by place.
    pub texture: Option<TextureUse>,
    /// True if the back emits too; else only the side from which the triangles are counter-clockwise.
    pub two_sided: bool,
}

/// Fresnel reflectance of a conductor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConductorFresnel {
    /// Schlick's approximation.
    Schlick {
        /// Reflectance at normal incidence.
        reflectance: Vec3,
    },
    /// Exact Fresnel equations.
    Exact {
        /// Factor of the reflected light, 0…1.
        reflectance: Vec3,
        /// Real part of the refractive index per colour channel.
        eta: Vec3,
        /// Extinction coefficient per colour channel.
        k: Vec3,
    },
}

impl ConductorFresnel {
    /// Reflectance at normal incidence.
    pub fn at_normal_incidence(&self) -> Vec3 {
        match *self {
            Self::Schlick { reflectance } => reflectance,
            Self::Exact { reflectance, eta, k } => {
                let (below, above) = (eta - 1.0, eta + 1.0);
                reflectance * (below * below + k * k) / (above * above + k * k)
            }
        }
    }
}

impl MaterialKind {
    /// Makes a clear dielectric.
    pub fn glass(ior: f32, alpha: f32) -> Self {
        let (reflectance, transmittance) = (Vec3::ONE, Vec3::ONE);
        Self::Dielectric { ior, alpha, reflectance, transmittance, absorption: Vec3::ZERO }
    }

    /// Makes a smooth pane of clear surfaces.
    pub fn pane(ior: f32, transmittance: Vec3) -> Self {
        Self::ThinDielectric { ior, alpha: 0.0, reflectance: Vec3::ONE, transmittance }
    }

    /// Name in scene files, number in hashes, and the parameters in groups; the table of a measured one is
    /// not among them.
    pub fn parameters(&self) -> (&'static str, u32, Vec<Vec<f32>>) {
        let colors = |colors: &[&Vec3]| colors.iter().flat_map(|color| color.to_array()).collect();
        match self {
            Self::Diffuse { reflectance } => ("diffuse", 0, vec![colors(&[reflectance])]),
            Self::Plastic { diffuse, alpha, ior } => {
                ("plastic", 1, vec![colors(&[diffuse]), vec![*alpha, *ior]])
            }
            Self::Conductor { alpha, fresnel } => {
                let (number, colors) = match fresnel {
                    ConductorFresnel::Schlick { reflectance } => (2, colors(&[reflectance])),
                    ConductorFresnel::Exact { reflectance: Vec3::ONE, eta, k } => {
                        (3, colors(&[eta, k]))
                    }
                    ConductorFresnel::Exact { reflectance, eta, k } => {
                        (3, colors(&[eta, k, reflectance]))
                    }
                };
                ("conductor", number, vec![vec![*alpha], colors])
            }
            Self::Measured { .. } => ("measured", 4, Vec::new()),
            Self::Principled(own) => {
                let numbers = vec![own.metallic, own.roughness, own.ior, own.specular];
                let coat = vec![own.coat_weight, own.coat_roughness];
                let mut groups = vec![colors(&[&own.base_color, &own.specular_color]), numbers];
                groups.extend((own.coat_weight > 0.0).then_some(coat));
                let sheen = [&own.sheen_color.to_array()[..], &[own.sheen_roughness]].concat();
                groups.extend((own.sheen_color != Vec3::ZERO).then_some(sheen));
                ("principled", 5, groups)
            }
            Self::Mirror { reflectance } => ("mirror", 6, vec![colors(&[reflectance])]),
            Self::Dielectric { ior, alpha, reflectance, transmittance, absorption } => {
                let factors = colors(&[reflectance, transmittance, absorption]);
                ("dielectric", 7, vec![vec![*ior, *alpha], factors])
            }
            Self::ThinDielectric { ior, alpha, reflectance, transmittance } => {
                let mut groups = vec![vec![*ior], colors(&[reflectance, transmittance])];
                groups.extend((*alpha > 0.0).then(|| vec![*alpha]));
                ("thin_dielectric", 8, groups)
            }
            Self::DiffuseTransmission { reflectance, transmittance } => {
                ("diffuse_transmission", 9, vec![colors(&[reflectance, transmittance])])
            }
        }
    }

    /// The same with factors of its colour, its roughness and its share of metal.
    pub(crate) fn scaled(&self, color: Vec3, rough: f32, metal: f32) -> Self {
        let mut kind = self.clone();
        for own in kind.colors() {
            *own = (*own * color).clamp(Vec3::ZERO, Vec3::ONE);
        }
        match &mut kind {
            Self::Conductor { alpha, .. } => *alpha = (*alpha * rough * rough).clamp(0.0, 1.0),
            Self::Principled(own) => {
                own.metallic = (own.metallic * metal).clamp(0.0, 1.0);
                own.roughness = (own.roughness * rough).clamp(0.0, 1.0);
            }
            _ => {}
        }
        kind
    }

    /// Colours that [`Surface::color`] is a factor of.
    pub(crate) fn colors(&mut self) -> Vec<&mut Vec3> {
        match self {
            Self::Diffuse { reflectance: own }
            | Self::Mirror { reflectance: own }
            | Self::Plastic { diffuse: own, .. }
            | Self::Conductor {
                fresnel:
                    ConductorFresnel::Schlick { reflectance: own }
                    | ConductorFresnel::Exact { reflectance: own, .. },
                ..
            }
            | Self::Principled(Principled { base_color: own, .. })
            | Self::Dielectric { transmittance: own, .. }
            | Self::ThinDielectric { transmittance: own, .. } => vec![own],
            Self::DiffuseTransmission { reflectance, transmittance } => {
                vec![reflectance, transmittance]
            }
            Self::Measured { .. } => Vec::new(),
        }
    }

    /// Absorption coefficient of the inside, per metre, of a dielectric that absorbs.
    pub fn absorption(&self) -> Option<Vec3> {
        match *self {
            Self::Dielectric { absorption, .. } if absorption != Vec3::ZERO => Some(absorption),
            _ => None,
        }
    }

    /// True for dielectrics and thin panes, which let light through.
    pub fn is_glass(&self) -> bool {
        matches!(self, Self::Dielectric { .. } | Self::ThinDielectric { .. })
    }

    /// True if no sampler draws light at the material, since what it sends on comes from one direction or
    /// from behind: paths follow it.
    pub fn is_specular(&self) -> bool {
        self.is_glass() || matches!(self, Self::Mirror { .. })
    }
}

/// Metallic-roughness material of glTF 2.0, appendix B, with `KHR_materials_ior`,
/// `KHR_materials_specular`, `KHR_materials_clearcoat` and `KHR_materials_sheen`; by default the white metal
/// that glTF takes where a file states nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Principled {
    /// Albedo of the dielectric's base, and reflectance of the metal at normal incidence, 0…1.
    pub base_color: Vec3,
    /// Share of metal, 0…1.
    pub metallic: f32,
    /// Roughness √α, 0…1.
    pub roughness: f32,
    /// Refractive index of the dielectric.
    pub ior: f32,
    /// Factor of the dielectric's specular reflection, 0…1.
    pub specular: f32,
    /// Factor of the dielectric's reflectance at normal incidence.
    pub specular_color: Vec3,
    /// Share of the surface below a clear coat of refractive index 1.5, 0…1.
    ///
    /// Deviation: the coat dims what it covers for light that enters as for light that leaves, so that the
    /// material is reciprocal; glTF dims by the direction of the viewer alone.
    pub coat_weight: f32,
    /// Roughness √α of the coat, 0…1.
    pub coat_roughness: f32,
    /// Colour of a rim as cloth has it, by `KHR_materials_sheen`, 0…1; not below a coat.
    ///
    /// Deviation: what it covers is dimmed as below a coat.
    pub sheen_color: Vec3,
    /// Roughness √α of the sheen, 0…1; at least 0.1 is rendered.
    pub sheen_roughness: f32,
}

impl Principled {
    /// Metal below a whole coat; `reflectance` is that of the metal, seen from the coat, at normal incidence.
    pub(crate) fn coated_metal(reflectance: Vec3, alpha: f32, coat_roughness: f32) -> Self {
        let (coat_weight, roughness) = (1.0, alpha.sqrt());
        let base_color = reflectance.clamp(Vec3::ZERO, Vec3::ONE);
        Self { base_color, roughness, coat_weight, coat_roughness, ..Self::default() }
    }
}

impl Default for Principled {
    fn default() -> Self {
        let (base_color, specular_color) = (Vec3::ONE, Vec3::ONE);
        Self {
            base_color,
            metallic: 1.0,
            roughness: 1.0,
            ior: 1.5,
            specular: 1.0,
            specular_color,
            coat_weight: 0.0,
            coat_roughness: 0.0,
            sheen_color: Vec3::ZERO,
            sheen_roughness: 0.5,
        }
    }
}

/// Reflection model with its parameters.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// Lambertian: reflectance / π.
    Diffuse {
        /// Albedo, 0…1.
        reflectance: Vec3,
    },
    /// Thin sheet that scatters light to both of its sides, as leaves, curtains and lampshades do:
    /// share / π on each, the same from either.
    DiffuseTransmission {
        /// Share that stays on the side from which light comes, 0…1.
        reflectance: Vec3,
        /// Share that leaves on the other side; with `reflectance` at most 1, or a factor of a texture.
        transmittance: Vec3,
    },
    /// GGX dielectric coat over a diffuse base.
    Plastic {
        /// Albedo of the base, 0…1.
        diffuse: Vec3,
        /// GGX width α.
        alpha: f32,
        /// Refractive index of the coat.
        ior: f32,
    },
    /// GGX microfacet conductor.
    Conductor {
        /// GGX width α.
        alpha: f32,
        /// Fresnel term.
        fresnel: ConductorFresnel,
    },
    /// Metallic-roughness material.
    Principled(Principled),
    /// Perfect mirror.
    Mirror {
        /// Reflectance in all directions, 0…1.
        reflectance: Vec3,
    },
    /// Interface to a solid dielectric, which lies behind the side from which the triangles are
    /// counter-clockwise.
    Dielectric {
        /// Refractive index of the inside over that of the outside.
        ior: f32,
        /// GGX width α; 0 is smooth.
        alpha: f32,
        /// Factor of the reflected light, 0…1.
        reflectance: Vec3,
        /// Factor of the transmitted light, 0…1.
        transmittance: Vec3,
        /// Absorption coefficient of the inside, per metre.
        absorption: Vec3,
    },
    /// Thin pane of a dielectric: reflects as a mirror or lets light straight through, with all
    /// reflections between its two sides; a rough one scatters what it lets through as what it reflects.
    ThinDielectric {
        /// Refractive index.
        ior: f32,
        /// GGX width α; 0 is smooth.
        alpha: f32,
        /// Factor of the reflected light, 0…1.
        reflectance: Vec3,
        /// Factor of the transmitted light, 0…1.
        transmittance: Vec3,
    },
    /// Tabulated measurement (MERL or Cornell file).
    Measured {
        /// The file.
        path: PathBuf,
        /// Its table on the half/difference grid, shared by materials that name the same file.
        table: Arc<MeasuredTable>,
    },
}
