//! Materials of a glTF document → materials of a scene.

use glam::{Vec2, Vec3};
use serde_json::Value as Json;

use super::{GltfReader, contents::ignore_extensions};
use crate::{
    coat::{COAT_IOR, DEFAULT_IOR, DIELECTRIC, metallic_roughness},
    error::Result,
    features::{self, Feature, Ignored},
    import::{Value, sheet},
    material::{Anisotropy, Emission, Material, MaterialKind, Opacity, Principled, Surface},
    mesh::{MeshMaterial, label},
    texture::{
        Channels, Encoding, TextureUse,
        linear::{Texelwise, lie_alike, opacity_of},
    },
};

const COLOR: (Channels, Encoding) = (Channels::Color, Encoding::Srgb);
/// Channels that hold numbers.
const RED: (Channels, Encoding) = (Channels::Red, Encoding::Linear);
const GREEN: (Channels, Encoding) = (Channels::Green, Encoding::Linear);
const BLUE: (Channels, Encoding) = (Channels::Blue, Encoding::Linear);
const ALPHA: (Channels, Encoding) = (Channels::Alpha, Encoding::Linear);
const VECTOR: (Channels, Encoding) = (Channels::Color, Encoding::Linear);

/// Transmitted share from which a surface is glass; there is no mixture of glass and others.
const GLASS: f32 = 0.5;
/// Share of light scattered through from which a surface is a sheet.
const LEAST_TRANSMISSION: f32 = 1e-3;
/// Roughness from which a thin pane is not smooth.
const VISIBLE_ROUGHNESS: f32 = 0.05;
/// Largest reflectance at normal incidence of a material that is read as a dielectric.
const STRONGEST_DIELECTRIC: f32 = 0.08;

/// Reads a finite number; `default` if it is absent.
pub(super) fn number(json: &Json, key: &str, default: f32) -> f32 {
    let number = json[key].as_f64().map(|number| number as f32);
    number.filter(|number| number.is_finite()).unwrap_or(default)
}

/// Reads a vector of finite numbers; `default` if it is absent.
pub(super) fn vector<const N: usize>(json: &Json, key: &str, default: [f32; N]) -> [f32; N] {
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

fn share(json: &Json, key: &str, default: f32) -> f32 {
    number(json, key, default).clamp(0.0, 1.0)
}

/// Mean of a texture, 1 without one.
fn mean(texture: &Option<TextureUse>) -> Vec3 {
    texture.as_ref().map_or(Vec3::ONE, |texture| texture.mean().into())
}

/// Reads a colour with components from 0 to 1.
fn color(json: &Json, key: &str, default: [f32; 3]) -> Vec3 {
    Vec3::from_array(vector(json, key, default)).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Material while it is read.
pub(super) struct Reading<'a> {
    json: &'a Json,
    /// Number or name, for messages.
    pub(super) place: String,
    ignored: Ignored,
}

impl<'a> Reading<'a> {
    fn new(json: &'a Json, index: usize) -> Self {
        let place = label("material", index, json["name"].as_str());
        Self { json, place, ignored: Ignored::default() }
    }

    fn extension(&self, name: &str) -> &Json {
        &self.json["extensions"][name]
    }

    pub(super) fn ignore(&mut self, feature: Feature) {
        self.ignored.add(feature, || self.place.clone());
    }

    fn ignore_if(&mut self, is_there: bool, feature: Feature) {
        if is_there {
            self.ignore(feature);
        }
    }
}

/// Glass that takes the place of a material on some triangles.
#[derive(Clone, Debug)]
pub(super) struct Pane {
    texture: TextureUse,
    /// Value of the texture from which a triangle is glass.
    least: f32,
    /// Index into the materials of the mesh.
    pub material: usize,
}

impl Pane {
    /// Set of texture coordinates that decide.
    pub(super) fn uv_set(&self) -> usize {
        self.texture.uv_set as usize
    }

    /// Tests for glass by the mean of the texture over the points of a triangle that lie in the middle and
    /// half-way to the corners.
    pub(super) fn covers(&self, uvs: [Vec2; 3]) -> bool {
        let middle = (uvs[0] + uvs[1] + uvs[2]) / 3.0;
        let points =
            [middle, 0.5 * (middle + uvs[0]), 0.5 * (middle + uvs[1]), 0.5 * (middle + uvs[2])];
        let value = |uv: Vec2| {
            let image = self.texture.image_from_uv.map(|[u, v, w]| u * uv.x + v * uv.y + w);
            self.texture.value(image.into()).x
        };
        0.25 * points.into_iter().map(value).sum::<f32>() >= self.least
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
        let texture = self.transmission_texture(index)?;
        let is_glass = texture.as_ref().map(|_| false);
        let found = self.push_material(index, is_glass)?;
        if let Some((texture, least)) = texture {
            let material = self.push_material(index, Some(true))?;
            self.panes.insert(found, Pane { texture, least, material });
        }
        self.materials.insert(index, found);
        Ok(found)
    }

    fn push_material(&mut self, index: usize, is_glass: Option<bool>) -> Result<usize> {
        let mut material = self.material(index, is_glass)?;
        if is_glass == Some(true) {
            material.material.name += ", glass";
        }
        self.mesh.materials.push(material);
        Ok(self.mesh.materials.len() - 1)
    }

    /// Texture of the share of transmitted light, with its value from which a surface is glass; none where
    /// that is nowhere reached.
    fn transmission_texture(&mut self, index: usize) -> Result<Option<(TextureUse, f32)>> {
        let json = &self.json["materials"][index];
        let transmission = &json["extensions"]["KHR_materials_transmission"];
        let pbr = &json["pbrMetallicRoughness"];
        let has_metallic_texture = !pbr["metallicRoughnessTexture"].is_null();
        let metallic = if has_metallic_texture { 0.0 } else { share(pbr, "metallicFactor", 1.0) };
        let factor = share(transmission, "transmissionFactor", 0.0) * (1.0 - metallic);
        if factor < GLASS || !json["extensions"]["KHR_materials_unlit"].is_null() {
            return Ok(None);
        }
        let info = &transmission["transmissionTexture"];
        let texture = self.texture(info, RED, &mut Reading::new(json, index))?;
        let Some(texture) = texture else { return Ok(None) };
        let least = GLASS / factor;
        let is_reached = texture.values().iter().any(|value| value[0] >= least);
        Ok(is_reached.then_some((texture, least)))
    }

    /// Reads a material, which is glass or not, or as its numbers say.
    fn material(&mut self, index: usize, is_glass: Option<bool>) -> Result<MeshMaterial> {
        let json = &self.json["materials"][index];
        let mut reading = Reading::new(json, index);
        ignore_extensions(&mut reading.ignored, json, &|| reading.place.clone());
        let mut reflection = if reading.extension("KHR_materials_pbrSpecularGlossiness").is_null() {
            self.metallic_roughness(&mut reading)?
        } else {
            self.specular_glossiness(&mut reading)?
        };
        if !reading.extension("KHR_materials_unlit").is_null() {
            reflection = unlit(reflection);
        } else {
            self.transmission(&mut reading, &mut reflection, is_glass)?;
            self.diffuse_transmission(&mut reading, &mut reflection)?;
            self.coat(&mut reading, &mut reflection)?;
            self.sheen(&mut reading, &mut reflection)?;
            self.anisotropy(&mut reading, &mut reflection)?;
            let normal = &json["normalTexture"];
            reflection.surface.normal = self.texture(normal, VECTOR, &mut reading)?;
            reflection.surface.normal_scale = number(normal, "scale", 1.0);
            reflection.surface.emission = self.emission(&mut reading)?;
        }
        let Reflection { kind, mut surface, alpha, .. } = reflection;
        let mode = json["alphaMode"].as_str();
        surface.opacity = match mode {
            Some("MASK") => {
                let cutoff = number(json, "alphaCutoff", 0.5);
                // No opacity reaches a cutoff above 1.
                let factor = if cutoff > 1.0 { 0.0 } else { alpha };
                Opacity { factor, cutoff: Some(cutoff.clamp(0.0, 1.0)), ..surface.opacity }
            }
            Some("BLEND") => Opacity { factor: alpha, ..surface.opacity },
            _ => Opacity::default(),
        };
        let name = json["name"].as_str().unwrap_or_default().to_owned();
        let material = Material { name, kind, surface };
        let is_culled = !json["doubleSided"].as_bool().unwrap_or(false);
        Ok(MeshMaterial { material, ignored: reading.ignored, is_culled })
    }

    /// The model of the core format with `KHR_materials_ior` and `KHR_materials_specular`.
    fn metallic_roughness(&mut self, reading: &mut Reading) -> Result<Reflection> {
        let pbr = &reading.json["pbrMetallicRoughness"];
        let model = &reading.json["extensions"]["KHR_materials_specular"];
        let strength = self.texture(&model["specularTexture"], ALPHA, reading)?;
        let tint = self.texture(&model["specularColorTexture"], COLOR, reading)?;
        let stated_ior = number(reading.extension("KHR_materials_ior"), "ior", DEFAULT_IOR);
        let specular_color = Vec3::from_array(vector(model, "specularColorFactor", [1.0; 3]));
        // The index 0 stands for an infinite one: all light is reflected before the factors.
        let (ior, whole) = match stated_ior {
            0.0 => (DEFAULT_IOR, DIELECTRIC.recip()),
            ior => (ior.clamp(COAT_IOR.0, COAT_IOR.1), 1.0),
        };
        let base_color = color(pbr, "baseColorFactor", [1.0; 3]);
        let kind = MaterialKind::Principled(Principled {
            base_color,
            metallic: share(pbr, "metallicFactor", 1.0),
            roughness: share(pbr, "roughnessFactor", 1.0),
            ior,
            specular: share(model, "specularFactor", 1.0) * mean(&strength).x,
            specular_color: whole * specular_color.max(Vec3::ZERO) * mean(&tint),
            ..Principled::default()
        });
        reading.ignore_if(strength.or(tint).is_some(), features::GLTF_SPECULAR_TEXTURE);
        let packed = &pbr["metallicRoughnessTexture"];
        let mut surface = self.colored(&pbr["baseColorTexture"], reading)?;
        surface.roughness = self.texture(packed, GREEN, reading)?;
        surface.metallic = self.texture(packed, BLUE, reading)?;
        let [_, _, _, alpha] = vector(pbr, "baseColorFactor", [1.0; 4]);
        Ok(Reflection { kind, surface, base_color, alpha: alpha.clamp(0.0, 1.0) })
    }

    /// `KHR_materials_pbrSpecularGlossiness`: as a dielectric of the same reflectance where that is a
    /// dielectric's, else as a metallic-roughness material, texel by texel.
    fn specular_glossiness(&mut self, reading: &mut Reading) -> Result<Reflection> {
        let json = reading.json;
        let model = &json["extensions"]["KHR_materials_pbrSpecularGlossiness"];
        let base_color = color(model, "diffuseFactor", [1.0; 3]);
        let mut specular_color = color(model, "specularFactor", [1.0; 3]);
        let glossiness = share(model, "glossinessFactor", 1.0);
        let [_, _, _, alpha] = vector(model, "diffuseFactor", [1.0; 4]);
        let alpha = alpha.clamp(0.0, 1.0);
        let mut surface = self.colored(&model["diffuseTexture"], reading)?;
        let specular = self.texture(&model["specularGlossinessTexture"], COLOR, reading)?;
        let mut roughness = 1.0 - glossiness;
        let lie_alike = match (&surface.color, &specular) {
            (Some(own), Some(specular)) => lie_alike(own, specular),
            _ => true,
        };
        if let Some(specular) = specular.as_ref().filter(|_| !lie_alike) {
            reading.ignore(features::GLTF_GLOSSINESS_TEXTURE);
            specular_color *= Vec3::from(specular.mean());
            roughness = 1.0;
            let (channels, encoding) = ALPHA;
            let (scale, bias) = ([-glossiness; 3], [1.0; 3]);
            let used = TextureUse { channels, encoding, scale, bias, ..specular.clone() };
            surface.roughness = Some(used);
        }
        let specular = specular.filter(|_| lie_alike);
        if specular.is_none() && specular_color.max_element() <= STRONGEST_DIELECTRIC {
            let kind = MaterialKind::Principled(Principled {
                base_color,
                metallic: 0.0,
                roughness,
                specular_color: specular_color / DIELECTRIC,
                ..Principled::default()
            });
            return Ok(Reflection { kind, surface, base_color, alpha });
        }
        let mut principled = Principled { roughness, ..Principled::default() };
        let has_gloss_image = specular.is_some();
        if surface.color.is_none() && !has_gloss_image {
            let (base_color, metallic) = metallic_roughness(base_color, specular_color);
            let kind = MaterialKind::Principled(Principled { base_color, metallic, ..principled });
            return Ok(Reflection { kind, surface, base_color, alpha });
        }
        let diffuse = Value::of(surface.color.take(), base_color);
        let specular = Value::of(specular, specular_color);
        let grid = Texelwise::of(&[diffuse.image(), specular.image()]);
        // The alpha of the specular image is a factor of the glossiness.
        let converted = grid.material(|index| {
            let (color, gloss) = (diffuse.at(&grid, index), specular.at(&grid, index));
            let (base, metallic) = metallic_roughness(color.truncate(), gloss.truncate());
            (base.extend(color.w), 1.0 - glossiness * gloss.w, metallic)
        });
        surface.color = Some(converted.base_color);
        surface.metallic = Some(converted.metallic);
        if has_gloss_image {
            surface.roughness = Some(converted.roughness);
            principled.roughness = 1.0;
        }
        let kind = MaterialKind::Principled(principled);
        Ok(Reflection { kind, surface, base_color: Vec3::ONE, alpha })
    }

    /// Surface with a texture of colour and opacity.
    fn colored(&mut self, info: &Json, reading: &mut Reading) -> Result<Surface> {
        let color = self.texture(info, COLOR, reading)?;
        let texture = color.as_ref().and_then(opacity_of);
        let opacity = Opacity { texture, ..Opacity::default() };
        Ok(Surface { color, opacity, ..Surface::default() })
    }

    /// Turns a surface that transmits most light into glass, or one that `is_glass` says is.
    fn transmission(
        &mut self,
        reading: &mut Reading,
        found: &mut Reflection,
        is_glass: Option<bool>,
    ) -> Result<()> {
        let json = reading.json;
        let transmission = &json["extensions"]["KHR_materials_transmission"];
        let MaterialKind::Principled(Principled { metallic, roughness, ior, .. }) = found.kind
        else {
            return Ok(());
        };
        let mean = |texture: &Option<TextureUse>| texture.as_ref().map(TextureUse::mean);
        let mean_number = |texture: &Option<TextureUse>| mean(texture).map_or(1.0, |mean| mean[0]);
        let texture = self.texture(&transmission["transmissionTexture"], RED, reading)?;
        reading.ignore_if(is_glass.is_some(), features::GLTF_TRANSMISSION_TEXTURE);
        let transmitted = share(transmission, "transmissionFactor", 0.0)
            * mean_number(&texture)
            * (1.0 - metallic * mean_number(&found.surface.metallic));
        if !is_glass.unwrap_or(transmitted >= GLASS) {
            let is_lost = is_glass.is_none() && transmitted > 0.0;
            reading.ignore_if(is_lost, features::GLTF_LOW_TRANSMISSION);
            return Ok(());
        }
        let tint = found.base_color;
        found.surface.metallic = None;
        let volume = &json["extensions"]["KHR_materials_volume"];
        let thickness = number(volume, "thicknessFactor", 0.0);
        let reflectance = Vec3::ONE;
        found.kind = if thickness > 0.0 {
            let attenuation = color(volume, "attenuationColor", [1.0; 3]);
            let distance = number(volume, "attenuationDistance", f32::INFINITY);
            // A colour of 0 would absorb without bound.
            let attenuation = attenuation.max(Vec3::splat(f32::MIN_POSITIVE));
            MaterialKind::Dielectric {
                ior,
                alpha: roughness * roughness,
                reflectance,
                transmittance: tint,
                absorption: (-attenuation.ln() / distance.max(1e-6)).max(Vec3::ZERO),
            }
        } else {
            // A smooth pane is nearly the same, and lets shadow rays through.
            let rough = roughness * mean_number(&found.surface.roughness) > VISIBLE_ROUGHNESS;
            found.surface.roughness = found.surface.roughness.take().filter(|_| rough);
            let alpha = if rough { roughness * roughness } else { 0.0 };
            MaterialKind::ThinDielectric { ior, alpha, reflectance, transmittance: tint }
        };
        Ok(())
    }

    /// Turns a surface that is no glass into a sheet, where it scatters light to its other side.
    fn diffuse_transmission(
        &mut self,
        reading: &mut Reading,
        found: &mut Reflection,
    ) -> Result<()> {
        let json = reading.json;
        let model = &json["extensions"]["KHR_materials_diffuse_transmission"];
        let MaterialKind::Principled(Principled { base_color, metallic, specular, .. }) =
            found.kind
        else {
            return Ok(());
        };
        let metal = found.surface.metallic.as_ref().map_or(1.0, |texture| texture.mean()[0]);
        let factor = share(model, "diffuseTransmissionFactor", 0.0);
        let below = 1.0 - metallic * metal;
        if factor * below < LEAST_TRANSMISSION {
            return Ok(());
        }
        let through = self.texture(&model["diffuseTransmissionTexture"], ALPHA, reading)?;
        let tint = self.texture(&model["diffuseTransmissionColorTexture"], COLOR, reading)?;
        let tint_factor = color(model, "diffuseTransmissionColorFactor", [1.0; 3]);
        let through = Value::of(through, Vec3::splat(factor));
        let base = Value::of(found.surface.color.take(), below * base_color);
        let tint = Value::of(tint, below * tint_factor);
        let reflected = |[base, through]: [Vec3; 2]| base * (1.0 - through);
        let (reflected, is_mean) = Value::combined([base, through.clone()], reflected);
        let (transmitted, is_tint_mean) =
            Value::combined([tint, through], |[tint, through]| tint * through);
        let (kind, image, is_ratio_mean) = sheet([reflected, transmitted]);
        let has_volume = !json["extensions"]["KHR_materials_volume"].is_null();
        let is_bare = specular == 0.0 && below == 1.0 && !has_volume;
        let has_own_pattern = is_mean || is_tint_mean || is_ratio_mean;
        reading.ignore_if(!is_bare || has_own_pattern, features::GLTF_SHEET);
        found.kind = kind;
        found.surface.color = image;
        found.surface.roughness = None;
        found.surface.metallic = None;
        Ok(())
    }

    /// Covers a metallic-roughness material by `KHR_materials_clearcoat`.
    fn coat(&mut self, reading: &mut Reading, found: &mut Reflection) -> Result<()> {
        let json = reading.json;
        let coat = &json["extensions"]["KHR_materials_clearcoat"];
        let mut is_alike = json["normalTexture"] == coat["clearcoatNormalTexture"];
        let mut mean = |key: &str, channels, reading: &mut Reading| {
            let texture = self.texture(&coat[key], channels, reading)?;
            is_alike &= texture.is_none();
            Ok(texture.map_or(1.0, |texture| texture.mean()[0]))
        };
        let weight = share(coat, "clearcoatFactor", 0.0) * mean("clearcoatTexture", RED, reading)?;
        let roughness = share(coat, "clearcoatRoughnessFactor", 0.0)
            * mean("clearcoatRoughnessTexture", GREEN, reading)?;
        if weight == 0.0 {
            return Ok(());
        }
        match &mut found.kind {
            MaterialKind::Principled(own) => {
                (own.coat_weight, own.coat_roughness) = (weight, roughness);
                reading.ignore_if(!is_alike, features::GLTF_CLEARCOAT_TEXTURE);
            }
            _ => reading.ignore(features::GLTF_CLEARCOAT),
        }
        Ok(())
    }

    /// Covers a metallic-roughness material without a coat by `KHR_materials_sheen`.
    fn sheen(&mut self, reading: &mut Reading, found: &mut Reflection) -> Result<()> {
        let json = reading.json;
        let sheen = &json["extensions"]["KHR_materials_sheen"];
        let color = color(sheen, "sheenColorFactor", [0.0; 3]);
        if color == Vec3::ZERO {
            return Ok(());
        }
        match &mut found.kind {
            MaterialKind::Principled(own) if own.coat_weight == 0.0 => {
                let tint = self.texture(&sheen["sheenColorTexture"], COLOR, reading)?;
                let rough = self.texture(&sheen["sheenRoughnessTexture"], ALPHA, reading)?;
                own.sheen_color = color * mean(&tint);
                own.sheen_roughness = share(sheen, "sheenRoughnessFactor", 0.0) * mean(&rough).x;
                reading.ignore_if(tint.or(rough).is_some(), features::GLTF_SHEEN_TEXTURE);
            }
            _ => reading.ignore(features::GLTF_SHEEN),
        }
        Ok(())
    }

    /// Stretches the highlights of a metallic-roughness material by `KHR_materials_anisotropy`.
    fn anisotropy(&mut self, reading: &mut Reading, found: &mut Reflection) -> Result<()> {
        let json = reading.json;
        let model = &json["extensions"]["KHR_materials_anisotropy"];
        let strength = share(model, "anisotropyStrength", 0.0);
        if strength == 0.0 {
            return Ok(());
        }
        if !matches!(found.kind, MaterialKind::Principled(_)) {
            reading.ignore(features::GLTF_ANISOTROPY);
            return Ok(());
        }
        let rotation = number(model, "anisotropyRotation", 0.0);
        let direction = self.texture(&model["anisotropyTexture"], VECTOR, reading)?;
        found.surface.anisotropy = Anisotropy { strength, rotation, direction };
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
            let place = &reading.place;
            return Err(
                self.error(format!("{place}: expected a finite emission, found {radiance}"))
            );
        }
        let texture = self.texture(&json["emissiveTexture"], COLOR, reading)?;
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
