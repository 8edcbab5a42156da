//! `fenestra fit`: fits environment maps and BRDFs with spherical radial basis functions.

mod source;

use std::path::{Path, PathBuf};

use clap::Subcommand;

use super::progress::Progress;
use crate::{
    error::Result,
    files::check_replaces_nothing,
    fit::{
        BrdfOptions, Cache, EnvironmentOptions, Fit, Method, brdf_lobes, environment_lobes,
        picture,
        report::{Description, describe_brdf, describe_environment},
        write_fit,
    },
    session::Standing,
};

/// Arguments of `fit`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Kind of source.
    #[command(subcommand)]
    pub target: Target,
}

/// Kinds of source.
#[derive(Debug, Subcommand)]
pub enum Target {
    /// Fit an environment map.
    Env(EnvironmentArguments),
    /// Fit BRDF × cosine at a series of view elevations.
    Brdf(BrdfArguments),
}

/// Options shared by both kinds of fit.
#[derive(Debug, clap::Args)]
pub struct Shared {
    /// Objective that the fit minimizes.
    #[arg(long, value_enum, default_value_t)]
    pub method: Method,
    /// Fit file to write, with a picture beside it. Default: the source's name in the working folder.
    #[arg(short, long, value_name = "FIT")]
    pub output: Option<PathBuf>,
    /// Neither read nor write the fit cache.
    #[arg(long)]
    pub no_cache: bool,
    /// Print JSON to standard output.
    #[arg(long)]
    pub json: bool,
    /// Hide progress.
    #[arg(long)]
    pub quiet: bool,
}

/// Arguments of `fit env`.
#[derive(Debug, clap::Args)]
pub struct EnvironmentArguments {
    /// Environment map (.hdr, .exr, .pfm), or a scene whose environment is fitted.
    pub map: PathBuf,
    /// Number of lobes.
    #[arg(long, default_value_t = 100)]
    pub lobes: usize,
    /// Shared options.
    #[command(flatten)]
    pub shared: Shared,
}

/// Arguments of `fit brdf`.
#[derive(Debug, clap::Args)]
pub struct BrdfArguments {
    /// Measured BRDF (.binary, .brdf, .bsdf), material of a scene (SCENE.toml#name), or TYPE:key=value,…
    /// with the keys of a scene's material, such as plastic:diffuse=0.5,alpha=0.1 or
    /// conductor:reflectance=[0.9,0.6,0.3],alpha=0.05.
    pub material: String,
    /// Number of lobes per view.
    #[arg(long, default_value_t = 20)]
    pub lobes: usize,
    /// Number of view elevations between normal and horizon.
    #[arg(long, default_value_t = 32)]
    pub views: usize,
    /// Shared options.
    #[command(flatten)]
    pub shared: Shared,
}

/// Runs `fit`.
///
/// # Errors
/// A source that cannot be read or fitted, options out of range, a file that cannot be written.
pub fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.target {
        Target::Env(arguments) => environment(arguments),
        Target::Brdf(arguments) => brdf(arguments),
    }
}

fn with_progress<T>(
    label: &str,
    quiet: bool,
    work: impl FnOnce(&mut dyn FnMut(f64)) -> Result<T>,
) -> Result<T> {
    let mut progress = Progress::new(label, quiet);
    let result = work(&mut |fraction| {
        progress.update(&Standing { fraction, ..Standing::default() });
    });
    let end = if result.is_ok() { "done" } else { "failed" };
    progress.finish(&Standing { fraction: 1.0, ..Standing::default() }, end);
    result
}

fn cache(shared: &Shared) -> Option<Cache> {
    if shared.no_cache { None } else { Cache::user() }
}

/// Returns the paths of the fit, which is `--output` or the source's name with extension `fit`, and of its
/// picture. Fails with [`crate::Error::Usage`] if either is one of the `inputs`.
fn outputs(shared: &Shared, name: &str, inputs: &[PathBuf]) -> Result<[PathBuf; 2]> {
    let fit = shared.output.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.fit")));
    let picture = fit.with_extension("png");
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    check_replaces_nothing(&[("the fit", &fit), ("its picture", &picture)], &inputs)?;
    Ok([fit, picture])
}

/// Prints the figures of a fit and the files written.
fn report(
    mut description: Description,
    shared: &Shared,
    (seconds, is_cached): (f64, bool),
    (fit, picture): (&Path, &Path),
) -> Result<()> {
    if shared.json {
        description.value["seconds"] = seconds.into();
        description.value["cached"] = is_cached.into();
        description.value["fit"] = fit.display().to_string().into();
        description.value["picture"] = picture.display().to_string().into();
        description.value["notes"] = description.warnings.into();
        return super::print_line(&format!("{:#}", description.value));
    }
    let from = if is_cached { " (read from the cache)" } else { "" };
    description.lines.push(format!("seconds          {seconds:.2}{from}"));
    description.lines.push(format!("written          {}", fit.display()));
    description.lines.push(format!("                 {}", picture.display()));
    description.lines.extend(description.warnings.iter().map(|note| format!("note: {note}")));
    super::print_line(&description.lines.join("\n"))
}

fn environment(arguments: &EnvironmentArguments) -> Result<()> {
    let shared = &arguments.shared;
    let (map, name, inputs) = source::environment(&arguments.map)?;
    let [path, picture_path] = outputs(shared, &name, &inputs)?;
    let options = EnvironmentOptions { lobes: arguments.lobes, method: shared.method };
    let fit = with_progress(&format!("fit {name}"), shared.quiet, |progress| {
        environment_lobes(&map, options, cache(shared).as_ref(), progress)
    })?;
    write_fit(&path, &Fit::Environment(fit.clone()))?;
    picture::write_environment(&picture_path, &map, &fit)?;
    let took = (fit.seconds, fit.is_cached);
    report(describe_environment(&fit), shared, took, (&path, &picture_path))
}

fn brdf(arguments: &BrdfArguments) -> Result<()> {
    let shared = &arguments.shared;
    let source = source::material(&arguments.material)?;
    let options =
        BrdfOptions { lobes: arguments.lobes, views: arguments.views, method: shared.method };
    let name = &source.name;
    let [path, picture_path] = outputs(shared, name, &source.inputs)?;
    let fit = with_progress(&format!("fit {name}"), shared.quiet, |progress| {
        let cache = cache(shared);
        brdf_lobes(&source.tables, 0, &arguments.material, options, cache.as_ref(), progress)
    })?;
    write_fit(&path, &Fit::Brdf(fit.clone()))?;
    picture::write_brdf(&picture_path, &source.tables, 0, &fit)?;
    let took = (fit.seconds, fit.is_cached);
    report(describe_brdf(&fit), shared, took, (&path, &picture_path))
}
