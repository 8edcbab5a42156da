//! Statements of MTL that name an image: `map_Kd -s 2 2 -clamp on wood.png`.

use std::path::PathBuf;

use crate::texture::{Channels, Encoding, TextureCache, TextureUse, Wrap};

pub(super) struct Map {
    pub(super) path: PathBuf,
    /// Library and line.
    pub(super) place: String,
    pub(super) options: Options,
}

/// Options before the name of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Options {
    /// `-s`, along u and v.
    scale: [f32; 2],
    /// `-o`, along u and v.
    offset: [f32; 2],
    clamps: bool,
    base_gain: [f32; 2],
    pub(super) channels: Option<Channels>,
    /// `-bm`, strength of a normal map.
    pub(super) strength: f32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            scale: [1.0; 2],
            offset: [0.0; 2],
            clamps: false,
            base_gain: [0.0, 1.0],
            channels: None,
            strength: 1.0,
        }
    }
}

/// Splits the text after the key into options and the name, which may hold spaces; returns the name, the
/// options, and those that change nothing here.
pub(super) fn parse(text: &str) -> (&str, Options, Vec<&str>) {
    let mut options = Options::default();
    let mut unknown = Vec::new();
    let mut rest = text.trim();
    while rest.starts_with('-') {
        let (option, tail) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        let mut tail = tail.trim_start();
        let mut word = || {
            let (word, after) = tail.split_once(char::is_whitespace)?;
            tail = after.trim_start();
            Some(word)
        };
        match option {
            "-clamp" => options.clamps = word() == Some("on"),
            "-imfchan" => {
                options.channels = match word() {
                    Some("r") => Some(Channels::Red),
                    Some("g") => Some(Channels::Green),
                    Some("b") => Some(Channels::Blue),
                    Some("m") => Some(Channels::Alpha),
                    Some("l") => Some(Channels::Color),
                    _ => None,
                }
            }
            "-bm" | "-boost" | "-texres" => {
                let value = word().and_then(|word| word.parse().ok());
                match value.filter(|_| option == "-bm") {
                    Some(strength) => options.strength = strength,
                    None => unknown.push(option),
                }
            }
            "-mm" => {
                for value in &mut options.base_gain {
                    *value = word().and_then(|word| word.parse().ok()).unwrap_or(*value);
                }
            }
            "-blendu" | "-blendv" | "-cc" | "-type" => {
                // Images are interpolated, and their colours stay.
                let usual = if option == "-cc" { "off" } else { "on" };
                if word() != Some(usual) {
                    unknown.push(option);
                }
            }
            "-s" | "-o" | "-t" => {
                let mut numbers = Vec::new();
                // One to three numbers stand before the name.
                while let Some((first, after)) = tail.split_once(char::is_whitespace)
                    && numbers.len() < 3
                    && let Ok(number) = first.parse::<f32>()
                {
                    numbers.push(number);
                    tail = after.trim_start();
                }
                let target = match option {
                    "-s" => &mut options.scale,
                    "-o" => &mut options.offset,
                    _ => {
                        unknown.push(option);
                        &mut [0.0; 2]
                    }
                };
                for (value, number) in target.iter_mut().zip(numbers) {
                    *value = number;
                }
            }
            // A name that begins with a dash.
            _ => break,
        }
        rest = tail;
    }
    (rest, options, unknown)
}

impl Map {
    /// Reads channels of the image.
    pub(super) fn load(
        &self,
        channels: Channels,
        encoding: Encoding,
        images: &mut TextureCache,
        warnings: &mut Vec<String>,
    ) -> Option<TextureUse> {
        let texture = images.load_readable(&self.path, &self.place, warnings)?;
        let Options { scale, offset, clamps, base_gain: [base, gain], .. } = self.options;
        Some(TextureUse {
            channels,
            encoding,
            // v counts from the lower edge of the image.
            image_from_uv: [[scale[0], 0.0, offset[0]], [0.0, -scale[1], 1.0 - offset[1]]],
            wrap: [if clamps { Wrap::Clamp } else { Wrap::Repeat }; 2],
            scale: [gain; 3],
            bias: [base; 3],
            ..TextureUse::from_lower_left(texture)
        })
    }
}
