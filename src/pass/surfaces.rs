//! Specialization of passes by what the surfaces of a scene need.

use super::texture_buffers::TextureAccess;
use crate::{
    scene::material::{Distribution, Material, MaterialKind},
    shader::constants::{
        CONSTANT_MATERIAL_KINDS, CONSTANT_SURFACES, SPECULAR_KINDS, SURFACES_ANISOTROPIC,
        SURFACES_BECKMANN, SURFACES_EMITTING, SURFACES_ONE_SIDED, SURFACES_PASSING,
        SURFACES_ROUGH_GLASS, SURFACES_SPECULAR, SURFACES_TEXTURED, SURFACES_TINTED_PANES,
    },
};

/// Kinds and properties that occur in a scene. Passes leave out the code of all others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Surfaces {
    /// Bit `1 << kind` for every kind of material.
    pub material_kinds: u32,
    /// Bits `SURFACES_…`.
    pub features: u32,
    /// Number of lamps and emitting triangles.
    pub lamp_count: u32,
    /// True if they are all the light there is.
    pub has_black_environment: bool,
    /// Access to textures and to attributes of triangles.
    pub access: TextureAccess,
}

impl Surfaces {
    /// Specialization constants of a pass over surfaces.
    pub(crate) fn constants(&self) -> Vec<(u32, u32)> {
        let own =
            [(CONSTANT_MATERIAL_KINDS, self.material_kinds), (CONSTANT_SURFACES, self.features)];
        [&own[..], &self.access.constants()].concat()
    }

    /// True if the scene needs what a bit `SURFACES_…` stands for.
    pub(crate) fn has(&self, feature: u32) -> bool {
        self.features & feature != 0
    }

    /// True if some material is not specular, so that the pixels of a cohort can share its light.
    pub(crate) fn can_share(&self) -> bool {
        self.material_kinds & !SPECULAR_KINDS != 0
    }
}

/// Bits `SURFACES_…` of what `materials` need.
pub fn features(materials: &[Material]) -> u32 {
    materials.iter().fold(0, |bits, material| bits | features_of(material))
}

/// Tests whether light may pass the surfaces of a material.
pub(crate) fn passes(material: &Material) -> bool {
    features_of(material) & SURFACES_PASSING != 0
}

fn features_of(material: &Material) -> u32 {
    let surface = &material.surface;
    let is_pane = matches!(material.kind, MaterialKind::ThinDielectric { alpha: 0.0, .. });
    let is_rough_glass = matches!(
        material.kind,
        MaterialKind::Dielectric { alpha, .. } | MaterialKind::ThinDielectric { alpha, .. } if alpha > 0.0
    );
    let is_opaque =
        surface.opacity.factor >= 1.0 && surface.opacity.texture.is_none() && !surface.vertex_color;
    let is_tinted = surface.color.is_some() || surface.vertex_color;
    let is_anisotropic = surface.anisotropy.strength > 0.0;
    let is_textured = is_tinted
        || is_anisotropic
        || [&surface.roughness, &surface.metallic, &surface.normal]
            .iter()
            .any(|texture| texture.is_some());
    [
        (SURFACES_SPECULAR, material.kind.is_specular()),
        (SURFACES_PASSING, is_pane || !is_opaque),
        (SURFACES_ONE_SIDED, !surface.two_sided),
        (SURFACES_TEXTURED, is_textured),
        (SURFACES_ANISOTROPIC, is_anisotropic),
        (SURFACES_TINTED_PANES, is_pane && is_tinted),
        (SURFACES_BECKMANN, surface.distribution == Distribution::Beckmann),
        (SURFACES_EMITTING, surface.emission.is_some()),
        (SURFACES_ROUGH_GLASS, is_rough_glass),
    ]
    .into_iter()
    .fold(0, |bits, (bit, is_needed)| if is_needed { bits | bit } else { bits })
}
