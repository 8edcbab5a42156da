//! Plots as inline SVG whose colours follow the page (classes `s0`, `s1`, … in `page.css`).

use super::html::{escape, number};
use crate::study::statistics::Interval;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 330.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 46.0;
/// Number of colours and markers of the page.
pub(crate) const STYLE_COUNT: usize = 8;

/// A point with its band or error bar.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    pub x: f64,
    pub y: Interval,
    /// Text at the point; empty for none.
    pub label: String,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Series {
    /// Index of colour and marker.
    pub style: usize,
    /// Name in the tooltip.
    pub name: String,
    /// Points in the order in which they are joined.
    pub points: Vec<Point>,
}

/// Axis: maps values to shares of its length.
struct Axis {
    low: f64,
    high: f64,
    is_logarithmic: bool,
    ticks: Vec<f64>,
}

impl Axis {
    /// Logarithmic, with ticks at 1, 2 and 5 of every decade, or only at 1 over three decades.
    fn logarithmic(values: impl Iterator<Item = f64>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        for value in values.filter(|value| *value > 0.0 && value.is_finite()) {
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (0.1, 1.0);
        }
        (low, high) = (low / 1.15, high * 1.15);
        let decades = (low.log10().floor() as i32)..=(high.log10().ceil() as i32);
        let steps: &[f64] = if (high / low).log10() > 3.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let ticks = decades
            .flat_map(|decade| steps.iter().map(move |step| step * 10.0_f64.powi(decade)))
            .filter(|tick| (low..=high).contains(tick))
            .collect();
        Self { low, high, is_logarithmic: true, ticks }
    }

    /// Linear over `low`…`high`, with ticks at round steps.
    fn linear(low: f64, high: f64) -> Self {
        let rough = (high - low) / 5.0;
        let decade = 10.0_f64.powf(rough.log10().floor());
        let factors = [1.0, 2.0, 5.0, 10.0];
        let factor = factors.into_iter().find(|factor| factor * decade >= rough).unwrap_or(10.0);
        let step = factor * decade;
        let count = ((high - low) / step).floor() as i32;
        let first = (low / step).ceil() as i32;
        let ticks = (first..=first + count)
            .map(|index| f64::from(index) * step)
            .filter(|tick| *tick <= high + 1e-9)
            .collect();
        Self { low, high, is_logarithmic: false, ticks }
    }

    fn share(&self, value: f64) -> f64 {
        if self.is_logarithmic {
            (value.max(self.low * 1e-3) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    fn label(&self, value: f64) -> String {
        if value == 0.0 {
            return "0".to_owned();
        }
        let magnitude = value.abs();
        let text = if !(1e-4..1e5).contains(&magnitude) {
            format!("{value:e}")
        } else {
            let decimals = if magnitude >= 1.0 { 0 } else { (-magnitude.log10()).ceil() as usize };
            format!("{value:.decimals$}")
        };
        text.replace('-', "−")
    }
}

struct Frame {
    x: Axis,
    y: Axis,
}

impl Frame {
    fn x(&self, value: f64) -> f64 {
        LEFT + self.x.share(value) * (WIDTH - LEFT - RIGHT)
    }

    fn y(&self, value: f64) -> f64 {
        let bottom = HEIGHT - BOTTOM;
        (bottom - self.y.share(value) * (bottom - TOP)).clamp(TOP, bottom)
    }

    /// Opening tag, grid, ticks and axis titles.
    fn start(&self, titles: [&str; 3]) -> String {
        let [title, x_title, y_title] = titles.map(escape);
        let mut svg = format!(
            "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" \
             aria-label=\"{title}\"><title>{title}</title>"
        );
        let bottom = HEIGHT - BOTTOM;
        for tick in &self.x.ticks {
            let x = self.x(*tick);
            svg += &format!(
                "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                bottom + 17.0,
                self.x.label(*tick)
            );
        }
        for tick in &self.y.ticks {
            let y = self.y(*tick);
            svg += &format!(
                "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                WIDTH - RIGHT,
                LEFT - 6.0,
                y + 4.0,
                self.y.label(*tick)
            );
        }
        svg += &format!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x_title}</text>\
             <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{y_title}</text>",
            0.5 * (LEFT + WIDTH - RIGHT),
            HEIGHT - 8.0,
            0.5 * (TOP + bottom)
        );
        svg
    }
}

/// Marker of a style, centred on the origin.
pub(crate) fn marker(style: usize) -> &'static str {
    match style % STYLE_COUNT {
        0 => "<circle r=\"4\"/>",
        1 => "<rect x=\"-3.6\" y=\"-3.6\" width=\"7.2\" height=\"7.2\"/>",
        2 => "<path d=\"M0-4.8 4.6 3.6H-4.6Z\"/>",
        3 => "<path d=\"M0-5 5 0 0 5-5 0Z\"/>",
        4 => "<path d=\"M0 4.8 4.6-3.6H-4.6Z\"/>",
        5 => "<path d=\"M-4.4-1.6h2.8v-2.8h3.2v2.8h2.8v3.2h-2.8v2.8h-3.2v-2.8h-2.8z\"/>",
        6 => "<rect x=\"-4.6\" y=\"-2.2\" width=\"9.2\" height=\"4.4\"/>",
        _ => "<rect x=\"-2.2\" y=\"-4.6\" width=\"4.4\" height=\"9.2\"/>",
    }
}

/// Marker at a point, with a tooltip.
fn mark(frame: &Frame, series: &Series, point: &Point) -> String {
    format!(
        "<g class=\"mark\" transform=\"translate({:.1} {:.1})\"><title>{}: {}, {}</title>{}</g>",
        frame.x(point.x),
        frame.y(point.y.middle),
        escape(&series.name),
        number(point.x, 3),
        number(point.y.middle, 3),
        marker(series.style)
    )
}

/// Draws lines with bands on two logarithmic axes, and a faint line of the given slope, at most 0. `titles`
/// are those of the plot, of the abscissa and of the ordinate.
pub(crate) fn log_log(titles: [&str; 3], series: &[Series], slope: f64) -> String {
    let all = || series.iter().flat_map(|series| &series.points);
    let frame = Frame {
        x: Axis::logarithmic(all().map(|point| point.x)),
        // Fit the ordinates to bands of at most a factor of 3, so that curves are not squashed.
        y: Axis::logarithmic(all().flat_map(|point| {
            let Interval { middle, low, high } = point.y;
            [middle, low.max(middle / 3.0), high.min(middle * 3.0)]
        })),
    };
    let mut svg = frame.start(titles);
    let [x0, x1] = [frame.x.low, frame.x.high];
    let middle = (frame.y.low * frame.y.high).sqrt() * (x0 * x1).powf(-0.5 * slope);
    // Clip the guide to the frame; a level one crosses all of it.
    let inside = |x: f64| {
        let [first, last] =
            [frame.y.high, frame.y.low].map(|y: f64| (y / middle).powf(1.0 / slope));
        if slope < 0.0 { x.clamp(first, last) } else { x }
    };
    let [x0, x1] = [inside(x0), inside(x1)];
    svg += &format!(
        "<line class=\"guide\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"><title>slope \
         {slope}</title></line>",
        frame.x(x0),
        frame.y(middle * x0.powf(slope)),
        frame.x(x1),
        frame.y(middle * x1.powf(slope))
    );
    for line in series {
        let place = |x: f64, y: f64| format!("{:.1},{:.1}", frame.x(x), frame.y(y));
        let upper = line.points.iter().map(|point| place(point.x, point.y.high));
        let lower = line.points.iter().rev().map(|point| place(point.x, point.y.low));
        let band: Vec<String> = upper.chain(lower).collect();
        let middle: Vec<String> = line.points.iter().map(|p| place(p.x, p.y.middle)).collect();
        svg += &format!(
            "<g class=\"s{}\"><polygon class=\"band\" points=\"{}\"/><polyline class=\"line\" \
             points=\"{}\"/>",
            line.style % STYLE_COUNT,
            band.join(" "),
            middle.join(" ")
        );
        svg.extend(line.points.iter().map(|point| mark(&frame, line, point)));
        svg += "</g>";
    }
    svg + "</svg>"
}

/// Draws points with error bars over 0…100% on linear axes; ordinates in percent. Ranges of ordinates are
/// bands over the whole width, each with its text.
pub(crate) fn scatter(titles: [&str; 3], series: &[Series], ranges: &[(&str, [f64; 2])]) -> String {
    let ordinates = series
        .iter()
        .flat_map(|series| &series.points)
        .flat_map(|Point { y, .. }| [y.low, y.middle, y.high])
        .chain(ranges.iter().flat_map(|(_, range)| *range));
    let (low, high) =
        ordinates.fold((0.0_f64, 5.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    let room = 0.06 * (high - low);
    let frame = Frame {
        x: Axis::linear(0.0, 100.0),
        y: Axis::linear(if low < 0.0 { low - room } else { 0.0 }, high + room),
    };
    let mut svg = frame.start(titles);
    for (label, range) in ranges {
        let [bottom, top] = range.map(|ordinate| frame.y(ordinate));
        svg += &format!(
            "<rect class=\"range\" x=\"{LEFT}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>\
             <text class=\"small\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            top - 1.0,
            WIDTH - LEFT - RIGHT,
            bottom - top + 2.0,
            LEFT + 6.0,
            if top - 5.0 > TOP + 8.0 { top - 5.0 } else { bottom + 14.0 },
            escape(label)
        );
    }
    for dots in series {
        svg += &format!("<g class=\"s{}\">", dots.style % STYLE_COUNT);
        for point in &dots.points {
            let x = frame.x(point.x);
            svg += &format!(
                "<line class=\"bar\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{:.1}\"/>{}",
                frame.y(point.y.low),
                frame.y(point.y.high),
                mark(&frame, dots, point)
            );
        }
        svg += "</g>";
    }
    svg + &labels(&frame, series) + "</svg>"
}

/// Labels the points of a scatter plot: points on the left beside them; those on the right, where
/// scenes crowd, in an evenly spaced column to their left, with a line to each point.
fn labels(frame: &Frame, series: &[Series]) -> String {
    const CROWDED_FROM: f64 = 60.0;
    const SPACING: f64 = 15.0;
    let labelled = series.iter().flat_map(|series| &series.points).filter(|p| !p.label.is_empty());
    let (mut crowded, free): (Vec<&Point>, Vec<&Point>) =
        labelled.partition(|point| point.x > CROWDED_FROM);
    let mut svg = String::new();
    for point in free {
        svg += &format!(
            "<text class=\"small\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            frame.x(point.x) + 9.0,
            frame.y(point.y.middle) + 4.0,
            escape(&point.label)
        );
    }
    let height_of = |point: &&Point| frame.y(point.y.middle);
    crowded.sort_by(|a, b| height_of(a).total_cmp(&height_of(b)));
    let column = crowded.iter().map(|point| frame.x(point.x)).fold(WIDTH, f64::min) - 26.0;
    // Centre the block on the points, but inside the frame.
    let count = crowded.len() as f64;
    let centre = crowded.iter().map(height_of).sum::<f64>() / count.max(1.0);
    let height = SPACING * (count - 1.0).max(0.0);
    let lowest = (HEIGHT - BOTTOM - 6.0 - height).max(TOP + 6.0);
    let start = (centre - 0.5 * height).clamp(TOP + 6.0, lowest);
    for (index, point) in crowded.iter().enumerate() {
        let y = start + SPACING * index as f64;
        svg += &format!(
            "<line class=\"leader\" x1=\"{:.1}\" y1=\"{y:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/><text \
             class=\"small\" x=\"{column:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            column + 3.0,
            frame.x(point.x),
            height_of(point),
            y + 4.0,
            escape(&point.label)
        );
    }
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64) -> Point {
        let y = Interval { middle: y, low: 0.8 * y, high: 1.2 * y };
        Point { x, y, label: "room".into() }
    }

    fn attribute(svg: &str, name: &str) -> Vec<f64> {
        svg.split(&format!(" {name}=\""))
            .skip(1)
            .filter_map(|rest| rest.split('"').next()?.parse().ok())
            .collect()
    }

    #[test]
    fn everything_lies_inside_the_drawing() {
        let points: Vec<Point> =
            (0..8).map(|i| point(f64::from(1 << i), 1.0 / f64::from(1 << i).sqrt())).collect();
        let series = [Series { style: 0, name: "mis".into(), points }];
        let svg = log_log(["t", "samples", "RMSE"], &series, -0.5);
        for name in ["x1", "x2", "x"] {
            assert!(attribute(&svg, name).iter().all(|x| (0.0..=WIDTH).contains(x)), "{name}");
        }
        for name in ["y1", "y2", "y"] {
            assert!(attribute(&svg, name).iter().all(|y| (0.0..=HEIGHT).contains(y)), "{name}");
        }
        assert_eq!(svg.matches("class=\"mark\"").count(), 8);
        assert!(!svg.contains("NaN"));
    }

    #[test]
    fn a_plot_of_nothing_is_empty_but_whole() {
        for svg in [
            log_log(["t", "x", "y"], &[], -1.0),
            log_log(["t", "x", "y"], &[], 0.0),
            scatter(["t", "x", "y"], &[], &[]),
        ] {
            assert!(svg.ends_with("</svg>") && !svg.contains("NaN") && !svg.contains("inf"));
        }
    }

    #[test]
    fn ticks_are_round_numbers() {
        let axis = Axis::logarithmic([1.0, 64.0].into_iter());
        assert_eq!(axis.ticks, [1.0, 2.0, 5.0, 10.0, 20.0, 50.0]);
        assert_eq!(Axis::linear(0.0, 100.0).ticks, [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]);
        assert_eq!(axis.label(0.02), "0.02");
        assert_eq!(axis.label(2e-5), "2e−5");
        let steep = Axis::logarithmic([1.0, 1e6].into_iter());
        assert!(steep.ticks.len() <= 8, "{:?}", steep.ticks);
    }

    #[test]
    fn overheads_have_bars_and_published_ranges() {
        let series = [Series { style: 1, name: "v".into(), points: vec![point(80.0, 40.0)] }];
        let svg = scatter(["t", "x", "y"], &series, &[("thesis <closed>", [40.0, 50.0])]);
        assert!(svg.contains("class=\"range\"") && svg.contains("class=\"bar\""));
        assert!(svg.contains("thesis &lt;closed&gt;"));
        // Ten of the 53 percent that the drawing shows, and a pixel about them.
        let expected = (HEIGHT - BOTTOM - TOP) * 10.0 / 53.0 + 2.0;
        let heights = attribute(&svg, "height");
        assert!(heights.iter().any(|height| (height - expected).abs() < 0.1), "{heights:?}");
    }

    #[test]
    fn crowded_labels_are_apart() {
        let points =
            vec![point(97.0, 40.0), point(97.5, 40.5), point(98.0, 41.0), point(20.0, 1.0)];
        let series = [Series { style: 1, name: "v".into(), points }];
        let svg = scatter(["t", "x", "y"], &series, &[]);
        let mut heights: Vec<f64> = svg
            .split("<text ")
            .filter(|text| text.contains(">room<"))
            .flat_map(|text| attribute(&format!(" {text}"), "y"))
            .collect();
        heights.sort_by(f64::total_cmp);
        assert_eq!(heights.len(), 4);
        assert!(heights.windows(2).all(|pair| pair[1] - pair[0] > 12.0), "{heights:?}");
    }
}
