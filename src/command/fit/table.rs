//! `fenestra fit table`: tabulates errors and times of many fits.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use super::{
    source::{self, Source},
    with_progress,
};
use crate::{
    error::Result,
    files::{check_replaces_nothing, extension, write_text},
    fit::{
        BrdfOptions, EnvironmentOptions, Method, brdf_lobes, config, environment_lobes, picture,
    },
    scene::EnvironmentMap,
};

/// Arguments of `fit table`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Maps, measured BRDFs and materials, as `fit env` and `fit brdf` take them.
    #[arg(required = true)]
    pub sources: Vec<String>,
    /// Lobe counts for maps.
    #[arg(long, value_delimiter = ',', default_value = "25,50,100,200,400")]
    pub environment_lobes: Vec<usize>,
    /// Lobe counts for BRDFs.
    #[arg(long, value_delimiter = ',', default_value = "8,20")]
    pub brdf_lobes: Vec<usize>,
    /// Number of view elevations for BRDFs.
    #[arg(long, default_value_t = 32)]
    pub views: usize,
    /// Objective that the fits minimize.
    #[arg(long, value_enum, default_value_t)]
    pub method: Method,
    /// Markdown file to write; default: standard output.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Folder for a picture of every fit.
    #[arg(long, value_name = "FOLDER")]
    pub pictures: Option<PathBuf>,
    /// Hide progress.
    #[arg(long)]
    pub quiet: bool,
}

/// Fits every source, bypassing the cache, and writes the table.
///
/// # Errors
/// A source that cannot be read or fitted, options out of range, a file that cannot be written.
pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let subjects: Vec<Subject> =
        arguments.sources.iter().map(|text| Subject::load(text)).collect::<Result<_>>()?;
    check_outputs(arguments, &subjects)?;
    let (mut maps, mut brdfs) = (String::new(), String::new());
    for subject in &subjects {
        match subject {
            Subject::Map(map, name, _) => environment(arguments, map, name, &mut maps)?,
            Subject::Brdf(source, name) => brdf(arguments, source, name, &mut brdfs)?,
        }
    }
    let mut tables = Vec::new();
    if !maps.is_empty() {
        let head = "| map | texels | lobes | χ² | KL (nats) | relative L2 | energy captured | s |\n\
                    |---|---|--:|--:|--:|--:|--:|--:|\n";
        tables.push(format!("{head}{maps}"));
    }
    if !brdfs.is_empty() {
        let angle = config::SUMMARY_ANGLE_DEG;
        let head = format!(
            "Means over the views up to {angle}° from the normal, with the largest χ² of a view, \
             halfway between two views, and of all views.\n\n\
             | BRDF | lobes × views | χ² mean | largest | between | to the horizon | KL (nats) | \
             relative L2 | energy captured | s |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n"
        );
        tables.push(format!("{head}{brdfs}"));
    }
    let text = tables.join("\n");
    match &arguments.output {
        Some(path) => write_text(path, &text),
        None => crate::command::print_line(text.trim_end()),
    }
}

/// One source of the table.
enum Subject {
    /// A map, its name, and the files that it was read from.
    Map(EnvironmentMap, String, Vec<PathBuf>),
    /// A material, and its name in the table.
    Brdf(Source, String),
}

impl Subject {
    fn load(text: &str) -> Result<Self> {
        let path = Path::new(text);
        if ["hdr", "exr", "pfm", "toml"].contains(&extension(path).as_str()) {
            let (map, name, inputs) = source::environment(path)?;
            return Ok(Self::Map(map, name, inputs));
        }
        let source = source::material(text)?;
        let name = if source::is_measured(path) { source.name.clone() } else { text.to_owned() };
        Ok(Self::Brdf(source, name))
    }

    /// Its pictures.
    fn pictures(&self, arguments: &Arguments) -> Vec<PathBuf> {
        let (name, lobes) = match self {
            Self::Map(_, name, _) => (name, &arguments.environment_lobes),
            Self::Brdf(source, _) => (&source.name, &arguments.brdf_lobes),
        };
        lobes.iter().filter_map(|lobes| picture_path(arguments, name, *lobes)).collect()
    }
}

/// Checks, before the work, that neither table nor pictures would replace a source or each other.
fn check_outputs(arguments: &Arguments, subjects: &[Subject]) -> Result<()> {
    let pictures: Vec<PathBuf> =
        subjects.iter().flat_map(|subject| subject.pictures(arguments)).collect();
    let table = arguments.output.iter().map(|path| ("--output", path.as_path()));
    let outputs: Vec<(&str, &Path)> =
        table.chain(pictures.iter().map(|path| ("the picture", path.as_path()))).collect();
    let inputs = subjects.iter().flat_map(|subject| match subject {
        Subject::Map(_, _, inputs) => inputs,
        Subject::Brdf(source, _) => &source.inputs,
    });
    check_replaces_nothing(&outputs, &inputs.map(PathBuf::as_path).collect::<Vec<_>>())
}

fn picture_path(arguments: &Arguments, name: &str, lobes: usize) -> Option<PathBuf> {
    let folder = arguments.pictures.as_ref()?;
    Some(folder.join(format!("{name}_{lobes}_{}.png", arguments.method)))
}

fn environment(
    arguments: &Arguments,
    map: &EnvironmentMap,
    name: &str,
    table: &mut String,
) -> Result<()> {
    for &lobes in &arguments.environment_lobes {
        let options = EnvironmentOptions { lobes, method: arguments.method };
        let fit = with_progress(&format!("{name}, {lobes} lobes"), arguments.quiet, |progress| {
            environment_lobes(map, options, None, progress)
        })?;
        if let Some(path) = picture_path(arguments, name, lobes) {
            picture::write_environment(&path, map, &fit)?;
        }
        let errors = fit.errors;
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "| {name} | {}×{} | {} | {:.3} | {:.4} | {:.3} | {:.3} | {:.2} |",
            map.width,
            map.height,
            fit.lobes.len(),
            errors.chi_squared,
            errors.kullback_leibler,
            errors.relative_l2,
            errors.energy_captured,
            fit.seconds
        );
    }
    Ok(())
}

fn brdf(arguments: &Arguments, source: &Source, name: &str, table: &mut String) -> Result<()> {
    for &lobes in &arguments.brdf_lobes {
        let options = BrdfOptions { lobes, views: arguments.views, method: arguments.method };
        let fit = with_progress(&format!("{name}, {lobes} lobes"), arguments.quiet, |progress| {
            brdf_lobes(&source.tables, 0, name, options, None, progress)
        })?;
        if let Some(path) = picture_path(arguments, &source.name, lobes) {
            picture::write_brdf(&path, &source.tables, 0, &fit)?;
        }
        let (summary, mean) = (fit.summary, fit.summary.mean);
        let largest = fit.views.iter().map(|view| view.errors.chi_squared).fold(0.0, f64::max);
        let _ = writeln!(
            table,
            "| {name} | {lobes} × {} | {:.3} | {:.3} | {:.3} | {largest:.3} | {:.4} | {:.3} | \
             {:.3} | {:.2} |",
            fit.views.len(),
            mean.chi_squared,
            summary.largest_chi_squared,
            summary.largest_chi_squared_between,
            mean.kullback_leibler,
            mean.relative_l2,
            mean.energy_captured,
            fit.seconds
        );
    }
    Ok(())
}
