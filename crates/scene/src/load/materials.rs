//! `[[material]]` → validated materials with their textures.

use std::{
    collections::{BTreeSet, HashMap},
    path::PathBuf,
};

use glam::Vec3;

use super::{FINITE, Loader, MIN_ALPHA};
use crate::{
    Scene,
    error::Result,
    file::{MaterialEntry, MaterialKeys, MaterialKindEntry, TextureEntry, Textured},
    material::{ConductorFresnel, Emission, Material, MaterialKind, Opacity, Principled, Surface},
    measured::MeasuredFiles,
    texture::{Encoding, Texture, TextureCache, TextureUse},
    transform::sine_cosine_deg,
};

/// Files that materials name, each loaded once.
#[derive(Default)]
struct Loaded {
    textures: TextureCache,
    measured: MeasuredFiles,
    inputs: Vec<PathBuf>,
    warnings: Vec<String>,
}

/// Value of a key without its texture, and the texture.
type Value<T> = (T, Option<TextureUse>);

impl Loader<'_> {
    pub(super) fn materials(&self, entries: &[MaterialEntry], scene: &mut Scene) -> Result<()> {
        let mut loaded = Loaded::default();
        let mut paths = Vec::new();
        for name in entries.iter().flat_map(MaterialEntry::textures).map(|entry| &entry.texture) {
            let path = self.file(name);
            if let Some(image) = self.arrays.images.get(name) {
                let label = path.display().to_string();
                let texture = Texture::of_image(&label, image, &mut loaded.warnings)
                    .map_err(|message| self.error(format!("{}: {message}", name.display())))?;
                loaded.textures.insert(&path, texture);
            } else {
                paths.push(path);
            }
        }
        loaded.textures.load_all(paths, &mut loaded.warnings)?;
        let mut lines = HashMap::new();
        for entry in entries {
            let name = &entry.keys.name;
            let label = format!("material `{name}` (line {})", entry.line);
            if let Some(first) = lines.insert(name, entry.line) {
                return Err(self
                    .error(format!("{label}: the name is taken by the material of line {first}")));
            }
            let mut surface = self.surface(&label, &entry.keys, &mut loaded)?;
            let kind = self.material_kind(&label, &entry.kind, &mut surface, &mut loaded)?;
            scene.materials.push(Material { name: name.clone(), kind, surface });
        }
        let of_arrays: BTreeSet<_> =
            self.arrays.images.keys().map(|name| self.file(name)).collect();
        scene.inputs.extend(loaded.textures.files().difference(&of_arrays).cloned());
        scene.inputs.append(&mut loaded.inputs);
        scene.warnings.append(&mut loaded.warnings);
        Ok(())
    }

    /// Reads the keys that all types share.
    fn surface(&self, label: &str, keys: &MaterialKeys, loaded: &mut Loaded) -> Result<Surface> {
        let mut surface = Surface {
            vertex_color: keys.vertex_color,
            two_sided: keys.two_sided,
            ..Surface::default()
        };
        if let Some(entry) = &keys.normal {
            self.check(entry.factor.is_none(), || {
                format!("{label}: normal: a normal map has a strength, found factor")
            })?;
            let strength = entry.strength.unwrap_or(1.0);
            self.check_range(&format!("{label}: normal.strength"), &[strength], FINITE)?;
            surface.normal =
                Some(self.texture_use(label, "normal", entry, Encoding::Linear, loaded)?);
            surface.normal_scale = strength;
        }
        if let Some(opacity) = &keys.opacity {
            let (factor, texture) = self.number(label, "opacity", opacity, (0.0, 1.0), loaded)?;
            surface.opacity = Opacity { factor, texture, cutoff: None };
        }
        if let Some(cutoff) = keys.opacity_cutoff {
            self.check_range(&format!("{label}: opacity_cutoff"), &[cutoff], (0.0, 1.0))?;
            surface.opacity.cutoff = Some(cutoff);
        }
        if let Some(emission) = &keys.emission {
            let (radiance, texture) =
                self.color(label, "emission", emission, (0.0, f32::MAX), loaded)?;
            let two_sided = keys.emission_two_sided;
            surface.emission = Some(Emission { radiance, texture, two_sided });
        }
        self.check(keys.emission.is_some() || !keys.emission_two_sided, || {
            format!("{label}: emission_two_sided needs emission")
        })?;
        Ok(surface)
    }

    fn material_kind(
        &self,
        label: &str,
        kind: &MaterialKindEntry,
        surface: &mut Surface,
        loaded: &mut Loaded,
    ) -> Result<MaterialKind> {
        let mut share = |key: &str, value: &Textured<[f32; 3]>, surface: &mut Surface| {
            let (color, texture) = self.color(label, key, value, (0.0, 1.0), loaded)?;
            surface.color = texture;
            Ok(color)
        };
        Ok(match kind {
            MaterialKindEntry::Diffuse(entry) => MaterialKind::Diffuse {
                reflectance: share("reflectance", &entry.reflectance, surface)?,
            },
            MaterialKindEntry::Mirror(entry) => MaterialKind::Mirror {
                reflectance: share("reflectance", &entry.reflectance, surface)?,
            },
            MaterialKindEntry::Plastic(entry) => {
                self.check_range(&format!("{label}: ior"), &[entry.ior], (1.01, 4.0))?;
                MaterialKind::Plastic {
                    diffuse: share("diffuse", &entry.diffuse, surface)?,
                    alpha: self.one_alpha(label, "plastic", entry.alpha, &entry.roughness)?,
                    ior: entry.ior,
                }
            }
            MaterialKindEntry::Conductor(entry) => {
                let fresnel = match (&entry.reflectance, entry.eta, entry.k) {
                    (Some(value), None, None) => ConductorFresnel::Schlick {
                        reflectance: share("reflectance", value, surface)?,
                    },
                    (None, Some(eta), Some(k)) => ConductorFresnel::Exact {
                        eta: self.vector(&format!("{label}: eta"), eta, (0.01, 100.0))?,
                        k: self.vector(&format!("{label}: k"), k, (0.0, 100.0))?,
                    },
                    _ => {
                        let expected = "a conductor needs either reflectance, or eta and k";
                        return Err(self.error(format!("{label}: {expected}")));
                    }
                };
                let alpha = if let Some(value @ Textured::Texture(_)) = &entry.roughness {
                    self.check(entry.alpha.is_none(), || {
                        format!("{label}: expected exactly one of alpha and roughness, found both")
                    })?;
                    let range = (MIN_ALPHA.sqrt(), 1.0);
                    let (roughness, texture) =
                        self.number(label, "roughness", value, range, loaded)?;
                    surface.roughness = texture;
                    (roughness * roughness).max(MIN_ALPHA)
                } else {
                    self.one_alpha(label, "conductor", entry.alpha, &entry.roughness)?
                };
                MaterialKind::Conductor { alpha, fresnel }
            }
            MaterialKindEntry::Principled(entry) => {
                let base_color = share("base_color", &entry.base_color, surface)?;
                self.check_range(&format!("{label}: ior"), &[entry.ior], (1.0, 4.0))?;
                self.check_range(&format!("{label}: specular"), &[entry.specular], (0.0, 1.0))?;
                let (what, factor) = (format!("{label}: specular_color"), (0.0, f32::MAX));
                let specular_color = self.vector(&what, entry.specular_color, factor)?;
                let (metallic, texture) =
                    self.number(label, "metallic", &entry.metallic, (0.0, 1.0), loaded)?;
                surface.metallic = texture;
                let (roughness, texture) =
                    self.number(label, "roughness", &entry.roughness, (0.0, 1.0), loaded)?;
                surface.roughness = texture;
                MaterialKind::Principled(Principled {
                    base_color,
                    metallic,
                    roughness,
                    ior: entry.ior,
                    specular: entry.specular,
                    specular_color,
                })
            }
            MaterialKindEntry::Dielectric(entry) => {
                let ior = entry.ior;
                self.check_range(&format!("{label}: ior"), &[ior], (0.2, 5.0))?;
                let what = format!("{label}: absorption");
                let absorption = self.vector(&what, entry.absorption, (0.0, 1e6))?;
                let is_smooth = entry.alpha.unwrap_or(0.0) == 0.0 && entry.roughness.is_none();
                let alpha = if is_smooth {
                    0.0
                } else {
                    self.check((ior - 1.0).abs() >= 0.01, || {
                        format!(
                            "{label}: ior: a rough dielectric of index {ior} bends no light; expected \
                             an index at least 0.01 from 1, or no roughness"
                        )
                    })?;
                    self.one_alpha(label, "dielectric", entry.alpha, &entry.roughness)?
                };
                MaterialKind::Dielectric {
                    ior,
                    alpha,
                    reflectance: self.share(label, "reflectance", entry.reflectance)?,
                    transmittance: self.share(label, "transmittance", entry.transmittance)?,
                    absorption,
                }
            }
            MaterialKindEntry::ThinDielectric(entry) => {
                self.check_range(&format!("{label}: ior"), &[entry.ior], (1.0, 4.0))?;
                MaterialKind::ThinDielectric {
                    ior: entry.ior,
                    reflectance: self.share(label, "reflectance", entry.reflectance)?,
                    transmittance: self.share(label, "transmittance", entry.transmittance)?,
                }
            }
            MaterialKindEntry::Measured(entry) => {
                let path = self.file(&entry.file);
                let Loaded { measured, inputs, warnings, .. } = loaded;
                let table = measured.table(&path, inputs, warnings)?;
                MaterialKind::Measured { path, table }
            }
        })
    }

    /// Reads three numbers 0…1.
    fn share(&self, label: &str, key: &str, share: [f32; 3]) -> Result<Vec3> {
        self.vector(&format!("{label}: {key}"), share, (0.0, 1.0))
    }

    /// Reads a colour or a texture of colours with its factor.
    fn color(
        &self,
        label: &str,
        key: &str,
        value: &Textured<[f32; 3]>,
        range: (f32, f32),
        loaded: &mut Loaded,
    ) -> Result<Value<Vec3>> {
        let (color, texture) = match value {
            Textured::Uniform(color) => (*color, None),
            Textured::Texture(entry) => {
                let used = self.texture_use(label, key, entry, Encoding::Srgb, loaded)?;
                (entry.factor.unwrap_or_default().0, Some(used))
            }
        };
        let factor = if texture.is_some() { ".factor" } else { "" };
        Ok((self.vector(&format!("{label}: {key}{factor}"), color, range)?, texture))
    }

    /// Reads a number or a texture of numbers with its factor.
    fn number(
        &self,
        label: &str,
        key: &str,
        value: &Textured<f32>,
        range: (f32, f32),
        loaded: &mut Loaded,
    ) -> Result<Value<f32>> {
        let entry = match value {
            Textured::Uniform(number) => {
                self.check_range(&format!("{label}: {key}"), &[*number], range)?;
                return Ok((*number, None));
            }
            Textured::Texture(entry) => entry,
        };
        let [factor, green, blue] = entry.factor.unwrap_or_default().0;
        self.check_range(&format!("{label}: {key}.factor"), &[factor], range)?;
        self.check(factor == green && green == blue, || {
            format!("{label}: {key}.factor: expected one number, found {:?}", [factor, green, blue])
        })?;
        let used = self.texture_use(label, key, entry, Encoding::Linear, loaded)?;
        Ok((factor, Some(used)))
    }

    /// GGX width of a material whose roughness is the same everywhere.
    fn one_alpha(
        &self,
        label: &str,
        kind: &str,
        alpha: Option<f32>,
        roughness: &Option<Textured<f32>>,
    ) -> Result<f32> {
        match (alpha, roughness) {
            (Some(alpha), None) => {
                self.check_range(&format!("{label}: alpha"), &[alpha], (MIN_ALPHA, 1.0))?;
                Ok(alpha)
            }
            (None, Some(Textured::Uniform(roughness))) => {
                let range = (MIN_ALPHA.sqrt(), 1.0);
                self.check_range(&format!("{label}: roughness"), &[*roughness], range)?;
                Ok((roughness * roughness).max(MIN_ALPHA))
            }
            (None, Some(Textured::Texture(_))) => Err(self.error(format!(
                "{label}: roughness: expected one number, found a texture; the tables of a {kind} are \
                 made for one roughness: use type = \"principled\""
            ))),
            (alpha, _) => {
                let found = if alpha.is_some() { "both" } else { "neither" };
                Err(self.error(format!(
                    "{label}: expected exactly one of alpha and roughness, found {found}"
                )))
            }
        }
    }

    /// Places an image on a surface. Its factor belongs to the property, whose default encoding is
    /// `encoding`.
    fn texture_use(
        &self,
        label: &str,
        key: &str,
        entry: &TextureEntry,
        encoding: Encoding,
        loaded: &mut Loaded,
    ) -> Result<TextureUse> {
        self.check(key == "normal" || entry.strength.is_none(), || {
            format!("{label}: {key}: strength is for `normal`; expected factor")
        })?;
        let limit = (-1e6, 1e6);
        self.check_range(&format!("{label}: {key}.scale"), &entry.scale.0, limit)?;
        self.check_range(&format!("{label}: {key}.offset"), &entry.offset, limit)?;
        self.check_range(&format!("{label}: {key}.rotate_deg"), &[entry.rotate_deg], FINITE)?;
        let path = self.file(&entry.texture);
        let texture = loaded.textures.load(&path, &mut loaded.warnings)?;
        Ok(TextureUse {
            channels: entry.channel.unwrap_or_default(),
            encoding: match entry.linear {
                None => encoding,
                Some(true) => Encoding::Linear,
                Some(false) => Encoding::Srgb,
            },
            image_from_uv: image_from_uv(entry),
            wrap: [entry.wrap; 2],
            interpolation: entry.interpolation,
            ..TextureUse::new(texture)
        })
    }
}

/// Image coordinates, from the upper left corner, of texture coordinates, from the lower left one.
fn image_from_uv(entry: &TextureEntry) -> [[f32; 3]; 2] {
    let (sine, cosine) = sine_cosine_deg(entry.rotate_deg);
    let offset = entry.offset.map(f64::from);
    let row = |scale: f32, along: [f64; 2]| {
        let [u, v] = along.map(|share| f64::from(scale) * share);
        [u, v, -(u * offset[0] + v * offset[1])]
    };
    let [scale_u, scale_v] = entry.scale.0;
    let right = row(scale_u, [cosine, sine]);
    let up = row(scale_v, [-sine, cosine]);
    let down = [-up[0], -up[1], 1.0 - up[2]];
    [right, down].map(|row| row.map(|number| number as f32))
}
