//! Text of an XML file before and beside its elements: lines, nesting, names.

use std::path::Path;

use crate::error::{Error, Result};

/// Starts of the lines of a text.
pub(super) struct Lines(Vec<usize>);

impl Lines {
    pub(super) fn new(text: &str) -> Self {
        Self(text.match_indices('\n').map(|(at, _)| at + 1).collect())
    }

    /// Line of a byte, from 1.
    pub(super) fn line(&self, byte: usize) -> u32 {
        self.0.partition_point(|start| *start <= byte) as u32 + 1
    }
}

/// Refuses text that nests elements so deep that a parser could run out of stack.
pub(super) fn check_nesting(path: &Path, text: &str, deepest: usize) -> Result<()> {
    let mut depth = 0_usize;
    let mut rest = text;
    while let Some(at) = rest.find('<') {
        rest = &rest[at..];
        let skip = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("<!", ">")];
        if let Some((_, end)) = skip.iter().find(|(start, _)| rest.starts_with(start)) {
            let Some(at) = rest.find(end) else { return Ok(()) };
            rest = &rest[at + end.len()..];
            continue;
        }
        let mut quote = None;
        let end = rest.char_indices().find(|&(_, c)| match quote {
            None if c == '>' => true,
            None if c == '"' || c == '\'' => {
                quote = Some(c);
                false
            }
            Some(open) if c == open => {
                quote = None;
                false
            }
            _ => false,
        });
        let Some((end, _)) = end else { return Ok(()) };
        if rest.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else if !rest[..end].ends_with('/') {
            depth += 1;
        }
        if depth > deepest {
            let line = text[..text.len() - rest.len()].matches('\n').count() + 1;
            let message = format!("elements are nested deeper than {deepest}");
            return Err(Error::parse(path, line, 1, message));
        }
        rest = &rest[end + 1..];
    }
    Ok(())
}

/// Name of version 3 for one of version 0.6: `toWorld` is `to_world`, `intIOR` `int_ior`.
pub(super) fn snake_case(name: &str) -> String {
    let mut snake = String::with_capacity(name.len() + 2);
    let mut before = '_';
    for c in name.chars() {
        if c.is_ascii_uppercase() && (before.is_ascii_lowercase() || before.is_ascii_digit()) {
            snake.push('_');
        }
        snake.push(c.to_ascii_lowercase());
        before = c;
    }
    snake
}
