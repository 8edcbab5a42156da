//! Pictures of a scene on the page: viewer, panes, error maps, magnified details.

use super::{
    html::{escape, number},
    pictures::{Picture, ScenePictures},
};
use crate::study::{falsecolour::Scale, plan::Rule, runs::StudiedScene};

const RAMP_STEPS: u32 = 16;

/// Name of a picture's class in the style sheet.
fn picture_class(scene: usize, picture: usize, is_error: bool) -> String {
    format!("{}{scene}-{picture}", if is_error { "e" } else { "p" })
}

/// Style sheet rules of a picture and its error map: they hold the images.
pub(crate) fn picture_style(scene: usize, number: usize, picture: &Picture) -> String {
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
pub(crate) fn picture_group(
    index: usize,
    scene: &StudiedScene,
    scene_pictures: &ScenePictures,
) -> String {
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
                options += &format!(
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
        html += &format!(
            "<script type=\"application/octet-stream\" class=\"halves\" data-picture=\"{}\" \
             data-width=\"{}\">{}</script>",
            picture_class(index, number, false),
            scene.width,
            picture.halves
        );
    }
    html += &include_str!("viewer.html")
        .replace("{{exposure}}", &format!("{:.2}", scene_pictures.exposure))
        .replace("{{scene}}", &escape(&scene.name))
        .replace("{{left}}", &options(pictures.len() - 1))
        .replace("{{right}}", &options(0));
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
        frames += &format!(
            "<div class=\"frame\" style=\"--left:{:.2}%;--top:{:.2}%;--side:{:.2}%\">{name}</div>",
            100.0 * crop.left,
            100.0 * crop.top,
            100.0 * crop.size
        );
    }
    html += &format!(
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
        html += &format!(
            "<div class=\"crop-row\" role=\"region\" tabindex=\"0\" aria-label=\"detail {name}\">"
        );
        for (number, picture) in pictures.iter().enumerate().filter(|item| is_magnified(&item)) {
            let caption = format!("{name}: {}", picture_name(picture));
            // Background positions are shares of the space left over.
            let position = |start: f64| 100.0 * start / (1.0 - crop.size).max(1e-6);
            html += &format!(
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_runs_from_blue_to_red() {
        let html = ramp(Scale { low: 0.0, high: 0.5 });
        assert!(html.contains("0.500") && html.matches("rgb(").count() == 17, "{html}");
    }
}
