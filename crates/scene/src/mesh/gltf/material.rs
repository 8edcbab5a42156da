//! Materials of a glTF document → materials of a scene.

use std::rc::Rc;

use glam::Vec3;
use serde_json::Value;

use super::{
    GltfReader,
    contents::{for_each_extension, ignore_extension, label},
};
use crate::{
    error::Result,
    features::{self, Feature, Ignored},
    material::{Emission, Material, MaterialKind, Opacity, Surface},
    mesh::{MeshMaterial, images},
    texture::{Channels, Encoding, TextureUse},
};

/// Colours of an image.
const COLOR: (Channels, Encoding) = (Channels::Color, Encoding::Srgb);
/// Channels that hold numbers.
const RED: (Channels, Encoding) = (Channels::Red, Encoding::Linear);
const GREEN: (Channels, Encoding) = (Channels::Green, Encoding::Linear);
const BLUE: (Channels, Encoding) = (Channels::Blue, Encoding::Linear);
const ALPHA: (Channels, Encoding) = (Channels::Alpha, Encoding::Linear);
const VECTOR: (Channels, Encoding) = (Channels::Color, Encoding::Linear);

/// Transmitted share from which a surface is glass; there is no mixture of glass and others.
const GLASS: f32 = 0.5;
/// Roughness from which a thin pane, which is always smooth, is worth a warning.
const VISIBLE_ROUGHNESS: f32 = 0.05;
/// Refractive indices of coats and glass.
const IOR_RANGE: (f32, f32) = (1.01, 4.0);
/// Refractive index of a material that states none, and its reflectance at normal incidence.
const DEFAULT_IOR: f32 = 1.5;
const DEFAULT_REFLECTANCE: f32 = 0.04;

/// Reads a finite number; `default` if it is absent.
pub(super) fn number(json: &Value, key: &str, default: f32) -> f32 {
    let number = json[key].as_f64().map(|number| number as f32);
    number.filter(|number| number.is_finite()).unwrap_or(default)
}

/// Reads a vector of finite numbers; `default` if it is absent.
pub(super) fn vector<const N: usize>(json: &Value, key: &str, default: [f32; N]) -> [f32; N] {
    let Some(numbers) = json[key].as_array().filter(|numbers| numbers.len() >= N) else {
        return default;
    };
    let mut vector = default;
    for (component, number) in vector.iter_mut().zip(numbers) {
        let number = number.as_f64().map(|number| number as f32);
        *component = number.filter(|number| number.is_finite()).unwrap_or(*component);
    }
    vector
}

/// Reads a number from 0 to 1.
fn share(json: &Value, key: &str, default: f32) -> f32 {
    number(json, key, default).clamp(0.0, 1.0)
}

/// Reads a colour with components from 0 to 1.
fn color(json: &Value, key: &str, default: [f32; 3]) -> Vec3 {
    Vec3::from_array(vector(json, key, default)).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Material while it is read.
struct Reading<'a> {
    json: &'a Value,
    place: Rc<dyn Fn() -> String + 'a>,
    ignored: Ignored,
}

impl Reading<'_> {
    fn extension(&self, name: &str) -> &Value {
        &self.json["extensions"][name]
    }

    fn ignore(&mut self, feature: Feature) {
        let place = Rc::clone(&self.place);
        self.ignored.add(feature, || place());
    }

    fn ignore_if(&mut self, is_there: bool, feature: Feature) {
        if is_there {
            self.ignore(feature);
        }
    }
}

/// Reflection model and the properties that come with it.
struct Reflection {
    kind: MaterialKind,
    surface: Surface,
    /// Colour and opacity of the material.
    base_color: Vec3,
    alpha: f32,
}

impl GltfReader<'_> {
    /// Returns the index in the mesh of a material of the document; reads it when it is new.
    pub(super) fn material_index(&mut self, index: usize) -> Result<usize> {
        if let Some(&found) = self.materials.get(&index) {
            return Ok(found);
        }
        let material = self.material(index)?;
        self.mesh.materials.push(material);
        let found = self.mesh.materials.len() - 1;
        self.materials.insert(index, found);
        Ok(found)
    }

    fn material(&mut self, index: usize) -> Result<MeshMaterial> {
        let json = &self.json["materials"][index];
        let name = json["name"].as_str();
        let place = Rc::new(move || label("material", index, name));
        let mut reading = Reading { json, place, ignored: Ignored::default() };
        for_each_extension(json, &mut |extension| {
            ignore_extension(&mut reading.ignored, extension, || label("material", index, name));
        });
        let mut reflection = if reading.extension("KHR_materials_pbrSpecularGlossiness").is_null() {
            self.metallic_roughness(&mut reading)?
        } else {
            self.specular_glossiness(&mut reading)?
        };
        if !reading.extension("KHR_materials_unlit").is_null() {
            reflection = unlit(reflection);
        } else {
            self.transmission(&mut reading, &mut reflection)?;
            let normal = &json["normalTexture"];
            reflection.surface.normal = self.use_texture(normal, VECTOR, &mut reading)?;
            reflection.surface.normal_scale = number(normal, "scale", 1.0);
            reflection.surface.emission = self.emission(&mut reading)?;
        }
        let Reflection { kind, mut surface, alpha, .. } = reflection;
        let mode = json["alphaMode"].as_str();
        surface.opacity = match mode {
            Some("MASK" | "BLEND") => Opacity {
                factor: alpha,
                texture: surface.opacity.texture,
                cutoff: (mode == Some("MASK")).then(|| share(json, "alphaCutoff", 0.5)),
            },
            _ => Opacity::default(),
        };
        let material = Material { name: name.unwrap_or_default().to_owned(), kind, surface };
        Ok(MeshMaterial { material, ignored: reading.ignored })
    }

    fn use_texture(
        &mut self,
        info: &Value,
        meaning: (Channels, Encoding),
        reading: &mut Reading,
    ) -> Result<Option<TextureUse>> {
        let place = Rc::clone(&reading.place);
        self.texture(info, meaning, &mut reading.ignored, &*place)
    }

    /// The model of the core format with `KHR_materials_ior` and `KHR_materials_specular`.
    fn metallic_roughness(&mut self, reading: &mut Reading) -> Result<Reflection> {
        let pbr = &reading.json["pbrMetallicRoughness"];
        let specular = reading.extension("KHR_materials_specular");
        let has_textures =
            !specular["specularTexture"].is_null() || !specular["specularColorTexture"].is_null();
        let stated_ior = number(reading.extension("KHR_materials_ior"), "ior", DEFAULT_IOR);
        let specular_color = Vec3::from_array(vector(specular, "specularColorFactor", [1.0; 3]));
        // The index 0 stands for an infinite one: all light is reflected before the factors.
        let (ior, whole) = match stated_ior {
            0.0 => (DEFAULT_IOR, DEFAULT_REFLECTANCE.recip()),
            ior => (ior.clamp(IOR_RANGE.0, IOR_RANGE.1), 1.0),
        };
        let base_color = color(pbr, "baseColorFactor", [1.0; 3]);
        let kind = MaterialKind::Principled {
            base_color,
            metallic: share(pbr, "metallicFactor", 1.0),
            roughness: share(pbr, "roughnessFactor", 1.0),
            ior,
            specular: share(specular, "specularFactor", 1.0),
            specular_color: whole * specular_color.max(Vec3::ZERO),
        };
        reading.ignore_if(has_textures, features::GLTF_SPECULAR_TEXTURE);
        let packed = &pbr["metallicRoughnessTexture"];
        let mut surface = self.colored(&pbr["baseColorTexture"], reading)?;
        surface.roughness = self.use_texture(packed, GREEN, reading)?;
        surface.metallic = self.use_texture(packed, BLUE, reading)?;
        let [_, _, _, alpha] = vector(pbr, "baseColorFactor", [1.0; 4]);
        Ok(Reflection { kind, surface, base_color, alpha: alpha.clamp(0.0, 1.0) })
    }

    /// `KHR_materials_pbrSpecularGlossiness` as a dielectric of the same reflectance.
    fn specular_glossiness(&mut self, reading: &mut Reading) -> Result<Reflection> {
        let json = reading.json;
        let model = &json["extensions"]["KHR_materials_pbrSpecularGlossiness"];
        let base_color = color(model, "diffuseFactor", [1.0; 3]);
        let glossiness = share(model, "glossinessFactor", 1.0);
        let mut surface = self.colored(&model["diffuseTexture"], reading)?;
        surface.roughness = self
            .use_texture(&model["specularGlossinessTexture"], ALPHA, reading)?
            .map(|texture| TextureUse { scale: [-glossiness; 3], bias: [1.0; 3], ..texture });
        let has_texture = surface.roughness.is_some();
        reading.ignore_if(has_texture, features::GLTF_GLOSSINESS_TEXTURE);
        let kind = MaterialKind::Principled {
            base_color,
            metallic: 0.0,
            roughness: if has_texture { 1.0 } else { 1.0 - glossiness },
            ior: DEFAULT_IOR,
            specular: 1.0,
            specular_color: color(model, "specularFactor", [1.0; 3]) / DEFAULT_REFLECTANCE,
        };
        let [_, _, _, alpha] = vector(model, "diffuseFactor", [1.0; 4]);
        Ok(Reflection { kind, surface, base_color, alpha: alpha.clamp(0.0, 1.0) })
    }

    /// Surface with a texture of colour and opacity.
    fn colored(&mut self, info: &Value, reading: &mut Reading) -> Result<Surface> {
        let color = self.use_texture(info, COLOR, reading)?;
        let opacity = color.as_ref().filter(|color| images::has_alpha(&color.texture));
        let opacity = opacity.map(|color| TextureUse {
            channels: ALPHA.0,
            encoding: ALPHA.1,
            ..color.clone()
        });
        let opacity = Opacity { texture: opacity, ..Opacity::default() };
        Ok(Surface { color, opacity, ..Surface::default() })
    }

    /// Turns a surface that transmits most light into glass.
    fn transmission(&mut self, reading: &mut Reading, found: &mut Reflection) -> Result<()> {
        let json = reading.json;
        let transmission = &json["extensions"]["KHR_materials_transmission"];
        let &MaterialKind::Principled { metallic, roughness, ior, .. } = &found.kind else {
            return Ok(());
        };
        let mean =
            |texture: &Option<TextureUse>| texture.as_ref().map_or(1.0, |used| used.mean()[0]);
        let texture = self.use_texture(&transmission["transmissionTexture"], RED, reading)?;
        let transmitted = share(transmission, "transmissionFactor", 0.0)
            * mean(&texture)
            * (1.0 - metallic * mean(&found.surface.metallic));
        if transmitted < GLASS {
            reading.ignore_if(transmitted > 0.0, features::GLTF_LOW_TRANSMISSION);
            return Ok(());
        }
        reading.ignore_if(texture.is_some(), features::GLTF_TRANSMISSION_TEXTURE);
        reading.ignore_if(found.surface.color.is_some(), features::GLTF_GLASS_COLOR);
        found.surface.color = None;
        found.surface.metallic = None;
        let volume = &json["extensions"]["KHR_materials_volume"];
        let (reflectance, transmittance) = (Vec3::ONE, found.base_color);
        found.kind = if number(volume, "thicknessFactor", 0.0) > 0.0 {
            let attenuation = color(volume, "attenuationColor", [1.0; 3]);
            let absorbs = !volume["attenuationDistance"].is_null() && attenuation != Vec3::ONE;
            reading.ignore_if(absorbs, features::GLTF_ABSORPTION);
            MaterialKind::Dielectric {
                ior,
                alpha: roughness * roughness,
                reflectance,
                transmittance,
            }
        } else {
            let rough = roughness * mean(&found.surface.roughness);
            reading.ignore_if(rough > VISIBLE_ROUGHNESS, features::GLTF_THIN_ROUGHNESS);
            found.surface.roughness = None;
            MaterialKind::ThinDielectric { ior, reflectance, transmittance }
        };
        Ok(())
    }

    fn emission(&mut self, reading: &mut Reading) -> Result<Option<Emission>> {
        let json = reading.json;
        let strength = reading.extension("KHR_materials_emissive_strength");
        let strength = number(strength, "emissiveStrength", 1.0).max(0.0);
        let factor = Vec3::from_array(vector(json, "emissiveFactor", [0.0; 3])).max(Vec3::ZERO);
        let radiance = factor * strength;
        if radiance == Vec3::ZERO {
            return Ok(None);
        }
        if !radiance.is_finite() {
            let place = (reading.place)();
            return Err(
                self.error(format!("{place}: expected a finite emission, found {radiance}"))
            );
        }
        let texture = self.use_texture(&json["emissiveTexture"], COLOR, reading)?;
        let two_sided = json["doubleSided"].as_bool().unwrap_or(false);
        Ok(Some(Emission { radiance, texture, two_sided }))
    }
}

/// Lets a surface emit its colour and reflect nothing, which is how it looks in any light.
fn unlit(found: Reflection) -> Reflection {
    let Reflection { surface, base_color, alpha, .. } = found;
    let emission = Emission { radiance: base_color, texture: surface.color, two_sided: true };
    Reflection {
        kind: MaterialKind::Diffuse { reflectance: Vec3::ZERO },
        surface: Surface {
            emission: Some(emission),
            opacity: surface.opacity,
            ..Surface::default()
        },
        base_color,
        alpha,
    }
}
