//! `fenestra merge`: combines renders of one scene.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use crate::{
    error::{Error, Result},
    files::check_replaces_nothing,
    film::{
        Aov, Checkpoint, Image, Metadata,
        checkpoint::is_checkpoint_path,
        merge::{Part, merge_checkpoints, merge_images},
    },
    terminal::say,
};

/// Arguments of `merge`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Images or checkpoints of one scene, rendered with different seeds or disjoint sample ranges.
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
    let mut images = Vec::new();
    for path in &arguments.parts {
        images.push((path.as_path(), Image::read_exr(path)?));
    }
    let wants_checkpoint = is_checkpoint_path(&arguments.output);
    let metadata = if images.iter().all(|(_, image)| Checkpoint::is_checkpoint(image)) {
        let mut checkpoints = Vec::new();
        for (path, image) in &images {
            checkpoints.push((*path, Checkpoint::from_image(image, path)?));
        }
        drop(images);
        let parts: Vec<(&Path, &Checkpoint)> =
            checkpoints.iter().map(|(path, checkpoint)| (*path, checkpoint)).collect();
        let merged = merge_checkpoints(&parts)?;
        if wants_checkpoint {
            merged.write(&arguments.output)?;
        } else {
            let mut image = merged.sums.to_image(Aov::value_variants());
            merged.metadata.store(&mut image);
            image.write_exr(&arguments.output)?;
        }
        merged.metadata
    } else {
        if wants_checkpoint {
            let image = images.iter().find(|(_, image)| !Checkpoint::is_checkpoint(image));
            let path = image.map_or(arguments.output.as_path(), |(path, _)| path);
            return Err(Error::usage(format!(
                "{} would be a checkpoint, but {} is an image without the sums: merge checkpoints, \
                 or give another name",
                arguments.output.display(),
                path.display()
            )));
        }
        let mut parts = Vec::new();
        for (path, image) in images {
            parts.push(load_part(path, image)?);
        }
        let borrowed: Vec<Part<'_>> =
            parts.iter().map(|(path, image, metadata)| Part { path, image, metadata }).collect();
        let (image, metadata) = merge_images(&borrowed)?;
        warn_of_dropped_channels(&borrowed, &image);
        image.write_exr(&arguments.output)?;
        metadata
    };
    summarize(arguments, &metadata)
}

/// Takes an image as it is, and a checkpoint as the image it gives.
fn load_part(path: &Path, image: Image) -> Result<(&Path, Image, Metadata)> {
    if Checkpoint::is_checkpoint(&image) {
        let checkpoint = Checkpoint::from_image(&image, path)?;
        return Ok((path, checkpoint.sums.to_image(Aov::value_variants()), checkpoint.metadata));
    }
    let metadata = Metadata::load(&image, path)?;
    Ok((path, image, metadata))
}

fn warn_of_dropped_channels(parts: &[Part<'_>], merged: &Image) {
    for part in parts {
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
