//! `fenestra fit table`: tabulates errors and times of many fits.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use super::{source, with_progress};
use crate::{
    error::Result,
    files::{extension, write_text},
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
    let (mut maps, mut brdfs) = (String::new(), String::new());
    for text in &arguments.sources {
        let path = Path::new(text);
        if ["hdr", "exr", "pfm", "toml"].contains(&extension(path).as_str()) {
            let (map, name, _) = source::environment(path)?;
            environment(arguments, &map, &name, &mut maps)?;
        } else {
            brdf(arguments, text, &mut brdfs)?;
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

fn brdf(arguments: &Arguments, text: &str, table: &mut String) -> Result<()> {
    let source = source::material(text)?;
    let name = if source::is_measured(Path::new(text)) { source.name.as_str() } else { text };
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
