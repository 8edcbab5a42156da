//! Plots of a scene, errors and efficiency against samples and against time, and that of overheads.

use super::{
    html::{escape, number},
    plot::{self, STYLE_COUNT, Series},
    tables,
};
use crate::study::{
    overhead::Overhead,
    plan::PublishedOverhead,
    results::Report,
    runs::{StudiedScene, distinct},
    statistics::Interval,
    summary::{Curve, CurvePoint},
};

/// Errors and efficiency against samples and against time.
pub(crate) fn plots(report: &Report, scene: &StudiedScene) -> String {
    let curves: Vec<(usize, &Curve)> = report
        .order
        .iter()
        .enumerate()
        .filter_map(|(style, name)| {
            let own = |curve: &&Curve| curve.scene == scene.name && curve.sampler == *name;
            report.curves.iter().find(own).map(|curve| (style, curve))
        })
        .filter(|(_, curve)| !curve.points.is_empty())
        .collect();
    if curves.is_empty() {
        return String::new();
    }
    let mut html = "<h3>Error on the way</h3><div class=\"plots\">".to_owned();
    for ordinate in &ORDINATES {
        for abscissa in &ABSCISSAS {
            html += &plot_figure(&scene.name, &curves, abscissa, ordinate);
        }
    }
    html + "</div><p class=\"soft\">Both axes logarithmic. relMSE is trimmed and over lit surfaces; \
           efficiency is 1 / (relMSE × seconds). Bands: 95% interval of the mean over the seeds. \
           Dashed: the slope of independent samples. Points that are not judged are left out.</p>"
}

struct Abscissa {
    name: &'static str,
    title: &'static str,
    value: fn(&CurvePoint) -> f64,
    slope: fn(&Curve) -> Option<f64>,
}

const ABSCISSAS: [Abscissa; 2] = [
    Abscissa {
        name: "samples",
        title: "samples per pixel",
        value: |point| f64::from(point.spp),
        slope: |curve| curve.slope_spp,
    },
    Abscissa {
        name: "time",
        title: "seconds of passes",
        value: |point| point.seconds,
        slope: |curve| curve.slope_seconds,
    },
];

/// Ordinate of the plots, with the slope of independent samples against it.
struct Ordinate {
    name: &'static str,
    value: fn(&CurvePoint) -> Option<Interval>,
    slope: f64,
}

const ORDINATES: [Ordinate; 3] = [
    Ordinate { name: "RMSE", value: |point| Some(point.rmse), slope: -0.5 },
    Ordinate { name: "relMSE", value: |point| point.relmse, slope: -1.0 },
    Ordinate { name: "efficiency", value: |point| point.efficiency, slope: 0.0 },
];

/// One plot with its legend; empty where nothing is judged.
fn plot_figure(
    scene: &str,
    curves: &[(usize, &Curve)],
    abscissa: &Abscissa,
    ordinate: &Ordinate,
) -> String {
    let mut legend = "<ul class=\"legend\">".to_owned();
    let mut all = Vec::new();
    for (style, curve) in curves {
        let point = |point: &CurvePoint| {
            let (x, y) = ((abscissa.value)(point), (ordinate.value)(point)?);
            Some(plot::Point { x, y, label: String::new() })
        };
        let points: Vec<plot::Point> = curve.points.iter().filter_map(point).collect();
        if points.is_empty() {
            continue;
        }
        let slope = (abscissa.slope)(curve)
            .filter(|_| ordinate.name == ORDINATES[0].name)
            .map_or_else(String::new, |slope| format!(", slope {}", number(slope, 3)));
        legend += &legend_entry(*style, &format!("{}{slope}", escape(&curve.sampler)));
        all.push(Series { style: *style, name: curve.sampler.clone(), points });
    }
    if all.is_empty() {
        return String::new();
    }
    let title = format!("{scene}: {} against {}", ordinate.name, abscissa.name);
    format!(
        "<figure>{}{legend}</ul></figure>",
        plot::log_log([&title, abscissa.title, ordinate.name], &all, ordinate.slope)
    )
}

/// Legend entry of marker and text; `text` is HTML.
fn legend_entry(style: usize, text: &str) -> String {
    format!(
        "<li class=\"s{}\"><svg viewBox=\"-6 -6 12 12\" aria-hidden=\"true\"><g class=\"mark\">{}\
         </g></svg>{text}</li>",
        style % STYLE_COUNT,
        plot::marker(style)
    )
}

/// Section of the page on overhead over a baseline: overhead against the share of blocked rays, and the
/// tables.
pub(crate) fn overhead_section(report: &Report) -> String {
    let Some(first) = report.overheads.first() else { return String::new() };
    let samplers = distinct(report.overheads.iter().map(|overhead| overhead.sampler.as_str()));
    let style_of = |sampler: &str| {
        report.order.iter().position(|name| name == sampler).unwrap_or(STYLE_COUNT - 1)
    };
    let more = |ratio: f64| 100.0 * (ratio - 1.0);
    let point = |overhead: &Overhead| {
        let is_labelled = overhead.sampler == samplers[0];
        let label = if is_labelled { overhead.scene.clone() } else { String::new() };
        Some(plot::Point { x: 100.0 * overhead.blocked_share?, y: overhead.total.map(more), label })
    };
    let series_of = |sampler: &&str| {
        let own = report.overheads.iter().filter(|overhead| overhead.sampler == *sampler);
        let points = own.filter_map(point).collect();
        Series { style: style_of(sampler), name: (*sampler).to_owned(), points }
    };
    let series: Vec<Series> = samplers.iter().map(series_of).collect();
    let published = report.published_overheads.iter();
    let ranges: Vec<(&str, [f64; 2])> = published
        .map(|PublishedOverhead { label, low, high }| (label.as_str(), [more(*low), more(*high)]))
        .collect();
    let legend: String =
        samplers.iter().map(|sampler| legend_entry(style_of(sampler), &escape(sampler))).collect();
    let baseline = &first.baseline;
    format!(
        "<section id=\"overhead\"><h2>Overhead</h2><p>How much more device time a sample takes than \
         with {}, at equal samples: in every round all samplers take turns over the same seed, and \
         each round gives one ratio.</p><figure>{}<ul class=\"legend\">{legend}</ul></figure>{}\
         </section>",
        escape(baseline),
        plot::scatter(
            [
                &format!("Overhead over {baseline} against blocked shadow rays"),
                &format!("blocked shadow rays of {baseline}, %"),
                "more device time, %",
            ],
            &series,
            &ranges
        ),
        tables::overheads(&report.overheads)
    )
}
