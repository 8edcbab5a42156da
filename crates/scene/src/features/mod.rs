//! Parts of foreign files and what becomes of them: the one declaration behind the readers'
//! warnings and the tables of `docs/formats.md`.

use std::path::Path;

/// Treatment of a part of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Rendered as the format says.
    Done,
    /// Rendered as the nearest thing that exists, without a warning.
    Mapped,
    /// Left out, with one warning for each file.
    Ignored,
    /// An error that names it.
    Refused,
}

impl Support {
    /// Word of the tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Mapped => "mapped",
            Self::Ignored => "warning",
            Self::Refused => "refused",
        }
    }
}

/// Part of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Name in warnings and tables; that of an extension or keyword is the format's own.
    pub name: &'static str,
    /// Treatment.
    pub support: Support,
    /// Details; may be empty.
    pub details: &'static str,
}

macro_rules! features {
    ($(#[$about:meta])* $table:ident; $($feature:ident $support:ident $name:literal $details:literal;)*) => {
        $(
            #[doc = $name]
            pub const $feature: Feature =
                Feature { name: $name, support: Support::$support, details: $details };
        )*
        $(#[$about])*
        pub const $table: &[Feature] = &[$($feature),*];
    };
}

mod gltf;
mod mitsuba;
mod obj;
mod pbrt;

pub use gltf::*;
pub use mitsuba::*;
pub use obj::*;
pub use pbrt::*;

/// Most kinds counted for one file; a file that is not what it seems may hold any number.
const MAX_KINDS: usize = 64;
/// Most characters of a name or place in a warning.
const MAX_CHARACTERS: usize = 80;

/// Counts what a file says and Fenestra leaves out, by kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ignored {
    kinds: Vec<Kind>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Kind {
    feature: Feature,
    name: String,
    count: usize,
    first: String,
}

impl Ignored {
    /// Counts `feature` once more; `place` is asked for the first time only.
    pub fn add(&mut self, feature: Feature, place: impl FnOnce() -> String) {
        self.add_named(feature, feature.name, place);
    }

    /// Counts a kind of `feature` that has a name of its own.
    pub fn add_named(&mut self, feature: Feature, name: &str, place: impl FnOnce() -> String) {
        self.count(feature, name, 1, place);
    }

    fn count(
        &mut self,
        feature: Feature,
        name: &str,
        count: usize,
        place: impl FnOnce() -> String,
    ) {
        debug_assert_eq!(feature.support, Support::Ignored, "{}", feature.name);
        let same = |kind: &&mut Kind| kind.feature == feature && kind.name == name;
        if let Some(kind) = self.kinds.iter_mut().find(same) {
            kind.count += count;
        } else if self.kinds.len() < MAX_KINDS || name == feature.name {
            let name = name.to_owned();
            self.kinds.push(Kind { feature, name, count, first: place() });
        } else {
            self.count(feature, feature.name, count, place);
        }
    }

    /// Adds the counts of another.
    pub fn merge(&mut self, other: &Self) {
        for kind in &other.kinds {
            self.count(kind.feature, &kind.name, kind.count, || kind.first.clone());
        }
    }

    /// One warning for each kind, in the order in which they came.
    pub fn warnings(&self, path: &Path) -> Vec<String> {
        let text = |kind: &Kind| {
            let Kind { feature, name, count, first } = kind;
            let (name, first) = (shorten(name), shorten(first));
            // The details of a table's "other" row say nothing of one of its kinds.
            let details = match feature.details {
                details if details.is_empty() || kind.name != feature.name => String::new(),
                details => format!(": {details}"),
            };
            let path = path.display();
            let first = if *count == 1 { first } else { format!("{count}, first in {first}") };
            format!("{path}: ignored {name} ({first}){details}")
        };
        self.kinds.iter().map(text).collect()
    }
}

/// Cuts a text that comes from a file, and replaces characters that would disturb a log.
fn shorten(text: &str) -> String {
    let mut characters = text.chars().map(|c| if c.is_control() { '?' } else { c });
    let mut short: String = characters.by_ref().take(MAX_CHARACTERS).collect();
    if characters.next().is_some() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_one_warning_and_kinds_are_bounded() {
        let mut ignored = Ignored::default();
        for line in 1..=3 {
            ignored.add(OBJ_COLOR, || format!("line {line}"));
        }
        ignored.add_named(OBJ_STATEMENT, "`deg`", || "line\n4".to_owned());
        let path = Path::new("a.obj");
        assert_eq!(ignored.warnings(path)[0], "a.obj: ignored vertex colours (3, first in line 1)");
        let second = "a.obj: ignored `deg` (line?4)";
        assert_eq!(ignored.warnings(path)[1], second);
        for number in 0..1000 {
            ignored.add_named(OBJ_STATEMENT, &format!("`x{number}`"), || "line 5".to_owned());
        }
        let warnings = ignored.warnings(path);
        assert_eq!(warnings.len(), MAX_KINDS + 1);
        assert!(warnings[MAX_KINDS].contains("other statements, by name (938, first in line 5)"));
        let mut twice = ignored.clone();
        twice.merge(&ignored);
        assert!(twice.warnings(path)[0].contains("(6, first in line 1)"));
    }
}
