//! Materials → metallic-roughness materials with their extensions.

use glam::Vec3;
use serde_json::{Value, json};

use super::document::{Layout, Sheet, Textures, peak};
use crate::{
    coat::DEFAULT_IOR,
    export::subject::Subject,
    material::{Anisotropy, ConductorFresnel, Emission, MaterialKind, Principled},
    texture::TextureUse,
};

/// Material on its way to the document.
pub(super) struct Translator<'a> {
    pub(super) subject: Subject<'a>,
    pub(super) textures: &'a mut Textures,
    /// Members of the material.
    pub(super) members: Value,
}

/// Factors of the core model.
fn core(base_color: Vec3, metallic: f32, roughness: f32) -> Principled {
    Principled { base_color, metallic, roughness, ..Principled::default() }
}

impl<'a> Translator<'a> {
    pub(super) fn translate(mut self) -> Value {
        let surface = self.subject.surface;
        let is_unlit = self.is_unlit();
        let core = if is_unlit {
            self.extension("KHR_materials_unlit", json!({}));
            let radiance = surface.emission.as_ref().map_or(Vec3::ZERO, |light| light.radiance);
            core(radiance, 0.0, 1.0)
        } else {
            self.core()
        };
        if !surface.two_sided && !self.subject.material.kind.is_glass() {
            self.subject
                .warn("its back is black in Fenestra, and seen or culled by readers of glTF");
        }
        let color = match &surface.emission {
            Some(light) if is_unlit => light.texture.as_ref(),
            _ => surface.color.as_ref(),
        };
        self.pbr(&core, color);
        self.anisotropy();
        self.subject.without_beckmann();
        if let Some(emission) = surface.emission.as_ref().filter(|_| !is_unlit) {
            self.emission(emission);
        }
        let normal = self.subject.normal().filter(|_| !is_unlit);
        if let Some(mut info) = self.texture(Layout::Vector, [normal, None], [Vec3::ONE; 2]) {
            if surface.normal_scale != 1.0 {
                info["scale"] = json!(surface.normal_scale);
            }
            self.members["normalTexture"] = info;
        }
        self.opacity();
        // The back of a double-sided material emits too.
        let is_double = surface.emission.as_ref().map_or(surface.two_sided, |own| own.two_sided);
        self.members["doubleSided"] = is_double.into();
        self.members["name"] = self.subject.material.name.clone().into();
        self.members
    }

    fn extension(&mut self, name: &'static str, value: Value) {
        self.textures.extensions.insert(name);
        self.members["extensions"][name] = value;
    }

    /// Tests for a surface that shows the same colour in any light.
    fn is_unlit(&self) -> bool {
        let surface = self.subject.surface;
        let is_black =
            matches!(self.subject.material.kind, MaterialKind::Diffuse { reflectance: Vec3::ZERO });
        let is_shown = |light: &Emission| {
            let largest = light.radiance * peak(light.texture.as_ref());
            light.two_sided && largest.max_element() <= 1.0
        };
        is_black && surface.emission.as_ref().is_some_and(is_shown) && !surface.vertex_color
    }

    /// Factors of the model, with the extensions that it needs.
    fn core(&mut self) -> Principled {
        let metal = |base_color, alpha: f32| core(base_color, 1.0, alpha.sqrt());
        match &self.subject.material.kind {
            MaterialKind::Diffuse { reflectance } => self.diffuse(*reflectance),
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                let (kept, passed) = (reflectance.max_element(), transmittance.max_element());
                let share = if passed > 0.0 { passed / (kept + passed) } else { 0.0 };
                if kept + passed > 1.0 + 1e-5 {
                    self.subject.warn(
                        "in glTF the same share of all colours goes through; those that do more than \
                         others are darker",
                    );
                }
                let color = (*transmittance / share.max(f32::MIN_POSITIVE)).min(Vec3::ONE);
                let mut sheet = json!({"diffuseTransmissionFactor": share});
                let texture = self.subject.surface.color.as_ref();
                let largest = self.peak_of_share(texture, color);
                sheet["diffuseTransmissionColorFactor"] =
                    json!((color * largest).min(Vec3::ONE).to_array());
                let (layout, peaks) = (Layout::ColorOpacity, [largest, Vec3::ONE]);
                if let Some(info) = self.texture(layout, [texture, None], peaks) {
                    sheet["diffuseTransmissionColorTexture"] = info;
                }
                self.extension("KHR_materials_diffuse_transmission", sheet);
                self.diffuse((*reflectance / (1.0 - share).max(f32::MIN_POSITIVE)).min(Vec3::ONE))
            }
            MaterialKind::Plastic { diffuse, alpha, ior } => {
                self.subject.warn(
                    "its coat and base become glTF's dielectric, which reflects by Schlick's \
                     approximation and darkens its base in another way",
                );
                self.dielectric(*ior, 1.0, Vec3::ONE);
                core(*diffuse, 0.0, alpha.sqrt())
            }
            MaterialKind::Conductor {
                alpha,
                fresnel: ConductorFresnel::Schlick { reflectance },
            } => metal(*reflectance, *alpha),
            MaterialKind::Conductor { alpha, fresnel } => {
                self.subject.warn(
                    "its refractive index becomes the reflectance at normal incidence, from which \
                     glTF's metal follows Schlick's approximation",
                );
                metal(fresnel.at_normal_incidence(), *alpha)
            }
            &MaterialKind::Principled(own) => {
                self.dielectric(own.ior, own.specular, own.specular_color);
                if own.coat_weight > 0.0 {
                    let (weight, roughness) = (own.coat_weight, own.coat_roughness);
                    let coat =
                        json!({"clearcoatFactor": weight, "clearcoatRoughnessFactor": roughness});
                    self.extension("KHR_materials_clearcoat", coat);
                }
                if own.sheen_color != Vec3::ZERO {
                    let (color, roughness) = (own.sheen_color.to_array(), own.sheen_roughness);
                    let sheen =
                        json!({"sheenColorFactor": color, "sheenRoughnessFactor": roughness});
                    self.extension("KHR_materials_sheen", sheen);
                }
                own
            }
            MaterialKind::Mirror { reflectance } => {
                if *reflectance != Vec3::ONE || self.subject.surface.color.is_some() {
                    self.subject
                        .warn("its mirror becomes a metal, which is white toward the horizon");
                }
                metal(*reflectance, 0.0)
            }
            MaterialKind::Dielectric { ior, alpha, reflectance, transmittance, absorption } => {
                let core = self.glass(*ior, alpha.sqrt(), *reflectance, *transmittance);
                // A thickness makes the surface the boundary of a solid.
                let mut volume = json!({"thicknessFactor": 1.0});
                let strongest = absorption.max_element();
                if strongest > 0.0 {
                    volume["attenuationDistance"] = json!(strongest.recip());
                    volume["attenuationColor"] = json!((-absorption / strongest).exp().to_array());
                }
                self.extension("KHR_materials_volume", volume);
                core
            }
            MaterialKind::ThinDielectric { ior, alpha, reflectance, transmittance } => {
                self.glass(*ior, alpha.sqrt(), *reflectance, *transmittance)
            }
            MaterialKind::Measured { path, table } => {
                let share = self.subject.measured(path, table);
                self.diffuse(share)
            }
        }
    }

    fn anisotropy(&mut self) {
        let Anisotropy { strength, rotation, direction } = &self.subject.surface.anisotropy;
        let is_measured = matches!(self.subject.material.kind, MaterialKind::Measured { .. });
        if *strength > 0.0 && !is_measured {
            let mut model = json!({"anisotropyStrength": strength, "anisotropyRotation": rotation});
            if let Some(info) =
                self.texture(Layout::Vector, [direction.as_ref(), None], [Vec3::ONE; 2])
            {
                model["anisotropyTexture"] = info;
            }
            self.extension("KHR_materials_anisotropy", model);
        }
    }

    fn diffuse(&mut self, reflectance: Vec3) -> Principled {
        self.dielectric(DEFAULT_IOR, 0.0, Vec3::ONE);
        core(reflectance, 0.0, 1.0)
    }

    fn dielectric(&mut self, ior: f32, specular: f32, specular_color: Vec3) {
        if ior != DEFAULT_IOR {
            self.extension("KHR_materials_ior", json!({"ior": ior}));
        }
        if specular != 1.0 || specular_color != Vec3::ONE {
            let color = specular_color.to_array();
            let value = json!({"specularFactor": specular, "specularColorFactor": color});
            self.extension("KHR_materials_specular", value);
        }
    }

    fn glass(
        &mut self,
        ior: f32,
        roughness: f32,
        reflectance: Vec3,
        transmittance: Vec3,
    ) -> Principled {
        if reflectance != Vec3::ONE {
            self.subject.warn("the factor of its reflected light has no place in glTF's glass");
        }
        if ior < 1.0 {
            self.subject.warn("glTF's refractive indices are at least 1; its own is below");
        }
        self.dielectric(ior.max(1.0), 1.0, Vec3::ONE);
        self.extension("KHR_materials_transmission", json!({"transmissionFactor": 1.0}));
        core(transmittance, 0.0, roughness)
    }

    /// `pbrMetallicRoughness`, with the textures of colour and opacity, roughness and metal.
    fn pbr(&mut self, core: &Principled, color: Option<&TextureUse>) {
        let surface = self.subject.surface;
        let mut number = |used, factor| self.peak_of_share(used, Vec3::splat(factor)).max_element();
        let [opacity, roughness, metallic] =
            [&surface.opacity.texture, &surface.roughness, &surface.metallic].map(Option::as_ref);
        let opaque = Vec3::splat(number(opacity, surface.opacity.factor));
        let gloss = [number(roughness, core.roughness), number(metallic, core.metallic)];
        let largest = [self.peak_of_share(color, core.base_color), opaque];
        let base_color = (core.base_color * largest[0]).clamp(Vec3::ZERO, Vec3::ONE);
        let mut pbr = json!({
            "baseColorFactor": base_color.extend(surface.opacity.factor * largest[1].x).to_array(),
            "metallicFactor": core.metallic * gloss[1],
            "roughnessFactor": core.roughness * gloss[0],
        });
        if let Some(info) = self.texture(Layout::ColorOpacity, [color, opacity], largest) {
            pbr["baseColorTexture"] = info;
        }
        let gloss = gloss.map(Vec3::splat);
        if let Some(info) = self.texture(Layout::RoughnessMetal, [roughness, metallic], gloss) {
            pbr["metallicRoughnessTexture"] = info;
        }
        self.members["pbrMetallicRoughness"] = pbr;
    }

    /// Largest value of a texture by channel, at least 1, as far as `factor` times it is at most 1.
    fn peak_of_share(&mut self, used: Option<&TextureUse>, factor: Vec3) -> Vec3 {
        let (largest, most) = (peak(used), factor.recip());
        if largest.cmpgt(most).any() {
            self.subject
                .warn("an image is above 1 in places; it is cut off at its texels, not between");
        }
        largest.min(most)
    }

    /// Reference to an image of one or two textures. Two must lie in the same way on the surface and
    /// have equally many texels; else the second is left out.
    fn texture(
        &mut self,
        layout: Layout,
        [first, second]: [Option<&TextureUse>; 2],
        peaks: [Vec3; 2],
    ) -> Option<Value> {
        let used = first.or(second)?;
        let place = |used: &TextureUse| {
            let sides = (used.texture.width, used.texture.height);
            (sides, used.uv_set, used.wrap, used.interpolation, used.image_from_uv)
        };
        let kept = second.filter(|other| place(used) == place(other));
        if second.is_some() && kept.is_none() {
            let [first, second] = match layout {
                Layout::RoughnessMetal => ["roughness", "metal"],
                Layout::ColorOpacity | Layout::Vector => ["colour", "opacity"],
            };
            self.subject.warn(&format!(
                "its textures of {first} and {second} lie on the surface in two ways or differ in \
                 size; glTF has one image for both, and that of {second} is left out"
            ));
        }
        let sheet = Sheet { layout, uses: [first.cloned(), kept.cloned()], peaks };
        let (info, is_exact) = self.textures.add(sheet, used);
        if !is_exact {
            self.subject.warn(
                "a texture is sheared on its coordinates, which glTF's transformation cannot",
            );
        }
        Some(info)
    }

    /// Factors of emission are at most 1 in glTF; an extension multiplies them.
    fn emission(&mut self, emission: &Emission) {
        let largest = peak(emission.texture.as_ref());
        let radiance = emission.radiance * largest;
        let strength = radiance.max_element().max(1.0);
        self.members["emissiveFactor"] = json!((radiance / strength).to_array());
        if strength > 1.0 {
            let value = json!({"emissiveStrength": strength});
            self.extension("KHR_materials_emissive_strength", value);
        }
        let (pair, peaks) = ([emission.texture.as_ref(), None], [largest, Vec3::ONE]);
        if let Some(info) = self.texture(Layout::ColorOpacity, pair, peaks) {
            self.members["emissiveTexture"] = info;
        }
    }

    fn opacity(&mut self) {
        let opacity = &self.subject.surface.opacity;
        let has_colors = self.subject.triangles.has_transparency;
        if let Some(cutoff) = opacity.cutoff {
            self.members["alphaMode"] = "MASK".into();
            self.members["alphaCutoff"] = json!(cutoff);
        } else if opacity.factor < 1.0 || opacity.texture.is_some() || has_colors {
            self.members["alphaMode"] = "BLEND".into();
        }
    }
}
