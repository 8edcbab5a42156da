//! `fenestra compare`: error metrics of an image against a reference.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use crate::{
    error::{Error, Result},
    files::check_replaces_nothing,
    film::{Attribute, Image},
    study::{
        falsecolour::{self, Scale},
        metrics::{self, Metrics},
    },
};

/// Arguments of `compare`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Image to evaluate (EXR).
    pub image: PathBuf,
    /// Reference (EXR).
    pub reference: PathBuf,
    /// Second, independent half of the reference, which keeps its noise out of the squared errors:
    /// they become (x − r₁)(x − r₂).
    #[arg(long, value_name = "EXR")]
    pub second_reference: Option<PathBuf>,
    /// Write the error of every pixel (RMS over RGB) in false colour with its scale, from blue
    /// (low) to red (high).
    #[arg(long, value_name = "PNG")]
    pub heatmap: Option<PathBuf>,
    /// Error shown red in the heatmap. Default: the 99th percentile.
    #[arg(long, value_name = "ERROR", requires = "heatmap")]
    pub heatmap_high: Option<f64>,
    /// Exit with status 3 if a metric is above a value, such as relmse=0.01. May be repeated.
    #[arg(long, value_name = "METRIC=VALUE", value_parser = parse_threshold)]
    pub fail_above: Vec<(String, f64)>,
    /// Exit with status 3 if a metric is below a value, such as mean_ratio=0.99. May be repeated.
    #[arg(long, value_name = "METRIC=VALUE", value_parser = parse_threshold)]
    pub fail_below: Vec<(String, f64)>,
    /// Print JSON to standard output; non-finite values are null.
    #[arg(long)]
    pub json: bool,
}

fn parse_threshold(text: &str) -> Result<(String, f64), String> {
    let names = Metrics::default().named().map(|(name, _)| name);
    let known = || format!("known metrics: {}", names.join(", "));
    let (name, value) = text
        .split_once('=')
        .ok_or_else(|| format!("expected METRIC=VALUE, as in relmse=0.01; {}", known()))?;
    if !names.contains(&name) {
        return Err(format!("no metric {name:?}; {}", known()));
    }
    match value.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((name.to_owned(), value)),
        _ => Err(format!("expected a finite number after {name}=, found {value:?}")),
    }
}

/// Compares two images.
///
/// # Errors
/// Files that cannot be read or compared; [`Error::Usage`] if the heatmap scale is not positive;
/// [`Error::Threshold`] if a metric is beyond its threshold.
pub fn run(arguments: &Arguments) -> Result<()> {
    if let Some(high) = arguments.heatmap_high.filter(|high| !(high.is_finite() && *high > 0.0)) {
        return Err(Error::usage(format!("--heatmap-high {high}: expected a positive number")));
    }
    if let Some(heatmap) = &arguments.heatmap {
        let second = arguments.second_reference.as_deref();
        let inputs = [Some(&*arguments.image), Some(&*arguments.reference), second];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().collect();
        check_replaces_nothing(&[("--heatmap", heatmap)], &inputs)?;
    }
    let image = Image::read_exr(&arguments.image)?;
    let read = |path: &PathBuf| {
        let reference = Image::read_exr(path)?;
        check_same_picture(&image, &arguments.image, &reference, path)?;
        reference.rgb(path)
    };
    let first = read(&arguments.reference)?;
    let picture = image.rgb(&arguments.image)?;
    let second = arguments.second_reference.as_ref().map(read).transpose()?;
    let second = second.as_ref().unwrap_or(&first);
    let metrics = Metrics::of_halves(&picture, &first, second)?;
    print(arguments, &picture, &metrics)?;
    if let Some(path) = &arguments.heatmap {
        let squared = metrics::squared_errors(&picture, &first, second)?;
        let errors: Vec<f64> = squared.into_iter().map(|error| error.max(0.0).sqrt()).collect();
        let scale = arguments
            .heatmap_high
            .map_or_else(|| Scale::of(&errors), |high| Scale { low: 0.0, high });
        falsecolour::picture(&errors, picture.width as usize, scale).write_png(path)?;
    }
    check_thresholds(arguments, &metrics)
}

/// Rejects different parts of the film; warns if the metadata belong to different scenes.
fn check_same_picture(image: &Image, path: &Path, reference: &Image, other: &Path) -> Result<()> {
    let window = |image: &Image| {
        let [x, y] = image.origin;
        format!("{}x{} pixels at {x},{y}", image.width, image.height)
    };
    if window(image) != window(reference) {
        return Err(Error::comparison(format!(
            "{} shows {}, {} shows {}; render both with one --size and --crop",
            path.display(),
            window(image),
            other.display(),
            window(reference)
        )));
    }
    let hash = |image: &Image| match image.attributes.get("fenestra.scene_hash") {
        Some(Attribute::Text(hash)) => Some(hash.clone()),
        _ => None,
    };
    if let (Some(ours), Some(theirs)) = (hash(image), hash(reference))
        && ours != theirs
    {
        log::warn!(
            "{} and {} show different scenes (hashes {ours} and {theirs})",
            path.display(),
            other.display()
        );
    }
    Ok(())
}

fn print(arguments: &Arguments, picture: &crate::film::RgbImage, metrics: &Metrics) -> Result<()> {
    if arguments.json {
        let mut result = serde_json::json!({
            "image": arguments.image.display().to_string(),
            "reference": arguments.reference.display().to_string(),
            "width": picture.width,
            "height": picture.height,
        });
        for (name, value) in metrics.named() {
            result[name] = serde_json::json!(value);
        }
        super::print_line(&format!("{result:#}"))
    } else {
        let lines = metrics.named().map(|(name, value)| format!("{name:<15} {value:.6e}"));
        super::print_line(&lines.join("\n"))
    }
}

fn check_thresholds(arguments: &Arguments, metrics: &Metrics) -> Result<()> {
    let named = BTreeMap::from(metrics.named());
    let mut failures = Vec::new();
    // NaN fails every threshold.
    let is_within: [fn(&f64, &f64) -> bool; 2] = [f64::le, f64::ge];
    let limits = [("above", &arguments.fail_above), ("below", &arguments.fail_below)];
    for ((side, thresholds), is_within) in limits.into_iter().zip(is_within) {
        for (name, threshold) in thresholds {
            let value = named.get(name.as_str()).copied().unwrap_or(f64::NAN);
            if !is_within(&value, threshold) {
                failures.push(format!("{name} is {value:.6e}, {side} the threshold {threshold}"));
            }
        }
    }
    if failures.is_empty() {
        return Ok(());
    }
    Err(Error::Threshold { message: failures.join("; ") })
}
