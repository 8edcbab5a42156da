//! Source of a fit: the user's text → map or material.

use std::path::{Path, PathBuf};

use crate::{
    brdf::MaterialTables,
    error::{Error, Result},
    files::extension,
    scene::{
        EnvironmentMap, Scene,
        material::{Material, MaterialKind},
        measured::MeasuredTable,
    },
};

/// Extensions of measured BRDFs.
const MEASURED: [&str; 3] = ["binary", "brdf", "bsdf"];
/// Material types that can be given inline.
const TYPES: [&str; 5] = ["diffuse", "plastic", "conductor", "principled", "measured"];
/// Minimal scene around an inline material.
const SCENE: &str = "[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n\
    vertical_fov_deg = 45\n[film]\nwidth = 1\nheight = 1\n[environment]\nconstant = [1, 1, 1]\n\
    [[object]]\nshape = \"sphere\"\nradius = 1\nmaterial = \"material\"\n";

/// A material with its tables and a name for files.
pub(crate) struct Source {
    /// Stem of the output files.
    pub name: String,
    pub tables: MaterialTables,
    /// Files that it was read from.
    pub inputs: Vec<PathBuf>,
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "fit".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// Loads a map, or the environment of a scene; derives a name for files, and tells which were read.
pub(super) fn environment(path: &Path) -> Result<(EnvironmentMap, String, Vec<PathBuf>)> {
    if extension(path) == "toml" {
        let scene = Scene::load(path)?;
        scene.warnings.iter().for_each(|warning| log::warn!("{warning}"));
        return Ok((scene.environment, format!("{}_environment", scene.name), scene.inputs));
    }
    let mut warnings = Vec::new();
    let map = EnvironmentMap::load(path, 1.0, &mut warnings)?;
    warnings.iter().for_each(|warning| log::warn!("{warning}"));
    Ok((map, stem(path), vec![path.into()]))
}

/// Loads a material from a measured file, `SCENE#name` or `TYPE:key=value,…`.
pub(super) fn material(text: &str) -> Result<Source> {
    let path = Path::new(text);
    if let Some((kind, keys)) = text.split_once(':')
        && TYPES.contains(&kind)
    {
        return in_words(text, kind, keys);
    }
    if let Some((scene, name)) = text.rsplit_once('#') {
        let scene = Scene::load(Path::new(scene))?;
        let found = scene.materials.iter().find(|material| material.name == name);
        let Some(found) = found else {
            let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
            return Err(Error::scene(
                &scene.path,
                format!("no material `{name}`; it has {}", names.join(", ")),
            ));
        };
        let tables = MaterialTables::new(std::slice::from_ref(found))?;
        return Ok(Source { name: format!("{}_{name}", scene.name), tables, inputs: scene.inputs });
    }
    if MEASURED.contains(&extension(path).as_str()) {
        let table = MeasuredTable::load(path)?;
        table.warnings.iter().for_each(|warning| log::warn!("{warning}"));
        let kind = MaterialKind::Measured { path: path.to_path_buf(), table: table.into() };
        let tables = MaterialTables::new(&[Material::new(stem(path), kind)])?;
        return Ok(Source { name: stem(path), tables, inputs: vec![path.into()] });
    }
    Err(Error::usage(format!(
        "`{text}` is no BRDF; expected a .binary, .brdf or .bsdf file, SCENE.toml#material, \
         or TYPE:key=value,… with the type {}",
        TYPES.join(", ")
    )))
}

/// Splits at commas outside brackets.
fn split_keys(keys: &str) -> Vec<&str> {
    let (mut parts, mut start, mut depth) = (Vec::new(), 0, 0_i32);
    for (index, character) in keys.char_indices() {
        match character {
            '[' => depth += 1,
            ']' => depth -= 1,
            ',' if depth <= 0 => {
                parts.push(&keys[start..index]);
                start = index + 1;
            }
            _ => {}
        }
    }
    parts.push(&keys[start..]);
    parts.into_iter().filter(|part| !part.trim().is_empty()).collect()
}

fn in_words(text: &str, kind: &str, keys: &str) -> Result<Source> {
    let mut scene = format!("{SCENE}[[material]]\nname = \"material\"\ntype = \"{kind}\"\n");
    for part in split_keys(keys) {
        let Some((key, value)) = part.split_once('=') else {
            return Err(Error::usage(format!("`{part}` in `{text}`; expected key=value")));
        };
        let (key, value) = (key.trim(), value.trim());
        // One number for a colour is grey; a file needs no quotes.
        let value = match key {
            "diffuse" | "reflectance" | "eta" | "k" | "base_color" | "specular_color"
                if !value.starts_with('[') =>
            {
                format!("[{value}, {value}, {value}]")
            }
            "file" if !value.starts_with('"') => format!("{value:?}"),
            _ => value.to_owned(),
        };
        scene += &format!("{key} = {value}\n");
    }
    // Line numbers of the generated text mean nothing to the user.
    let scene = Scene::parse(Path::new(text), &scene).map_err(|error| match error {
        Error::Parse { message, .. } | Error::Scene { message, .. } => {
            Error::usage(format!("`{text}`: {message}"))
        }
        other => other,
    })?;
    let name: String =
        text.chars().map(|c| if c.is_ascii_alphanumeric() || c == '.' { c } else { '_' }).collect();
    // A dot would be taken for an extension.
    let tables = MaterialTables::new(&scene.materials)?;
    Ok(Source { name: name.replace('.', "p"), tables, inputs: scene.inputs })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_in_words_are_those_of_scene_files() {
        assert_eq!(split_keys("a=1,b=[1,2],c=3"), ["a=1", "b=[1,2]", "c=3"]);
        let known = material("plastic:diffuse=0.5,alpha=0.1");
        assert_eq!(
            known.map(|source| source.name).ok(),
            Some("plastic_diffuse_0p5_alpha_0p1".into())
        );
        assert!(material("conductor:reflectance=[0.9,0.6,0.3],alpha=0.05").is_ok());
        assert!(material("principled:base_color=0.5,metallic=0.2,roughness=0.4").is_ok());
        for wrong in ["plastic:alpha", "plastic:gloss=1", "diffuse:reflectance=2", "walls", ""] {
            assert!(material(wrong).is_err(), "{wrong}");
        }
    }
}
