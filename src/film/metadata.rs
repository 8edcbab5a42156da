//! Metadata of a render, stored as attributes of its image file.
//!
//! `samplesPerPixel` and `renderTimeSeconds` are pbrt's names, `generatedBy` is Mitsuba's; the rest is under
//! `fenestra.`. [`Metadata::sample_ranges`] keep `merge` and `--resume` from counting a sample twice.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    path::Path,
    str::FromStr,
};

use super::{Attribute, Image, cryptomatte::PREFIX, denoised::check_film, sums::Ahead};
use crate::error::{Error, Result};

/// Samples `first … first + count − 1` of every pixel, drawn with one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SampleRange {
    /// Seed of the random numbers.
    pub seed: u32,
    /// Index of the first sample.
    pub first: u32,
    /// Number of samples.
    pub count: u32,
}

impl SampleRange {
    /// Tests whether both hold a sample of the same seed and index.
    pub fn overlaps(&self, other: &Self) -> bool {
        let end = |range: &Self| u64::from(range.first) + u64::from(range.count);
        self.seed == other.seed
            && self.count > 0
            && other.count > 0
            && u64::from(self.first) < end(other)
            && u64::from(other.first) < end(self)
    }
}

impl fmt::Display for SampleRange {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}+{}", self.seed, self.first, self.count)
    }
}

impl FromStr for SampleRange {
    type Err = String;

    /// Parses `seed:first+count`.
    fn from_str(text: &str) -> Result<Self, String> {
        let parse = || {
            let (seed, range) = text.split_once(':')?;
            let (first, count) = range.split_once('+')?;
            Some(Self {
                seed: seed.parse().ok()?,
                first: first.parse().ok()?,
                count: count.parse().ok()?,
            })
        };
        parse().ok_or_else(|| format!("expected seed:first+count, found {text:?}"))
    }
}

/// Settings, samples, times and device of a render.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// Fenestra's version.
    pub version: String,
    /// Scene name.
    pub scene: String,
    /// `Scene::hash`.
    pub scene_hash: String,
    /// Hash of each fit used, by what was fitted.
    pub fit_hashes: BTreeMap<String, String>,
    /// Sampler's name.
    pub sampler: String,
    /// Sampler's parameters as text, by name.
    pub sampler_parameters: BTreeMap<String, String>,
    /// Number of candidates from which `guided` chose each shadow ray; absent if it is unknown or
    /// differs between parts. The sampler parameter of this name holds the value asked for.
    pub candidates: Option<u32>,
    /// Directions traced at every vertex of every camera path.
    pub shadow_rays: u32,
    /// Path vertices at which environment light is gathered.
    pub depth: u32,
    /// Samples of every pixel that the image holds.
    pub sample_ranges: Vec<SampleRange>,
    /// Further samples of some pixels.
    pub ahead: Ahead,
    /// Wall time of the passes, seconds.
    pub seconds: f64,
    /// Device time by pass, seconds.
    pub gpu_seconds: BTreeMap<String, f64>,
    /// Attributes of Cryptomatte, as [`cryptomatte::attributes`](super::cryptomatte).
    pub mattes: BTreeMap<String, String>,
    /// Vulkan device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// Its tracer: "device", or "Embree" with its version.
    pub tracer: String,
}

/// Longest render time that is believed, seconds: a century.
const LONGEST_RENDER: f64 = 100.0 * 365.25 * 86400.0;

/// Refuses ranges that pass the last sample of a seed, 2³² − 1, or that share samples.
fn check_ranges(ranges: &[SampleRange]) -> Result<(), String> {
    for (index, range) in ranges.iter().enumerate() {
        if u64::from(range.first) + u64::from(range.count) > 1 << 32 {
            return Err(format!("{range} passes the last sample of a seed, {}", u32::MAX));
        }
        if let Some(other) = ranges[..index].iter().find(|other| other.overlaps(range)) {
            return Err(format!("{other} and {range} share samples"));
        }
    }
    Ok(())
}

/// Parses `blocks` or `blocks:x:y`, with the offset of the sample.
fn parse_ahead(text: &str) -> Option<Ahead> {
    let mut parts = text.split(':');
    let blocks = parts.next()?.parse().ok()?;
    let offset = parts.map(|part| part.parse().ok().filter(|at: &f32| at.abs() <= 0.5));
    let offset = match offset.collect::<Option<Vec<f32>>>()?[..] {
        [] => None,
        [x, y] => Some([x, y]),
        _ => return None,
    };
    let ahead = Ahead { blocks, offset };
    (!ahead.is_none()).then_some(ahead)
}

/// Converts times by pass from milliseconds to seconds.
pub(crate) fn seconds_of(ms: &BTreeMap<String, f64>) -> BTreeMap<String, f64> {
    ms.iter().map(|(pass, ms)| (pass.clone(), ms * 1e-3)).collect()
}

impl Metadata {
    /// Samples per pixel over all ranges.
    pub fn sample_count(&self) -> u64 {
        self.sample_ranges.iter().map(|range| u64::from(range.count)).sum()
    }

    /// Stores everything as attributes of `image`, in place of what it says of another render.
    pub fn store(&self, image: &mut Image) {
        // Not every render has these.
        for name in ["fenestra.seed", "fenestra.ahead", "fenestra.candidates"] {
            image.attributes.remove(name);
        }
        image.attributes.retain(|name, _| !name.starts_with(PREFIX));
        let mut put = |name: &str, value: Attribute| {
            image.attributes.insert(name.to_owned(), value);
        };
        let text = |value: &str| Attribute::Text(value.to_owned());
        put("generatedBy", Attribute::Text(format!("Fenestra {}", self.version)));
        let count = i32::try_from(self.sample_count()).unwrap_or(i32::MAX);
        put("samplesPerPixel", Attribute::Integer(count));
        put("renderTimeSeconds", Attribute::Float(self.seconds as f32));
        put("fenestra.version", text(&self.version));
        put("fenestra.scene", text(&self.scene));
        put("fenestra.scene_hash", text(&self.scene_hash));
        put("fenestra.sampler", text(&self.sampler));
        put("fenestra.shadow_rays", Attribute::Text(self.shadow_rays.to_string()));
        put("fenestra.depth", Attribute::Text(self.depth.to_string()));
        if let [range] = self.sample_ranges[..] {
            put("fenestra.seed", Attribute::Text(range.seed.to_string()));
        }
        let ranges: Vec<String> = self.sample_ranges.iter().map(ToString::to_string).collect();
        put("fenestra.sample_ranges", Attribute::Text(ranges.join(" ")));
        if !self.ahead.is_none() {
            let Ahead { blocks, offset } = self.ahead;
            let offset = offset.map(|[x, y]| format!(":{x}:{y}")).unwrap_or_default();
            put("fenestra.ahead", Attribute::Text(format!("{blocks}{offset}")));
        }
        put("fenestra.seconds", Attribute::Double(self.seconds));
        put("fenestra.device", text(&self.device));
        put("fenestra.driver", text(&self.driver));
        put("fenestra.tracer", text(&self.tracer));
        for (name, value) in &self.sampler_parameters {
            put(&format!("fenestra.sampler_parameters.{name}"), text(value));
        }
        if let Some(candidates) = self.candidates {
            put("fenestra.candidates", Attribute::Text(candidates.to_string()));
        }
        for (name, value) in &self.fit_hashes {
            put(&format!("fenestra.fit_hashes.{name}"), text(value));
        }
        for (name, value) in &self.mattes {
            put(&format!("{PREFIX}{name}"), text(value));
        }
        for (name, value) in &self.gpu_seconds {
            put(&format!("fenestra.gpu_seconds.{name}"), Attribute::Double(*value));
        }
    }

    /// Reads the metadata back from the attributes of `image`; `path` only serves error messages.
    ///
    /// # Errors
    /// [`Error::Format`] names the attribute that is missing or malformed, or the denoiser of a picture
    /// that is none of samples alone.
    pub fn load(image: &Image, path: &Path) -> Result<Self> {
        check_film(image, path)?;
        let refuse = |message: String| Error::format(path, message);
        let text = |name: &str| match image.attributes.get(name) {
            Some(Attribute::Text(value)) => Ok(value.clone()),
            Some(other) => Err(refuse(format!("attribute {name}: expected text, found {other:?}"))),
            None => {
                Err(refuse(format!("no attribute {name}: not an image that Fenestra rendered")))
            }
        };
        let number = |name: &str| {
            let expected = |error| refuse(format!("attribute {name}: expected a number: {error}"));
            text(name)?.parse::<u32>().map_err(expected)
        };
        let has = |name: &str| image.attributes.contains_key(name);
        let named = |prefix: &'static str| {
            image.attributes.iter().filter_map(move |(name, value)| {
                name.strip_prefix(prefix).map(|rest| (rest.to_owned(), value))
            })
        };
        let texts = |prefix: &'static str| {
            named(prefix)
                .filter_map(|(name, value)| match value {
                    Attribute::Text(value) => Some((name, value.clone())),
                    _ => None,
                })
                .collect()
        };
        let double = |value: &Attribute| match *value {
            Attribute::Double(value) => Some(value),
            Attribute::Float(value) => Some(f64::from(value)),
            _ => None,
        };
        let sample_ranges = text("fenestra.sample_ranges")?
            .split_whitespace()
            .map(SampleRange::from_str)
            .collect::<Result<Vec<_>, _>>()
            .and_then(|ranges| check_ranges(&ranges).map(|()| ranges))
            .map_err(|message| refuse(format!("attribute fenestra.sample_ranges: {message}")))?;
        let ahead = match has("fenestra.ahead") {
            true => parse_ahead(&text("fenestra.ahead")?).ok_or_else(|| {
                refuse("attribute fenestra.ahead: expected blocks or blocks:x:y".into())
            })?,
            false => Ahead::default(),
        };
        let seconds = image.attributes.get("fenestra.seconds").and_then(double).unwrap_or(0.0);
        if !(0.0..=LONGEST_RENDER).contains(&seconds) {
            return Err(refuse(format!(
                "attribute fenestra.seconds: expected 0 to {LONGEST_RENDER} seconds, found {seconds}"
            )));
        }
        Ok(Self {
            version: text("fenestra.version")?,
            scene: text("fenestra.scene")?,
            scene_hash: text("fenestra.scene_hash")?,
            fit_hashes: texts("fenestra.fit_hashes."),
            sampler: text("fenestra.sampler")?,
            sampler_parameters: texts("fenestra.sampler_parameters."),
            candidates: has("fenestra.candidates")
                .then(|| number("fenestra.candidates"))
                .transpose()?,
            shadow_rays: number("fenestra.shadow_rays")?,
            depth: number("fenestra.depth")?,
            sample_ranges,
            ahead,
            seconds,
            gpu_seconds: named("fenestra.gpu_seconds.")
                .filter_map(|(name, value)| Some((name, double(value)?)))
                .collect(),
            mattes: texts(PREFIX),
            device: text("fenestra.device")?,
            driver: text("fenestra.driver")?,
            // Older files do not say; the device traced.
            tracer: text("fenestra.tracer").unwrap_or_else(|_| "device".to_owned()),
        })
    }

    /// Lists the settings that keep two renders from being parts of one image, as "name: ours
    /// against theirs". Seeds, sample ranges, devices and times may differ.
    pub(crate) fn differences(&self, other: &Self) -> Vec<String> {
        let mut found = Vec::new();
        let mut compare = |what: &str, ours: String, theirs: String| {
            if ours != theirs {
                found.push(format!("{what}: {ours} against {theirs}"));
            }
        };
        compare("scene hash", self.scene_hash.clone(), other.scene_hash.clone());
        compare("sampler", self.sampler.clone(), other.sampler.clone());
        compare("shadow rays", self.shadow_rays.to_string(), other.shadow_rays.to_string());
        compare("depth", self.depth.to_string(), other.depth.to_string());
        for (what, missing, ours, theirs) in [
            ("sampler parameter", "default", &self.sampler_parameters, &other.sampler_parameters),
            ("fit of", "none", &self.fit_hashes, &other.fit_hashes),
        ] {
            for name in ours.keys().chain(theirs.keys()).collect::<BTreeSet<_>>() {
                let value = |values: &BTreeMap<String, String>| {
                    values.get(name).map_or(missing.to_owned(), Clone::clone)
                };
                compare(&format!("{what} {name}"), value(ours), value(theirs));
            }
        }
        found
    }

    /// Adds the ranges of `other` and joins neighbours of one seed.
    pub fn add_ranges(&mut self, other: &Self) {
        self.sample_ranges.extend(&other.sample_ranges);
        self.sample_ranges.sort_by_key(|range| (range.seed, range.first));
        let mut joined: Vec<SampleRange> = Vec::new();
        for range in self.sample_ranges.drain(..) {
            let neighbour = joined.last_mut().filter(|last| {
                last.seed == range.seed && last.first.checked_add(last.count) == Some(range.first)
            });
            // A count of 2³², all samples of a seed, does not fit.
            match neighbour.and_then(|last| Some((last.count.checked_add(range.count)?, last))) {
                Some((count, last)) => last.count = count,
                None => joined.push(range),
            }
        }
        self.sample_ranges = joined;
    }
}
