//! Textures and the colours that stand in their place.

use std::{ops::Neg, sync::Arc};

use glam::Vec3;

use super::{
    Reader,
    document::{Node, is_spectrum},
    parameters::Parameters,
    spectra::{self, Role},
};
use crate::{
    error::Result,
    features,
    import::Value,
    texture::{Encoding, Interpolation, Texels, Texture, TextureUse, Wrap},
};

/// Most `scale` textures around one another.
pub(super) const MAX_SCALES: usize = 8;

impl Reader {
    /// Colour or texture of a parameter, if it is there.
    pub(super) fn value(
        &mut self,
        parameters: &Parameters<'_>,
        name: &str,
        role: Role,
    ) -> Result<Option<Value>> {
        let Some(node) = parameters.any(name)? else { return Ok(None) };
        match node.tag() {
            "texture" => {
                let value = self.texture(node, MAX_SCALES)?;
                let is_number = role == Role::Index || ["opacity", "weight"].contains(&name);
                let swaps = is_number && node.kind() == "checkerboard" && node.version() >= 2.0;
                Ok(Some(match value {
                    // Mitsuba since version 2 swaps the squares of a checkerboard that is read as numbers.
                    Value::Image(mut board) if swaps => {
                        board.bias =
                            [0, 1, 2].map(|channel| board.bias[channel] + board.scale[channel]);
                        board.scale = board.scale.map(f32::neg);
                        Value::Image(board)
                    }
                    Value::Constant(color) if role == Role::Reflectance => {
                        Value::Constant(color.min(Vec3::ONE))
                    }
                    value => value,
                }))
            }
            _ if role == Role::Reflectance => spectra::reflectance(node, &mut self.ignored)
                .map(|color| Some(Value::Constant(color))),
            _ => spectra::color(node, role).map(|color| Some(Value::Constant(color))),
        }
    }

    /// As [`Reader::value`]; the same number everywhere if it is not there.
    pub(super) fn value_or(
        &mut self,
        parameters: &Parameters<'_>,
        name: &str,
        role: Role,
        otherwise: f32,
    ) -> Result<Value> {
        let value = self.value(parameters, name, role)?;
        Ok(value.unwrap_or(Value::Constant(Vec3::splat(otherwise))))
    }

    pub(super) fn texture(&mut self, node: Node<'_>, scales_left: usize) -> Result<Value> {
        let parameters = Parameters::new(node);
        let value = match node.kind() {
            "bitmap" | "ldrtexture" => match self.bitmap(&parameters)? {
                Some(texture) => Value::Image(texture),
                None => Value::Constant(Vec3::splat(0.5)),
            },
            "checkerboard" => Value::Image(self.checkerboard(&parameters, scales_left)?),
            "mesh_attribute" | "vertexcolors" => {
                let name = parameters.string("name")?.unwrap_or("vertex_color");
                let scale = Vec3::splat(parameters.float("scale")?.unwrap_or(1.0));
                if name == "vertex_color" {
                    Value::Vertices(scale)
                } else {
                    self.unknown_texture(&format!("mesh_attribute` of `{name}"), node)
                }
            }
            kind if is_spectrum(kind) => {
                let color = spectra::color_of_kind(node, Role::Light)?;
                return Ok(Value::Constant(color.max(Vec3::ZERO)));
            }
            "scale" if scales_left > 0 => self.scaled(&parameters, scales_left)?,
            found => {
                return Ok(self.unknown_texture(found, node));
            }
        };
        parameters.finish(&mut self.ignored);
        Ok(value)
    }

    fn unknown_texture(&mut self, found: &str, node: Node<'_>) -> Value {
        let name = format!("texture `{found}`, which is 0.5");
        self.ignored.add_named(features::MI_TEXTURE, &name, || node.place());
        Value::Constant(Vec3::splat(0.5))
    }

    /// Texture of version 0.6 that multiplies another.
    fn scaled(&mut self, parameters: &Parameters<'_>, scales_left: usize) -> Result<Value> {
        let node = parameters.node;
        let Some(inner) = parameters.object("texture")? else {
            return Err(node.error("scale: expected a texture in it, found none"));
        };
        let factor = spectra::parameter(parameters, "scale", Role::Index)?.unwrap_or(Vec3::ONE);
        Ok(self.texture(inner, scales_left - 1)?.affine(factor, Vec3::ZERO))
    }

    /// Image of a file; none if that is not there, or none that can be read.
    fn bitmap(&mut self, parameters: &Parameters<'_>) -> Result<Option<TextureUse>> {
        let node = parameters.node;
        let Some(name) = parameters.string("filename")? else {
            return Err(node.error("bitmap: expected the parameter `filename`"));
        };
        let Ok(Some(path)) = node.file_if_there(name) else {
            self.ignored.add(features::MI_MISSING, || format!("`{name}`, {}", node.place()));
            return Ok(None);
        };
        let texture = self.textures.load_readable(&path, &node.place(), &mut self.warnings);
        let Some(texture) = texture else { return Ok(None) };
        self.inputs.push(path);
        // Version 0.6 states an exponent; only that of linear values is different from sRGB.
        let is_linear = parameters.float("gamma")? == Some(1.0);
        let is_raw = parameters.boolean("raw")?.unwrap_or(is_linear);
        let wrap = |name: &str, absent: Wrap| {
            Ok(match parameters.string(name)? {
                None => absent,
                Some("repeat") => Wrap::Repeat,
                Some("mirror") => Wrap::Mirror,
                Some("clamp") => Wrap::Clamp,
                Some(found) => {
                    let message =
                        format!("{name}: expected repeat, mirror or clamp, found `{found}`");
                    return Err(node.error(message));
                }
            })
        };
        let both = wrap("wrap_mode", Wrap::Repeat)?;
        let filter_type = parameters.string("filter_type")?.map(str::to_lowercase);
        let interpolation = match filter_type.as_deref() {
            Some("nearest") => Interpolation::Nearest,
            None | Some("bilinear" | "trilinear" | "ewa") => Interpolation::Bilinear,
            Some(found) => {
                let message = format!("filter_type: expected bilinear or nearest, found `{found}`");
                return Err(node.error(message));
            }
        };
        parameters.without_effect("format cache max_anisotropy accel");
        Ok(Some(TextureUse {
            encoding: if is_raw { Encoding::Linear } else { Encoding::Srgb },
            image_from_uv: image_from_uv(parameters)?,
            wrap: [wrap("wrap_mode_u", both)?, wrap("wrap_mode_v", both)?],
            interpolation,
            ..TextureUse::new(texture)
        }))
    }

    /// Colour of a value where a texture cannot be used, which `feature` names.
    pub(super) fn without_texture(
        &mut self,
        value: Option<Value>,
        node: Node<'_>,
        feature: features::Feature,
    ) -> Option<Vec3> {
        if let Value::Constant(color) = value? {
            return Some(color);
        }
        self.ignored.add(feature, || node.place());
        None
    }

    /// Two colours on squares of half a unit: the first where both coordinates are in the same half.
    fn checkerboard(
        &mut self,
        parameters: &Parameters<'_>,
        scales_left: usize,
    ) -> Result<TextureUse> {
        let mut color = |name: &str, grey: f32| match parameters.any(name)? {
            None => Ok(Vec3::splat(grey)),
            Some(node) if node.tag() == "texture" && scales_left > 0 => {
                let value = self.texture(node, scales_left - 1)?;
                if !matches!(value, Value::Constant(_)) {
                    let name = "textures of a `checkerboard`, of which the means count";
                    self.ignored.add_named(features::MI_TEXTURE, name, || node.place());
                }
                Ok(value.mean().min(Vec3::ONE))
            }
            Some(node) => spectra::reflectance(node, &mut self.ignored),
        };
        let (first, second) = (color("color0", 0.4)?, color("color1", 0.2)?);
        let (zero, one) = ([0, 0, 0, 255], [255; 4]);
        let texture = Texture {
            name: format!("checkerboard of {}", parameters.node.place()),
            width: 2,
            height: 2,
            texels: Texels::Bytes(vec![zero, one, one, zero]),
        };
        Ok(TextureUse {
            encoding: Encoding::Linear,
            interpolation: Interpolation::Nearest,
            image_from_uv: image_from_uv(parameters)?,
            scale: (second - first).to_array(),
            bias: first.to_array(),
            ..TextureUse::new(Arc::new(texture))
        })
    }
}

/// Image coordinates from those of the mesh: (0, 0) is the upper left corner in Mitsuba 3 too, whose
/// OBJ reader turns v round. `uoffset` and `uscale` of version 0.6 go in the order of its upgrade.
fn image_from_uv(parameters: &Parameters<'_>) -> Result<[[f32; 3]; 2]> {
    let matrix = parameters.transform("to_uv")?;
    let [mut u, mut v] = [0, 1].map(|index| {
        let row = matrix.row(index);
        [row.x, row.y, row.w].map(|number| number as f32)
    });
    if !u.iter().chain(&v).all(|number| number.is_finite()) {
        return Err(parameters.node.error("to_uv: expected finite numbers"));
    }
    let both = parameters.float("uvscale")?.unwrap_or(1.0);
    for (row, axis) in [(&mut u, "u"), (&mut v, "v")] {
        let scale = parameters.float(&format!("{axis}scale"))?.unwrap_or(both);
        row[2] += parameters.float(&format!("{axis}offset"))?.unwrap_or(0.0);
        row.iter_mut().for_each(|number| *number *= scale);
    }
    Ok([u, v])
}
