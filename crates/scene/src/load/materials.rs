//! `[[material]]` → validated materials with their textures.

use std::{
    collections::{BTreeSet, HashMap},
    path::PathBuf,
};

use glam::Vec3;

use super::{FINITE, Loader, MIN_ALPHA};
use crate::{
    Scene,
    coat::COAT_IOR,
    error::{Error, Result},
    file::{MaterialEntry, MaterialKeys, MaterialKindEntry, TextureEntry, Textured},
    material::{
        Anisotropy, ConductorFresnel, Distribution, Emission, Material, MaterialKind, Opacity,
        Principled, Surface,
    },
    measured::MeasuredFiles,
    texture::{Encoding, Texture, TextureCache, TextureUse},
    transform::sine_cosine_deg,
};

/// Value of a key without its texture, and the texture.
type Value<T> = (T, Option<TextureUse>);

/// Range of shares and reflectances.
const SHARE: (f32, f32) = (0.0, 1.0);

impl Loader<'_> {
    pub(super) fn materials(&self, entries: &[MaterialEntry], scene: &mut Scene) -> Result<()> {
        let mut textures = TextureCache::default();
        let mut paths = Vec::new();
        for name in entries.iter().flat_map(MaterialEntry::textures).map(|entry| &entry.texture) {
            let path = self.file(name);
            if let Some(image) = self.arrays.images.get(name) {
                let label = path.display().to_string();
                let texture = Texture::of_image(&label, image, &mut scene.warnings)
                    .map_err(|message| self.error(format!("{}: {message}", name.display())))?;
                textures.insert(&path, texture);
            } else {
                paths.push(path);
            }
        }
        textures.load_all(paths, &mut scene.warnings)?;
        let of_arrays: BTreeSet<_> =
            self.arrays.images.keys().map(|name| self.file(name)).collect();
        scene.inputs.extend(textures.files().difference(&of_arrays).cloned());
        let mut reader = Reader {
            loader: self,
            textures,
            measured: MeasuredFiles::default(),
            inputs: &mut scene.inputs,
            warnings: &mut scene.warnings,
            label: String::new(),
            surface: Surface::default(),
        };
        let mut lines = HashMap::new();
        for entry in entries {
            let name = &entry.keys.name;
            reader.label = format!("material `{name}` (line {})", entry.line);
            if let Some(first) = lines.insert(name, entry.line) {
                let message = format!("the name is taken by the material of line {first}");
                return Err(reader.error(&message));
            }
            reader.read_surface(&entry.keys)?;
            let kind = reader.kind(&entry.kind)?;
            let can_stretch = matches!(
                kind,
                MaterialKind::Conductor { .. }
                    | MaterialKind::Principled(_)
                    | MaterialKind::Measured { .. }
            );
            let message = "anisotropy is for conductor and principled materials";
            reader.check(can_stretch || reader.surface.anisotropy.strength == 0.0, message)?;
            let has_distribution = matches!(
                kind,
                MaterialKind::Conductor { .. }
                    | MaterialKind::Plastic { .. }
                    | MaterialKind::Dielectric { .. }
            );
            let is_default = reader.surface.distribution == Distribution::default();
            let message = "distribution is for conductor, plastic and dielectric materials";
            reader.check(has_distribution || is_default, message)?;
            let surface = std::mem::take(&mut reader.surface);
            scene.materials.push(Material { name: name.clone(), kind, surface });
        }
        Ok(())
    }
}

/// Reader of entries, which loads each file once.
struct Reader<'a> {
    loader: &'a Loader<'a>,
    textures: TextureCache,
    measured: MeasuredFiles,
    inputs: &'a mut Vec<PathBuf>,
    warnings: &'a mut Vec<String>,
    /// Name and line of the entry, for messages.
    label: String,
    /// Surface of the entry as far as it has been read.
    surface: Surface,
}

impl Reader<'_> {
    fn error(&self, message: &str) -> Error {
        self.loader.error(format!("{}: {message}", self.label))
    }

    fn check(&self, holds: bool, message: &str) -> Result<()> {
        if holds { Ok(()) } else { Err(self.error(message)) }
    }

    fn check_range(&self, key: &str, values: &[f32], range: (f32, f32)) -> Result<()> {
        self.loader.check_range(&format!("{}: {key}", self.label), values, range)
    }

    fn vector(&self, key: &str, values: [f32; 3], range: (f32, f32)) -> Result<Vec3> {
        self.check_range(key, &values, range)?;
        Ok(Vec3::from_array(values))
    }

    /// Reads the keys that all types share.
    fn read_surface(&mut self, keys: &MaterialKeys) -> Result<()> {
        self.surface.vertex_color = keys.vertex_color;
        self.surface.two_sided = keys.two_sided;
        self.surface.distribution = keys.distribution;
        if let Some(entry) = &keys.normal {
            let message = "normal: a normal map has a strength, found factor";
            self.check(entry.factor.is_none(), message)?;
            let strength = entry.strength.unwrap_or(1.0);
            self.check_range("normal.strength", &[strength], FINITE)?;
            self.surface.normal = Some(self.texture_use("normal", entry, Encoding::Linear)?);
            self.surface.normal_scale = strength;
        }
        let (strength, direction) = self.number("anisotropy", &keys.anisotropy, SHARE)?;
        self.check_range("anisotropy_rotate_deg", &[keys.anisotropy_rotate_deg], FINITE)?;
        let rotation = keys.anisotropy_rotate_deg.to_radians();
        self.surface.anisotropy = Anisotropy { strength, rotation, direction };
        if let Some(opacity) = &keys.opacity {
            let (factor, texture) = self.number("opacity", opacity, SHARE)?;
            self.surface.opacity = Opacity { factor, texture, cutoff: None };
        }
        if let Some(cutoff) = keys.opacity_cutoff {
            self.check_range("opacity_cutoff", &[cutoff], SHARE)?;
            self.surface.opacity.cutoff = Some(cutoff);
        }
        if let Some(emission) = &keys.emission {
            let (radiance, texture) = self.color("emission", emission, (0.0, f32::MAX))?;
            let two_sided = keys.emission_two_sided;
            self.surface.emission = Some(Emission { radiance, texture, two_sided });
        }
        let has_side = keys.emission.is_some() || !keys.emission_two_sided;
        self.check(has_side, "emission_two_sided needs emission")
    }

    fn kind(&mut self, kind: &MaterialKindEntry) -> Result<MaterialKind> {
        Ok(match kind {
            MaterialKindEntry::Diffuse(entry) => MaterialKind::Diffuse {
                reflectance: self.share("reflectance", &entry.reflectance)?,
            },
            MaterialKindEntry::DiffuseTransmission(entry) => {
                let reflectance = self.share("reflectance", &entry.reflectance)?;
                let transmittance = self.vector("transmittance", entry.transmittance, SHARE)?;
                let most = (reflectance + transmittance).max_element();
                let message = format!(
                    "reflectance and transmittance: expected a sum of at most 1, found {most}"
                );
                self.check(most < 1.0 + 1e-5, &message)?;
                MaterialKind::DiffuseTransmission { reflectance, transmittance }
            }
            MaterialKindEntry::Mirror(entry) => {
                MaterialKind::Mirror { reflectance: self.share("reflectance", &entry.reflectance)? }
            }
            MaterialKindEntry::Plastic(entry) => {
                self.check_range("ior", &[entry.ior], COAT_IOR)?;
                MaterialKind::Plastic {
                    diffuse: self.share("diffuse", &entry.diffuse)?,
                    alpha: self.alpha(Some("plastic"), entry.alpha, &entry.roughness)?,
                    ior: entry.ior,
                }
            }
            MaterialKindEntry::Conductor(entry) => {
                let fresnel = match (&entry.reflectance, entry.eta, entry.k) {
                    (Some(value), None, None) => {
                        ConductorFresnel::Schlick { reflectance: self.share("reflectance", value)? }
                    }
                    (value, Some(eta), Some(k)) => ConductorFresnel::Exact {
                        reflectance: match value {
                            Some(value) => self.share("reflectance", value)?,
                            None => Vec3::ONE,
                        },
                        eta: self.vector("eta", eta, (0.01, 100.0))?,
                        k: self.vector("k", k, (0.0, 100.0))?,
                    },
                    _ => {
                        let message = "a conductor needs reflectance, or eta and k, or all three";
                        return Err(self.error(message));
                    }
                };
                let alpha = self.alpha(None, entry.alpha, &entry.roughness)?;
                MaterialKind::Conductor { alpha, fresnel }
            }
            MaterialKindEntry::Principled(entry) => {
                let base_color = self.share("base_color", &entry.base_color)?;
                self.check_range("ior", &[entry.ior], (1.0, 4.0))?;
                self.check_range("specular", &[entry.specular], SHARE)?;
                let factor = (0.0, f32::MAX);
                let specular_color = self.vector("specular_color", entry.specular_color, factor)?;
                let (metallic, texture) = self.number("metallic", &entry.metallic, SHARE)?;
                self.surface.metallic = texture;
                let (roughness, texture) = self.number("roughness", &entry.roughness, SHARE)?;
                self.surface.roughness = texture;
                let (coat_weight, coat_roughness) = (entry.coat_weight, entry.coat_roughness);
                self.check_range("coat_weight", &[coat_weight], SHARE)?;
                self.check_range("coat_roughness", &[coat_roughness], SHARE)?;
                let sheen_color = self.vector("sheen_color", entry.sheen_color, SHARE)?;
                self.check_range("sheen_roughness", &[entry.sheen_roughness], SHARE)?;
                let is_single = coat_weight == 0.0 || sheen_color == Vec3::ZERO;
                self.check(is_single, "expected a coat or a sheen, found both")?;
                MaterialKind::Principled(Principled {
                    base_color,
                    metallic,
                    roughness,
                    ior: entry.ior,
                    specular: entry.specular,
                    specular_color,
                    coat_weight,
                    coat_roughness,
                    sheen_color,
                    sheen_roughness: entry.sheen_roughness,
                })
            }
            MaterialKindEntry::Dielectric(entry) => {
                let ior = entry.ior;
                self.check_range("ior", &[ior], (0.2, 5.0))?;
                let absorption = self.vector("absorption", entry.absorption, (0.0, 1e6))?;
                let alpha = self.glass_alpha("dielectric", entry.alpha, &entry.roughness)?;
                let message = format!(
                    "ior: a rough dielectric of index {ior} bends no light; expected an index at least \
                     0.01 from 1, or no roughness"
                );
                self.check(alpha == 0.0 || (ior - 1.0).abs() >= 0.01, &message)?;
                MaterialKind::Dielectric {
                    ior,
                    alpha,
                    reflectance: self.vector("reflectance", entry.reflectance, SHARE)?,
                    transmittance: self.share("transmittance", &entry.transmittance)?,
                    absorption,
                }
            }
            MaterialKindEntry::ThinDielectric(entry) => {
                self.check_range("ior", &[entry.ior], (1.0, 4.0))?;
                MaterialKind::ThinDielectric {
                    ior: entry.ior,
                    alpha: self.glass_alpha("thin_dielectric", entry.alpha, &entry.roughness)?,
                    reflectance: self.vector("reflectance", entry.reflectance, SHARE)?,
                    transmittance: self.share("transmittance", &entry.transmittance)?,
                }
            }
            MaterialKindEntry::Measured(entry) => {
                let path = self.loader.file(&entry.file);
                let table = self.measured.table(&path, self.inputs, self.warnings)?;
                let message = "anisotropy is that of the file of a measured material";
                self.check(self.surface.anisotropy.strength == 0.0, message)?;
                self.surface.anisotropy.strength = f32::from(table.has_turns());
                MaterialKind::Measured { path, table }
            }
        })
    }

    /// Reads the colour of the model, 0…1, whose texture is that of the surface.
    fn share(&mut self, key: &str, value: &Textured<[f32; 3]>) -> Result<Vec3> {
        let (color, texture) = self.color(key, value, SHARE)?;
        self.surface.color = texture;
        Ok(color)
    }

    /// Reads a colour or a texture of colours with its factor.
    fn color(
        &mut self,
        key: &str,
        value: &Textured<[f32; 3]>,
        range: (f32, f32),
    ) -> Result<Value<Vec3>> {
        let entry = match value {
            Textured::Uniform(color) => return Ok((self.vector(key, *color, range)?, None)),
            Textured::Texture(entry) => entry,
        };
        let used = self.texture_use(key, entry, Encoding::Srgb)?;
        let factor = entry.factor.unwrap_or_default().0;
        Ok((self.vector(&format!("{key}.factor"), factor, range)?, Some(used)))
    }

    /// Reads a number or a texture of numbers with its factor.
    fn number(
        &mut self,
        key: &str,
        value: &Textured<f32>,
        range: (f32, f32),
    ) -> Result<Value<f32>> {
        let entry = match value {
            Textured::Uniform(number) => {
                self.check_range(key, &[*number], range)?;
                return Ok((*number, None));
            }
            Textured::Texture(entry) => entry,
        };
        let [factor, green, blue] = entry.factor.unwrap_or_default().0;
        self.check_range(&format!("{key}.factor"), &[factor], range)?;
        let found = [factor, green, blue];
        let message = format!("{key}.factor: expected one number, found {found:?}");
        self.check(factor == green && green == blue, &message)?;
        Ok((factor, Some(self.texture_use(key, entry, Encoding::Linear)?)))
    }

    /// The width of glass, 0 where it is smooth.
    fn glass_alpha(
        &mut self,
        kind: &str,
        alpha: Option<f32>,
        roughness: &Option<Textured<f32>>,
    ) -> Result<f32> {
        let is_smooth = alpha.unwrap_or(0.0) == 0.0 && roughness.is_none();
        if is_smooth { Ok(0.0) } else { self.alpha(Some(kind), alpha, roughness) }
    }

    /// Reads a GGX width. The tables of the kind `tabulated` are made for one roughness.
    fn alpha(
        &mut self,
        tabulated: Option<&str>,
        alpha: Option<f32>,
        roughness: &Option<Textured<f32>>,
    ) -> Result<f32> {
        match (alpha, roughness, tabulated) {
            (Some(alpha), None, _) => {
                self.check_range("alpha", &[alpha], (MIN_ALPHA, 1.0))?;
                Ok(alpha)
            }
            (None, Some(Textured::Texture(_)), Some(kind)) => Err(self.error(&format!(
                "roughness: expected one number, found a texture; the tables of a {kind} are made for \
                 one roughness: use type = \"principled\""
            ))),
            (None, Some(value), _) => {
                let range = (MIN_ALPHA.sqrt(), 1.0);
                let (roughness, texture) = self.number("roughness", value, range)?;
                self.surface.roughness = texture;
                Ok((roughness * roughness).max(MIN_ALPHA))
            }
            (alpha, ..) => {
                let found = if alpha.is_some() { "both" } else { "neither" };
                let expected = "expected exactly one of alpha and roughness";
                Err(self.error(&format!("{expected}, found {found}")))
            }
        }
    }

    /// Places an image on a surface. Its factor belongs to the property, whose default encoding is
    /// `encoding`.
    fn texture_use(
        &mut self,
        key: &str,
        entry: &TextureEntry,
        encoding: Encoding,
    ) -> Result<TextureUse> {
        let message = format!("{key}: strength is for `normal`; expected factor");
        self.check(key == "normal" || entry.strength.is_none(), &message)?;
        let limit = (-1e6, 1e6);
        self.check_range(&format!("{key}.scale"), &entry.scale.0, limit)?;
        self.check_range(&format!("{key}.offset"), &entry.offset, limit)?;
        self.check_range(&format!("{key}.rotate_deg"), &[entry.rotate_deg], FINITE)?;
        let path = self.loader.file(&entry.texture);
        let texture = self.textures.load(&path, self.warnings)?;
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
