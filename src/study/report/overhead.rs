//! Section of the page on overhead over a baseline.

use super::{
    curves::legend_entry,
    html::escape,
    plot::{self, STYLE_COUNT, Series},
    tables,
};
use crate::study::{overhead::Overhead, plan::PublishedOverhead, results::Report, runs::distinct};

/// Overhead against the share of blocked rays, and the tables.
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
