//! Text of attributes → numbers.

use super::document::Node;
use crate::error::Result;

/// Text of the attribute `value`.
pub(super) fn value(node: Node<'_>) -> Result<&str> {
    node.attribute("value")
        .ok_or_else(|| node.error(format!("`{}`: expected the attribute `value`", node.tag())))
}

/// Finite number in single precision.
pub(super) fn float(node: Node<'_>) -> Result<f32> {
    number(node, value(node)?).map(|number| number as f32)
}

/// Finite number of an attribute or of a part of one.
pub(super) fn number(node: Node<'_>, text: &str) -> Result<f64> {
    let text = text.trim();
    let parsed: Option<f64> = text.parse().ok();
    parsed.filter(|number| (*number as f32).is_finite()).ok_or_else(|| {
        node.error(format!("`{}`: expected a finite number, found `{text}`", node.name()))
    })
}

/// Numbers with commas or spaces between them.
pub(super) fn numbers(node: Node<'_>, text: &str) -> Result<Vec<f64>> {
    let words = text.split(|c: char| c == ',' || c.is_whitespace());
    words.filter(|word| !word.is_empty()).map(|word| number(node, word)).collect()
}
