//! False-colour pictures of scalar maps: blue low, red high, with a legend.
//!
//! Colours are Google's Turbo map ([`colorous::TURBO`]), from dark blue through green to dark red.

use std::path::Path;

use super::statistics::percentile;
use crate::{error::Result, film::picture::write_png};

/// Values at the two ends of the colour map; values outside take the colour of the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Value shown blue.
    pub low: f64,
    /// Value shown red.
    pub high: f64,
}

impl Scale {
    /// Spans 0 to the 99th percentile of `values`, so that a few outliers do not turn the rest
    /// blue; 0 to 1 if that is not positive.
    pub(crate) fn of(values: &[f64]) -> Self {
        let finite = values.iter().copied().filter(|value| value.is_finite()).collect();
        let high = percentile(finite, 99).filter(|high| *high > 0.0).unwrap_or(1.0);
        Self { low: 0.0, high }
    }

    /// Returns the display colour of a value; NaN is magenta, which the map does not contain.
    pub(crate) fn colour(&self, value: f64) -> [u8; 3] {
        if value.is_nan() {
            return [255, 0, 255];
        }
        let position = ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0);
        colorous::TURBO.eval_continuous(position).into_array()
    }
}

/// A display picture: sRGB bytes, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Canvas {
    pub width: usize,
    pub height: usize,
    /// Row by row from the top.
    pub pixels: Vec<[u8; 3]>,
}

const WHITE: [u8; 3] = [255; 3];
const BLACK: [u8; 3] = [0; 3];
/// Height of the legend: margin, bar, ticks, digits, margin.
const LEGEND_HEIGHT: usize = 34;
const MARGIN: usize = 4;
const BAR_HEIGHT: usize = 10;
const TICK_HEIGHT: usize = 3;
/// Numbers under the bar: at its ends and in the middle.
const TICK_COUNT: usize = 3;
/// Least width of a picture: that of the legend's three numbers.
const LEAST_WIDTH: usize = 168;
/// Side of a digit's pixels in pixels of the picture.
const DIGIT_SCALE: usize = 2;
/// Columns of a digit and the gap to the next.
const DIGIT_ADVANCE: usize = 4 * DIGIT_SCALE;

/// Returns the rows of a 3×5 glyph from the top; bit 2 is the left column.
fn glyph(character: char) -> [u8; 5] {
    match character {
        '0' => [7, 5, 5, 5, 7],
        '1' => [2, 6, 2, 2, 7],
        '2' => [7, 1, 7, 4, 7],
        '3' => [7, 1, 7, 1, 7],
        '4' => [5, 5, 7, 1, 1],
        '5' => [7, 4, 7, 1, 7],
        '6' => [7, 4, 7, 5, 7],
        '7' => [7, 1, 2, 2, 2],
        '8' => [7, 5, 7, 5, 7],
        '9' => [7, 5, 7, 1, 7],
        'e' => [0, 7, 7, 4, 7],
        '-' => [0, 0, 7, 0, 0],
        '.' => [0, 0, 0, 0, 2],
        _ => [0; 5],
    }
}

impl Canvas {
    fn filled(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    fn fill(&mut self, left: usize, top: usize, width: usize, height: usize, colour: [u8; 3]) {
        for y in top..(top + height).min(self.height) {
            for x in left..(left + width).min(self.width) {
                self.pixels[y * self.width + x] = colour;
            }
        }
    }

    fn draw_text(&mut self, text: &str, left: usize, top: usize) {
        for (index, character) in text.chars().enumerate() {
            let rows = glyph(character);
            for (row, bits) in rows.into_iter().enumerate() {
                for column in (0..3).filter(|column| bits & (4 >> column) != 0) {
                    let x = left + index * DIGIT_ADVANCE + column * DIGIT_SCALE;
                    self.fill(x, top + row * DIGIT_SCALE, DIGIT_SCALE, DIGIT_SCALE, BLACK);
                }
            }
        }
    }

    pub(crate) fn write_png(&self, path: &Path) -> Result<()> {
        write_png(path, self.width as u32, &self.pixels)
    }
}

/// Draws `values` in false colour above a legend with numbers at both ends and in the middle. A map
/// narrower than the legend is centred on white. Panics if `values` is not a whole number of rows of `width`.
pub(crate) fn picture(values: &[f64], width: usize, scale: Scale) -> Canvas {
    assert!(width > 0 && values.len().is_multiple_of(width), "whole rows of {width} values");
    let height = values.len() / width;
    let canvas_width = width.max(LEAST_WIDTH);
    let mut canvas = Canvas::filled(canvas_width, height + LEGEND_HEIGHT, WHITE);
    let left = (canvas_width - width) / 2;
    for (index, &value) in values.iter().enumerate() {
        let (x, y) = (left + index % width, index / width);
        canvas.pixels[y * canvas_width + x] = scale.colour(value);
    }
    let bar_top = height + MARGIN;
    let bar_width = canvas_width - 2 * MARGIN;
    let share = |column: usize| column as f64 / (bar_width - 1) as f64;
    for column in 0..bar_width {
        let value = scale.low + share(column) * (scale.high - scale.low);
        canvas.fill(MARGIN + column, bar_top, 1, BAR_HEIGHT, scale.colour(value));
    }
    for tick in 0..TICK_COUNT {
        let column = tick * (bar_width - 1) / (TICK_COUNT - 1);
        canvas.fill(MARGIN + column, bar_top + BAR_HEIGHT, 1, TICK_HEIGHT, BLACK);
        let text = number(scale.low + share(column) * (scale.high - scale.low));
        let text_width = text.len() * DIGIT_ADVANCE;
        let centred = (MARGIN + column).saturating_sub(text_width / 2);
        let text_left = centred.clamp(MARGIN, canvas_width - MARGIN - text_width);
        canvas.draw_text(&text, text_left, bar_top + BAR_HEIGHT + TICK_HEIGHT + 2);
    }
    canvas
}

/// Formats a number in few characters: "0", "0.250", "12.50", "3.0e-5".
fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if (0.01..10_000.0).contains(&magnitude) {
        let decimals = match magnitude {
            0.0..0.1 => 4,
            0.1..1.0 => 3,
            1.0..100.0 => 2,
            _ => 0,
        };
        format!("{value:.decimals$}")
    } else {
        format!("{value:.1e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn low_is_blue_and_high_is_red() {
        let scale = Scale { low: 0.0, high: 2.0 };
        let [red, _, blue] = scale.colour(0.2);
        assert!(blue > red, "low is blue");
        let [red, _, blue] = scale.colour(1.8);
        assert!(red > blue, "high is red");
        assert_eq!(scale.colour(9.0), scale.colour(2.0));
        assert_eq!(scale.colour(-1.0), scale.colour(0.0));
        assert_eq!(scale.colour(f64::INFINITY), scale.colour(2.0));
        assert_eq!(scale.colour(f64::NAN), [255, 0, 255]);
    }

    #[test]
    fn scale_ends_where_99_percent_lie_below() {
        let values: Vec<f64> = (1..=200).map(f64::from).collect();
        assert_eq!(Scale::of(&values), Scale { low: 0.0, high: 198.0 });
        assert_eq!(Scale::of(&[3.0, f64::INFINITY]), Scale { low: 0.0, high: 3.0 });
        assert_eq!(Scale::of(&[0.0; 4]), Scale { low: 0.0, high: 1.0 });
        assert_eq!(Scale::of(&[]), Scale { low: 0.0, high: 1.0 });
    }

    #[test]
    fn map_stands_above_a_legend_from_low_to_high() {
        let scale = Scale { low: 0.0, high: 1.0 };
        let values: Vec<f64> = (0..400).map(|index| f64::from(index % 200) / 199.0).collect();
        let canvas = picture(&values, 200, scale);
        assert_eq!((canvas.width, canvas.height), (200, 2 + LEGEND_HEIGHT));
        assert_eq!(canvas.pixels[0], scale.colour(0.0));
        assert_eq!(canvas.pixels[2 * 200 - 1], scale.colour(1.0));
        let bar = (2 + MARGIN) * 200;
        assert_eq!(canvas.pixels[bar + MARGIN], scale.colour(0.0));
        assert_eq!(canvas.pixels[bar + 199 - MARGIN], scale.colour(1.0));
        assert!(canvas.pixels.contains(&BLACK), "digits are drawn");
    }

    #[test]
    fn small_maps_are_centred_over_the_legend() {
        let canvas = picture(&[1.0; 4], 2, Scale { low: 0.0, high: 1.0 });
        assert_eq!(canvas.width, LEAST_WIDTH);
        assert_eq!(canvas.pixels[0], WHITE);
        assert_ne!(canvas.pixels[LEAST_WIDTH / 2 - 1], WHITE);
    }

    #[test]
    fn numbers_are_short() {
        for (value, expected) in [
            (0.0, "0"),
            (0.25, "0.250"),
            (0.05, "0.0500"),
            (12.5, "12.50"),
            (1234.5, "1234"),
            (3e-5, "3.0e-5"),
            (2.5e8, "2.5e8"),
        ] {
            assert_eq!(number(value), expected);
        }
        assert!(number(-1e-300).len() * DIGIT_ADVANCE < LEAST_WIDTH / 2);
    }
}
