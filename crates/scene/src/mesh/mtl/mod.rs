//! MTL, the material libraries of OBJ files: one line at a time → materials.

mod surface;

use std::path::{Path, PathBuf};

use glam::Vec3;

use crate::{
    beside::Folder,
    features::{self, Feature, Ignored},
    texture::{Channels, Encoding, TextureCache, TextureUse, Wrap},
};

/// Keyword and rest of a statement without its comment. Names may hold a `#`: there a comment begins at one
/// that stands alone.
pub(super) fn statement(text: &str) -> (&str, &str) {
    let text = text.trim();
    let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    if keyword.starts_with('#') {
        return ("", "");
    }
    let is = |name: &&str| keyword.eq_ignore_ascii_case(name);
    let has_name = ["o", "g", "usemtl", "mtllib", "newmtl", "bump", "norm"].iter().any(is)
        || keyword.get(..4).is_some_and(|start| start.eq_ignore_ascii_case("map_"));
    let comment = match rest.strip_suffix(" #") {
        Some(name) if has_name => Some(name.len()),
        _ if has_name => rest.find(" # "),
        // A number may be printed as 1.#IND.
        _ => rest.match_indices('#').map(|(at, _)| at).find(|at| !rest[..*at].ends_with('.')),
    };
    (keyword, rest[..comment.unwrap_or(rest.len())].trim())
}

/// Material library as far as it has been read.
pub(super) struct Library<'a> {
    /// Folder of the OBJ file.
    folder: &'a Folder,
    /// Folder of the library, relative to `folder`.
    within: PathBuf,
    path: &'a Path,
    pub(super) materials: Vec<LibraryMaterial>,
}

/// Material of a library: its keys as they stand.
#[derive(Default)]
pub(super) struct LibraryMaterial {
    pub(super) name: String,
    ignored: Ignored,
    /// Name of the library and number of the line that was read last, for messages.
    place: String,
    diffuse: Vec3,
    specular: Vec3,
    exponent: f32,
    ior: Option<f32>,
    model: u32,
    opacity: Option<f32>,
    transparency: Option<f32>,
    filter: Option<Vec3>,
    emission: Option<Vec3>,
    roughness: Option<f32>,
    metallic: Option<f32>,
    coat_weight: Option<f32>,
    coat_roughness: Option<f32>,
    sheen: Option<f32>,
    anisotropy: Option<f32>,
    /// Turn of its direction about the normal.
    anisotropy_turns: Option<f32>,
    color_map: Option<Map>,
    opacity_map: Option<Map>,
    emission_map: Option<Map>,
    roughness_map: Option<Map>,
    metallic_map: Option<Map>,
    normal_map: Option<Map>,
    bump_map: Option<Map>,
}

impl LibraryMaterial {
    fn ignore(&mut self, feature: Feature, kind: &str) {
        let place = || format!("material `{}`, {}", self.name, self.place);
        self.ignored.add_named(feature, kind, place);
    }
}

impl<'a> Library<'a> {
    /// Begins the library at `path`, which belongs to an OBJ file in `folder`.
    pub(super) fn new(folder: &'a Folder, path: &'a Path) -> Self {
        let within = path.parent().and_then(|own| own.strip_prefix(&folder.path).ok());
        let within = within.unwrap_or(Path::new("")).to_owned();
        Self { folder, within, path, materials: Vec::new() }
    }

    /// Reads a line into the last material, or begins one.
    pub(super) fn read_line(&mut self, line: usize, text: &str) {
        let (key, rest) = statement(text);
        if key.eq_ignore_ascii_case("newmtl") {
            let (name, diffuse) = (rest.to_owned(), Vec3::ONE);
            self.materials.push(LibraryMaterial { name, diffuse, model: 2, ..Default::default() });
            return;
        }
        let Self { folder, within, path, materials } = self;
        let Some(entry) = materials.last_mut().filter(|_| !key.is_empty()) else { return };
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        entry.place = format!("{file}:{line}");
        let numbers: Vec<f32> =
            rest.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
        let share = numbers.first().filter(|n| n.is_finite()).map(|n| n.clamp(0.0, 1.0));
        let color = match numbers[..] {
            [grey] => Some(Vec3::splat(grey)),
            [red, green, blue, ..] => Some(Vec3::new(red, green, blue)),
            _ => None,
        };
        let color = color.filter(|color| color.is_finite() && color.min_element() >= 0.0);
        let map = |entry: &mut LibraryMaterial| -> Option<Map> {
            let (name, options, unknown) = parse_map(rest);
            for option in unknown {
                entry.ignore(features::MTL_OPTION, &format!("option `{option}`"));
            }
            let place = entry.place.clone();
            let Ok(path) = folder.found_within(within, name.trim_matches('"')) else {
                entry.ignore(features::MTL_OUTSIDE, &format!("image `{name}`"));
                return None;
            };
            Some(Map { path, place, options })
        };
        match key.to_ascii_lowercase().as_str() {
            "kd" | "ks" | "ke" | "tf" if color.is_none() => {
                entry.ignore(features::MTL_KEY, &format!("`{key}` that is no colour"));
            }
            "kd" => {
                entry.diffuse = color.unwrap_or_default().min(Vec3::ONE);
                if color.is_some_and(|color| color.max_element() > 1.0 + 1e-4) {
                    entry.ignore(features::MTL_KEY, "part of `Kd` above 1");
                }
            }
            "ks" => entry.specular = color.unwrap_or_default().min(Vec3::ONE),
            "ke" => entry.emission = color,
            "tf" => entry.filter = color.map(|color| color.min(Vec3::ONE)),
            "ns" => {
                let exponent = numbers.first().filter(|n| n.is_finite() && **n > 0.0);
                entry.exponent = exponent.copied().unwrap_or(0.0);
            }
            "ni" => entry.ior = numbers.first().copied(),
            "illum" => match rest.parse() {
                Ok(model @ (0..=7 | 9)) => entry.model = model,
                _ => entry.ignore(features::MTL_ILLUM_MODEL, &format!("`illum {rest}`")),
            },
            "d" if share.is_some() => entry.opacity = share,
            "tr" if share.is_some() => entry.transparency = share,
            "pr" if share.is_some() => entry.roughness = share,
            "pm" if share.is_some() => entry.metallic = share,
            "ka" if color == Some(Vec3::ZERO) => {}
            "pc" if share.is_some() => entry.coat_weight = share,
            "pcr" if share.is_some() => entry.coat_roughness = share,
            "ps" if share.is_some() => entry.sheen = share,
            "aniso" if share.is_some() => entry.anisotropy = share,
            "anisor" if share.is_some() => entry.anisotropy_turns = share,
            "ka" => entry.ignore(features::MTL_KA, features::MTL_KA.name),
            "map_kd" => entry.color_map = map(entry),
            "map_d" => entry.opacity_map = map(entry),
            "map_ke" => entry.emission_map = map(entry),
            "map_pr" => entry.roughness_map = map(entry),
            "map_pm" => entry.metallic_map = map(entry),
            "norm" => entry.normal_map = map(entry),
            "bump" | "map_bump" => entry.bump_map = map(entry),
            _ => entry.ignore(features::MTL_KEY, &format!("`{key}`")),
        }
    }
}

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
fn parse_map(text: &str) -> (&str, Options, Vec<&str>) {
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
