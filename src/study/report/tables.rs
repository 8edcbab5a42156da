//! Tables of the page: ratios at a glance, published figures beside ours, every figure of a scene, overheads.

use std::collections::BTreeSet;

use super::html::{Table, count, escape, interval, number, percent, percent_added, percent_more};
use crate::study::{
    metrics::parts::PartErrors,
    overhead::{Overhead, PassOverhead},
    plan::{PublishedErrors, Rule},
    quality::{Figure, THRESHOLDS, TimeToQuality},
    results::Report,
    runs::distinct,
    statistics::Interval,
    summary::{SUSPICIOUS_DEVIATION, Summary},
    surfaces::Parts,
};

const NOT_JUDGED: &str = "<span class=\"refused\">not judged</span>";

/// Formats a ratio, marked if it is better, or says that it is not judged.
fn ratio_cell(ratio: Option<&Interval>, is_better: bool) -> String {
    match ratio {
        Some(ratio) if is_better => format!("<span class=\"best\">{}</span>", interval(ratio, 3)),
        Some(ratio) => interval(ratio, 3),
        None => NOT_JUDGED.to_owned(),
    }
}

/// Finds the figures of a sampler in a scene under a rule.
pub(super) fn find<'a>(
    report: &'a Report,
    scene: &str,
    sampler: &str,
    rule: Rule,
) -> Option<&'a Summary> {
    report.summaries.iter().find(|summary| {
        summary.scene == scene && summary.sampler == sampler && summary.rule == rule
    })
}

struct Glance {
    caption: &'static str,
    value: fn(&Summary) -> Option<&Interval>,
    is_less_better: bool,
}

const GLANCES: [Glance; 4] = [
    Glance {
        caption: "Trimmed relMSE on lit surfaces over that of {first}: less is better. The environment \
                  seen directly is left out.",
        value: |summary| summary.surfaces_ratio.as_ref(),
        is_less_better: true,
    },
    Glance {
        caption: "RMSE over that of {first}: less is better. Bright pixels count most.",
        value: |summary| summary.rmse_ratio.as_ref(),
        is_less_better: true,
    },
    Glance {
        caption: "Root of trimmed relMSE over that of {first}: less is better. Dark pixels count as \
                  much as bright ones.",
        value: |summary| summary.relative_ratio.as_ref(),
        is_less_better: true,
    },
    Glance {
        caption: "Efficiency over that of {first}: MSE × seconds of {first} over that of the sampler. \
                  More is better; 2 means the same error in half the time.",
        value: |summary| summary.efficiency.as_ref(),
        is_less_better: false,
    },
];

/// Ratios to the first sampler in every scene.
pub(crate) fn at_a_glance(report: &Report) -> String {
    let [first, others @ ..] = &report.order[..] else { return String::new() };
    if others.is_empty() || report.summaries.is_empty() {
        return String::new();
    }
    let mut html = "<p>Geometric means over pairs of the same seed with their 95% intervals; bold \
                    where the whole interval is better than 1.</p>"
        .to_owned();
    // The tables of many samplers are too wide to stand side by side.
    html += if others.len() <= 2 { "<div class=\"side\">" } else { "<div>" };
    for glance in &GLANCES {
        html += &format!("<div>{}</div>", glance_table(report, (first, others), glance));
    }
    html + "</div>"
}

fn glance_table(report: &Report, (first, others): (&str, &[String]), glance: &Glance) -> String {
    let mut table = Table::new(glance.caption.replace("{first}", &escape(first)), &["scene", "at"]);
    table.columns(others);
    for scene in &report.scenes {
        let row = |rule: &Rule| {
            let found: Vec<Option<&Summary>> =
                others.iter().map(|name| find(report, &scene.name, name, *rule)).collect();
            let is_there = found.iter().any(Option::is_some);
            let cell = |summary: &Summary| {
                let ratio = (glance.value)(summary);
                let is_better = |ratio: &Interval| {
                    if glance.is_less_better { ratio.high < 1.0 } else { ratio.low > 1.0 }
                };
                ratio_cell(ratio, summary.runs > 1 && ratio.is_some_and(is_better))
            };
            let cells = found.into_iter().map(|summary| summary.map_or_else(String::new, cell));
            is_there.then(|| std::iter::once(rule.describe()).chain(cells).collect())
        };
        table.group(&scene.name, report.rules.iter().filter_map(row));
    }
    table.html()
}

/// Seconds until relMSE falls to the thresholds, for every sampler in every scene.
pub fn times_to_quality(report: &Report) -> String {
    let mut html = String::new();
    for (figure, name) in [(Figure::Relmse, "relMSE"), (Figure::RelmseTrimmed, "trimmed relMSE")] {
        let caption = format!(
            "Seconds until {name} falls to a threshold and stays there: median over the seeds, with \
             the fastest and the slowest. Interpolated between the looks of a run. In italics: the \
             error at the end of runs that did not get there, and an extrapolation as if it went on \
             to fall as 1/time."
        );
        let mut table = Table::new(caption, &["scene", "down to"]);
        table.columns(&report.order);
        for scene in &report.scenes {
            let row = |threshold: f64| {
                let is_here = |time: &&TimeToQuality| {
                    (time.scene.as_str(), time.figure) == (scene.name.as_str(), figure)
                        && time.threshold == threshold
                };
                let here: Vec<&TimeToQuality> =
                    report.times_to_quality.iter().filter(is_here).collect();
                let cells = report.order.iter().map(|name| {
                    let own = here.iter().find(|time| time.sampler == *name);
                    own.map_or_else(String::new, |time| time_cell(time))
                });
                let is_there = !here.is_empty();
                is_there.then(|| std::iter::once(threshold.to_string()).chain(cells).collect())
            };
            table.group(&scene.name, THRESHOLDS.into_iter().filter_map(row));
        }
        html += &table.html();
    }
    html
}

fn time_cell(time: &TimeToQuality) -> String {
    let seconds = |value: f64| format!("{} s", number(value, 3));
    if !time.is_judged {
        return NOT_JUDGED.to_owned();
    }
    let Some(middle) = time.seconds else {
        let extrapolated = time
            .extrapolated_seconds
            .map_or_else(String::new, |value| format!("; extrapolated {}", seconds(value)));
        return format!(
            "<span class=\"refused\">not reached by {} of {}: {} after {}{extrapolated}</span>",
            time.runs - time.reached,
            time.runs,
            number(time.last_error, 2),
            seconds(time.last_seconds)
        );
    };
    let bound = if time.is_upper_bound { "≤ " } else { "" };
    let spread = match (time.fastest, time.slowest) {
        (Some(low), Some(high)) if low == high => String::new(),
        (Some(low), Some(high)) => format!("({}–{})", number(low, 3), number(high, 3)),
        (Some(low), None) => {
            let missed = time.runs - time.reached;
            format!("({}–; not reached by {missed} of {})", number(low, 3), time.runs)
        }
        (None, _) => String::new(),
    };
    format!("{bound}{} <span class=\"interval\">{spread}</span>", seconds(middle))
}

/// Tables of published figures beside the study's own, one for each source and scene.
pub fn published(report: &Report) -> String {
    let mut html = String::new();
    let keys = report.published_errors.iter().map(|entry| (&entry.source, &entry.scene));
    let is_studied = |scene: &String| report.scenes.iter().any(|studied| studied.name == *scene);
    for (source, scene) in distinct(keys.filter(|(_, scene)| is_studied(scene))) {
        let entries: Vec<_> = report
            .published_errors
            .iter()
            .filter(|entry| entry.source == *source && entry.scene == *scene)
            .collect();
        let names: Vec<&String> = report
            .order
            .iter()
            .filter(|name| entries.iter().any(|entry| entry.values.contains_key(*name)))
            .collect();
        let [first, second] = names[..] else { continue };
        let [a, b] = [first, second].map(|name| escape(name));
        let value = |entry: &PublishedErrors, name: &String| entry.values.get(name).copied();
        let published = |entry: &PublishedErrors, name: &String| {
            value(entry, name).map_or_else(String::new, |value| number(value, 6))
        };
        let ratio = |entry: &PublishedErrors| {
            let ratio = value(entry, first).zip(value(entry, second));
            ratio.map_or_else(String::new, |(a, b)| number(b / a, 3))
        };
        let ours = |entry: &PublishedErrors, name: &str, cell: fn(&Summary) -> String| {
            let found = find(report, scene, name, Rule::Spp(entry.spp));
            found.map_or_else(|| "–".to_owned(), cell)
        };
        let ratio_here = |summary: &Summary| ratio_cell(summary.rmse_ratio.as_ref(), false);
        let columns: [Column<'_, PublishedErrors>; 7] = [
            ("samples per pixel", &|e| e.spp.to_string()),
            (&format!("published,<br>{a}"), &|e| published(e, first)),
            (&format!("published,<br>{b}"), &|e| published(e, second)),
            ("published<br>ratio", &ratio),
            (&format!("RMSE here,<br>{a}"), &|e| ours(e, first, rmse_cell)),
            (&format!("RMSE here,<br>{b}"), &|e| ours(e, second, rmse_cell)),
            ("ratio<br>here", &|e| ours(e, second, ratio_here)),
        ];
        let caption = format!(
            "{} beside this study: {}. The published unit is unknown, so that only the ratios \
             can be compared.",
            escape(source),
            escape(scene)
        );
        let mut table = Table::new(caption, &columns.map(|(head, _)| head));
        for entry in &entries {
            table.row(false, columns.iter().map(|(_, cell)| cell(entry)).collect());
        }
        html += &table.html();
    }
    html
}

fn judged_cell(value: f64, is_judged: bool) -> String {
    if is_judged { number(value, 3) } else { NOT_JUDGED.to_owned() }
}

fn rmse_cell(summary: &Summary) -> String {
    judged_cell(summary.errors.rmse, summary.mse_judged)
}

/// Head of a column, and the function that formats its cell in a row.
type Column<'a, R> = (&'a str, &'a dyn Fn(&R) -> String);

/// Percentage of a share, or nothing.
fn share_cell(share: Option<f64>) -> String {
    share.map_or_else(String::new, percent)
}

/// Three digits of a figure, or nothing.
fn optional_cell(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| number(value, 3))
}

pub fn figures(report: &Report, scene: &str) -> String {
    let own: Vec<&Summary> =
        report.summaries.iter().filter(|summary| summary.scene == scene).collect();
    let names: BTreeSet<&String> =
        own.iter().flat_map(|summary| summary.statistics.keys()).collect();
    let relative = |s: &Summary, value: f64| judged_cell(value, s.relmse_judged);
    let on_surfaces = |s: &Summary, value: fn(PartErrors) -> f64| {
        let Parts { surfaces, surfaces_judged, .. } = s.parts;
        surfaces.map_or("–".to_owned(), |part| judged_cell(value(part), surfaces_judged))
    };
    let on_environment = |part: PartErrors| number(part.mse, 3);
    let columns: [Column<'_, Summary>; 18] = [
        ("sampler", &|s| escape(&s.sampler)),
        ("at", &|s| s.rule.describe()),
        ("runs", &|s| s.runs.to_string()),
        ("samples", &|s| count(s.spp)),
        ("seconds", &|s| number(s.seconds, 3)),
        ("RMSE", &rmse_cell),
        ("MSE", &|s| judged_cell(s.errors.mse, s.mse_judged)),
        ("relMSE", &|s| relative(s, s.errors.relmse)),
        ("relMSE,<br>trimmed", &|s| relative(s, s.errors.relmse_trimmed)),
        ("relMSE,<br>99.9%", &|s| relative(s, s.errors.relmse_p999)),
        ("relMSE,<br>largest", &|s| relative(s, s.errors.relmse_max)),
        ("relMSE,<br>surfaces", &|s| on_surfaces(s, |part| part.relmse)),
        ("trimmed,<br>surfaces", &|s| on_surfaces(s, |part| part.relmse_trimmed)),
        ("MSE,<br>environment", &|s| s.parts.environment.map_or("–".to_owned(), on_environment)),
        ("ꟻLIP", &|s| optional_cell(s.flip)),
        ("mean ratio", &mean_cell),
        ("visible<br>rays", &|s| share_cell(s.visible_share)),
        ("GPU ms<br>per sample", &|s| number(s.gpu_ms_per_sample.values().sum(), 3)),
    ];
    let caption = format!(
        "Means over the seeds. Mean ratio: the picture's mean over the reference's, with its \
         95% interval; a mean further off than {SUSPICIOUS_DEVIATION} standard errors is marked."
    );
    let mut table = Table::new(caption, &columns.map(|(head, _)| head));
    table.columns(&names.iter().map(|name| name.replace('_', " ")).collect::<Vec<_>>());
    for rule in &report.rules {
        let of_rule = own.iter().filter(|summary| summary.rule == *rule);
        for (index, summary) in of_rule.enumerate() {
            let statistic = |name: &&String| optional_cell(summary.statistics.get(*name).copied());
            let cells = columns.iter().map(|(_, cell)| cell(summary));
            table.row(index == 0, cells.chain(names.iter().map(statistic)).collect());
        }
    }
    table.html()
}

/// Formats the mean ratio, and marks a suspicious one.
fn mean_cell(summary: &Summary) -> String {
    let mut mean = interval(&summary.mean_ratio, 4);
    if summary.is_suspicious() {
        let deviation = number(summary.mean_deviation.unwrap_or(0.0), 2);
        mean += &format!(" <strong class=\"warn\">{deviation} σ</strong>");
    }
    mean
}

/// Overhead of every sampler in every scene, then pass by pass.
pub fn overheads(overheads: &[Overhead]) -> String {
    let Some(first) = overheads.first() else { return String::new() };
    let baseline = escape(&first.baseline);
    let columns: [Column<'_, Overhead>; 8] = [
        ("scene", &|o| escape(&o.scene)),
        ("sampler", &|o| escape(&o.sampler)),
        ("blocked rays<br>of the baseline", &|o| share_cell(o.blocked_share)),
        ("blocked rays<br>of the sampler", &|o| share_cell(o.own_blocked_share)),
        ("device time", &|o| percent_more(&o.total)),
        ("wall time", &|o| percent_more(&o.wall)),
        ("ms per sample,<br>baseline", &|o| number(o.total_ms[0], 3)),
        ("ms per sample,<br>sampler", &|o| number(o.total_ms[1], 3)),
    ];
    let caption = format!(
        "Time per sample over that of {baseline}, by the device's timestamps and by the wall \
         clock: median over {} interleaved rounds with the interval that holds it with 95% \
         confidence.",
        first.rounds
    );
    let mut table = Table::new(caption, &columns.map(|(head, _)| head));
    let mut scene = "";
    for overhead in overheads {
        let cells = columns.iter().map(|(_, cell)| cell(overhead)).collect();
        table.row(scene != overhead.scene, cells);
        scene = &overhead.scene;
    }
    let columns: [Column<'_, PassOverhead>; 5] = [
        ("pass", &|p| escape(&p.pass)),
        ("ms per sample,<br>baseline", &|p| number(p.ms[0], 3)),
        ("ms per sample,<br>sampler", &|p| number(p.ms[1], 3)),
        ("ratio", &|p| p.ratio.map_or("–".to_owned(), |ratio| interval(&ratio, 3))),
        ("adds to the<br>whole time", &|p| percent_added(&p.added_share)),
    ];
    let mut html = table.html();
    for overhead in overheads {
        let (scene, sampler) = (escape(&overhead.scene), escape(&overhead.sampler));
        let caption = format!("{sampler} against {baseline} in {scene}, pass by pass");
        let mut table = Table::new(caption, &columns.map(|(head, _)| head));
        for pass in &overhead.passes {
            table.row(false, columns.iter().map(|(_, cell)| cell(pass)).collect());
        }
        html += &format!(
            "<details><summary>{sampler} in {scene}, pass by pass</summary>{}</details>",
            table.html()
        );
    }
    html
}
