//! Checkpoints: the film's sums and the metadata of their render, as an OpenEXR file.
//!
//! The channels hold the sums bit for bit: `Sum.R/G/B`, `SumCompensation.R/G/B`, `Squares.R/G/B`,
//! `Pending.R/G/B` of a stopped sweep, `UnfilteredSum.R/G/B`,
//! `SquaresCompensation.R/G/B`, `AlbedoSum.R/G/B`, `NSum.X/Y/Z`, `PSum.X/Y/Z`, `GuideCellSum.R/G/B`,
//! `GuideLevelSum.R/G/B`, and each count of shadow rays, cache entries and coverages as a pair of floats
//! that add up to the integer;
//! `GroupSum_NAME.R/G/B` and so on of each group of lights.
//! Beside them, the picture `R`, `G`, `B` lets any viewer open the file. An attribute holds the
//! SHA-256 of window, channels and attributes, so that damage does not pass for radiance.
//!
//! The guide of a sampler that learns lies in a file of its own, named by its content:
//! `image.checkpoint.<hash>.guide`. It is written before the checkpoint that holds its hash, and
//! the guide of the older checkpoint is removed after. The renaming of the checkpoint is the one
//! moment at which both change, so a killed process leaves the old pair or the new one.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::{
    Attribute, GroupSums, Image,
    metadata::Metadata,
    sums::{COUNTS, COVERAGES, Coverage, Sums, TRIPLES, split},
};
use crate::{
    error::{Error, Result},
    files::{self, hexadecimal, write_atomically},
    scene::light_group::ENVIRONMENT,
    shader::constants::{FILM_BLOCK, MATTE_SLOTS},
};

/// Attribute that marks a checkpoint, and the version of its channels.
const FORMAT_ATTRIBUTE: &str = "fenestra.checkpoint";
const FORMAT_VERSION: i32 = 5;
/// Channels of [`Sums::pending`].
const PENDING: [&str; 3] = ["Pending.R", "Pending.G", "Pending.B"];
/// SHA-256 of the rest of the file.
const CHECKSUM_ATTRIBUTE: &str = "fenestra.checksum";
/// SHA-256 of the guide's file.
const GUIDE_ATTRIBUTE: &str = "fenestra.guide";
/// Digits of that hash in the file's name.
const GUIDE_NAME_DIGITS: usize = 12;

/// Steps in which a checkpoint is written, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// The guide appears.
    Guide,
    /// The checkpoint takes the place of the older one.
    Checkpoint,
    /// The older guide goes.
    Removal,
}

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

/// Path of the guide with this hash: `image.checkpoint.exr` → `image.checkpoint.<hash>.guide`.
fn guide_path(checkpoint: &Path, hash: &str) -> PathBuf {
    let digits: String = hash.chars().take(GUIDE_NAME_DIGITS).collect();
    checkpoint.with_extension(format!("{digits}.guide"))
}

/// Lists the guides that lie beside a checkpoint.
///
/// # Errors
/// [`Error::Io`] for a folder that cannot be read.
pub fn guide_paths(checkpoint: &Path) -> Result<Vec<PathBuf>> {
    let folder = files::parent_of(checkpoint);
    let stem = checkpoint.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let prefix = stem.unwrap_or_default() + ".";
    let is_guide = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
        let name = name.unwrap_or_default();
        let hash = name.strip_prefix(&prefix).and_then(|rest| rest.strip_suffix(".guide"));
        hash.is_some_and(|hash| {
            hash.len() == GUIDE_NAME_DIGITS
                && hash.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
        })
    };
    let entries =
        fs::read_dir(folder).map_err(|source| Error::io(folder, "read folder", source))?;
    let mut paths: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path()).filter(is_guide).collect();
    paths.sort();
    Ok(paths)
}

/// Removes a checkpoint and its guides, where they exist.
///
/// # Errors
/// [`Error::Io`] with the cause.
pub fn remove_checkpoint(path: &Path) -> Result<()> {
    files::remove(path)?;
    guide_paths(path)?.iter().try_for_each(|guide| files::remove(guide))
}

/// Locks the folder of a checkpoint against other writers, where the system has such locks.
fn locked_folder(path: &Path) -> Option<fs::File> {
    let folder = fs::File::open(files::parent_of(path)).ok()?;
    folder.lock().ok()?;
    Some(folder)
}

/// Tests whether `path` is named like a checkpoint.
pub(crate) fn is_checkpoint_path(path: &Path) -> bool {
    path.file_name()
        .is_some_and(|name| name.to_string_lossy().to_lowercase().ends_with(".checkpoint.exr"))
}

/// Path and bytes of a guide.
pub(crate) type GuideFile = (PathBuf, Vec<u8>);

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

    /// Writes the checkpoint of a sampler that does not learn, atomically.
    ///
    /// # Errors
    /// [`Error::Io`] with the cause.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.write_with_guide(path, None)
    }

    /// Writes the checkpoint and the file of its guide, as [`Encoded::write`].
    ///
    /// # Errors
    /// [`Error::Io`] with the cause.
    pub fn write_with_guide(&self, path: &Path, guide: Option<&[u8]>) -> Result<()> {
        self.encode(guide.map(<[u8]>::to_vec)).write(path)
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

    /// Reads a checkpoint and the path and bytes of its guide, if it has one.
    ///
    /// # Errors
    /// As [`Checkpoint::read`], for either file.
    pub fn read_with_guide(path: &Path) -> Result<(Self, Option<GuideFile>)> {
        // Another process may replace the pair between the two files.
        let _lock = locked_folder(path);
        let image = Image::read_exr(path)?;
        let checkpoint = Self::from_image(&image, path)?;
        let Some(Attribute::Text(hash)) = image.attributes.get(GUIDE_ATTRIBUTE) else {
            return Ok((checkpoint, None));
        };
        let guide_path = guide_path(path, hash);
        let guide = files::read(&guide_path)?;
        if hexadecimal(&Sha256::digest(&guide)) != *hash {
            return Err(Error::format(
                &guide_path,
                format!("damaged, or not the guide of {}", path.display()),
            ));
        }
        Ok((checkpoint, Some((guide_path, guide))))
    }

    /// Extracts the checkpoint from an image file; `path` only serves error messages.
    ///
    /// # Errors
    /// As [`Checkpoint::read`].
    pub fn from_image(image: &Image, path: &Path) -> Result<Self> {
        match image.attributes.get(FORMAT_ATTRIBUTE) {
            Some(Attribute::Integer(FORMAT_VERSION)) => {}
            Some(other) => {
                return Err(Error::format(
                    path,
                    format!(
                        "checkpoint of another version: expected {FORMAT_VERSION}, found {other:?}"
                    ),
                ));
            }
            None => {
                return Err(Error::format(
                    path,
                    format!("not a checkpoint: no attribute {FORMAT_ATTRIBUTE}"),
                ));
            }
        }
        let metadata = Metadata::load(image, path)?;
        let ahead = metadata.ahead;
        let blocks = [image.width, image.height].map(|side| u64::from(side.div_ceil(FILM_BLOCK)));
        if u64::from(ahead.blocks) >= blocks[0] * blocks[1] {
            let message = format!("{} blocks of its film have further samples", ahead.blocks);
            return Err(Error::format(path, message));
        }
        let has_samples = |count: &u32| (*count > 0 || !ahead.is_none()) && *count < u32::MAX;
        let sample_count =
            u32::try_from(metadata.sample_count()).ok().filter(has_samples).ok_or_else(|| {
                Error::format(path, format!("{} samples per pixel", metadata.sample_count()))
            })?;
        let mut origin = [0; 2];
        for (value, stored) in origin.iter_mut().zip(image.origin) {
            *value = u32::try_from(stored).map_err(|_| {
                Error::format(
                    path,
                    format!("window starts at {:?}, outside the film", image.origin),
                )
            })?;
        }
        let mut sums = Sums {
            width: image.width,
            height: image.height,
            origin,
            film_size: image.film_size,
            sample_count,
            ahead,
            ..Sums::default()
        };
        let layer = |names: [&str; 3], is_optional: bool| match image.triple(names) {
            Some(found) => Ok(found),
            None if is_optional => Ok(Vec::new()),
            None => {
                let message = format!("incomplete checkpoint: no channels {names:?}");
                Err(Error::format(path, message))
            }
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
        if sums.non_finite_count() > 0 {
            return Err(Error::format(
                path,
                format!("{} pixels with sums that are not finite", sums.non_finite_count()),
            ));
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
        let described = |sums: &Sums| {
            format!(
                "{}x{} at {},{} of {}x{}",
                sums.width,
                sums.height,
                sums.origin[0],
                sums.origin[1],
                sums.film_size[0],
                sums.film_size[1]
            )
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
        Err(Error::format(
            path,
            format!(
                "the checkpoint belongs to another render ({}); give the options it was made with, \
                 or leave out --resume to start again",
                differences.join("; ")
            ),
        ))
    }
}

/// A checkpoint as the files that it is written to.
pub(crate) struct Encoded {
    image: Image,
    guide: Option<Vec<u8>>,
}

impl Encoded {
    /// Writes the checkpoint and the file of its guide. Both replace older ones at one moment: at
    /// every other, and after every failure, the older pair or the newer one is complete.
    ///
    /// # Errors
    /// [`Error::Io`] with the cause.
    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        self.write_in_steps(path, &mut |_| Ok(()))
    }

    /// [`Self::write`], which asks `before` each step whether to go on.
    fn write_in_steps(
        &self,
        path: &Path,
        before: &mut dyn FnMut(Step) -> Result<()>,
    ) -> Result<()> {
        // Others that write this checkpoint would remove the guide before its checkpoint is there.
        let _lock = locked_folder(path);
        let Self { image, guide } = self;
        let mut kept = None;
        let mut added = None;
        if let (Some(guide), Some(Attribute::Text(hash))) =
            (guide, image.attributes.get(GUIDE_ATTRIBUTE))
        {
            let guide_path = guide_path(path, hash);
            before(Step::Guide)?;
            let is_new = !guide_path.exists();
            write_atomically(&guide_path, |file| file.write_all(guide))?;
            kept = guide_path.file_name().map(ToOwned::to_owned);
            added = is_new.then_some(guide_path);
        }
        before(Step::Checkpoint)?;
        if let Err(error) = image.write_exr_uncompressed(path) {
            // Without its checkpoint a guide only takes space, but the disk may fail after the renaming.
            let guide_of = |image: &Image| image.attributes.get(GUIDE_ATTRIBUTE).cloned();
            let is_named =
                Image::read_exr(path).is_ok_and(|found| guide_of(&found) == guide_of(image));
            for guide in added.iter().filter(|_| !is_named) {
                files::remove(guide).unwrap_or_else(|error| log::warn!("{error}"));
            }
            return Err(error);
        }
        before(Step::Removal)?;
        // The checkpoint is safe: a guide that stays behind does no harm.
        let remove_others = || {
            let others = guide_paths(path)?;
            let others = others.iter().filter(|other| other.file_name() != kept.as_deref());
            others.into_iter().try_for_each(|other| files::remove(other))
        };
        if let Err(error) = remove_others() {
            log::warn!("{error}");
        }
        Ok(())
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

/// Inverse of [`insert_counts`]; empty if a channel is missing.
///
/// # Errors
/// [`Error::Format`] for a pair that is not a count of 32 bits.
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

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::film::SampleRange;

    fn checkpoint(samples: u32) -> Checkpoint {
        let mut sums = Sums::new([0, 0], 2, 1, [2, 1]);
        sums.sum = vec![[samples as f32; 3]; 2];
        sums.sample_count = samples;
        let range = SampleRange { seed: 1, first: 0, count: samples };
        Checkpoint {
            sums,
            metadata: Metadata { sample_ranges: vec![range], ..Metadata::default() },
        }
    }

    /// Stops the second writing before each of its steps, as a killed process or a full disk does,
    /// and within the first two, which leaves a part of a temporary file behind.
    #[test]
    fn a_complete_pair_exists_after_every_step() {
        let pair = |samples: u32| (checkpoint(samples), format!("guide of {samples}").into_bytes());
        for stop in [Step::Guide, Step::Checkpoint, Step::Removal] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("room.checkpoint.exr");
            let write = |samples: u32, before: &mut dyn FnMut(Step) -> Result<()>| {
                let (checkpoint, guide) = pair(samples);
                checkpoint.encode(Some(guide)).write_in_steps(&path, before)
            };
            let read = || {
                let (checkpoint, guide) = Checkpoint::read_with_guide(&path).unwrap();
                (checkpoint, guide.unwrap().1)
            };
            write(4, &mut |_| Ok(())).unwrap();
            assert_eq!(read(), pair(4));
            fs::write(folder.path().join(".fenestra-1-part.tmp"), "part").unwrap();
            let stopped = |step| if step == stop { Err(Error::Interrupted) } else { Ok(()) };
            assert!(write(8, &mut { stopped }).is_err());
            assert_eq!(read(), pair(if stop == Step::Removal { 8 } else { 4 }), "{stop:?}");
            // The next writing removes what the stopped one left behind.
            write(12, &mut |_| Ok(())).unwrap();
            assert_eq!(read(), pair(12), "{stop:?}");
            assert_eq!(guide_paths(&path).unwrap().len(), 1, "{stop:?}");
            remove_checkpoint(&path).unwrap();
            assert!(!path.exists() && guide_paths(&path).unwrap().is_empty());
        }
    }

    /// The second writer comes when the guide of the first is there, its checkpoint not yet.
    #[test]
    fn two_writers_leave_a_complete_pair() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.checkpoint.exr");
        std::thread::scope(|scope| {
            let second = || checkpoint(8).write_with_guide(&path, Some(b"second")).unwrap();
            let mut before = |step| {
                if step == Step::Checkpoint {
                    let writer = scope.spawn(second);
                    let start = std::time::Instant::now();
                    while !writer.is_finished() && start.elapsed().as_millis() < 100 {
                        std::thread::yield_now();
                    }
                }
                Ok(())
            };
            checkpoint(4)
                .encode(Some(b"first".to_vec()))
                .write_in_steps(&path, &mut before)
                .unwrap();
            assert!(Checkpoint::read_with_guide(&path).unwrap().1.is_some());
        });
        assert_eq!(Checkpoint::read_with_guide(&path).unwrap().1.unwrap().1, b"second");
    }

    #[test]
    fn obstacles_leave_the_older_pair() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.checkpoint.exr");
        checkpoint(4).write_with_guide(&path, Some(b"older")).unwrap();
        // A folder where the guide should go
        let obstacle = guide_path(&path, &hexadecimal(&Sha256::digest(b"newer")));
        fs::create_dir(&obstacle).unwrap();
        assert!(checkpoint(8).write_with_guide(&path, Some(b"newer")).is_err());
        let (read, guide) = Checkpoint::read_with_guide(&path).unwrap();
        assert_eq!((read, guide.unwrap().1), (checkpoint(4), b"older".to_vec()));
        // A folder where the checkpoint should go
        fs::remove_dir(&obstacle).unwrap();
        let kept = folder.path().join("kept");
        fs::rename(&path, &kept).unwrap();
        fs::create_dir(&path).unwrap();
        assert!(checkpoint(8).write_with_guide(&path, Some(b"newer")).is_err());
        assert_eq!(guide_paths(&path).unwrap().len(), 1, "the try leaves nothing");
        fs::remove_dir(&path).unwrap();
        fs::rename(&kept, &path).unwrap();
        let (read, guide) = Checkpoint::read_with_guide(&path).unwrap();
        assert_eq!((read, guide.unwrap().1), (checkpoint(4), b"older".to_vec()));
    }

    #[test]
    fn a_damaged_or_exchanged_guide_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.checkpoint.exr");
        checkpoint(4).write_with_guide(&path, Some(b"learned")).unwrap();
        let guide = guide_paths(&path).unwrap().remove(0);
        fs::write(&guide, b"lEarned").unwrap();
        let error = Checkpoint::read_with_guide(&path).unwrap_err().to_string();
        assert!(error.contains("damaged, or not the guide of"), "{error}");
        fs::remove_file(&guide).unwrap();
        let error = Checkpoint::read_with_guide(&path).unwrap_err().to_string();
        assert!(error.contains(".guide: cannot read"), "{error}");
        // A checkpoint of a sampler that does not learn removes guides of older ones.
        checkpoint(4).write_with_guide(&path, Some(b"learned")).unwrap();
        checkpoint(8).write(&path).unwrap();
        assert_eq!(guide_paths(&path).unwrap(), Vec::<PathBuf>::new());
        assert!(Checkpoint::read_with_guide(&path).unwrap().1.is_none());
    }
}
