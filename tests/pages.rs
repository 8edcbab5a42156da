//! The pages of the repository: their links lead somewhere, their pictures are shown, their tables of
//! parameters have the defaults of the samplers, and all together are short.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use fenestra::sampler::{Parameters, Sampler};

/// Most words of `docs` and the README, as `cat docs/*.md README.md | wc -w` counts them.
const WORDS: usize = 30_000;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn files_of(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join(folder)).into_iter().flatten();
    entries.map(|entry| entry.unwrap().path()).collect()
}

/// Every page with its text.
fn pages() -> Vec<(PathBuf, String)> {
    let files = [files_of(""), files_of("docs"), files_of("crates/scene")].concat();
    let is_page = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "md");
    let pages = files.into_iter().filter(is_page);
    pages.map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

/// Targets of the links of a page.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0))
}

/// Names that links may give to the headings of a page, as GitHub makes them.
fn anchors(text: &str) -> BTreeSet<String> {
    let name = |heading: &str| -> String {
        let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
        heading.to_lowercase().chars().filter(kept).collect::<String>().replace(' ', "-")
    };
    let headings = text.lines().filter(|line| line.starts_with('#'));
    headings.map(|line| name(line.trim_start_matches('#').trim())).collect()
}

#[test]
fn links_lead_to_files_and_headings() {
    let mut dead = Vec::new();
    for (page, text) in pages() {
        for link in links(&text).filter(|link| !link.contains("://")) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { page.clone() } else { page.with_file_name(file) };
            let has_heading = |text: String| anchors(&text).contains(anchor);
            let is_live = if anchor.is_empty() {
                target.exists()
            } else {
                fs::read_to_string(&target).is_ok_and(has_heading)
            };
            if !is_live {
                dead.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(dead.is_empty(), "dead links:\n{}", dead.join("\n"));
}

#[test]
fn every_picture_is_shown() {
    let pages = pages();
    let shown: BTreeSet<_> = pages
        .iter()
        .flat_map(|(page, text)| links(text).map(|link| page.with_file_name(link)))
        .collect();
    for file in files_of("docs") {
        let is_picture =
            ["png", "jpg", "svg"].iter().any(|kind| file.extension() == Some(kind.as_ref()));
        assert!(!is_picture || shown.contains(&file), "{}: no page shows it", file.display());
    }
}

/// Keys and defaults in the tables of `--set`.
fn parameters(text: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut is_table = false;
    for line in text.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, keys, defaults, ..] = cells[..] else {
            is_table = false;
            continue;
        };
        is_table |= keys == "`--set`";
        let [keys, defaults] =
            [keys, defaults].map(|cell| cell.split(", ").map(|name| name.trim_matches('`')));
        for (key, default) in keys.zip(defaults) {
            let key = match key.strip_prefix("--set ") {
                Some(assignment) => assignment.split('=').next().unwrap(),
                None if is_table && !key.starts_with('-') => key,
                None => continue,
            };
            found.push((key.to_owned(), default.to_owned()));
        }
    }
    found
}

#[test]
fn tables_of_parameters_have_every_key_and_its_default() {
    let defaults = Parameters::default();
    let own: BTreeSet<(String, String)> =
        Sampler::ALL.iter().flat_map(|sampler| sampler.describe(&defaults)).collect();
    let mut keys: BTreeSet<&str> = Parameters::keys().into_iter().collect();
    // The text names these two.
    keys.remove("preset");
    keys.remove("portal-share");
    for (path, text) in &pages() {
        for (key, default) in parameters(text) {
            let mut parameters = defaults;
            parameters.set(&format!("{key}={default}")).unwrap();
            let is_own = own.contains(&(key.clone(), default.clone()));
            let path = path.display();
            assert!(is_own || parameters == defaults, "{path}: {key} = {default}");
            keys.remove(&*key);
        }
    }
    assert!(keys.is_empty(), "in no table: {keys:?}");
}

#[test]
fn pages_are_short() {
    let is_counted =
        |path: &Path| path.starts_with(root().join("docs")) || path.ends_with("README.md");
    let is_of_crate = |path: &Path| path.starts_with(root().join("crates"));
    let counted = |(path, _): &&(PathBuf, String)| is_counted(path) && !is_of_crate(path);
    let pages = pages();
    let words: usize =
        pages.iter().filter(counted).map(|(_, text)| text.split_whitespace().count()).sum();
    assert!(words <= WORDS, "{words} words in docs and README, more than {WORDS}");
}
