//! HTML building blocks: escaped text, readable numbers, tables.

use crate::study::statistics::Interval;

/// Escapes the special characters of HTML, for content and attributes.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
        // Two of them mark the placeholders of the templates.
        .replace('{', "&#123;")
}

/// Formats a number with `digits` significant digits: 0.0213, 14.5, 2.1e−5.
pub fn number(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".to_owned() } else { "–".to_owned() };
    }
    let rounded = format!("{value:.*e}", digits.saturating_sub(1));
    let exponent: i32 =
        rounded.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
    if (-4..6).contains(&exponent) {
        let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
        format!("{value:.decimals$}").replace('-', "−")
    } else {
        rounded.replace('-', "−")
    }
}

/// Formats an interval: "0.54 (0.50–0.58)".
pub fn interval(interval: &Interval, digits: usize) -> String {
    let [middle, low, high] =
        [interval.middle, interval.low, interval.high].map(|value| number(value, digits));
    if low == high {
        return middle;
    }
    format!("{middle} <span class=\"interval\">({low}–{high})</span>")
}

/// Formats a ratio of times as a percentage more or less: "+12.3% (+11.9 to +12.8)".
pub(crate) fn percent_more(ratio: &Interval) -> String {
    percent_added(&ratio.map(|ratio| ratio - 1.0))
}

/// Formats an added share as a percentage, as [`percent_more`] does.
pub(crate) fn percent_added(share: &Interval) -> String {
    let percent = |value: f64| format!("{:+.1}", 100.0 * value).replace('-', "−");
    let [middle, low, high] = [share.middle, share.low, share.high].map(percent);
    format!("{middle}% <span class=\"interval\">({low} to {high})</span>")
}

/// Formats a number of samples, whole or a mean.
pub fn count(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value:.0}") } else { format!("{value:.1}") }
}

pub(crate) fn percent(share: f64) -> String {
    format!("{}%", number(100.0 * share, 3))
}

/// A table: escaped caption, row headings in the first column, cells in HTML.
pub struct Table {
    caption: String,
    head: Vec<String>,
    rows: Vec<(bool, Vec<String>)>,
}

impl Table {
    pub(crate) fn new(caption: String, head: &[&str]) -> Self {
        let head = head.iter().map(|text| (*text).to_owned()).collect();
        Self { caption, head, rows: Vec::new() }
    }

    /// Adds columns with these texts as heads.
    pub(crate) fn columns<'a>(&mut self, heads: impl IntoIterator<Item = &'a String>) {
        self.head.extend(heads.into_iter().map(|text| escape(text)));
    }

    /// Adds a row; `starts_group` draws a line above it.
    pub(crate) fn row(&mut self, starts_group: bool, cells: Vec<String>) {
        self.rows.push((starts_group, cells));
    }

    /// Adds rows under one heading, which stands before the first of them, below a line.
    pub(crate) fn group(&mut self, heading: &str, rows: impl IntoIterator<Item = Vec<String>>) {
        for (index, mut cells) in rows.into_iter().enumerate() {
            cells.insert(0, if index == 0 { escape(heading) } else { String::new() });
            self.row(index == 0, cells);
        }
    }

    /// Renders the table in a frame that scrolls sideways if it is too wide for the page; nothing
    /// without rows.
    pub(crate) fn html(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let mut html = format!(
            "<p class=\"caption\">{0}</p><div class=\"table\" role=\"region\" tabindex=\"0\" \
             aria-label=\"{0}\"><table><thead><tr>",
            self.caption
        );
        for cell in &self.head {
            html += &format!("<th scope=\"col\">{cell}</th>");
        }
        html += "</tr></thead><tbody>";
        for (starts_group, cells) in &self.rows {
            html += if *starts_group { "<tr class=\"group\">" } else { "<tr>" };
            if let [heading, cells @ ..] = &cells[..] {
                html += &format!("<th scope=\"row\">{heading}</th>");
                html.extend(cells.iter().map(|cell| format!("<td>{cell}</td>")));
            }
            html += "</tr>";
        }
        html + "</tbody></table></div>"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escape("<a b=\"c\">'&{"), "&lt;a b=&quot;c&quot;&gt;&#39;&amp;&#123;");
    }

    #[test]
    fn numbers_have_their_digits() {
        for (value, expected) in [
            (0.0, "0"),
            (0.021345, "0.0213"),
            (14.55, "14.6"),
            (999.96, "1000"),
            (12345.0, "12345"),
            (-0.5, "−0.500"),
            (2.13e-5, "2.13e−5"),
            (1.5e9, "1.50e9"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(number(value, 3), expected);
        }
    }

    #[test]
    fn intervals_show_both_ends() {
        let spread = Interval { middle: 0.5, low: 0.25, high: 1.0 };
        let text = interval(&spread, 2);
        assert!(text.starts_with("0.50 ") && text.contains("(0.25–1.0)"), "{text}");
        assert_eq!(interval(&Interval { middle: 2.0, low: 2.0, high: 2.0 }, 2), "2.0");
        let more = percent_more(&Interval { middle: 1.123, low: 0.98, high: 1.2 });
        assert!(more.starts_with("+12.3%") && more.contains("(−2.0 to +20.0)"), "{more}");
    }

    #[test]
    fn tables_have_headings_for_columns_and_rows() {
        let mut table = Table::new("Errors".into(), &["sampler"]);
        assert_eq!(table.html(), "");
        table.columns([&"RMSE".to_owned()]);
        table.row(true, vec!["mis".into(), "0.1".into()]);
        let html = table.html();
        assert!(html.contains("<th scope=\"col\">RMSE</th>"), "{html}");
        assert!(html.contains("<tr class=\"group\"><th scope=\"row\">mis</th><td>0.1</td></tr>"));
    }
}
