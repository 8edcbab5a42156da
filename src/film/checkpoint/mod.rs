//! Checkpoints: the film's sums and the metadata of their render, as an OpenEXR file.
//!
//! The channels hold the sums bit for bit: `Sum.R/G/B`, `SumCompensation.R/G/B`, `Squares.R/G/B`,
//! `Pending.R/G/B` of a stopped sweep, `UnfilteredSum.R/G/B`, `SquaresCompensation.R/G/B`, `AlbedoSum.R/G/B`,
//! `NSum.X/Y/Z`, `PSum.X/Y/Z`, `GuideCellSum.R/G/B`, `GuideLevelSum.R/G/B`, and each count of shadow rays,
//! cache entries and coverages as a pair of floats that add up to the integer; `GroupSum_NAME.R/G/B` and so
//! on of each group of lights. Beside them, the picture `R`, `G`, `B` lets any viewer open the file. An
//! attribute holds the SHA-256 of window, channels and attributes, so that damage does not pass for radiance.

mod pair;

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::{
    Attribute, GroupSums, Image,
    layers::{COUNTS, COVERAGES, Coverage, TRIPLES},
    metadata::Metadata,
    sums::{Sums, split},
};
use crate::{
    error::{Error, Result},
    files::hexadecimal,
    scene::light_group::ENVIRONMENT,
    shader::constants::{FILM_BLOCK, MATTE_SLOTS},
};

pub(crate) use pair::Encoded;
pub use pair::{guide_paths, remove_checkpoint};

/// Attribute that marks a checkpoint, and the version of its channels.
const FORMAT_ATTRIBUTE: &str = "fenestra.checkpoint";
const FORMAT_VERSION: i32 = 5;
/// Channels of [`Sums::pending`].
const PENDING: [&str; 3] = ["Pending.R", "Pending.G", "Pending.B"];
/// SHA-256 of the rest of the file.
const CHECKSUM_ATTRIBUTE: &str = "fenestra.checksum";
/// SHA-256 of the guide's file.
const GUIDE_ATTRIBUTE: &str = "fenestra.guide";
/// Everything needed to continue a render as if it had not stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The film.
    pub sums: Sums,
    /// Metadata of its render.
    pub metadata: Metadata,
}

/// `image.exr` → `image.checkpoint.exr`.
pub fn checkpoint_path(image: &Path) -> PathBuf {
    image.with_extension("checkpoint.exr")
}

/// Tests whether `path` is named like a checkpoint.
pub(crate) fn is_checkpoint_path(path: &Path) -> bool {
    path.file_name()
        .is_some_and(|name| name.to_string_lossy().to_lowercase().ends_with(".checkpoint.exr"))
}

impl Checkpoint {
    /// Tests whether an image file holds a checkpoint.
    pub fn is_checkpoint(image: &Image) -> bool {
        image.attributes.contains_key(FORMAT_ATTRIBUTE)
    }

    /// Converts the checkpoint to the image that its file stores.
    fn to_image(&self) -> Image {
        let sums = &self.sums;
        let mut image = sums.to_image(&[]);
        for (layer, values) in TRIPLES.iter().zip(sums.triples()) {
            if !values.is_empty() {
                image.insert_triple(layer.channels, values);
            }
        }
        if !sums.ahead.is_none() {
            image.insert_triple(PENDING, &sums.pending);
        }
        for (layer, counts) in COUNTS.iter().zip(sums.counts()) {
            insert_counts(&mut image, layer.channels, counts);
        }
        for ((_, layer), coverages) in COVERAGES.iter().zip(sums.coverages()) {
            for slot in 0..MATTE_SLOTS as usize {
                let counts: Vec<_> = coverages.iter().map(|coverage| coverage[slot]).collect();
                let names = slot_names(layer, slot);
                insert_counts(&mut image, names.each_ref().map(String::as_str), &counts);
            }
        }
        for group in &sums.groups {
            for (part, values) in GroupSums::PARTS.iter().zip(group.parts()) {
                if !values.is_empty() {
                    let names = GroupSums::channels(part, &group.name);
                    image.insert_triple(names.each_ref().map(String::as_str), values);
                }
            }
        }
        self.metadata.store(&mut image);
        image.attributes.insert(FORMAT_ATTRIBUTE.to_owned(), Attribute::Integer(FORMAT_VERSION));
        image
    }

    /// Prepares the files: most of the work of a large film.
    pub(crate) fn encode(&self, guide: Option<Vec<u8>>) -> Encoded {
        let mut image = self.to_image();
        if let Some(guide) = &guide {
            let hash = Attribute::Text(hexadecimal(&Sha256::digest(guide)));
            image.attributes.insert(GUIDE_ATTRIBUTE.to_owned(), hash);
        }
        let checksum = Attribute::Text(checksum(&image));
        image.attributes.insert(CHECKSUM_ATTRIBUTE.to_owned(), checksum);
        Encoded { image, guide }
    }

    /// Reads a checkpoint, bit for bit as it was written.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Format`] if the file is no complete checkpoint of finite sums or
    /// does not match its checksum.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_image(&Image::read_exr(path)?, path)
    }

    /// Extracts the checkpoint from an image file; `path` only serves error messages.
    ///
    /// # Errors
    /// As [`Checkpoint::read`].
    pub fn from_image(image: &Image, path: &Path) -> Result<Self> {
        let refuse = |message: String| Error::format(path, message);
        match image.attributes.get(FORMAT_ATTRIBUTE) {
            Some(Attribute::Integer(FORMAT_VERSION)) => {}
            Some(other) => {
                return Err(refuse(format!(
                    "checkpoint of another version: expected {FORMAT_VERSION}, found {other:?}"
                )));
            }
            None => {
                return Err(refuse(format!("not a checkpoint: no attribute {FORMAT_ATTRIBUTE}")));
            }
        }
        let metadata = Metadata::load(image, path)?;
        let ahead = metadata.ahead;
        let blocks = [image.width, image.height].map(|side| u64::from(side.div_ceil(FILM_BLOCK)));
        if u64::from(ahead.blocks) >= blocks[0] * blocks[1] {
            let blocks = ahead.blocks;
            return Err(refuse(format!("{blocks} blocks of its film have further samples")));
        }
        let samples = metadata.sample_count();
        let has_samples = |count: &u32| (*count > 0 || !ahead.is_none()) && *count < u32::MAX;
        let sample_count = u32::try_from(samples).ok().filter(has_samples);
        let sample_count =
            sample_count.ok_or_else(|| refuse(format!("{samples} samples per pixel")))?;
        let [Ok(x), Ok(y)] = image.origin.map(u32::try_from) else {
            let origin = image.origin;
            return Err(refuse(format!("window starts at {origin:?}, outside the film")));
        };
        let mut sums = Sums {
            width: image.width,
            height: image.height,
            origin: [x, y],
            film_size: image.film_size,
            sample_count,
            ahead,
            ..Sums::default()
        };
        let layer = |names: [&str; 3], is_optional: bool| match image.triple(names) {
            Some(found) => Ok(found),
            None if is_optional => Ok(Vec::new()),
            None => Err(refuse(format!("incomplete checkpoint: no channels {names:?}"))),
        };
        for (known, values) in TRIPLES.iter().zip(sums.triples_mut()) {
            *values = layer(known.channels, known.aov.is_some())?;
        }
        if !ahead.is_none() {
            sums.pending = layer(PENDING, false)?;
        }
        for (layer, values) in COUNTS.iter().zip(sums.counts_mut()) {
            *values = counts(image, layer.channels, path)?;
        }
        for ((_, layer), coverages) in COVERAGES.iter().zip(sums.coverages_mut()) {
            for slot in 0..MATTE_SLOTS as usize {
                let names = slot_names(layer, slot);
                let counts = counts(image, names.each_ref().map(String::as_str), path)?;
                coverages.resize(counts.len(), Coverage::default());
                coverages.iter_mut().zip(counts).for_each(|(own, count)| own[slot] = count);
            }
        }
        let group_of = |channel: &String| {
            let name = channel.strip_prefix(GroupSums::PARTS[0])?.strip_prefix('_')?;
            Some(name.strip_suffix(".R")?.to_owned())
        };
        let mut names: Vec<String> = image.channels.keys().filter_map(group_of).collect();
        names.sort_by_key(|name| name != ENVIRONMENT);
        for name in names {
            let part = |part: &str| {
                let names = GroupSums::channels(part, &name);
                layer(names.each_ref().map(String::as_str), false)
            };
            let [sum, compensation, pending] = GroupSums::PARTS.map(part);
            let pending = if ahead.is_none() { Vec::new() } else { pending? };
            sums.groups.push(GroupSums { sum: sum?, compensation: compensation?, pending, name });
        }
        let bad = sums.non_finite_count();
        if bad > 0 {
            return Err(refuse(format!("{bad} pixels with sums that are not finite")));
        }
        let stored = image.attributes.get(CHECKSUM_ATTRIBUTE);
        if stored != Some(&Attribute::Text(checksum(image))) {
            return Err(Error::format(
                path,
                "damaged checkpoint: its checksum does not match its content; delete it, or leave \
                 out --resume to start again",
            ));
        }
        Ok(Self { sums, metadata })
    }

    /// Checks that a render described by `expected` can continue from this checkpoint. It needs the
    /// same scene, sampler with its parameters, shadow rays, depth and window, and a single range
    /// of samples, with the seed and the first sample of the range expected. `window` holds no samples
    /// yet; every layer that it has (albedo, …) must be in the checkpoint too.
    ///
    /// # Errors
    /// [`Error::Format`] lists every difference and the remedy.
    pub fn check_resume(&self, path: &Path, expected: &Metadata, window: &Sums) -> Result<()> {
        let mut differences = self.metadata.differences(expected);
        let described = |Sums { width, height, origin: [x, y], film_size, .. }: &Sums| {
            format!("{width}x{height} at {x},{y} of {}x{}", film_size[0], film_size[1])
        };
        let (ours, theirs) = (described(&self.sums), described(window));
        if ours != theirs {
            differences.push(format!("window: {ours} against {theirs}"));
        }
        match (&self.metadata.sample_ranges[..], &expected.sample_ranges[..]) {
            ([ours], [theirs]) if ours.seed != theirs.seed => {
                differences.push(format!("seed: {} against {}", ours.seed, theirs.seed));
            }
            ([ours], [theirs]) if ours.first != theirs.first => {
                differences.push(format!("first sample: {} against {}", ours.first, theirs.first));
            }
            ([_], _) => {}
            _ => differences.push(format!(
                "{} ranges of samples against one: a merged checkpoint cannot be continued",
                self.metadata.sample_ranges.len()
            )),
        }
        for aov in self.sums.lacks(window) {
            differences.push(format!("layer {}: absent against asked for", aov.name()));
        }
        if differences.is_empty() {
            return Ok(());
        }
        let message = format!(
            "the checkpoint belongs to another render ({}); give the options it was made with, or leave out \
             --resume to start again",
            differences.join("; ")
        );
        Err(Error::format(path, message))
    }
}

/// Inserts four channels for pairs of counts: leading part and rest of the first count, then of the
/// second. Inserts nothing without pairs.
fn insert_counts(image: &mut Image, names: [&str; 4], counts: &[[u32; 2]]) {
    if counts.is_empty() {
        return;
    }
    for (index, name) in names.into_iter().enumerate() {
        let part = |pair: &[u32; 2]| {
            let (leading, rest) = split(f64::from(pair[index / 2]));
            if index % 2 == 0 { leading } else { rest }
        };
        image.channels.insert(name.to_owned(), counts.par_iter().map(part).collect());
    }
}

/// Channels of a slot of a layer of coverages.
fn slot_names(layer: &str, slot: usize) -> [String; 4] {
    ["Id", "IdCompensation", "Samples", "SamplesCompensation"]
        .map(|part| format!("{layer}{slot}.{part}"))
}

/// Inverse of [`insert_counts`]; empty if a channel is missing. Fails with [`Error::Format`] for a pair that
/// is not a count of 32 bits.
fn counts(image: &Image, names: [&str; 4], path: &Path) -> Result<Vec<[u32; 2]>> {
    let [Some(first), Some(first_rest), Some(second), Some(second_rest)] =
        names.map(|name| image.channels.get(name))
    else {
        return Ok(Vec::new());
    };
    let count = |leading: f32, rest: f32| {
        let value = f64::from(leading) + f64::from(rest);
        if value.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&value) {
            let message = format!("channels {names:?}: expected a count, found {value}");
            return Err(Error::format(path, message));
        }
        Ok(value as u32)
    };
    (0..image.pixel_count())
        .map(|pixel| {
            let first = count(first[pixel], first_rest[pixel])?;
            Ok([first, count(second[pixel], second_rest[pixel])?])
        })
        .collect()
}

/// Name of a channel and the SHA-256 of its samples.
fn hash_of_channel<'a>((name, samples): (&'a String, &Vec<f32>)) -> (&'a str, [u8; 32]) {
    let mut hasher = Sha256::new();
    let mut bytes = [[0; 4]; 1024];
    for samples in samples.chunks(bytes.len()) {
        for (bytes, sample) in bytes.iter_mut().zip(samples) {
            *bytes = sample.to_le_bytes();
        }
        hasher.update(bytes[..samples.len()].as_flattened());
    }
    (name, hasher.finalize().into())
}

/// SHA-256 of the window, the channels' hashes and all attributes but the checksum itself.
fn checksum(image: &Image) -> String {
    let mut hasher = Sha256::new();
    for value in [image.width, image.height, image.film_size[0], image.film_size[1]] {
        hasher.update(value.to_le_bytes());
    }
    hasher.update(image.origin.map(i32::to_le_bytes).as_flattened());
    // Lengths keep names and values apart.
    let mut add = |tag: u8, name: &str, bytes: &[u8]| {
        hasher.update([tag]);
        hasher.update((name.len() as u64).to_le_bytes());
        hasher.update(name);
        hasher.update((bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    // Channels have hashes of their own, so that threads share them.
    let channels: Vec<_> = image.channels.par_iter().map(hash_of_channel).collect();
    for (name, hash) in channels {
        add(0, name, &hash);
    }
    for (name, value) in &image.attributes {
        match value {
            _ if name == CHECKSUM_ATTRIBUTE => {}
            Attribute::Text(value) => add(1, name, value.as_bytes()),
            Attribute::Integer(value) => add(2, name, &value.to_le_bytes()),
            Attribute::Float(value) => add(3, name, &value.to_le_bytes()),
            Attribute::Double(value) => add(4, name, &value.to_le_bytes()),
        }
    }
    hexadecimal(&hasher.finalize())
}
