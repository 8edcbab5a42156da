//! The page of a study, `index.html`: one file that needs no network.
//!
//! Text, tables and plots work without JavaScript; `page.js` adds the viewer (two overlaid
//! pictures, one zoom and pan for all pictures of a scene). Colours follow the reader's choice of
//! light or dark (`page.css`).

pub mod html;
pub mod pictures;
pub mod plot;
pub mod tables;
mod verdict;

use std::fmt::Write;

use super::{
    falsecolour::Scale,
    folder::Folder,
    own_errors::JUDGED_FROM,
    plan::Plan,
    record::SceneRecord,
    reference_check::Verdict,
    results::Report,
    rule::Rule,
    statistics::Interval,
    summary::{Curve, CurvePoint, rules},
};
use crate::{error::Result, files::write_text};
use html::{escape, number};
use pictures::{Picture, ScenePictures};
use plot::{STYLE_COUNT, Series};

/// Largest number of samplers that show pictures of every rule; more show only those of the largest
/// number of samples and of the time.
const FEW_SAMPLERS: usize = 3;
/// Steps of the false-colour legend.
const RAMP_STEPS: u32 = 16;

/// Writes `index.html`.
///
/// # Errors
/// A picture cannot be read, or the page cannot be written.
pub fn write(report: &Report, plan: &Plan, folder: &Folder) -> Result<()> {
    let rules = rules(plan);
    let shown: Vec<Rule> = rules
        .iter()
        .copied()
        .filter(|rule| {
            report.order.len() <= FEW_SAMPLERS
                || matches!(rule, Rule::Seconds(_))
                || plan.spp.last().is_some_and(|spp| *rule == Rule::Spp(*spp))
        })
        .collect();
    let mut body = start(report);
    let mut style = String::new();
    if !report.summaries.is_empty() {
        body += "<section id=\"glance\"><h2>At a glance</h2>";
        body += &verdict::all(report, &rules);
        body += &tables::at_a_glance(report, &rules);
        body += "</section>";
        let times = tables::times_to_quality(report);
        if !times.is_empty() {
            let _ =
                write!(body, "<section id=\"quality\"><h2>Time to quality</h2>{times}</section>");
        }
        let published = tables::published(report);
        if !published.is_empty() {
            let _ = write!(
                body,
                "<section id=\"published\"><h2>Beside the published figures</h2>{}{published}\
                 </section>",
                include_str!("published.html")
            );
        }
        for (index, scene) in report.scenes.iter().enumerate() {
            let own = report.summaries.iter().any(|summary| summary.scene == scene.name);
            if scene.reference.is_some() && own {
                let pictures = pictures::load(folder, scene, &report.order, &shown, &report.runs)?;
                for (number, picture) in pictures.pictures.iter().enumerate() {
                    style += &picture_style(index, number, picture);
                }
                body += &scene_section(report, index, scene, &pictures, &rules);
            }
        }
    }
    body += &overhead_section(report);
    body += &end(report);
    let page = include_str!("page.html")
        .replace("{{title}}", &escape(&report.title))
        .replace("{{style}}", include_str!("page.css"))
        .replace("{{script}}", include_str!("page.js"))
        .replace("{{pictures}}", &style)
        .replace("{{body}}", &body);
    write_text(&folder.path().join("index.html"), &page)
}

/// Header: title, notes, links.
fn start(report: &Report) -> String {
    let facts = &report.circumstances;
    let mut html = format!(
        "<header><h1>{}</h1><p class=\"facts\">Fenestra {}, {}, {}</p>",
        escape(&report.title),
        escape(&facts.version),
        escape(&facts.date),
        escape(&facts.device)
    );
    if !report.is_complete {
        html += "<p class=\"warning\"><strong class=\"warn\">This study ended early.</strong> The \
                 page shows the runs that were finished; the same command continues it.</p>";
    }
    for scene in &report.scenes {
        if scene.reference_check.as_ref().is_some_and(|check| check.verdict == Verdict::Disagrees) {
            let _ = write!(
                html,
                "<p class=\"warning\"><strong class=\"warn\">The reference of {} is in \
                 doubt.</strong> An independent picture disagrees with it.</p>",
                escape(&scene.name)
            );
        }
    }
    for note in &report.notes {
        let _ = write!(html, "<p>{}</p>", escape(note));
    }
    html += "<nav aria-label=\"Sections\"><ul>";
    let mut link = |id: &str, text: &str| {
        let _ = write!(html, "<li><a href=\"#{id}\">{}</a></li>", escape(text));
    };
    if !report.summaries.is_empty() {
        link("glance", "At a glance");
        link("quality", "Time to quality");
        for (index, scene) in report.scenes.iter().enumerate() {
            if report.summaries.iter().any(|summary| summary.scene == scene.name) {
                link(&format!("scene-{index}"), &scene.name);
            }
        }
    }
    if !report.overheads.is_empty() {
        link("overhead", "Overhead");
    }
    link("definitions", "Definitions");
    link("circumstances", "Circumstances");
    html + "</ul></nav><p class=\"facts\">Every run: <a href=\"results.csv\">CSV</a>, \
            <a href=\"results.json\">JSON</a>. Pictures link to their EXR.</p></header>"
}

/// Name of a picture's class in the style sheet.
fn picture_class(scene: usize, picture: usize, is_error: bool) -> String {
    format!("{}{scene}-{picture}", if is_error { "e" } else { "p" })
}

fn picture_style(scene: usize, number: usize, picture: &Picture) -> String {
    let rule = |is_error, uri: &String| {
        if uri.is_empty() {
            return String::new();
        }
        format!(".{}{{background-image:url({uri})}}\n", picture_class(scene, number, is_error))
    };
    rule(false, &picture.colour) + &rule(true, &picture.error)
}

/// Names a picture: "visibility, 400 spp" or "reference".
fn picture_name(picture: &Picture) -> String {
    match picture.rule {
        Some(rule) => format!("{}, {}", escape(&picture.sampler), rule.describe()),
        None => "reference".to_owned(),
    }
}

fn scene_section(
    report: &Report,
    index: usize,
    scene: &SceneRecord,
    pictures: &ScenePictures,
    rules: &[Rule],
) -> String {
    let mut html = format!(
        "<section id=\"scene-{index}\"><h2>{}</h2><p class=\"facts\">{}×{} pixels, {} triangles. ",
        escape(&scene.name),
        scene.width,
        scene.height,
        scene.triangles
    );
    if let Some(reference) = &scene.reference {
        let _ = write!(html, "Reference: {}", escape(&reference.description));
        html += &match (reference.mse, reference.seconds) {
            (Some(mse), Some(seconds)) => format!(
                "; its own RMSE is {}, it took {} s.</p>",
                number(mse.max(0.0).sqrt(), 3),
                number(seconds, 3)
            ),
            (Some(mse), None) => {
                format!("; its own RMSE is {}.</p>", number(mse.max(0.0).sqrt(), 3))
            }
            (None, _) => "; how noisy it is itself is not known, and its noise is part of every \
                          error here.</p>"
                .to_owned(),
        };
    }
    if let Some(check) = &scene.reference_check {
        let text = escape(&check.describe());
        html += &match check.verdict {
            Verdict::Disagrees => format!(
                "<p class=\"warning\"><strong class=\"warn\">The reference is in doubt.</strong> \
                 {text}. No figure of this scene is to be trusted before it is known which of the \
                 two is wrong.</p>"
            ),
            Verdict::Agrees | Verdict::TooNoisy => format!("<p class=\"facts\">Check: {text}.</p>"),
        };
    }
    let refused = report
        .summaries
        .iter()
        .filter(|summary| summary.scene == scene.name && !summary.mse_judged)
        .count();
    if refused > 0 {
        let _ = write!(
            html,
            "<p class=\"warning\">Figures that are not judged, because the error is not well above the \
             reference's own: {refused}. A longer reference (<code>--reference-spp</code>) \
             helps.</p>"
        );
    }
    if let Some(part) = scene.parts.filter(|part| part.surface_share < 1.0) {
        let _ = write!(
            html,
            "<p class=\"facts\">{} of the pixels see the environment directly. Their errors are those \
             of smoothing it, and are given apart from those of lit surfaces.</p>",
            html::percent(1.0 - part.surface_share)
        );
    }
    let sentence = verdict::of_scene(report, scene, rules);
    if !sentence.is_empty() {
        let _ = write!(html, "<p class=\"verdict\">{sentence}</p>");
    }
    html += &picture_group(index, scene, pictures);
    html += &plots(report, scene);
    html += &tables::figures(report, &scene.name, rules);
    html + "</section>"
}

/// Links to the files of a picture, named for readers who only hear them.
fn links(picture: &Picture, caption: &str) -> String {
    let link = |path: &String| {
        format!(
            " <a href=\"{}\" aria-label=\"{caption}: EXR {}\">EXR</a>",
            escape(&path.replace('%', "%25").replace('#', "%23").replace('?', "%3F")),
            escape(path)
        )
    };
    picture.files.iter().map(link).collect()
}

/// Viewer, panes, error maps and crops.
fn picture_group(index: usize, scene: &SceneRecord, scene_pictures: &ScenePictures) -> String {
    let ScenePictures { pictures, scale, crops, .. } = scene_pictures;
    let aspect = format!("--aspect:{}/{}", scene.width, scene.height);
    let mut html = format!(
        "<div class=\"pictures\" style=\"{aspect}\" data-exposure=\"{:.4}\">",
        scene_pictures.exposure
    );
    let options = |chosen: usize| {
        let mut options = String::new();
        for (number, picture) in pictures.iter().enumerate() {
            let mut option = |is_error: bool, name: String| {
                let selected = if number == chosen && !is_error { " selected" } else { "" };
                let _ = write!(
                    options,
                    "<option value=\"{}\"{selected}>{name}</option>",
                    picture_class(index, number, is_error)
                );
            };
            option(false, picture_name(picture));
            if !picture.error.is_empty() {
                option(true, format!("{}: error", picture_name(picture)));
            }
        }
        options
    };
    for (number, picture) in pictures.iter().enumerate().filter(|(_, p)| !p.halves.is_empty()) {
        let _ = write!(
            html,
            "<script type=\"application/octet-stream\" class=\"halves\" data-picture=\"{}\" \
             data-width=\"{}\">{}</script>",
            picture_class(index, number, false),
            scene.width,
            picture.halves
        );
    }
    let _ = write!(
        html,
        "{}",
        include_str!("viewer.html")
            .replace("{{exposure}}", &format!("{:.2}", scene_pictures.exposure))
            .replace("{{scene}}", &escape(&scene.name))
            .replace("{{left}}", &options(pictures.len() - 1))
            .replace("{{right}}", &options(0))
    );
    let pane = |number: usize, is_error: bool, caption: &str| {
        let link = if is_error { String::new() } else { links(&pictures[number], caption) };
        format!(
            "<figure><div class=\"pane linked\"><div class=\"picture {}\" role=\"img\" \
             aria-label=\"{caption}\"></div></div><figcaption>{caption}{link}</figcaption></figure>",
            picture_class(index, number, is_error)
        )
    };
    html += "<div class=\"grid-of-panes\">";
    for (number, picture) in pictures.iter().enumerate() {
        html += &pane(number, false, &picture_name(picture));
    }
    html += "</div><h3>Errors</h3><p class=\"soft\">Error of every pixel: root of the mean over \
             RGB and the seeds of the squared error. One scale for the whole scene; its end is what \
             1% of the pixels on surfaces exceed.</p>";
    html += &ramp(*scale);
    html += "<div class=\"grid-of-panes\">";
    for (number, picture) in pictures.iter().enumerate().skip(1) {
        html += &pane(number, true, &picture_name(picture));
    }
    html += "</div><h3>Details</h3><div class=\"crops\">";
    let mut frames = String::new();
    for (crop, name) in crops.iter().zip(["A", "B", "C"]) {
        let _ = write!(
            frames,
            "<div class=\"frame\" style=\"--left:{:.2}%;--top:{:.2}%;--side:{:.2}%\">{name}</div>",
            100.0 * crop.left,
            100.0 * crop.top,
            100.0 * crop.size
        );
    }
    let _ = write!(
        html,
        "<figure><div class=\"pane\"><div class=\"picture {}\" role=\"img\" aria-label=\"where the \
         details lie\"></div>{frames}</div><figcaption>where samplers differ most on \
         surfaces</figcaption>\
         </figure>",
        picture_class(index, 0, false)
    );
    // Magnify the largest number of samples, or all pictures if no rule is by samples.
    let last = pictures
        .iter()
        .filter_map(|picture| picture.rule)
        .rfind(|rule| matches!(rule, Rule::Spp(_)));
    let is_magnified = |picture: &&(usize, &Picture)| {
        last.is_none() || picture.1.rule.is_none() || picture.1.rule == last
    };
    html += "</div>";
    for (crop, name) in crops.iter().zip(["A", "B", "C"]) {
        let _ = write!(
            html,
            "<div class=\"crop-row\" role=\"region\" tabindex=\"0\" aria-label=\"detail {name}\">"
        );
        for (number, picture) in pictures.iter().enumerate().filter(|item| is_magnified(&item)) {
            let caption = format!("{name}: {}", picture_name(picture));
            // Background positions are shares of the space left over.
            let position = |start: f64| 100.0 * start / (1.0 - crop.size).max(1e-6);
            let _ = write!(
                html,
                "<figure><div class=\"pane\"><div class=\"picture {}\" role=\"img\" \
                 aria-label=\"{caption}\" style=\"--size:{:.2}%;--px:{:.2}%;--py:{:.2}%\"></div>\
                 </div><figcaption>{caption}</figcaption></figure>",
                picture_class(index, number, false),
                100.0 / crop.size,
                position(crop.left),
                position(crop.top)
            );
        }
        html += "</div>";
    }
    html + "</div>"
}

/// Legend of the false colours.
fn ramp(scale: Scale) -> String {
    let colours: Vec<String> = (0..=RAMP_STEPS)
        .map(|step| {
            let share = f64::from(step) / f64::from(RAMP_STEPS);
            let [red, green, blue] = scale.colour(scale.low + share * (scale.high - scale.low));
            format!("rgb({red} {green} {blue})")
        })
        .collect();
    format!(
        "<div class=\"ramp\" role=\"img\" aria-label=\"blue {} to red {}\"><span>{}</span><span \
         class=\"bar\" style=\"background:linear-gradient(to right,{})\"></span><span>{}</span></div>",
        number(scale.low, 3),
        number(scale.high, 3),
        number(scale.low, 3),
        colours.join(","),
        number(scale.high, 3)
    )
}

/// Errors and efficiency against samples and against time.
fn plots(report: &Report, scene: &SceneRecord) -> String {
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

/// Abscissa of the plots.
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
            let y = (ordinate.value)(point)?;
            let x = (abscissa.value)(point);
            Some(plot::Point { x, y: y.middle, low: y.low, high: y.high, label: String::new() })
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
        plot::log_log(&title, abscissa.title, ordinate.name, &all, ordinate.slope)
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

/// Overhead against the share of blocked rays, and the tables.
fn overhead_section(report: &Report) -> String {
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

/// Definitions, and circumstances of the study.
fn end(report: &Report) -> String {
    let facts = &report.circumstances;
    let mut rows = String::new();
    let mut row = |what: &str, value: &str| {
        let _ = write!(rows, "<dt>{what}</dt><dd>{value}</dd>");
    };
    row("Machine", &escape(&facts.machine));
    row("Device and driver", &format!("{} ({})", escape(&facts.device), escape(&facts.driver)));
    row("Command", &format!("<code>{}</code>", escape(&facts.command)));
    row(
        "Version and date",
        &format!("Fenestra {}, {}", escape(&facts.version), escape(&facts.date)),
    );
    row(
        "Rays and depth",
        &format!(
            "{} shadow rays per path vertex, light gathered at {}",
            report.shadow_rays,
            if report.depth == 1 {
                "the first vertex (direct light)".to_owned()
            } else {
                format!("{} vertices", report.depth)
            }
        ),
    );
    row(
        "Seeds",
        &match report.seeds {
            1 => "1".to_owned(),
            seeds => format!("1 to {seeds}; pictures are of seed 1"),
        },
    );
    let samplers: Vec<String> = report
        .order
        .iter()
        .map(|label| {
            let parameters: Vec<String> = report
                .samplers
                .get(label)
                .into_iter()
                .flatten()
                .map(|(name, value)| {
                    format!("{} {}", escape(&name.replace('_', " ")), escape(value))
                })
                .collect();
            if parameters.is_empty() {
                escape(label)
            } else {
                format!("{} ({})", escape(label), parameters.join(", "))
            }
        })
        .collect();
    row("Samplers", &samplers.join(", "));
    format!(
        "<section id=\"definitions\"><h2>Definitions</h2>{}</section><section \
         id=\"circumstances\"><h2>Circumstances</h2><dl>{rows}</dl><p class=\"soft\">Every run is in \
         <a href=\"results.csv\">results.csv</a> and <a href=\"results.json\">results.json</a> beside \
         this page.</p></section>",
        include_str!("definitions.html").replace("{{judged_from}}", &number(JUDGED_FROM, 1))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_runs_from_blue_to_red() {
        let html = ramp(Scale { low: 0.0, high: 0.5 });
        assert!(html.contains("0.500") && html.matches("rgb(").count() == 17, "{html}");
    }

    #[test]
    fn templates_have_the_places_that_are_filled() {
        let page = include_str!("page.html");
        for place in ["title", "style", "script", "pictures", "body"] {
            assert!(page.contains(&format!("{{{{{place}}}}}")), "{place}");
        }
        // The page fetches nothing.
        for text in [page, include_str!("page.css"), include_str!("page.js")] {
            assert!(
                !text.contains("http:") && !text.contains("https:") && !text.contains("@import")
            );
        }
    }
}
