//! Translation of materials, as far as all formats share it.

use std::{f32::consts::FRAC_PI_2, path::Path};

use glam::{Vec2, Vec3};

use super::{
    images::Recipe,
    parts::{Parts, Triangles},
    triple,
};
use crate::{
    coat::normal_reflectance,
    material::{Distribution, Material, MaterialKind, Principled, Surface},
    math::colour::luminance,
    measured::MeasuredTable,
    texture::{Interpolation, TextureUse},
};

/// Material on its way to a format.
pub(super) struct Subject<'a> {
    /// Format or program, as warnings call it.
    pub(super) program: &'static str,
    pub(super) material: &'a Material,
    pub(super) surface: &'a Surface,
    pub(super) triangles: Triangles,
    pub(super) warnings: &'a mut Vec<String>,
}

/// Opacity of a surface that is not opaque.
pub(super) enum Opacity<'a> {
    Factor(f32),
    Image(&'a TextureUse, Recipe),
}

impl<'a> Subject<'a> {
    pub(super) fn new(
        program: &'static str,
        material: &'a Material,
        parts: &Parts,
        warnings: &'a mut Vec<String>,
    ) -> Self {
        let surface = &material.surface;
        Self { program, material, surface, triangles: parts.describe(surface), warnings }
    }

    pub(super) fn warn(&mut self, difference: &str) {
        self.warnings.push(format!("material `{}`: {difference}", self.material.name));
    }

    /// Reflectance of the diffuse surface that stands for a measured one.
    pub(super) fn measured(&mut self, path: &Path, table: &MeasuredTable) -> Vec3 {
        let share = reflected_share(table);
        self.warn(&format!(
            "{} is not written for {}; written as diffuse with the reflectance {}",
            path.display(),
            self.program,
            triple(share)
        ));
        share
    }

    /// Share of metal and roughness of a principled material, by the means of its textures.
    pub(super) fn mean_metal_and_roughness(&self) -> (f32, f32) {
        match self.material.mean_kind() {
            MaterialKind::Principled(own) => (own.metallic, own.roughness),
            _ => (0.0, 1.0),
        }
    }

    /// Names a coat or a sheen, which are written to glTF alone.
    pub(super) fn without_cover(&mut self, material: &Principled) {
        if material.coat_weight > 0.0 {
            self.warn("its coat is left out");
        }
        if material.sheen_color != Vec3::ZERO {
            self.warn("its sheen is left out");
        }
    }

    /// Names a rough pane, for formats whose panes are smooth.
    pub(super) fn without_rough_pane(&mut self) {
        if !matches!(self.material.kind, MaterialKind::ThinDielectric { alpha: 0.0, .. }) {
            self.warn("its rough pane becomes a smooth one");
        }
    }

    /// Names normals of Beckmann's, for formats and models that have none.
    pub(super) fn without_beckmann(&mut self) {
        if self.surface.distribution == Distribution::Beckmann {
            self.warn("its microfacets become GGX of the same width");
        }
    }

    /// Widths of GGX along tangent and bitangent, where they differ. Names other directions, for formats that
    /// have none, and rounds their widths.
    pub(super) fn widths(&mut self, alpha: f32) -> Option<[f32; 2]> {
        let anisotropy = &self.surface.anisotropy;
        if anisotropy.strength == 0.0 {
            return None;
        }
        let [along, across] = anisotropy.widths(alpha);
        let quarters = anisotropy.rotation / FRAC_PI_2;
        let is_straight = (quarters - quarters.round()).abs() < 1e-3;
        if self.surface.roughness.is_some() {
            self.warn("its highlights are stretched by a texture of roughness; they become round");
            return None;
        }
        if !is_straight || anisotropy.direction.is_some() {
            self.warn(
                "its highlights are stretched in another direction than u and v; they become round",
            );
            return Some([anisotropy.mean_width(alpha); 2]);
        }
        let is_along_u = quarters.round().rem_euclid(2.0) == 0.0;
        Some(if is_along_u { [along, across] } else { [across, along] })
    }

    /// Image of the GGX width, if the roughness has one.
    pub(super) fn width(&mut self, alpha: f32) -> Option<(&'a TextureUse, Recipe)> {
        let used = self.surface.roughness.as_ref()?;
        if used.interpolation == Interpolation::Bilinear {
            self.warn(&format!(
                "{} interpolates alpha between texels, Fenestra the roughness, its root",
                self.program
            ));
        }
        Some((used, Recipe::Squared(alpha)))
    }

    /// Normal map, if the coordinates of any triangle tell its directions.
    pub(super) fn normal(&self) -> Option<&'a TextureUse> {
        self.surface.normal.as_ref().filter(|_| self.triangles.bitangents != [0; 2])
    }

    /// Image of the normal map, for the greater part of the triangles.
    pub(super) fn bumps(&mut self) -> Recipe {
        let [same, opposite] = self.triangles.bitangents;
        if same > 0 && opposite > 0 {
            self.warn(&format!(
                "{} of {} triangles show the normal map as a mirror image, which {} bends the wrong \
                 way",
                same.min(opposite),
                same + opposite,
                self.program
            ));
        }
        let scale = self.surface.normal_scale;
        Recipe::Normal(Vec2::new(scale, if opposite > same { -scale } else { scale }))
    }

    /// Opacity for a parameter called `name`.
    pub(super) fn opacity(&mut self, name: &str) -> Option<Opacity<'a>> {
        let opacity = &self.surface.opacity;
        let factor = opacity.factor;
        let Some(used) = &opacity.texture else {
            let factor = match opacity.cutoff {
                Some(cutoff) if factor >= cutoff => 1.0,
                Some(_) => 0.0,
                None => factor,
            };
            return (factor < 1.0).then_some(Opacity::Factor(factor));
        };
        let Some(cutoff) = opacity.cutoff else {
            return Some(Opacity::Image(used, Recipe::Number(factor)));
        };
        if used.interpolation == Interpolation::Bilinear {
            self.warn(&format!(
                "{}'s {name} has no cutoff; an enlarged image of 0 and 1 takes its place, with edges \
                 in steps of a fraction of a texel",
                self.program
            ));
        }
        Some(Opacity::Image(used, Recipe::Cut { factor, cutoff }))
    }
}

/// Share of light from a uniform hemisphere that a measured material reflects: 2 ∫ E(μ) μ dμ by midpoints.
fn reflected_share(table: &MeasuredTable) -> Vec3 {
    const STEPS: u32 = 64;
    let step = |index: u32| {
        let cosine = (index as f32 + 0.5) / STEPS as f32;
        table.albedo(cosine) * (2.0 * cosine / STEPS as f32)
    };
    (0..STEPS).map(step).sum::<Vec3>().clamp(Vec3::ZERO, Vec3::ONE)
}

/// Root of the reflectance of the largest refractive index, 4, that is read back.
const LARGEST_ROOT: f32 = 0.6;

/// Reflectance of a principled dielectric at normal incidence.
fn reflectance_of(&Principled { ior, specular, specular_color, .. }: &Principled) -> f32 {
    luminance((normal_reflectance(ior) * specular_color).min(Vec3::ONE) * specular).max(0.0)
}

/// Tests for a dielectric that has no strength and colour of its own.
fn is_plain(principled: &Principled) -> bool {
    principled.specular == 1.0 && principled.specular_color == Vec3::ONE
}

/// Refractive index, up to 4, whose reflectance at normal incidence is that of a principled dielectric.
pub(super) fn index_of(principled: &Principled) -> f32 {
    if is_plain(principled) {
        return principled.ior;
    }
    let root = reflectance_of(principled).sqrt().min(LARGEST_ROOT);
    (1.0 + root) / (1.0 - root)
}

/// Difference that the index makes; none for a dielectric that has no strength and colour of its own.
pub(super) fn difference_of_index(principled: &Principled) -> Option<String> {
    if is_plain(principled) {
        return None;
    }
    let reflectance = reflectance_of(principled);
    let most = LARGEST_ROOT * LARGEST_ROOT;
    Some(if reflectance > most {
        format!(
            "its dielectric reflects {reflectance} at normal incidence; the refractive index 4 that \
             is written reflects {most}, and the base shows more"
        )
    } else {
        "strength and colour of the dielectric's reflection become a refractive index of the same \
         reflectance at normal incidence"
            .to_owned()
    })
}
