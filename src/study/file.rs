//! Study files: TOML text → scenes, description and options.
//!
//! ```toml
//! study = "Title of the report"
//! notes = ["A paragraph under the title."]
//! scenes = ["../meeting_room.toml"]      # relative to this file
//!
//! [settings]                             # names as on the command line
//! samplers = ["mis", "ris:candidates=8"]
//! spp = [200, 400]
//! time = "30s"
//!
//! [quick]                                # what --quick puts in place of settings
//! spp = [16]
//!
//! [[published.errors]]                   # a publication's figures
//! scene = "meeting_room"
//! source = "Table 6.3"
//! spp = 200
//! values = { product = 0.127465, visibility = 0.091346 }
//! ```

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::{Spanned, de::DeTable};

use super::{
    contender::Contender,
    plan::{CheckPlan, Description, Options, PublishedErrors, PublishedOverhead},
};
use crate::{
    error::{Error, Result, TextError},
    files::{extension, read_text},
    sampler::Parameters,
    session::{parse_duration, parse_size},
};

/// Parsed study file.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyFile {
    /// Scene files, resolved against the study file's folder.
    pub scenes: Vec<PathBuf>,
    /// Title, notes, published figures.
    pub description: Description,
    /// `[settings]`.
    pub settings: Options,
    /// `[quick]`.
    pub quick: Options,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Root {
    study: String,
    #[serde(default)]
    notes: Vec<String>,
    scenes: Spanned<Vec<PathBuf>>,
    #[serde(default)]
    settings: Entries,
    #[serde(default)]
    quick: Entries,
    #[serde(default)]
    published: Published,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entries {
    samplers: Option<Spanned<Vec<String>>>,
    spp: Option<Vec<u32>>,
    time: Option<Spanned<String>>,
    seeds: Option<u32>,
    size: Option<Spanned<String>>,
    shadow_rays: Option<u32>,
    depth: Option<u32>,
    reference_sampler: Option<Spanned<String>>,
    reference_spp: Option<u32>,
    reference_check: Option<Spanned<String>>,
    overhead: Option<bool>,
    overhead_baseline: Option<Spanned<String>>,
    overhead_spp: Option<u32>,
    overhead_repetitions: Option<u32>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Published {
    #[serde(default)]
    errors: Vec<PublishedErrors>,
    #[serde(default)]
    overheads: Vec<PublishedOverhead>,
}

/// Tests whether `path` is a study file: TOML with a key `study`, where a scene has `[camera]`.
///
/// # Errors
/// The file cannot be read, is no TOML, or has neither key.
pub fn is_study(path: &Path) -> Result<bool> {
    if extension(path) != "toml" {
        return Ok(false);
    }
    let text = read_text(path)?;
    let table =
        DeTable::parse(&text).map_err(|error| TextError::from(error).locate(path, &text))?;
    let has = |key: &str| table.get_ref().contains_key(key);
    match (has("study"), has("camera")) {
        (true, _) => Ok(true),
        (false, true) => Ok(false),
        (false, false) => Err(Error::format(
            path,
            "expected a scene (with a table [camera]) or a study (with a line study = \"title\"), \
             found neither",
        )),
    }
}

impl StudyFile {
    /// Reads a study file; sampler parameters start from `defaults`.
    ///
    /// # Errors
    /// The file cannot be read, or [`Error::Parse`] with line and column: text that is no TOML, an
    /// unknown key, an unknown sampler, a value out of range.
    pub fn load(path: &Path, defaults: Parameters) -> Result<Self> {
        let text = read_text(path)?;
        Self::parse(&text, path.parent().unwrap_or(Path::new("")), defaults)
            .map_err(|failure| failure.locate(path, &text))
    }

    fn parse(text: &str, folder: &Path, defaults: Parameters) -> Result<Self, TextError> {
        let root: Root = toml::from_str(text)?;
        Ok(Self {
            scenes: root.scenes.into_inner().iter().map(|scene| folder.join(scene)).collect(),
            description: Description {
                title: Some(root.study),
                notes: root.notes,
                published_errors: root.published.errors,
                published_overheads: root.published.overheads,
            },
            settings: root.settings.into_options(folder, defaults)?,
            quick: root.quick.into_options(folder, defaults)?,
        })
    }
}

/// Parses a value, if there is one; a failure carries the value's location.
fn read<T, V, E: ToString>(
    entry: Option<Spanned<V>>,
    parse: impl FnOnce(&V) -> Result<T, E>,
) -> Result<Option<T>, TextError> {
    entry
        .map(|entry| {
            let span = entry.span();
            let parsed = parse(entry.get_ref());
            parsed.map_err(|error| TextError { span, message: error.to_string() })
        })
        .transpose()
}

impl Entries {
    fn into_options(self, folder: &Path, defaults: Parameters) -> Result<Options, TextError> {
        let contender = |text: &String| Contender::parse(text, defaults);
        Ok(Options {
            samplers: read(self.samplers, |texts| Contender::parse_all(texts, defaults))?,
            spp: self.spp,
            time: read(self.time, |text| parse_duration(text))?,
            seeds: self.seeds,
            size: read(self.size, |text| parse_size(text))?,
            shadow_rays: self.shadow_rays,
            depth: self.depth,
            reference_sampler: read(self.reference_sampler, contender)?,
            reference_spp: self.reference_spp,
            reference_check: read(self.reference_check, |text| {
                CheckPlan::parse(text, folder, defaults)
            })?,
            overhead: self.overhead,
            overhead_baseline: read(self.overhead_baseline, contender)?,
            overhead_spp: self.overhead_spp,
            overhead_repetitions: self.overhead_repetitions,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::sampler::Sampler;

    fn parse(text: &str) -> Result<StudyFile> {
        StudyFile::parse(text, Path::new("studies"), Parameters::default())
            .map_err(|failure| failure.locate(Path::new("study.toml"), text))
    }

    #[test]
    fn every_key_is_read() {
        let study = parse(
            "study = \"Title\"\nnotes = [\"Why.\"]\nscenes = [\"../a.toml\"]\n\
             [settings]\nsamplers = [\"mis\", \"ris:candidates=8\"]\nspp = [2, 4]\ntime = \"30s\"\n\
             seeds = 4\nsize = \"160x120\"\nshadow_rays = 3\ndepth = 2\n\
             reference_sampler = \"ris\"\nreference_spp = 99\nreference_check = \"cosine\"\n\
             overhead = true\n\
             overhead_baseline = \"mis\"\noverhead_spp = 7\noverhead_repetitions = 8\n\
             [quick]\nspp = [1]\n\
             [[published.errors]]\nscene = \"a\"\nsource = \"Table 1\"\nspp = 2\n\
             values = { mis = 0.5 }\n\
             [[published.overheads]]\nlabel = \"open\"\nlow = 1.0\nhigh = 1.02\n",
        )
        .unwrap();
        assert_eq!(study.scenes, [PathBuf::from("studies/../a.toml")]);
        let settings = &study.settings;
        assert_eq!(settings.samplers.as_ref().unwrap()[1].parameters.candidates, Some(8));
        assert_eq!(settings.time, Some(Duration::from_secs(30)));
        assert_eq!(settings.reference_sampler.as_ref().unwrap().sampler, Sampler::Ris);
        assert!(matches!(settings.reference_check, Some(CheckPlan::Sampler(_))));
        assert_eq!((settings.overhead_spp, settings.overhead_repetitions), (Some(7), Some(8)));
        assert_eq!(study.quick, Options { spp: Some(vec![1]), ..Options::default() });
        assert_eq!(study.description.published_errors[0].values["mis"], 0.5);
        assert_eq!(study.description.published_overheads[0].high, 1.02);
    }
}
