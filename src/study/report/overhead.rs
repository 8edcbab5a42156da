//! Section of the page on overhead over a baseline.

use super::{
    curves::legend_entry,
    html::escape,
    plot::{self, STYLE_COUNT, Series},
    tables,
};
use crate::study::results::Report;

/// Overhead against the share of blocked rays, and the tables.
pub(crate) fn overhead_section(report: &Report) -> String {
    let Some(first) = report.overheads.first() else { return String::new() };
    let mut samplers: Vec<&str> = Vec::new();
    for overhead in &report.overheads {
        if !samplers.contains(&overhead.sampler.as_str()) {
            samplers.push(&overhead.sampler);
        }
    }
    let style_of = |sampler: &str| {
        report.order.iter().position(|name| name == sampler).unwrap_or(STYLE_COUNT - 1)
    };
    let more = |ratio: f64| 100.0 * (ratio - 1.0);
    let series: Vec<Series> = samplers
        .iter()
        .map(|sampler| Series {
            style: style_of(sampler),
            name: (*sampler).to_owned(),
            points: report
                .overheads
                .iter()
                .filter(|overhead| overhead.sampler == *sampler)
                .filter_map(|overhead| {
                    Some(plot::Point {
                        x: 100.0 * overhead.blocked_share?,
                        y: more(overhead.total.middle),
                        low: more(overhead.total.low),
                        high: more(overhead.total.high),
                        label: if *sampler == samplers[0] {
                            overhead.scene.clone()
                        } else {
                            String::new()
                        },
                    })
                })
                .collect(),
        })
        .collect();
    let ranges: Vec<plot::Range> = report
        .published_overheads
        .iter()
        .map(|published| plot::Range {
            label: published.label.clone(),
            low: more(published.low),
            high: more(published.high),
        })
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
            &format!("Overhead over {baseline} against blocked shadow rays"),
            &format!("blocked shadow rays of {baseline}, %"),
            "more device time, %",
            &series,
            &ranges
        ),
        tables::overheads(&report.overheads)
    )
}
