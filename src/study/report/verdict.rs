//! A sentence for every scene: who has less error than the first sampler, by how much, how sure.

use super::{
    html::{escape, number},
    tables::find,
};
use crate::study::{
    plan::Rule, reference_check::Verdict, results::Report, runs::StudiedScene,
    statistics::Interval, summary::Summary,
};

pub(super) fn all(report: &Report) -> String {
    let items: String = report
        .scenes
        .iter()
        .map(|scene| (scene, of_scene(report, scene)))
        .filter(|(_, sentence)| !sentence.is_empty())
        .map(|(scene, sentence)| format!("<li><b>{}</b>: {sentence}</li>", escape(&scene.name)))
        .collect();
    if items.is_empty() {
        return items;
    }
    format!(
        "<ul class=\"verdicts\">{items}</ul><p class=\"soft\">Errors in these sentences are trimmed \
         relMSE on lit surfaces; in brackets the 95% interval over the seeds.</p>"
    )
}

/// The verdict of one scene, at equal time if the study has that, else at its most samples; empty
/// if there is nothing to compare.
pub(crate) fn of_scene(report: &Report, scene: &StudiedScene) -> String {
    let ([first, others @ ..], Some(rule)) = (&report.order[..], report.rules.last()) else {
        return String::new();
    };
    let found: Vec<&Summary> =
        others.iter().filter_map(|name| find(report, &scene.name, name, *rule)).collect();
    if found.is_empty() {
        return String::new();
    }
    if scene.reference_check.as_ref().is_some_and(|check| check.verdict == Verdict::Disagrees) {
        return "No verdict: the reference is in doubt.".to_owned();
    }
    let at = match rule {
        Rule::Spp(spp) => format!("At {spp} samples"),
        Rule::Seconds(_) => "At equal time".to_owned(),
    };
    let judged = found.iter().filter_map(|summary| Some((summary, summary.surfaces_ratio?)));
    let best = judged.min_by(|a, b| a.1.middle.total_cmp(&b.1.middle));
    let Some((summary, ratio)) = best else {
        return format!(
            "{at} nothing can be judged: the errors of {} or of the others are not well above the \
             reference's own.",
            escape(first)
        );
    };
    let excluded = found.iter().filter(|summary| summary.surfaces_ratio.is_none()).count();
    let mut text = format!(
        "{at} {}",
        compared(&escape(&summary.sampler), &escape(first), &ratio, summary.runs)
    );
    if excluded > 0 {
        text += &format!(" Not judged: {excluded} of {} samplers.", found.len());
    }
    if summary.is_suspicious() {
        text += " Its mean is further off than noise explains.";
    }
    text
}

/// "guided has 8.7 times less error than mis (7.8 to 9.6)."
fn compared(name: &str, first: &str, ratio: &Interval, runs: usize) -> String {
    let bounds = |low: f64, high: f64| match runs {
        1 => " (one seed, so no bounds)".to_owned(),
        _ => format!(" ({} to {})", number(low, 2), number(high, 2)),
    };
    let Interval { middle, low, high } = *ratio;
    if high < 1.0 {
        let inverse = bounds(1.0 / high, 1.0 / low);
        format!("{name} has {} times less error than {first}{inverse}.", number(1.0 / middle, 2))
    } else if low > 1.0 {
        format!(
            "no sampler has less error than {first}; {name} has {} times as much{}.",
            number(middle, 2),
            bounds(low, high)
        )
    } else {
        format!(
            "{name} and {first} cannot be told apart: {name} has {} times the error{}.",
            number(middle, 2),
            bounds(low, high)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_say_who_and_how_sure() {
        let say = |middle, low, high, runs| {
            compared("guided", "mis", &Interval { middle, low, high }, runs)
        };
        assert_eq!(
            say(1.0 / 8.7, 1.0 / 9.6, 1.0 / 7.8, 3),
            "guided has 8.7 times less error than mis (7.8 to 9.6)."
        );
        assert!(
            say(2.0, 1.5, 3.0, 3).starts_with("no sampler has less error than mis; guided has")
        );
        assert!(say(0.9, 0.7, 1.2, 3).contains("cannot be told apart"));
        assert!(say(0.5, 0.5, 0.5, 1).contains("one seed, so no bounds"));
    }
}
