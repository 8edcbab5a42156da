//! Rust sources read as text: their tokens, and the files that each file uses by its paths.
//!
//! A path leads to the file that declares the item, through `use` items and re-exports. Methods are
//! not followed: a method of a type counts as use of the file that declares the type.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

/// Files by their path, with `/` between folders.
pub type Files = BTreeMap<String, String>;
/// Nodes that each node uses.
pub type Graph = BTreeMap<String, BTreeSet<String>>;
/// Segments of a path from the root of the crate.
type Segments = Vec<String>;

/// Adds the text files of `folder` and of the folders in it, named by their path from `root`.
fn add_files(root: &Path, folder: &Path, files: &mut Files) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            add_files(root, &path, files);
        } else if let Ok(text) = fs::read_to_string(&path) {
            let name: Vec<_> = path.strip_prefix(root).unwrap().iter().collect();
            files.insert(name.join("/".as_ref()).into_string().unwrap(), text);
        }
    }
}

/// Reads the text files of the package's `folder`.
pub fn files_of(folder: &str) -> Files {
    let (root, mut files) = (Path::new(env!("CARGO_MANIFEST_DIR")), Files::new());
    add_files(root, &root.join(folder), &mut files);
    files
}

/// Returns the length of the comment, string or character literal at the start of `text`, or 0.
fn skipped(text: &str) -> usize {
    let until = |start: usize, end: &str| {
        text[start..].find(end).map_or(text.len(), |at| start + at + end.len())
    };
    let mut is_escaped = false;
    let mut ends_string = |c| {
        let ends = c == '"' && !is_escaped;
        is_escaped = c == '\\' && !is_escaped;
        ends
    };
    match text {
        _ if text.starts_with("//") => until(2, "\n"),
        _ if text.starts_with("/*") => until(2, "*/"),
        _ if text.starts_with("r\"") => until(2, "\""),
        _ if text.starts_with("r#\"") => until(3, "\"#"),
        _ if text.starts_with('"') => text[1..].find(&mut ends_string).map_or(1, |at| at + 2),
        _ if text.starts_with("'\\") => until(3, "'"),
        _ if text.starts_with('\'') && text.chars().nth(2) == Some('\'') => until(1, "'"),
        _ => 0,
    }
}

/// Splits Rust into words, `::` and single characters, without comments, literals and the items
/// under `#[cfg(test)]`.
pub fn tokens(text: &str) -> Vec<&str> {
    let (mut rest, mut tokens) = (text, Vec::new());
    while let Some(first) = rest.chars().next() {
        let mut length = skipped(rest);
        if length == 0 {
            let word = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            length = if rest.starts_with("::") { 2 } else { word.max(first.len_utf8()) };
            tokens.push(&rest[..length]);
        }
        rest = rest[length..].trim_start();
    }
    while let Some(start) = tokens.windows(7).position(|some| some.concat() == "#[cfg(test)]") {
        let mut depth = 0;
        let end = tokens[start..].iter().position(|token| {
            depth += i32::from(*token == "{") - i32::from(*token == "}");
            depth == 0 && [";", "}"].contains(token)
        });
        tokens.drain(start..=start + end.unwrap());
    }
    tokens
}

/// Reads the tree of a `use` item at the start of `tokens`, adds the name and the path of each leaf
/// to `leaves`, and returns the number of tokens read.
fn read_use(tokens: &[&str], mut path: Segments, leaves: &mut Vec<(String, Segments)>) -> usize {
    let mut at = 0;
    loop {
        match tokens[at] {
            "{" => {
                at += 1;
                while tokens[at] != "}" {
                    at += read_use(&tokens[at..], path.clone(), leaves);
                    at += usize::from(tokens[at] == ",");
                }
                return at + 1;
            }
            "as" => {
                leaves.push((tokens[at + 1].into(), path));
                return at + 2;
            }
            "," | "}" | ";" => {
                leaves.push((path.last().unwrap().clone(), path));
                return at;
            }
            "::" => {}
            "self" if !path.is_empty() => {}
            segment => path.push(segment.into()),
        }
        at += 1;
    }
}

/// Returns the leaves of all `use` items and the other paths in `tokens`.
fn paths(tokens: &[&str]) -> (Vec<(String, Segments)>, Vec<Segments>) {
    let (mut leaves, mut inline, mut at) = (Vec::new(), Vec::new(), 0);
    let is_word = |token: &str| token.starts_with(|c: char| c.is_alphabetic() || c == '_');
    while at + 1 < tokens.len() {
        if tokens[at] == "use" && tokens[at + 1] != "<" {
            at += 1 + read_use(&tokens[at + 1..], Vec::new(), &mut leaves);
        } else if is_word(tokens[at]) && tokens[at + 1] == "::" {
            let mut path = vec![tokens[at].into()];
            while tokens[at + 1] == "::" && is_word(tokens[at + 2]) {
                at += 2;
                path.push(tokens[at].into());
            }
            inline.push(path);
        }
        at += 1;
    }
    (leaves, inline)
}

/// Returns the path of the module that the file `name` holds.
fn module_of(name: &str) -> Segments {
    let path = name.strip_prefix("src/").unwrap().strip_suffix(".rs").unwrap();
    let path = path.strip_suffix("/mod").unwrap_or(path);
    path.split('/').filter(|segment| *segment != "lib").map(str::to_owned).collect()
}

/// Modules of the crate: the file of each, and the names that its `use` items bring in.
struct Crate {
    files: BTreeMap<Segments, String>,
    names: BTreeMap<Segments, BTreeMap<String, Segments>>,
}

impl Crate {
    /// Makes a path used in `module` one from the root; `None` if it leads out of the crate.
    fn absolute(&self, module: &[String], path: &[String]) -> Option<Segments> {
        let ups = path.iter().take_while(|segment| *segment == "super").count();
        let is_child = self.files.contains_key(&[module, &path[..1]].concat());
        match path[0].as_str() {
            "crate" => Some(path[1..].to_vec()),
            "self" => Some([module, &path[1..]].concat()),
            "super" => Some([&module[..module.len() - ups], &path[ups..]].concat()),
            _ if is_child => Some([module, path].concat()),
            name => Some([self.names.get(module)?.get(name)?, &path[1..]].concat()),
        }
    }

    /// Returns the file that declares an item, through re-exports.
    fn file_of(&self, path: &[String]) -> &str {
        let depth = (0..=path.len()).rev().find(|depth| self.files.contains_key(&path[..*depth]));
        let (module, rest) = path.split_at(depth.unwrap());
        let target = rest.first().and_then(|name| self.names.get(module)?.get(name));
        match target {
            Some(target) => self.file_of(&[target, &rest[1..]].concat()),
            None => &self.files[module],
        }
    }
}

/// Returns the files that each file of a crate uses, without `main.rs` and tests.
pub fn uses(sources: &Files) -> Graph {
    let is_code = |name: &str| name.ends_with(".rs") && !name.ends_with("/tests.rs");
    let parsed: Vec<_> = sources
        .iter()
        .filter(|(name, _)| is_code(name) && *name != "src/main.rs")
        .map(|(name, text)| (name, module_of(name), paths(&tokens(text))))
        .collect();
    let files = parsed.iter().map(|(name, module, _)| (module.clone(), (*name).clone())).collect();
    let mut modules = Crate { files, names: BTreeMap::new() };
    let absolute_leaf = |module: &[String], (name, path): &(String, Segments)| {
        Some((name.clone(), modules.absolute(module, path)?)).filter(|(name, _)| name != "*")
    };
    let names = parsed.iter().map(|(_, module, (leaves, _))| {
        (module.clone(), leaves.iter().filter_map(|leaf| absolute_leaf(module, leaf)).collect())
    });
    modules.names = names.collect();
    let used = parsed.iter().map(|(name, module, (leaves, inline))| {
        let paths = leaves.iter().map(|(_, path)| path).chain(inline);
        let paths = paths.filter_map(|path| modules.absolute(module, path));
        let files = paths.map(|path| modules.file_of(&path).to_owned());
        ((*name).clone(), files.filter(|file| file != *name).collect())
    });
    used.collect()
}
