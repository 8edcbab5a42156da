//! Combines renders of one scene made with different seeds, sample ranges or windows into one.
//!
//! Checkpoints merge exactly, by adding their sums. Images merge by averaging their means, weighted by sample
//! count, which equals one run up to rounding. Windows of the same samples are joined pixel by pixel.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use super::{Image, checkpoint::Checkpoint, cryptomatte, metadata::Metadata};
use crate::error::{Error, Result};

/// One image to merge.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// Its file, for messages.
    pub path: &'a Path,
    /// Its channels.
    pub image: &'a Image,
    /// Metadata of its render.
    pub metadata: &'a Metadata,
}

/// Adds the sums of checkpoints of one render.
///
/// # Errors
/// [`Error::Format`] names two files that differ in scene, sampler, window, …, or that share
/// samples. [`Error::Usage`] without parts.
pub fn merge_checkpoints(parts: &[(&Path, &Checkpoint)]) -> Result<Checkpoint> {
    let ((_, first), others) = split(parts)?;
    check(parts, |(path, Checkpoint { sums, metadata })| {
        let window = (sums.origin.map(i64::from), sums.width, sums.height, sums.film_size);
        (path, window, metadata)
    })?;
    let mut merged = (*first).clone();
    for (path, part) in others {
        let [own, before] = [part, &merged].map(|checkpoint| checkpoint.sums.sample_count);
        if before.checked_add(own).is_none() {
            let most = u32::MAX;
            let message = format!(
                "its {own} samples per pixel and the {before} of the parts before exceed {most}"
            );
            return Err(Error::format(path, message));
        }
        merged.sums.add(&part.sums);
        add_metadata(&mut merged.metadata, &part.metadata);
    }
    Ok(merged)
}

/// Averages images of one render, weighted by sample count, and pools the variance of the pixel
/// mean over all samples. Drops channels that some part lacks.
///
/// # Errors
/// As [`merge_checkpoints`].
pub fn merge_images(parts: &[Part<'_>]) -> Result<(Image, Metadata)> {
    let (first, others) = split(parts)?;
    check(parts, |Part { path, image, metadata }| {
        let window = (image.origin.map(i64::from), image.width, image.height, image.film_size);
        (path, window, metadata)
    })?;
    let mut metadata = first.metadata.clone();
    others.iter().for_each(|part| add_metadata(&mut metadata, part.metadata));
    if metadata.sample_count() == 0 {
        return Err(Error::format(first.path, "no part holds any sample"));
    }
    let mut merged = Image {
        channels: BTreeMap::new(),
        attributes: first.image.attributes.clone(),
        ..*first.image
    };
    for name in common_channels(parts).filter(|name| !cryptomatte::is_channel(name)) {
        merged.channels.insert(name.clone(), merge_channel(name, parts));
    }
    let images: Vec<_> =
        parts.iter().map(|part| (part.image, part.metadata.sample_count() as f64)).collect();
    cryptomatte::merge(&mut merged, &images, metadata.sample_count() as f64);
    metadata.store(&mut merged);
    Ok((merged, metadata))
}

/// Joins images of the same samples that show different windows of one film into the smallest window around
/// them all. Where windows overlap, the first part gives the pixel. Drops channels that some part lacks.
///
/// # Errors
/// [`Error::Format`] names two files that differ in film, scene, sampler or samples, or a pixel that no part
/// shows. [`Error::Usage`] without parts.
pub fn join_windows(parts: &[Part<'_>]) -> Result<(Image, Metadata)> {
    let (first, others) = split(parts)?;
    let mut metadata = first.metadata.clone();
    for part in others {
        let mut differences = part.metadata.differences(first.metadata);
        let [ours, theirs] = [part, first].map(|part| part.image.film_size);
        if ours != theirs {
            differences.push(format!("film: {ours:?} against {theirs:?} pixels"));
        }
        let [ours, theirs] = [part.metadata, first.metadata].map(|metadata| {
            let ranges = metadata.sample_ranges.iter().map(ToString::to_string);
            ranges.collect::<Vec<_>>().join(", ")
        });
        if ours != theirs {
            differences.push(format!("samples: {ours} against {theirs}"));
        }
        if !differences.is_empty() {
            let (other, list) = (first.path.display(), differences.join("; "));
            let message = format!("no window of one film with {other}: {list}");
            return Err(Error::format(part.path, message));
        }
        add_metadata(&mut metadata, part.metadata);
    }
    metadata.sample_ranges.clone_from(&first.metadata.sample_ranges);
    let start = |axis: usize| parts.iter().map(|part| part.image.origin[axis]).min().unwrap_or(0);
    let origin = [start(0), start(1)];
    // Places of a part's columns and rows in the whole.
    let place = |part: &Part<'_>| {
        let [x, y] = [0, 1].map(|axis| (part.image.origin[axis] - origin[axis]) as usize);
        let (width, height) = (part.image.width as usize, part.image.height as usize);
        (x..x + width, y..y + height)
    };
    let ends = || parts.iter().map(place).map(|(columns, rows)| [columns.end, rows.end]);
    let [width, height] = [0, 1].map(|axis| ends().map(|end| end[axis]).max().unwrap_or(0));
    let mut sources: Vec<Option<(usize, usize)>> = vec![None; width * height];
    for (index, part) in parts.iter().enumerate().rev() {
        let (columns, rows) = place(part);
        for (pixel, (row, column)) in
            rows.flat_map(|row| columns.clone().map(move |column| (row, column))).enumerate()
        {
            sources[row * width + column] = Some((index, pixel));
        }
    }
    let shown = |(at, source): (usize, &Option<(usize, usize)>)| {
        source.ok_or_else(|| {
            let [x, y] = [at % width, at / width].map(|at| at as i64);
            let [x, y] = [x + i64::from(origin[0]), y + i64::from(origin[1])];
            Error::format(first.path, format!("pixel {x},{y} of its film lies in no part"))
        })
    };
    let sources = sources.iter().enumerate().map(shown).collect::<Result<Vec<_>>>()?;
    let mut joined = Image {
        width: width as u32,
        height: height as u32,
        origin,
        film_size: first.image.film_size,
        channels: BTreeMap::new(),
        attributes: first.image.attributes.clone(),
    };
    for name in common_channels(parts) {
        let pixel = |(part, pixel): &(usize, usize)| parts[*part].image.channels[name][*pixel];
        joined.channels.insert(name.clone(), sources.iter().map(pixel).collect());
    }
    metadata.store(&mut joined);
    Ok((joined, metadata))
}

/// Parts the first from the others.
fn split<T>(parts: &[T]) -> Result<(&T, &[T])> {
    parts.split_first().ok_or_else(|| Error::usage("nothing to merge"))
}

fn common_channels<'a>(parts: &'a [Part<'a>]) -> impl Iterator<Item = &'a String> {
    let has = |part: &Part<'_>, name: &String| part.image.channels.contains_key(name);
    let names = parts.first().into_iter().flat_map(|part| part.image.channels.keys());
    names.filter(move |name| parts.iter().all(|part| has(part, name)))
}

/// One channel of one part, with the channel that merging it requires.
struct Samples<'a> {
    /// Samples per pixel of the part.
    count: f64,
    own: &'a [f32],
    /// Mean for a variance, traced shadow rays for a visible share, hits for cache entries.
    companion: &'a [f32],
}

fn merge_channel(name: &str, parts: &[Part<'_>]) -> Vec<f32> {
    let wanted = match name {
        "Visible.Y" => Some("ShadowRays.Y"),
        "CacheEntries.Y" => Some("Hits.Y"),
        _ => name.strip_prefix("Variance."),
    };
    let has = |name: &&str| parts.iter().all(|part| part.image.channels.contains_key(*name));
    let companion = wanted.filter(has);
    let samples: Vec<Samples<'_>> = parts
        .iter()
        .map(|part| Samples {
            count: part.metadata.sample_count() as f64,
            own: &part.image.channels[name],
            companion: companion.map_or(&[], |name| &part.image.channels[name]),
        })
        .collect();
    let total: f64 = samples.iter().map(|part| part.count).sum();
    let merge_pixel: &dyn Fn(usize) -> f64 = match (name, companion) {
        ("SampleCount.Y" | "ShadowRays.Y" | "Hits.Y", _) => {
            &|pixel| samples.iter().map(|part| f64::from(part.own[pixel])).sum()
        }
        ("Visible.Y" | "CacheEntries.Y", Some(_)) => &|pixel| pooled_share(&samples, pixel),
        (_, Some(_)) => &|pixel| pooled_variance(&samples, total, pixel),
        (_, None) => &|pixel| {
            let weighted = |part: &Samples<'_>| part.count * f64::from(part.own[pixel]);
            samples.iter().map(weighted).sum::<f64>() / total
        },
    };
    (0..parts[0].image.pixel_count()).map(|pixel| merge_pixel(pixel) as f32).collect()
}

/// Pools the parts' visible shares, weighted by traced rays; likewise cache entries per hit.
fn pooled_share(samples: &[Samples<'_>], pixel: usize) -> f64 {
    let traced = |part: &Samples<'_>| f64::from(part.companion[pixel]);
    let visible: f64 = samples.iter().map(|part| traced(part) * f64::from(part.own[pixel])).sum();
    visible / samples.iter().map(traced).sum::<f64>().max(1.0)
}

/// Variance of the mean of all samples, estimated from Σx and Σx² as
/// [`Sums::variance_of_mean`](super::sums::Sums::variance_of_mean) does; each part's mean and
/// variance give its share.
fn pooled_variance(samples: &[Samples<'_>], total: f64, pixel: usize) -> f64 {
    if total < 2.0 {
        return 0.0;
    }
    let (mut sum, mut squares) = (0.0, 0.0);
    for part in samples {
        let n = part.count;
        let (mean, variance) = (f64::from(part.companion[pixel]), f64::from(part.own[pixel]));
        sum += n * mean;
        squares += n * (n - 1.0) * variance + n * mean * mean;
    }
    (squares - sum * sum / total).max(0.0) / (total * (total - 1.0))
}

/// Origin, width, height and film size of a part.
type Placement = ([i64; 2], u32, u32, [u32; 2]);

/// Refuses parts that differ from the first in window or metadata, or share samples with one before.
fn check<T>(parts: &[T], facts: impl Fn(&T) -> (&Path, Placement, &Metadata)) -> Result<()> {
    let facts: Vec<_> = parts.iter().map(facts).collect();
    if let Some((path, ..)) = facts.iter().find(|(_, _, metadata)| !metadata.ahead.is_none()) {
        let message = "it was interrupted within a sample of the film, which only some pixels have; \
                       finish that by render --resume";
        return Err(Error::format(path, message));
    }
    let (first_path, first_window, first) = facts[0];
    for (index, (path, window, metadata)) in facts.iter().enumerate().skip(1) {
        let refuse = |message: String| Err(Error::format(path, message));
        if first_window != *window {
            let describe = |([x, y], width, height, [film_width, film_height]): Placement| {
                format!("{width}x{height} pixels at {x},{y} of {film_width}x{film_height}")
            };
            return refuse(format!(
                "shows {}, but {} shows {}",
                describe(*window),
                first_path.display(),
                describe(first_window)
            ));
        }
        let differences = metadata.differences(first);
        if !differences.is_empty() {
            let (other, list) = (first_path.display(), differences.join("; "));
            return refuse(format!("not of one render with {other}: {list}"));
        }
        for (earlier_path, _, earlier) in &facts[..index] {
            let ranges = metadata.sample_ranges.iter();
            let mut pairs =
                ranges.flat_map(|own| earlier.sample_ranges.iter().map(move |o| (own, o)));
            if let Some((own, other)) = pairs.find(|(own, other)| other.overlaps(own)) {
                return refuse(format!(
                    "holds samples {}..{} of seed {}, but {} holds samples {}..{} of it; render the \
                     parts with different --seed or --sample-offset",
                    own.first,
                    u64::from(own.first) + u64::from(own.count),
                    own.seed,
                    earlier_path.display(),
                    other.first,
                    u64::from(other.first) + u64::from(other.count),
                ));
            }
        }
    }
    Ok(())
}

fn add_metadata(merged: &mut Metadata, part: &Metadata) {
    merged.add_ranges(part);
    merged.candidates = merged.candidates.filter(|_| merged.candidates == part.candidates);
    // A layer that a part lacks is no layer of the whole.
    merged.mattes.retain(|name, _| part.mattes.contains_key(name));
    merged.seconds += part.seconds;
    for (name, seconds) in &part.gpu_seconds {
        *merged.gpu_seconds.entry(name.clone()).or_default() += seconds;
    }
    merged.device = joined(&merged.device, &part.device);
    merged.driver = joined(&merged.driver, &part.driver);
    merged.tracer = joined(&merged.tracer, &part.tracer);
}

/// Joins both lists of names, without repetition.
fn joined(ours: &str, theirs: &str) -> String {
    let names: BTreeSet<&str> = ours.split(" + ").chain(theirs.split(" + ")).collect();
    names.into_iter().collect::<Vec<_>>().join(" + ")
}
