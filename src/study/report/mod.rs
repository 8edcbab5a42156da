//! The page of a study, `index.html`: one file that needs no network.
//!
//! Text, tables and plots work without JavaScript; `page.js` adds the viewer (two overlaid pictures, one zoom
//! and pan for all pictures of a scene). Colours follow the reader's choice of light or dark (`page.css`).

mod curves;
mod html;
mod pictures;
mod plot;
mod tables;
mod verdict;
mod viewer;

use super::{
    folder::Folder,
    plan::{JUDGED_FROM, Rule},
    reference_check::Verdict,
    results::Report,
    runs::StudiedScene,
};
use crate::{error::Result, files::write_text};
use html::{escape, number};
use pictures::ScenePictures;

/// Largest number of samplers that show pictures of every rule; more show only those of the largest
/// number of samples and of the time.
const FEW_SAMPLERS: usize = 3;

/// Writes `results.json`, `results.csv` and `index.html`. Fails if a picture cannot be read, or a file cannot
/// be written.
pub fn write(report: &Report, folder: &Folder) -> Result<()> {
    report.write(folder)?;
    let is_by_samples = |rule: &&Rule| matches!(rule, Rule::Spp(_));
    let most_samples = report.rules.iter().rfind(is_by_samples);
    let is_shown = |rule: &&Rule| {
        report.order.len() <= FEW_SAMPLERS || !is_by_samples(rule) || Some(*rule) == most_samples
    };
    let shown: Vec<Rule> = report.rules.iter().filter(is_shown).copied().collect();
    let mut body = start(report);
    let mut style = String::new();
    if !report.summaries.is_empty() {
        let verdicts = verdict::all(report);
        let glance = verdicts + &tables::at_a_glance(report);
        body += &format!("<section id=\"glance\"><h2>At a glance</h2>{glance}</section>");
        body += &section("quality", "Time to quality", "", &tables::times_to_quality(report));
        let about = include_str!("published.html");
        let published = tables::published(report);
        body += &section("published", "Beside the published figures", about, &published);
        for (index, scene) in report.scenes.iter().enumerate() {
            let own = report.summaries.iter().any(|summary| summary.scene == scene.name);
            if scene.reference.is_some() && own {
                let pictures = pictures::load(folder, report, scene, &shown)?;
                for (number, picture) in pictures.pictures.iter().enumerate() {
                    style += &viewer::picture_style(index, number, picture);
                }
                body += &scene_section(report, index, scene, &pictures);
            }
        }
    }
    body += &curves::overhead_section(report);
    body += &end(report);
    let page = include_str!("page.html")
        .replace("{{title}}", &escape(&report.title))
        .replace("{{style}}", include_str!("page.css"))
        .replace("{{script}}", include_str!("page.js"))
        .replace("{{pictures}}", &style)
        .replace("{{body}}", &body);
    write_text(&folder.path.join("index.html"), &page)
}

/// A section under a heading, opened by `about`; nothing without tables.
fn section(id: &str, heading: &str, about: &str, tables: &str) -> String {
    if tables.is_empty() {
        return String::new();
    }
    format!("<section id=\"{id}\"><h2>{heading}</h2>{about}{tables}</section>")
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
            html += &format!(
                "<p class=\"warning\"><strong class=\"warn\">The reference of {} is in \
                 doubt.</strong> An independent picture disagrees with it.</p>",
                escape(&scene.name)
            );
        }
    }
    for note in &report.notes {
        html += &format!("<p>{}</p>", escape(note));
    }
    html += "<nav aria-label=\"Sections\"><ul>";
    let mut link = |id: &str, text: &str| {
        html += &format!("<li><a href=\"#{id}\">{}</a></li>", escape(text));
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

fn scene_section(
    report: &Report,
    index: usize,
    scene: &StudiedScene,
    pictures: &ScenePictures,
) -> String {
    let mut html = format!(
        "<section id=\"scene-{index}\"><h2>{}</h2><p class=\"facts\">{}×{} pixels, {} triangles. ",
        escape(&scene.name),
        scene.width,
        scene.height,
        scene.triangles
    );
    if let Some(reference) = &scene.reference {
        html += &format!("Reference: {}", escape(&reference.description));
        let took = |seconds| format!(", it took {} s", number(seconds, 3));
        html += &match reference.mse {
            Some(mse) => format!(
                "; its own RMSE is {}{}.</p>",
                number(mse.max(0.0).sqrt(), 3),
                reference.seconds.map_or_else(String::new, took)
            ),
            None => "; how noisy it is itself is not known, and its noise is part of every error \
                     here.</p>"
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
        html += &format!(
            "<p class=\"warning\">Figures that are not judged, because the error is not well above the \
             reference's own: {refused}. A longer reference (<code>--reference-spp</code>) \
             helps.</p>"
        );
    }
    if let Some(part) = scene.parts.filter(|part| part.surface_share < 1.0) {
        html += &format!(
            "<p class=\"facts\">{} of the pixels see the environment directly. Their errors are those \
             of smoothing it, and are given apart from those of lit surfaces.</p>",
            html::percent(1.0 - part.surface_share)
        );
    }
    let sentence = verdict::of_scene(report, scene);
    if !sentence.is_empty() {
        html += &format!("<p class=\"verdict\">{sentence}</p>");
    }
    html += &viewer::picture_group(index, scene, pictures);
    html += &curves::plots(report, scene);
    html += &tables::figures(report, &scene.name);
    html + "</section>"
}

/// Definitions, and circumstances of the study.
fn end(report: &Report) -> String {
    let facts = &report.circumstances;
    let mut rows = String::new();
    let mut row = |what: &str, value: &str| {
        rows += &format!("<dt>{what}</dt><dd>{value}</dd>");
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
            report.shadow_rays.map_or("each sampler's own".to_owned(), |rays| rays.to_string()),
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
    let describe = |label: &String| {
        let assign = |(name, value): (&String, &String)| {
            format!("{} {}", escape(&name.replace('_', " ")), escape(value))
        };
        let parameters = report.samplers.get(label).into_iter().flatten().map(assign);
        match &parameters.collect::<Vec<_>>()[..] {
            [] => escape(label),
            parameters => format!("{} ({})", escape(label), parameters.join(", ")),
        }
    };
    row("Samplers", &report.order.iter().map(describe).collect::<Vec<_>>().join(", "));
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
