//! Checkpoints: the film's sums and the metadata of their render, as an OpenEXR file.
//!
//! The channels hold the sums bit for bit: `Sum.R/G/B`, `SumCompensation.R/G/B`, `Squares.R/G/B`,
//! `AlbedoSum.R/G/B`, `NSum.X/Y/Z`, `PSum.X/Y/Z`, `GuideCellSum.R/G/B`, `GuideLevelSum.R/G/B`, and
//! each count of shadow rays and cache entries as a pair of floats that add up to the integer.
//! Beside them, the picture `R`, `G`, `B` lets any viewer open the file.

use std::path::{Path, PathBuf};

use super::{
    exr::{Attribute, Image},
    metadata::{Metadata, SampleRange},
    sums::{Sums, split},
};
use crate::error::{Error, Result};

/// Attribute that marks a checkpoint, and the version of its channels.
const FORMAT_ATTRIBUTE: &str = "fenestra.checkpoint";
const FORMAT_VERSION: i32 = 1;

const SUM: [&str; 3] = ["Sum.R", "Sum.G", "Sum.B"];
const COMPENSATION: [&str; 3] = ["SumCompensation.R", "SumCompensation.G", "SumCompensation.B"];
const SQUARES: [&str; 3] = ["Squares.R", "Squares.G", "Squares.B"];
const ALBEDO: [&str; 3] = ["AlbedoSum.R", "AlbedoSum.G", "AlbedoSum.B"];
const NORMAL: [&str; 3] = ["NSum.X", "NSum.Y", "NSum.Z"];
const POSITION: [&str; 3] = ["PSum.X", "PSum.Y", "PSum.Z"];
const GUIDE_CELL: [&str; 3] = ["GuideCellSum.R", "GuideCellSum.G", "GuideCellSum.B"];
const GUIDE_LEVEL: [&str; 3] = ["GuideLevelSum.R", "GuideLevelSum.G", "GuideLevelSum.B"];
/// Visible and traced shadow rays: leading part and rest of each count.
const SHADOW_RAYS: [&str; 4] = [
    "ShadowRays.Visible",
    "ShadowRays.VisibleCompensation",
    "ShadowRays.Traced",
    "ShadowRays.TracedCompensation",
];
/// Entries of visibility caches and hits that have a cache, in the same way.
const CACHE_ENTRIES: [&str; 4] = [
    "CacheEntries.Entries",
    "CacheEntries.EntriesCompensation",
    "CacheEntries.Hits",
    "CacheEntries.HitsCompensation",
];

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

/// Path of the guide learned up to a checkpoint: `image.checkpoint.exr` → `image.checkpoint.guide`.
pub fn guide_path(checkpoint: &Path) -> PathBuf {
    checkpoint.with_extension("guide")
}

/// Tests whether `path` is named like a checkpoint.
pub fn is_checkpoint_path(path: &Path) -> bool {
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
        let layers = [
            (SUM, &sums.sum),
            (COMPENSATION, &sums.compensation),
            (SQUARES, &sums.squares),
            (ALBEDO, &sums.albedo),
            (NORMAL, &sums.normal),
            (POSITION, &sums.position),
            (GUIDE_CELL, &sums.guide_cell),
            (GUIDE_LEVEL, &sums.guide_level),
        ];
        for (names, values) in layers {
            if !values.is_empty() {
                image.insert_triple(names, values);
            }
        }
        insert_counts(&mut image, SHADOW_RAYS, &sums.visible);
        insert_counts(&mut image, CACHE_ENTRIES, &sums.cache_entries);
        self.metadata.store(&mut image);
        image.attributes.insert(FORMAT_ATTRIBUTE.to_owned(), Attribute::Integer(FORMAT_VERSION));
        image
    }

    /// Writes the checkpoint, atomically.
    ///
    /// # Errors
    /// [`Error::Io`] with the cause.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.to_image().write_exr_uncompressed(path)
    }

    /// Reads a checkpoint, bit for bit as it was written.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Format`] if the file is no complete checkpoint of finite sums.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_image(&Image::read_exr(path)?, path)
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
        let required = |names: [&str; 3]| {
            image.triple(names).ok_or_else(|| {
                Error::format(path, format!("incomplete checkpoint: no channels {names:?}"))
            })
        };
        let sample_count = u32::try_from(metadata.sample_count()).map_err(|_| {
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
        let sums = Sums {
            width: image.width,
            height: image.height,
            origin,
            film_size: image.film_size,
            sample_count,
            sum: required(SUM)?,
            compensation: required(COMPENSATION)?,
            squares: required(SQUARES)?,
            albedo: image.triple(ALBEDO).unwrap_or_default(),
            normal: image.triple(NORMAL).unwrap_or_default(),
            position: image.triple(POSITION).unwrap_or_default(),
            visible: counts(image, SHADOW_RAYS),
            cache_entries: counts(image, CACHE_ENTRIES),
            guide_cell: image.triple(GUIDE_CELL).unwrap_or_default(),
            guide_level: image.triple(GUIDE_LEVEL).unwrap_or_default(),
        };
        if sums.non_finite_count() > 0 {
            return Err(Error::format(
                path,
                format!("{} pixels with sums that are not finite", sums.non_finite_count()),
            ));
        }
        Ok(Self { sums, metadata })
    }

    /// Checks that a render described by `expected` can continue from this checkpoint. It needs the
    /// same scene, sampler with its parameters, shadow rays, depth and window, and a single range
    /// of samples, `first …` of `seed`. `window` holds no samples yet; every layer that it has
    /// (albedo, …) must be in the checkpoint too.
    ///
    /// # Errors
    /// [`Error::Format`] lists every difference and the remedy.
    pub fn check_resume(
        &self,
        path: &Path,
        expected: &Metadata,
        window: &Sums,
        seed: u32,
        first: u32,
    ) -> Result<()> {
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
        match self.metadata.sample_ranges[..] {
            [SampleRange { seed: ours, .. }] if ours != seed => {
                differences.push(format!("seed: {ours} against {seed}"));
            }
            [SampleRange { first: ours, .. }] if ours != first => {
                differences.push(format!("first sample: {ours} against {first}"));
            }
            [_] => {}
            _ => differences.push(format!(
                "{} ranges of samples against one: a merged checkpoint cannot be continued",
                self.metadata.sample_ranges.len()
            )),
        }
        let layers = [
            ("albedo", self.sums.albedo.is_empty(), window.albedo.is_empty()),
            ("normal", self.sums.normal.is_empty(), window.normal.is_empty()),
            ("position", self.sums.position.is_empty(), window.position.is_empty()),
            ("visible", self.sums.visible.is_empty(), window.visible.is_empty()),
            ("cache-entries", self.sums.cache_entries.is_empty(), window.cache_entries.is_empty()),
            ("guide-cell", self.sums.guide_cell.is_empty(), window.guide_cell.is_empty()),
        ];
        for (name, ours_missing, theirs_missing) in layers {
            if ours_missing && !theirs_missing {
                differences.push(format!("layer {name}: absent against asked for"));
            }
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
        image.channels.insert(name.to_owned(), counts.iter().map(part).collect());
    }
}

/// Inverse of [`insert_counts`]; empty if a channel is missing.
fn counts(image: &Image, names: [&str; 4]) -> Vec<[u32; 2]> {
    let [Some(first), Some(first_rest), Some(second), Some(second_rest)] =
        names.map(|name| image.channels.get(name))
    else {
        return Vec::new();
    };
    let count = |leading: f32, rest: f32| (f64::from(leading) + f64::from(rest)) as u32;
    (0..image.pixel_count())
        .map(|pixel| {
            [count(first[pixel], first_rest[pixel]), count(second[pixel], second_rest[pixel])]
        })
        .collect()
}
