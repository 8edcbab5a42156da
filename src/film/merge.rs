//! Combines renders of one scene made with different seeds or sample ranges into one.
//!
//! Checkpoints are merged exactly, by adding their sums; images by their means weighted with their
//! sample counts, which equals one run up to rounding.

use std::{collections::BTreeSet, path::Path};

use super::{
    checkpoint::Checkpoint,
    exr::Image,
    metadata::Metadata,
};
use crate::error::{Error, Result};

/// One image to merge.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// Its file, for messages.
    pub path: &'a Path,
    /// Its channels.
    pub image: &'a Image,
    /// What it was rendered with.
    pub metadata: &'a Metadata,
}

/// Adds the sums of checkpoints of one render.
///
/// # Errors
/// [`Error::Format`] naming the two files: another scene, sampler, window, …; samples that both
/// hold. [`Error::Usage`] without parts.
pub fn merge_checkpoints(parts: &[(&Path, &Checkpoint)]) -> Result<Checkpoint> {
    let Some(((first_path, first), others)) = parts.split_first() else {
        return Err(Error::usage("nothing to merge"));
    };
    let mut merged = (*first).clone();
    for (index, (path, part)) in others.iter().enumerate() {
        let window = |checkpoint: &Checkpoint| {
            let sums = &checkpoint.sums;
            (sums.origin.map(i64::from), sums.width, sums.height, sums.film_size)
        };
        check_window(first_path, window(first), path, window(part))?;
        check_metadata(first_path, &first.metadata, path, &part.metadata)?;
        for (earlier_path, earlier) in &parts[..=index] {
            check_overlap(earlier_path, &earlier.metadata, path, &part.metadata)?;
        }
        merged.sums.add(&part.sums);
        add_metadata(&mut merged.metadata, &part.metadata);
    }
    Ok(merged)
}

/// Means of images of one render, weighted with their sample counts; the variance of the pixel mean
/// is that of all samples pooled. Channels that not every part has are left out.
///
/// # Errors
/// As [`merge_checkpoints`].
pub fn merge_images(parts: &[Part<'_>]) -> Result<(Image, Metadata)> {
    let Some((first, others)) = parts.split_first() else {
        return Err(Error::usage("nothing to merge"));
    };
    let mut metadata = first.metadata.clone();
    for (index, part) in others.iter().enumerate() {
        let window = |image: &Image| {
            (image.origin.map(i64::from), image.width, image.height, image.film_size)
        };
        check_window(first.path, window(first.image), part.path, window(part.image))?;
        check_metadata(first.path, first.metadata, part.path, part.metadata)?;
        for earlier in &parts[..=index] {
            check_overlap(earlier.path, earlier.metadata, part.path, part.metadata)?;
        }
        add_metadata(&mut metadata, part.metadata);
    }
    if metadata.sample_count() == 0 {
        return Err(Error::format(first.path, "no part holds any sample"));
    }
    let mut merged = Image {
        channels: std::collections::BTreeMap::new(),
        attributes: first.image.attributes.clone(),
        ..*first.image
    };
    let is_common = |name: &&String| {
        others.iter().all(|part| part.image.channels.contains_key(name.as_str()))
    };
    for name in first.image.channels.keys().filter(is_common) {
        merged.channels.insert(name.clone(), merge_channel(name, parts));
    }
    metadata.store(&mut merged);
    Ok((merged, metadata))
}

/// Merges one channel that every part has.
fn merge_channel(name: &str, parts: &[Part<'_>]) -> Vec<f32> {
    let count = |part: &Part<'_>| part.metadata.sample_count() as f64;
    let value = |part: &Part<'_>, channel: &str, pixel: usize| {
        f64::from(part.image.channels[channel][pixel])
    };
    let has = |channel: &str| parts.iter().all(|part| part.image.channels.contains_key(channel));
    let sum = |term: &dyn Fn(&Part<'_>) -> f64| parts.iter().map(term).sum::<f64>();
    let total = sum(&count);
    let colour = name.strip_prefix("Variance.").filter(|colour| has(colour));
    let at = |pixel: usize| match (name, colour) {
        ("SampleCount.Y" | "ShadowRays.Y", _) => sum(&|part| value(part, name, pixel)),
        ("Visible.Y", _) if has("ShadowRays.Y") => {
            let traced = |part: &Part<'_>| value(part, "ShadowRays.Y", pixel);
            let visible = sum(&|part| traced(part) * value(part, name, pixel));
            visible / sum(&traced).max(1.0)
        }
        (_, Some(colour)) => {
            // Undo the mean and its variance into Σx and Σx², add, and estimate again:
            // `Sums::variance_of_mean`.
            let mean = |part: &Part<'_>| value(part, colour, pixel);
            let squares = sum(&|part| {
                let n = count(part);
                n * (n - 1.0) * value(part, name, pixel) + n * mean(part) * mean(part)
            });
            let radiance = sum(&|part| count(part) * mean(part));
            let deviation = (squares - radiance * radiance / total).max(0.0);
            if total < 2.0 { 0.0 } else { deviation / (total * (total - 1.0)) }
        }
        _ => sum(&|part| count(part) * value(part, name, pixel)) / total,
    };
    (0..parts[0].image.pixel_count()).map(|pixel| at(pixel) as f32).collect()
}

/// Origin, width, height and film size of a part.
type Window = ([i64; 2], u32, u32, [u32; 2]);

fn check_window(first_path: &Path, first: Window, path: &Path, part: Window) -> Result<()> {
    if first == part {
        return Ok(());
    }
    let describe = |([x, y], width, height, [film_width, film_height]): Window| {
        format!("{width}x{height} pixels at {x},{y} of {film_width}x{film_height}")
    };
    Err(Error::format(
        path,
        format!(
            "shows {}, but {} shows {}",
            describe(part),
            first_path.display(),
            describe(first)
        ),
    ))
}

fn check_metadata(
    first_path: &Path,
    first: &Metadata,
    path: &Path,
    part: &Metadata,
) -> Result<()> {
    let differences = part.differences(first);
    if differences.is_empty() {
        return Ok(());
    }
    Err(Error::format(
        path,
        format!("not of one render with {}: {}", first_path.display(), differences.join("; ")),
    ))
}

fn check_overlap(
    first_path: &Path,
    first: &Metadata,
    path: &Path,
    part: &Metadata,
) -> Result<()> {
    for range in &part.sample_ranges {
        if let Some(other) = first.sample_ranges.iter().find(|other| other.overlaps(range)) {
            return Err(Error::format(
                path,
                format!(
                    "holds samples {}..{} of seed {}, but {} holds samples {}..{} of it; render the \
                     parts with different --seed or --sample-offset",
                    range.first,
                    u64::from(range.first) + u64::from(range.count),
                    range.seed,
                    first_path.display(),
                    other.first,
                    u64::from(other.first) + u64::from(other.count),
                ),
            ));
        }
    }
    Ok(())
}

fn add_metadata(merged: &mut Metadata, part: &Metadata) {
    merged.add_ranges(part);
    merged.seconds += part.seconds;
    for (name, seconds) in &part.gpu_seconds {
        *merged.gpu_seconds.entry(name.clone()).or_default() += seconds;
    }
    merged.device = joined(&merged.device, &part.device);
    merged.driver = joined(&merged.driver, &part.driver);
}

/// Both names, without repetition.
fn joined(ours: &str, theirs: &str) -> String {
    let names: BTreeSet<&str> = ours.split(" + ").chain(theirs.split(" + ")).collect();
    names.into_iter().collect::<Vec<_>>().join(" + ")
}
