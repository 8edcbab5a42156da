//! Textures of a scene description → constants and [`TextureUse`]s: images and what scales, inverts and
//! mixes them.

use std::{collections::HashMap, sync::Arc};

use glam::Vec3;
use half::f16;

use super::{
    directives::Description,
    parameters::{Entity, Kind, Log, Parameter},
    spectra,
};
use crate::{
    error::Result,
    features,
    import::Value,
    texture::{
        Channels, Encoding, Interpolation, Texels, Texture, TextureUse, Wrap, linear::has_alpha,
    },
};

/// Most textures that may refer to one another.
const MAX_DEPTH: usize = 16;

/// Textures of a scene, with the images read so far.
pub(super) struct Textures<'a> {
    description: &'a Description,
    /// Report of all that reads materials and lights.
    pub log: Log<'a>,
    images: HashMap<(String, String), Option<Arc<Texture>>>,
    /// Values of named textures, those of numbers apart.
    values: HashMap<(bool, String), Value>,
    /// Textures that refer to the one that is read.
    depth: usize,
}

impl<'a> Textures<'a> {
    /// Takes the textures of `description`.
    pub(super) fn new(description: &'a Description, log: Log<'a>) -> Self {
        Self { description, log, images: HashMap::new(), values: HashMap::new(), depth: 0 }
    }

    /// Spectrum of a parameter, constant or textured, if it is given.
    pub(super) fn spectrum(&mut self, entity: &Entity, name: &str) -> Result<Option<Value>> {
        self.value(entity, name, false)
    }

    /// Number of a parameter, constant or textured, if it is given.
    pub(super) fn number(&mut self, entity: &Entity, name: &str) -> Result<Option<Value>> {
        self.value(entity, name, true)
    }

    fn value(&mut self, entity: &Entity, name: &str, is_number: bool) -> Result<Option<Value>> {
        let kinds: &[Kind] = if is_number {
            &[Kind::Float, Kind::Integer, Kind::Texture]
        } else {
            &[Kind::Rgb, Kind::Spectrum, Kind::Blackbody, Kind::Texture]
        };
        let Some(parameter) = entity.find_of(name, kinds)? else { return Ok(None) };
        Ok(Some(match parameter.kind {
            Kind::Texture => self.named(parameter, is_number)?,
            Kind::Float | Kind::Integer => {
                Value::number(parameter.numbers().first().copied().unwrap_or(0.0))
            }
            _ => Value::Constant(spectra::reflectance(parameter, &mut self.log)?),
        }))
    }

    /// Texture that a parameter names.
    fn named(&mut self, parameter: &Parameter, is_number: bool) -> Result<Value> {
        let name = parameter.text();
        let key = (is_number, name.to_owned());
        let Some(entity) = self.description.textures.get(&key) else {
            let kind = if is_number { "float" } else { "spectrum" };
            let message = format!("parameter `{}`: there is no {kind} texture", parameter.name);
            return Err(parameter.place.error(format!("{message} `{name}`")));
        };
        if self.depth == MAX_DEPTH {
            let message = format!("more than {MAX_DEPTH} textures refer to one another");
            return Err(entity.error(message));
        }
        if let Some(value) = self.values.get(&key) {
            return Ok(value.clone());
        }
        self.depth += 1;
        let value = self.texture(entity, is_number);
        self.depth -= 1;
        let value = value?;
        self.log.unused(entity);
        self.values.insert(key, value.clone());
        Ok(value)
    }

    fn texture(&mut self, entity: &Entity, is_number: bool) -> Result<Value> {
        let of = |this: &mut Self, name: &str, otherwise: f64| {
            let value = this.value(entity, name, is_number)?;
            Ok(value.unwrap_or(Value::number(otherwise)))
        };
        match entity.name.as_str() {
            "imagemap" => self.image(entity, is_number),
            "constant" => of(self, "value", 1.0),
            "scale" => {
                let texture = of(self, "tex", 1.0)?;
                let scale = self.value(entity, "scale", true)?;
                Ok(match (texture, scale.unwrap_or(Value::number(1.0))) {
                    (texture, Value::Constant(factor)) => texture.affine(factor, Vec3::ZERO),
                    (texture, scale) => {
                        self.combined(entity, [texture, scale], |[texture, scale]| {
                            texture * mean(scale)
                        })
                    }
                })
            }
            "mix" | "directionmix" => {
                let (first, second) = (of(self, "tex1", 0.0)?, of(self, "tex2", 1.0)?);
                let amount = self.value(entity, "amount", true)?.unwrap_or(Value::number(0.5));
                if entity.name == "directionmix" {
                    self.ignore(entity, "its mean");
                }
                Ok(match (first, second, amount) {
                    (Value::Constant(constant), image, Value::Constant(amount)) => {
                        image.affine(amount, constant * (1.0 - amount))
                    }
                    (image, Value::Constant(constant), Value::Constant(amount)) => {
                        image.affine(1.0 - amount, constant * amount)
                    }
                    (first, second, amount) => {
                        self.combined(entity, [first, second, amount], |[first, second, amount]| {
                            first.lerp(second, mean(amount))
                        })
                    }
                })
            }
            "checkerboard" => {
                let (first, second) = (of(self, "tex1", 1.0)?, of(self, "tex2", 0.0)?);
                let is_flat = entity.number("dimension", 2.0)? == 2.0;
                match (first, second) {
                    (Value::Constant(first), Value::Constant(second)) if is_flat => {
                        let mapping = mapping(entity, &mut self.log)?;
                        Ok(Value::Image(checkerboard(first, second, mapping)))
                    }
                    (first, _) => {
                        self.ignore(entity, "its `tex1`");
                        Ok(first)
                    }
                }
            }
            "bilerp" | "dots" | "fbm" | "marble" | "windy" | "wrinkled" | "ptex" => {
                self.ignore(entity, "0.5");
                Ok(Value::number(0.5))
            }
            _ => Err(entity.error("expected a kind of texture that pbrt-v4 has")),
        }
    }

    /// Names a kind of texture, with all its parameters, as rendered by another value.
    fn ignore(&mut self, entity: &Entity, value: &str) {
        let name = format!("texture `{}`: {value} instead", entity.name);
        self.log.ignore_named(features::PBRT_TEXTURE, &name, &entity.place);
        entity.unused().for_each(drop);
    }

    /// Makes a value of others texel by texel.
    fn combined<const N: usize>(
        &mut self,
        entity: &Entity,
        values: [Value; N],
        of: impl Fn([Vec3; N]) -> Vec3 + Sync,
    ) -> Value {
        let (value, any_mean) = Value::combined(values, of);
        if any_mean {
            self.log.ignore(features::PBRT_TEXTURE_MIX, &entity.place);
        }
        value
    }

    fn image(&mut self, entity: &Entity, is_number: bool) -> Result<Value> {
        let file = entity.required("filename")?;
        let (encoding, gamma) = decoding(entity)?;
        let ([du, u], [dv, v]) = mapping(entity, &mut self.log)?;
        let Some(texture) = self.load(entity, file, gamma) else {
            entity.without_effect("filter maxanisotropy wrap scale invert");
            return Ok(Value::number(0.5));
        };
        let mut image = TextureUse {
            // v points up in pbrt, down in images.
            image_from_uv: [[u, 0.0, du], [0.0, -v, 1.0 - dv]],
            encoding,
            ..TextureUse::new(texture)
        };
        image.interpolation = match entity.string("filter")?.unwrap_or("bilinear") {
            "point" => Interpolation::Nearest,
            "bilinear" | "trilinear" | "ewa" | "EWA" => Interpolation::Bilinear,
            other => return Err(entity.error(format!("unknown filter `{other}`"))),
        };
        entity.optional("maxanisotropy")?;
        image.wrap = [match entity.string("wrap")?.unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "clamp" => Wrap::Clamp,
            other @ ("black" | "octahedralsphere") => {
                let name = format!("wrap `{other}` of a texture");
                self.log.ignore_named(features::PBRT_TEXTURE_WRAP, &name, &entity.place);
                Wrap::Clamp
            }
            other => return Err(entity.error(format!("unknown wrap mode `{other}`"))),
        }; 2];
        if is_number {
            // Deviation: pbrt takes opacity where the image has it, else the mean of the colours; here their
            // luminance is the number, but for roughness.
            image.channels =
                if has_alpha(&image.texture) { Channels::Alpha } else { Channels::Color };
        }
        let scale = entity.number("scale", 1.0)? as f32;
        let value = Value::Image(image).scaled(scale);
        if entity.boolean("invert", false)? {
            return Ok(value.affine(Vec3::NEG_ONE, Vec3::ONE));
        }
        Ok(value)
    }

    /// Reads an image file once for each exponent that decodes its 8-bit colours, if one does. A file that
    /// cannot be read is a warning and no texture.
    fn load(&mut self, entity: &Entity, file: &str, gamma: Option<f32>) -> Option<Arc<Texture>> {
        let key = (file.to_owned(), format!("{gamma:?}"));
        if let Some(texture) = self.images.get(&key) {
            return texture.clone();
        }
        let loaded = self.log.folder.file(file).and_then(|path| {
            let texture = Texture::load(&path, &mut self.log.warnings);
            texture.map(|texture| (path, texture)).map_err(|error| error.to_string())
        });
        let (path, mut texture) = match loaded {
            Ok(loaded) => loaded,
            Err(message) => {
                let error = entity.error(message);
                self.log.warnings.push(format!("{error}; rendered without this texture"));
                self.images.insert(key, None);
                return None;
            }
        };
        if let (Some(gamma), Texels::Bytes(_) | Texels::Shorts(_)) = (gamma, &texture.texels) {
            let decoded = |[red, green, blue, alpha]: [f32; 4]| {
                let [red, green, blue] = [red, green, blue].map(|value| value.powf(gamma));
                [red, green, blue, alpha].map(f16::from_f32)
            };
            let texels = texture.linear_texels(Encoding::Linear).into_iter().map(decoded);
            texture.texels = Texels::Halves(texels.collect());
        }
        let texture = Arc::new(texture);
        self.log.inputs.push(path);
        self.images.insert(key, Some(Arc::clone(&texture)));
        Some(texture)
    }

    /// Normal map that a material names, if it does.
    pub(super) fn normal_map(&mut self, entity: &Entity) -> Result<Option<TextureUse>> {
        let Some(file) = entity.string("normalmap")? else { return Ok(None) };
        let texture = self.load(entity, file, None);
        let encoding = Encoding::Linear;
        Ok(texture.map(|image| TextureUse { encoding, ..TextureUse::from_lower_left(image) }))
    }

    /// Image of the radiance of an area light, if it names one: shown once, (0, 0) at its lower left.
    pub(super) fn light_image(&mut self, entity: &Entity) -> Result<Option<TextureUse>> {
        let Some(file) = entity.string("filename")? else { return Ok(None) };
        let texture = self.load(entity, file, None);
        let wrap = [Wrap::Clamp; 2];
        Ok(texture.map(|image| TextureUse { wrap, ..TextureUse::from_lower_left(image) }))
    }
}

/// Encoding of 8-bit colours, and the exponent of one that is neither of [`Encoding`].
fn decoding(entity: &Entity) -> Result<(Encoding, Option<f32>)> {
    // Only 8-bit colours are encoded; other texels are linear whatever this says.
    match entity.string("encoding")?.unwrap_or("sRGB") {
        "sRGB" => Ok((Encoding::Srgb, None)),
        "linear" => Ok((Encoding::Linear, None)),
        other => {
            let gamma = other.strip_prefix("gamma ").and_then(|gamma| gamma.trim().parse().ok());
            let gamma = gamma.filter(|gamma: &f32| *gamma > 0.0 && gamma.is_finite());
            let error = || {
                let expected = "expected the encoding sRGB, linear or gamma with a number";
                entity.error(format!("{expected}, found `{other}`"))
            };
            Ok((Encoding::Linear, Some(gamma.ok_or_else(error)?)))
        }
    }
}

/// Shift and scale along u and v.
type Mapping = ([f32; 2], [f32; 2]);

fn mapping(entity: &Entity, log: &mut Log) -> Result<Mapping> {
    let kind = entity.string("mapping")?.unwrap_or("uv");
    if kind != "uv" {
        let name = format!("mapping `{kind}` of a texture");
        log.ignore_named(features::PBRT_TEXTURE_MAPPING, &name, &entity.place);
        entity.without_effect("v1 v2");
    }
    let of = |name: &str, otherwise: f64| Ok(entity.number(name, otherwise)? as f32);
    Ok(([of("udelta", 0.0)?, of("uscale", 1.0)?], [of("vdelta", 0.0)?, of("vscale", 1.0)?]))
}

/// Image of 2×2 texels, each of which is a square of one unit of the mapped coordinates.
fn checkerboard(first: Vec3, second: Vec3, ([du, u], [dv, v]): Mapping) -> TextureUse {
    let [first, second] =
        [first, second].map(|color| color.extend(1.0).to_array().map(f16::from_f32));
    let texture = Texture {
        name: "checkerboard".to_owned(),
        width: 2,
        height: 2,
        texels: Texels::Halves(vec![first, second, second, first]),
    };
    TextureUse {
        image_from_uv: [[0.5 * u, 0.0, 0.5 * du], [0.0, 0.5 * v, 0.5 * dv]],
        encoding: Encoding::Linear,
        interpolation: Interpolation::Nearest,
        ..TextureUse::new(Arc::new(texture))
    }
}

/// Number of a colour, as pbrt takes that of an image.
fn mean(color: Vec3) -> f32 {
    color.element_sum() / 3.0
}

/// Makes a texture of numbers, `of` the numbers of another.
pub(super) fn map_numbers(image: &TextureUse, of: impl Fn(f32) -> f32 + Sync) -> TextureUse {
    let has_color = image.channels == Channels::Color;
    let numbers = image.with_texels(|[red, green, blue, _]| {
        [of(if has_color { mean(Vec3::new(red, green, blue)) } else { red }); 4]
    });
    TextureUse { channels: Channels::Red, ..numbers }
}
