//! Keys of an MTL material → the material of a scene.

use std::f32::consts::TAU;

use glam::Vec3;

use super::{LibraryMaterial, Map};
use crate::{
    coat::{COAT_IOR, DEFAULT_IOR},
    features::{self, Feature},
    import::Width,
    material::{Emission, Material, MaterialKind, Opacity, Principled, Surface},
    mesh::MeshMaterial,
    texture::{
        Channels, Encoding, TextureCache,
        linear::{has_alpha, holds_normals, opacity_of},
    },
};

/// Roughness of a material that states no more than its metallic share.
const DEFAULT_ROUGHNESS: f32 = 0.5;
/// Opacity below which glass is a pane, and not a coat on a base that lets some light through.
const PANE_OPACITY: f32 = 0.5;
/// Largest component of a black colour.
const BLACK: f32 = 1e-3;
/// Largest component of a colour below a mirror or glass, which hand-written files leave above black.
const DARK: f32 = 0.02;
/// Smallest GGX width of a gloss that is not a mirror.
const SMALLEST_WIDTH: f32 = 1e-3;

impl LibraryMaterial {
    /// Returns the material of the scene; reads its images.
    pub(in crate::mesh) fn finish(
        &self,
        images: &mut TextureCache,
        warnings: &mut Vec<String>,
    ) -> MeshMaterial {
        let color_map = self.color_map.as_ref();
        let color =
            color_map.and_then(|map| map.load(Channels::Color, Encoding::Srgb, images, warnings));
        let mut load = |map: &Option<Map>, encoding| {
            let map = map.as_ref()?;
            map.load(map.options.channels.unwrap_or_default(), encoding, images, warnings)
        };
        let mut opacity_texture = load(&self.opacity_map, Encoding::Linear);
        if let (Some(opacity), None) =
            (&mut opacity_texture, self.opacity_map.as_ref().and_then(|map| map.options.channels))
            && has_alpha(&opacity.texture)
        {
            opacity.channels = Channels::Alpha;
        }
        // The transparent texels of a colour image cut the surface out.
        if self.opacity_map.is_none() {
            opacity_texture = color.as_ref().and_then(opacity_of);
        }
        let emission_texture = load(&self.emission_map, Encoding::Srgb);
        let mut surface = Surface {
            roughness: load(&self.roughness_map, Encoding::Linear),
            metallic: load(&self.metallic_map, Encoding::Linear),
            normal: load(&self.normal_map, Encoding::Linear),
            normal_scale: self.normal_map.as_ref().map_or(1.0, |map| map.options.strength),
            ..Surface::default()
        };
        // Files with images often leave the colour black that would multiply them.
        let diffuse = if color.is_some() && self.diffuse.max_element() <= BLACK {
            Vec3::ONE
        } else {
            self.diffuse
        };
        surface.color = color;
        let mut ignored = self.ignored.clone();
        // Blender and others write normal maps under this key.
        if let Some(map) = &self.bump_map
            && let Some(bumps) = load(&self.bump_map, Encoding::Linear)
        {
            if surface.normal.is_none() && holds_normals(&bumps.texture) {
                surface.normal = Some(bumps);
                surface.normal_scale = map.options.strength;
            } else {
                let place = || format!("material `{}`, {}", self.name, map.place);
                ignored.add(features::MTL_BUMP, place);
            }
        }
        let mut ignore = |feature: Feature| {
            ignored.add(feature, || format!("material `{}`", self.name));
        };
        // Some exporters write 1 for opaque: nobody writes what nobody sees.
        let transparency = self.transparency.filter(|share| *share < 1.0);
        if self.opacity.is_none() && self.transparency != transparency {
            ignore(features::MTL_TRANSPARENT);
        }
        let opacity = self.opacity.or(transparency.map(|share| 1.0 - share)).unwrap_or(1.0);
        let is_of_coat = |ior: &f32| (COAT_IOR.0..=COAT_IOR.1).contains(ior);
        let ior = self.ior.filter(is_of_coat).unwrap_or(DEFAULT_IOR);
        let is_glossy = self.specular.max_element() > 0.0 && self.model >= 2;
        let is_pane = matches!(self.model, 4 | 6 | 7 | 9) && opacity < PANE_OPACITY;
        // Converters write these models for all surfaces; those that refract have an index.
        let is_solid = matches!(self.model, 6 | 7) && self.ior.is_some() && opacity == 1.0;
        let is_dark = color_map.is_none() && diffuse.max_element() <= DARK;
        let kind = if self.is_metallic_roughness() {
            let one_if = |texture: bool, otherwise| if texture { 1.0 } else { otherwise };
            let roughness = one_if(surface.roughness.is_some(), DEFAULT_ROUGHNESS);
            let mut roughness = self.roughness.unwrap_or(roughness);
            let width = Width::stretched(roughness, self.anisotropy.unwrap_or(0.0));
            if width.anisotropy.strength > 0.0 {
                roughness = width.mean_roughness();
                surface.anisotropy = width.anisotropy;
                surface.anisotropy.rotation += TAU * self.anisotropy_turns.unwrap_or(0.0);
            }
            let is_coated = self.coat_weight.is_some_and(|weight| weight > 0.0);
            MaterialKind::Principled(Principled {
                base_color: diffuse,
                metallic: self.metallic.unwrap_or(one_if(surface.metallic.is_some(), 0.0)),
                roughness,
                ior,
                coat_weight: self.coat_weight.unwrap_or(0.0),
                coat_roughness: self.coat_roughness.unwrap_or(0.0),
                sheen_color: Vec3::splat(self.sheen.filter(|_| !is_coated).unwrap_or(0.0)),
                ..Principled::default()
            })
        } else if is_pane {
            // The image varies the colour of what the pane does not let through.
            let image = surface.color.take().filter(|_| self.filter.is_none());
            surface.color =
                image.map(|image| image.affine(opacity * diffuse, Vec3::splat(1.0 - opacity)));
            let tint = Vec3::ONE.lerp(diffuse, opacity);
            let tint = if surface.color.is_some() { Vec3::ONE } else { tint };
            let transmittance = self.filter.unwrap_or(tint);
            MaterialKind::pane(ior, transmittance)
        } else if is_dark && is_solid {
            // The filter is that of two surfaces.
            let transmittance = self.filter.unwrap_or(Vec3::ONE).powf(0.5);
            let (reflectance, absorption) = (Vec3::ONE, Vec3::ZERO);
            MaterialKind::Dielectric { ior, alpha: 0.0, reflectance, transmittance, absorption }
        } else if is_dark && is_glossy && matches!(self.model, 3 | 5) {
            MaterialKind::Mirror { reflectance: self.specular }
        } else if is_glossy {
            ignore(features::MTL_KS_COLOR);
            // The width at which GGX and Blinn's cosine power are alike near the normal.
            let alpha = (2.0 / (self.exponent + 2.0)).sqrt().clamp(SMALLEST_WIDTH, 1.0);
            MaterialKind::Plastic { diffuse, alpha, ior }
        } else {
            MaterialKind::Diffuse { reflectance: diffuse }
        };
        let is_glass = is_pane || matches!(kind, MaterialKind::Dielectric { .. });
        if !is_glass && self.filter.is_some_and(|filter| filter != Vec3::ONE) {
            ignore(features::MTL_TF);
        }
        surface.opacity = Opacity {
            factor: if is_pane { 1.0 } else { opacity },
            texture: opacity_texture,
            cutoff: None,
        };
        let default = if emission_texture.is_some() { Vec3::ONE } else { Vec3::ZERO };
        let radiance = self.emission.filter(|e| *e != Vec3::ZERO).unwrap_or(default);
        if radiance != Vec3::ZERO {
            let texture = emission_texture;
            surface.emission = Some(Emission { radiance, texture, two_sided: true });
        }
        let material = Material { name: self.name.clone(), kind, surface };
        MeshMaterial { material, ignored, is_culled: false }
    }

    /// Tests for the keys of the metallic-roughness extension.
    fn is_metallic_roughness(&self) -> bool {
        self.roughness.is_some()
            || self.metallic.is_some()
            || [self.coat_weight, self.sheen, self.anisotropy].map(Option::unwrap_or_default)
                != [0.0; 3]
            || self.roughness_map.is_some()
            || self.metallic_map.is_some()
    }
}
