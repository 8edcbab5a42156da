//! `fenestra info`: describes and checks a file, or without one, the installation.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde_json::json;

use crate::{
    brdf::sanity::{ELEVATIONS_DEG, Sanity},
    error::{Error, Result},
    files,
    film::{Attribute, Checkpoint, Image},
    fit,
    fit::report::Description,
    scene::{EnvironmentMap, Scene, measured::MeasuredTable},
};

/// Arguments of `info`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene (.toml, .gltf, .glb, .obj, .pbrt, .xml), image (.exr), environment map (.hdr, .pfm; .exr with
    /// --map), measured BRDF (.binary, .brdf, .bsdf) or fit (.fit).
    pub file: Option<PathBuf>,
    /// Read an .exr file as an environment map.
    #[arg(long, requires = "file")]
    pub map: bool,
    /// Print JSON to standard output.
    #[arg(long)]
    pub json: bool,
}

/// Reports on a file or on the installation.
///
/// # Errors
/// A file that cannot be read, or of no known kind.
pub fn run(arguments: &Arguments) -> Result<()> {
    let mut report = match &arguments.file {
        None => installation(),
        Some(path) => file(path, arguments.map)?,
    };
    if arguments.json {
        report.value["warnings"] = json!(report.warnings);
        return super::print_line(&format!("{:#}", report.value));
    }
    report.lines.extend(report.warnings.iter().map(|warning| format!("warning: {warning}")));
    super::print_line(&report.lines.join("\n"))
}

fn file(path: &Path, is_map: bool) -> Result<Description> {
    match files::extension(path).as_str() {
        "toml" | "gltf" | "glb" | "obj" | "pbrt" | "xml" => scene(path),
        "hdr" | "pfm" => environment_map(path),
        "exr" if is_map => environment_map(path),
        "exr" => image(path),
        "binary" | "brdf" | "bsdf" => measured_brdf(path),
        fit::cache::EXTENSION => fit::describe(path),
        _ => {
            // Report a missing file before an unknown kind.
            fs::metadata(path).map_err(|source| Error::io(path, "read", source))?;
            Err(Error::format(
                path,
                "unknown kind of file; expected .toml, .exr, .hdr, .pfm, .binary, .brdf, .bsdf or .fit",
            ))
        }
    }
}

/// Returns total bytes and number of the files in a folder; zeros if there is none.
fn folder_size(folder: &Path) -> (u64, u64) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.filter_map(|entry| entry.metadata().ok()).filter(fs::Metadata::is_file);
    files.fold((0, 0), |(bytes, count), file| (bytes + file.len(), count + 1))
}

fn installation() -> Description {
    let mut lines = vec![format!("Fenestra {}", env!("CARGO_PKG_VERSION"))];
    let mut caches = serde_json::Map::new();
    for kind in ["fits", "pipelines"] {
        let Some(folder) = files::cache_folder(kind) else {
            lines.push(format!("cache of {kind}: none (neither XDG_CACHE_HOME nor HOME is set)"));
            continue;
        };
        let (bytes, count) = folder_size(&folder);
        lines.push(format!(
            "cache of {kind}: {} ({count} files, {:.1} MiB; may be deleted)",
            folder.display(),
            bytes as f64 / f64::from(1 << 20)
        ));
        let folder = folder.display().to_string();
        caches.insert(kind.to_owned(), json!({ "folder": folder, "files": count, "bytes": bytes }));
    }
    lines.push("devices: run `fenestra devices`".to_owned());
    let value = json!({ "version": env!("CARGO_PKG_VERSION"), "caches": caches });
    Description { value, lines, warnings: Vec::new() }
}

fn scene(path: &Path) -> Result<Description> {
    let scene = Scene::load(path)?;
    let mut triangle_counts = vec![0_u64; scene.materials.len()];
    for material in scene.geometry.materials_in_use() {
        if let Some(count) = triangle_counts.get_mut(material as usize) {
            *count += 1;
        }
    }
    let map = &scene.environment;
    let mut lines = vec![
        format!("scene {}", scene.name),
        format!("film         {}x{} pixels", scene.film.width, scene.film.height),
        format!("triangles    {}", scene.geometry.triangle_count()),
        format!("environment  {} ({}x{} texels)", map.source, map.width, map.height),
        format!("hash         {}", scene.hash),
    ];
    if !scene.variants.is_empty() {
        lines.push(format!("variants     {}", scene.variants.join(", ")));
    }
    let mut materials = Vec::new();
    for (material, count) in scene.materials.iter().zip(&triangle_counts) {
        let (kind, ..) = material.kind.parameters();
        lines.push(format!("material     {} ({kind}, {count} triangles)", material.name));
        materials.push(json!({ "name": material.name, "type": kind, "triangles": count }));
    }
    let value = json!({
        "kind": "scene",
        "name": scene.name,
        "width": scene.film.width,
        "height": scene.film.height,
        "triangles": scene.geometry.triangle_count(),
        "instances": scene.geometry.instances.len(),
        "environment": { "source": map.source, "width": map.width, "height": map.height },
        "materials": materials,
        "variants": scene.variants,
        "hash": scene.hash,
    });
    Ok(Description { value, lines, warnings: scene.warnings })
}

fn image(path: &Path) -> Result<Description> {
    let image = Image::read_exr(path)?;
    let is_checkpoint = Checkpoint::is_checkpoint(&image);
    let kind = if is_checkpoint { "checkpoint" } else { "image" };
    let [x, y] = image.origin;
    let [film_width, film_height] = image.film_size;
    let mut lines = vec![format!(
        "{kind} of {}x{} pixels at {x},{y} of {film_width}x{film_height}",
        image.width, image.height
    )];
    let (mut channels, mut warnings) = (serde_json::Map::new(), Vec::new());
    for (name, samples) in &image.channels {
        let summary = ChannelSummary::of(samples.iter().copied());
        lines.push(format!("channel {name:<24} {}", describe(&summary)));
        if summary.nan + summary.infinite > 0 {
            warnings.push(format!(
                "channel {name}: {} samples are not finite",
                summary.nan + summary.infinite
            ));
        }
        channels.insert(name.clone(), json!(summary));
    }
    let mut attributes = serde_json::Map::new();
    for (name, attribute) in &image.attributes {
        let value = match attribute {
            Attribute::Text(value) => json!(value),
            Attribute::Integer(value) => json!(value),
            Attribute::Float(value) => json!(value),
            Attribute::Double(value) => json!(value),
        };
        lines.push(format!("{name} = {value}"));
        attributes.insert(name.clone(), value);
    }
    if is_checkpoint && let Err(error) = Checkpoint::from_image(&image, path) {
        warnings.push(error.to_string());
    }
    let value = json!({
        "kind": kind,
        "width": image.width,
        "height": image.height,
        "origin": image.origin,
        "film_size": image.film_size,
        "channels": channels,
        "attributes": attributes,
    });
    Ok(Description { value, lines, warnings })
}

/// Range, mean and oddities of the samples of a channel, to judge whether a file is sane.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
struct ChannelSummary {
    /// Smallest finite sample; absent if there is none.
    minimum: Option<f32>,
    /// Largest finite sample; absent if there is none.
    maximum: Option<f32>,
    /// Mean of the finite samples; absent if there is none.
    mean: Option<f64>,
    /// Samples that are not a number.
    nan: usize,
    infinite: usize,
    /// Samples below 0, including −∞.
    negative: usize,
}

impl ChannelSummary {
    fn of(samples: impl IntoIterator<Item = f32>) -> Self {
        let mut summary = Self::default();
        let (mut sum, mut count) = (0.0_f64, 0_usize);
        for sample in samples {
            if sample < 0.0 {
                summary.negative += 1;
            }
            if sample.is_nan() {
                summary.nan += 1;
            } else if sample.is_infinite() {
                summary.infinite += 1;
            } else {
                sum += f64::from(sample);
                count += 1;
                summary.minimum = Some(summary.minimum.map_or(sample, |least| least.min(sample)));
                summary.maximum = Some(summary.maximum.map_or(sample, |most| most.max(sample)));
            }
        }
        if count > 0 {
            summary.mean = Some(sum / count as f64);
        }
        summary
    }
}

fn describe(summary: &ChannelSummary) -> String {
    let mut text = match (summary.minimum, summary.maximum, summary.mean) {
        (Some(minimum), Some(maximum), Some(mean)) => {
            format!("{minimum:.6e} to {maximum:.6e}, mean {mean:.6e}")
        }
        _ => "no finite sample".to_owned(),
    };
    for (count, what) in
        [(summary.nan, "NaN"), (summary.infinite, "infinite"), (summary.negative, "negative")]
    {
        if count > 0 {
            text += &format!(", {count} {what}");
        }
    }
    text
}

fn environment_map(path: &Path) -> Result<Description> {
    let mut warnings = Vec::new();
    let map = EnvironmentMap::load(path, 1.0, &mut warnings)?;
    let mut lines = vec![format!("environment map of {}x{} texels", map.width, map.height)];
    let mut channels = serde_json::Map::new();
    for (index, name) in ["R", "G", "B"].into_iter().enumerate() {
        let summary = ChannelSummary::of(map.texels.iter().map(|texel| texel[index]));
        lines.push(format!("channel {name:<24} {}", describe(&summary)));
        channels.insert(name.to_owned(), json!(summary));
    }
    let value = json!({
        "kind": "environment map",
        "width": map.width,
        "height": map.height,
        "channels": channels,
    });
    Ok(Description { value, lines, warnings })
}

fn measured_brdf(path: &Path) -> Result<Description> {
    let table = MeasuredTable::load(path)?;
    let sanity = Sanity::of(&table);
    let mut warnings = table.warnings.clone();
    warnings.extend(sanity.warnings());
    let mut lines = vec![
        "measured BRDF on 90 x 90 x 180 cells".to_owned(),
        format!("cells without measurement  {}", table.invalid_cell_count),
        format!("largest value tried        {:.4} /sr", sanity.largest_value),
        format!("largest reciprocity error  {:.2e}", sanity.largest_reciprocity_error),
    ];
    for (elevation, [red, green, blue]) in ELEVATIONS_DEG.iter().zip(&sanity.albedo) {
        lines.push(format!("albedo at {elevation:>2} deg           {red:.3} {green:.3} {blue:.3}"));
    }
    let value = json!({
        "kind": "measured BRDF",
        "invalid_cells": table.invalid_cell_count,
        "elevations_deg": ELEVATIONS_DEG,
        "sanity": sanity,
    });
    Ok(Description { value, lines, warnings })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oddities_are_counted_and_left_out_of_the_mean() {
        let samples = [1.0, f32::NAN, -3.0, f32::INFINITY, 5.0, f32::NEG_INFINITY];
        let expected = ChannelSummary {
            minimum: Some(-3.0),
            maximum: Some(5.0),
            mean: Some(1.0),
            nan: 1,
            infinite: 2,
            negative: 2,
        };
        assert_eq!(ChannelSummary::of(samples), expected);
        assert_eq!(ChannelSummary::of([f32::NAN]).mean, None);
        assert_eq!(ChannelSummary::of([]), ChannelSummary::default());
    }
}
