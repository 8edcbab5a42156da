//! `fenestra merge`: combines renders of one scene.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use crate::{
    error::{Error, Result},
    files::check_replaces_nothing,
    film::{
        Aov, Checkpoint, Image, Metadata,
        checkpoint::is_checkpoint_path,
        merge::{Part, join_windows, merge_checkpoints, merge_images},
    },
    terminal::say,
};

/// Arguments of `merge`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Images or checkpoints of one scene, rendered with different seeds, disjoint sample ranges, or windows
    /// (`--crop`) of the same samples.
    #[arg(required = true, value_name = "PART.exr")]
    pub parts: Vec<PathBuf>,
    /// Merged image, or a checkpoint if the name ends in .checkpoint.exr and every part is one.
    #[arg(short, long, value_name = "OUT.exr")]
    pub output: PathBuf,
    /// Print no summary.
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the summary as JSON to standard output.
    #[arg(long)]
    pub json: bool,
}

/// Merges the parts and writes the result.
///
/// # Errors
/// Unreadable files, parts of different renders, samples held by two parts, an unwritable output.
pub fn run(arguments: &Arguments) -> Result<()> {
    let parts: Vec<&Path> = arguments.parts.iter().map(PathBuf::as_path).collect();
    check_replaces_nothing(&[("--output", &arguments.output)], &parts)?;
    let mut groups: Vec<Vec<(&Path, Image)>> = Vec::new();
    for path in &arguments.parts {
        let image = Image::read_exr(path)?;
        let window = |image: &Image| (image.origin, image.width, image.height);
        match groups.iter_mut().find(|group| window(&group[0].1) == window(&image)) {
            Some(group) => group.push((path, image)),
            None => groups.push(vec![(path, image)]),
        }
    }
    if is_checkpoint_path(&arguments.output) {
        let merged = merge_to_checkpoint(&groups, &arguments.output)?;
        merged.write(&arguments.output)?;
        return summarize(arguments, &merged.metadata);
    }
    let windows = groups.into_iter().map(merge_window).collect::<Result<_>>()?;
    let (_, image, metadata) = join(windows, join_windows)?;
    image.write_exr(&arguments.output)?;
    summarize(arguments, &metadata)
}

/// A file with its image and metadata.
type Picture<'a> = (&'a Path, Image, Metadata);

/// Adds the sums of the checkpoints of one window.
fn merge_to_checkpoint(groups: &[Vec<(&Path, Image)>], output: &Path) -> Result<Checkpoint> {
    let refuse = |path: &Path, problem: &str| {
        Err(Error::usage(format!(
            "{} would be a checkpoint, but {} {problem}, or give another name",
            output.display(),
            path.display()
        )))
    };
    let mut images = groups.iter().flatten();
    if let Some((path, _)) = images.find(|(_, image)| !Checkpoint::is_checkpoint(image)) {
        return refuse(path, "is an image without the sums: merge checkpoints");
    }
    match groups {
        [group] => merge_exactly(group),
        [_, other, ..] => refuse(other[0].0, "shows another window: merge those of one window"),
        [] => Err(Error::usage("nothing to merge")),
    }
}

fn merge_exactly(group: &[(&Path, Image)]) -> Result<Checkpoint> {
    let read = |(path, image): &(&Path, Image)| Checkpoint::from_image(image, path);
    let checkpoints = group.iter().map(read).collect::<Result<Vec<_>>>()?;
    let parts: Vec<(&Path, &Checkpoint)> =
        group.iter().map(|(path, _)| *path).zip(&checkpoints).collect();
    merge_checkpoints(&parts)
}

/// Merges the parts that show one window into an image: exactly where all are checkpoints.
fn merge_window(group: Vec<(&Path, Image)>) -> Result<Picture<'_>> {
    if group.iter().all(|(_, image)| Checkpoint::is_checkpoint(image)) {
        let merged = merge_exactly(&group)?;
        let mut image = merged.sums.to_image(Aov::value_variants());
        merged.metadata.store(&mut image);
        return Ok((group[0].0, image, merged.metadata));
    }
    let parts = group.into_iter().map(|(path, image)| load_part(path, image));
    join(parts.collect::<Result<_>>()?, merge_images)
}

/// Joins pictures under the name of the first, which alone stays as it is; warns of channels that get lost.
fn join<'a>(
    mut pictures: Vec<Picture<'a>>,
    joined: fn(&[Part<'_>]) -> Result<(Image, Metadata)>,
) -> Result<Picture<'a>> {
    if pictures.len() == 1 {
        return Ok(pictures.remove(0));
    }
    let parts: Vec<Part<'_>> =
        pictures.iter().map(|(path, image, metadata)| Part { path, image, metadata }).collect();
    let (merged, metadata) = joined(&parts)?;
    for part in &parts {
        let is_dropped = |name: &&String| !merged.channels.contains_key(name.as_str());
        let dropped: Vec<&str> =
            part.image.channels.keys().filter(is_dropped).map(String::as_str).collect();
        if !dropped.is_empty() {
            log::warn!(
                "{}: not every part has channels {}; left out",
                part.path.display(),
                dropped.join(", ")
            );
        }
    }
    Ok((pictures[0].0, merged, metadata))
}

/// Takes an image as it is, and a checkpoint as the image it gives.
fn load_part(path: &Path, image: Image) -> Result<Picture<'_>> {
    if Checkpoint::is_checkpoint(&image) {
        let checkpoint = Checkpoint::from_image(&image, path)?;
        return Ok((path, checkpoint.sums.to_image(Aov::value_variants()), checkpoint.metadata));
    }
    let metadata = Metadata::load(&image, path)?;
    Ok((path, image, metadata))
}

fn summarize(arguments: &Arguments, metadata: &Metadata) -> Result<()> {
    if arguments.json {
        let summary = serde_json::json!({
            "output": arguments.output.display().to_string(),
            "parts": arguments.parts.len(),
            "scene_hash": metadata.scene_hash,
            "samples_per_pixel": metadata.sample_count(),
            "sample_ranges": metadata.sample_ranges,
            "seconds": metadata.seconds,
        });
        return super::print_line(&format!("{summary:#}"));
    }
    if !arguments.quiet {
        say!(
            "{}: {} samples per pixel from {} parts",
            arguments.output.display(),
            metadata.sample_count(),
            arguments.parts.len()
        );
    }
    Ok(())
}
