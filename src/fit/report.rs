//! Descriptions of fits, in words and in JSON.

use std::path::Path;

use serde_json::{Value, json};

use super::{
    cache::read_fit,
    config::{self, Method},
    fitted::{BrdfFit, EnvironmentFit, Fit},
    judge::FitErrors,
};
use crate::error::Result;

/// Description of a file, for machines and for people.
#[derive(Clone, Debug)]
pub struct Description {
    /// For machines.
    pub value: Value,
    /// For people.
    pub lines: Vec<String>,
    /// Warnings, among them notes on departures from what was asked.
    pub warnings: Vec<String>,
}

/// Describes a fit file.
///
/// # Errors
/// As [`read_fit`].
pub fn describe(path: &Path) -> Result<Description> {
    Ok(match read_fit(path)? {
        Fit::Environment(fit) => describe_environment(&fit),
        Fit::Brdf(fit) => describe_brdf(&fit),
    })
}

fn method(method: Method) -> &'static str {
    match method {
        Method::Em => "em (Kullback-Leibler divergence, expectation maximization)",
        Method::L2 => "l2 (squared error, L-BFGS)",
    }
}

fn error_lines(errors: &FitErrors) -> Vec<String> {
    vec![
        format!("relative L2      {:.4}", errors.relative_l2),
        format!("chi squared      {:.4} as a sampling density", errors.chi_squared),
        format!("Kullback-Leibler {:.4} nats", errors.kullback_leibler),
        format!("energy captured  {:.4}", errors.energy_captured),
    ]
}

/// Smallest and largest bandwidth of lobes that hold energy.
fn bandwidths(lobes: impl Iterator<Item = (f32, f32)>) -> (f32, f32) {
    lobes
        .filter(|(_, amplitude)| *amplitude > 0.0)
        .fold((f32::MAX, 0.0), |(low, high), (bandwidth, _)| {
            (low.min(bandwidth), high.max(bandwidth))
        })
}

pub(crate) fn describe_environment(fit: &EnvironmentFit) -> Description {
    let (low, high) = bandwidths(fit.lobes.iter().map(|lobe| (lobe.bandwidth, lobe.amplitude)));
    let mut lines = vec![
        format!("environment fit of {}", fit.source),
        format!("method           {}", method(fit.method)),
        format!("lobes            {} of {} asked for", fit.lobes.len(), fit.requested_lobes),
        format!("bandwidths       {low:.3} to {high:.1}"),
    ];
    lines.extend(error_lines(&fit.errors));
    let value = json!({
        "kind": "environment fit",
        "source": fit.source,
        "method": fit.method,
        "requested_lobes": fit.requested_lobes,
        "lobes": fit.lobes.len(),
        "smallest_bandwidth": low,
        "largest_bandwidth": high,
        "errors": fit.errors,
    });
    Description { value, lines, warnings: fit.notes.clone() }
}

pub(crate) fn describe_brdf(fit: &BrdfFit) -> Description {
    let lobes = fit.views.iter().flat_map(|view| &view.lobes);
    let (low, high) = bandwidths(lobes.map(|lobe| (lobe.bandwidth, lobe.amplitude)));
    let count = fit.views.first().map_or(0, |view| view.lobes.len());
    let angle = config::SUMMARY_ANGLE_DEG;
    let summary = &fit.summary;
    let mut lines = vec![
        format!("BRDF fit of {}", fit.source),
        format!("method           {}", method(fit.method)),
        format!("views            {}", fit.views.len()),
        format!("lobes per view   {count} of {} asked for", fit.requested_lobes),
        format!("bandwidths       {low:.3} to {high:.1}"),
        format!("means over the views up to {angle} degrees from the normal:"),
    ];
    lines.extend(error_lines(&summary.mean));
    lines.push(format!("largest chi squared {:.4} at a view", summary.largest_chi_squared));
    let between = summary.largest_chi_squared_between;
    lines.push(format!("                    {between:.4} between two views"));
    lines.push("view   albedo  chi squared  relative L2  energy captured".to_owned());
    for view in &fit.views {
        lines.push(format!(
            "{:>4.1}   {:>6.4}  {:>11.4}  {:>11.4}  {:>15.4}",
            view.theta.to_degrees(),
            view.albedo,
            view.errors.chi_squared,
            view.errors.relative_l2,
            view.errors.energy_captured
        ));
    }
    let views: Vec<Value> = fit
        .views
        .iter()
        .map(|view| json!({ "theta": view.theta, "albedo": view.albedo, "errors": view.errors }))
        .collect();
    let value = json!({
        "kind": "BRDF fit",
        "source": fit.source,
        "method": fit.method,
        "requested_lobes": fit.requested_lobes,
        "lobes": count,
        "smallest_bandwidth": low,
        "largest_bandwidth": high,
        "summary": summary,
        "views": views,
    });
    Description { value, lines, warnings: fit.notes.clone() }
}
