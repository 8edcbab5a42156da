//! The order of the house: layers of modules, circles of files, one style of module files, line
//! lengths, comments and `unsafe`. The checks read the sources as text, and every test first feeds
//! its check a planted violation.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::collections::BTreeSet;

use crate::support::source::{Files, Graph, files_of, tokens, uses};

/// Top-level modules of `src`; each may use those before it. `lib.rs` brings in the crate of scenes.
const ORDER: [&str; 20] = [
    "lib",
    "terminal",
    "shader",
    "math",
    "gpu",
    "surface",
    "brdf",
    "srbf",
    "accel",
    "film",
    "fit",
    "pass",
    "sampler",
    "session",
    "self_test",
    "study",
    "bench",
    "view",
    "command",
    "cli",
];

/// Modules that compile and test with no Vulkan loader present, although `gpu` stands before them.
const WITHOUT_GPU: [&str; 6] = ["surface", "brdf", "srbf", "accel", "film", "fit"];

/// Uses of one file by another that close a circle and may stay, each with the reason.
const EXCEPTIONS: [(&str, &str, &str); 0] = [];

/// Columns of the longest line.
const COLUMNS: usize = 110;

/// Circles found, and the nodes visited on the way.
struct Circles<'a> {
    visited: BTreeSet<&'a str>,
    circles: Vec<String>,
}

/// Sources of each crate, by their path from its folder.
fn crates() -> [Files; 3] {
    ["", "crates/scene/", "crates/python/"].map(|folder| {
        let files = files_of(&format!("{folder}src")).into_iter();
        files.map(|(name, text)| (name[folder.len()..].to_owned(), text)).collect()
    })
}

/// Makes planted files.
fn planted(files: &[(&str, &str)]) -> Files {
    files.iter().map(|(name, text)| ((*name).into(), (*text).into())).collect()
}

/// Returns the top-level module of a source file.
fn room(name: &str) -> &str {
    let path = name.strip_prefix("src/").unwrap();
    path.split_once('/').map_or(path.trim_end_matches(".rs"), |(room, _)| room)
}

/// Finds uses against [`ORDER`] and [`WITHOUT_GPU`]; without them rooms form no circle.
fn against_the_order(graph: &Graph) -> Vec<String> {
    let place = |room| ORDER.iter().position(|other| *other == room);
    let is_refused = |from, to| {
        let is_later = place(to).is_none_or(|to| place(from) <= Some(to));
        let is_gpu = to == "gpu" && WITHOUT_GPU.contains(&from);
        from != "lib" && from != to && (is_later || is_gpu)
    };
    let edges = graph.iter().flat_map(|(from, used)| used.iter().map(move |to| (from, to)));
    let refused = edges.filter(|(from, to)| is_refused(room(from), room(to)));
    refused.map(|(from, to)| format!("{from} uses {to}")).collect()
}

/// Follows uses from `node`, with `above` the way to it, and adds each circle to `found`.
fn follow<'a>(graph: &'a Graph, node: &'a str, above: &mut Vec<&'a str>, found: &mut Circles<'a>) {
    if let Some(start) = above.iter().position(|other| *other == node) {
        found.circles.push([&above[start..], &[node]].concat().join(" → "));
    } else if found.visited.insert(node) {
        above.push(node);
        graph[node].iter().for_each(|used| follow(graph, used, above, found));
        above.pop();
    }
}

/// Finds circles of files, apart from `exceptions`, and exceptions that are not needed. A `mod.rs`
/// and the files below it may use each other: it declares and re-exports them.
fn circles(mut graph: Graph, exceptions: &[(&str, &str, &str)]) -> Vec<String> {
    let is_hub_of = |hub: &str, file: &str| {
        let folder = hub.strip_suffix("mod.rs").or(hub.strip_suffix("lib.rs"));
        folder.is_some_and(|folder| file.starts_with(folder))
    };
    for (from, used) in &mut graph {
        used.retain(|to| !is_hub_of(from, to) && !is_hub_of(to, from));
    }
    let is_needless = |(from, to, _): &&(&str, &str, &str)| {
        !graph.get_mut(*from).is_some_and(|used| used.remove(*to))
    };
    let needless = exceptions.iter().filter(is_needless);
    let needless = needless.map(|(from, to, _)| format!("{from} does not use {to}")).collect();
    let mut found = Circles { visited: BTreeSet::new(), circles: needless };
    for node in graph.keys() {
        follow(&graph, node, &mut Vec::new(), &mut found);
    }
    found.circles
}

/// Finds `foo.rs` beside a folder `foo`.
fn split_modules(files: &Files) -> Vec<String> {
    let has_folder = |name: &&String| {
        let folder = name.strip_suffix(".rs").map(|path| format!("{path}/"));
        folder.is_some_and(|folder| files.keys().any(|other| other.starts_with(&folder)))
    };
    files.keys().filter(has_folder).cloned().collect()
}

/// Finds lines that are too long, rows of tables in doc comments apart, which cannot be broken, and
/// lines of comments that begin with a word that waits for its subject.
fn bad_lines(files: &Files) -> Vec<String> {
    let fault = |line: &str| {
        let comment = line.trim_start().strip_prefix("//");
        let comment = comment.map(|comment| comment.trim_start_matches(['/', '!']).trim_start());
        let first = comment.and_then(|text| text.split(|c: char| !c.is_alphanumeric()).next());
        let columns = line.chars().count();
        if columns > COLUMNS && !comment.is_some_and(|comment| comment.starts_with('|')) {
            Some(format!("{columns} columns"))
        } else {
            let is_refused = |word: &&str| ["What", "Whether", "Of", "Which"].contains(word);
            first.filter(is_refused).map(|word| format!("a comment begins with {word}"))
        }
    };
    let lines = files.iter().flat_map(|(name, text)| {
        text.lines().enumerate().map(move |(index, line)| (name, index + 1, line))
    });
    lines
        .filter_map(|(name, number, line)| Some(format!("{name}:{number}: {}", fault(line)?)))
        .collect()
}

/// Finds files of code outside `src/gpu` that say `unsafe`.
fn unsafe_files(files: &Files) -> Vec<String> {
    let is_unsafe = |(name, text): &(&String, &String)| {
        room(name) != "gpu" && name.ends_with(".rs") && tokens(text).contains(&"unsafe")
    };
    files.iter().filter(is_unsafe).map(|(name, _)| name.clone()).collect()
}

/// Fails with the complaints against the house, if there are any.
fn assert_none(rule: &str, complaints: &[String]) {
    assert!(complaints.is_empty(), "{rule}:\n{}", complaints.join("\n"));
}

#[test]
fn paths_lead_to_the_files_that_declare() {
    let graph = uses(&planted(&[
        ("src/lib.rs", "pub mod a; pub use a::{deep::Thing};"),
        ("src/a/mod.rs", "mod deep; mod other; pub use self::deep::{self as low, Thing as It};"),
        ("src/a/deep.rs", "use std::fmt; // use crate::b;\n const S: &str = \"\\\"crate::b::B\";"),
        (
            "src/a/other.rs",
            "use super::{It, super::b::*}; #[cfg(test)] mod tests { use crate::c; }",
        ),
        (
            "src/b.rs",
            "fn f<'a>(c: char) -> bool { c == '\"' } use crate::a; type T = a::low::Thing;",
        ),
        ("src/c.rs", "impl crate::Thing { fn g() -> impl Sized + use<> { crate::a::other::G } }"),
    ]));
    let used = |name: &str| graph[name].iter().map(String::as_str).collect::<Vec<_>>();
    assert_eq!(used("src/a/deep.rs"), [""; 0]);
    assert_eq!(used("src/a/other.rs"), ["src/a/deep.rs", "src/b.rs"]);
    assert_eq!(used("src/b.rs"), ["src/a/deep.rs", "src/a/mod.rs"]);
    assert_eq!(used("src/c.rs"), ["src/a/deep.rs", "src/a/other.rs"]);
}

#[test]
fn rooms_use_those_before_them() {
    let sources = planted(&[
        ("src/film/mod.rs", "use crate::gpu::Device; use crate::math::Frame;"),
        ("src/gpu/mod.rs", "fn f() { crate::film::merge(); }"),
        ("src/gpu/device.rs", "use crate::math;"),
        ("src/misc.rs", "use crate::math;"),
        ("src/math.rs", ""),
    ]);
    let expected = [
        "src/film/mod.rs uses src/gpu/mod.rs",
        "src/gpu/mod.rs uses src/film/mod.rs",
        "src/misc.rs uses src/math.rs",
    ];
    assert_eq!(against_the_order(&uses(&sources)), expected);
    assert_none("uses against ORDER or WITHOUT_GPU", &against_the_order(&uses(&files_of("src"))));
}

#[test]
fn files_form_no_circle() {
    let sources = planted(&[
        ("src/a/mod.rs", "mod x; mod y; mod z; pub use x::X; pub struct Hub(y::Y);"),
        ("src/a/x.rs", "use super::{Hub, y::Y};"),
        ("src/a/y.rs", "use super::z;"),
        ("src/a/z/mod.rs", "mod low; use super::X;"),
        ("src/a/z/low.rs", "use super::X; use crate::a::Hub;"),
    ]);
    let circle = "src/a/x.rs → src/a/y.rs → src/a/z/mod.rs → src/a/x.rs";
    assert_eq!(circles(uses(&sources), &[]), [circle]);
    let exceptions = [("src/a/y.rs", "src/a/z/mod.rs", ""), ("src/a/y.rs", "src/a/x.rs", "")];
    assert_eq!(circles(uses(&sources), &exceptions), ["src/a/y.rs does not use src/a/x.rs"]);
    let found = crates().map(|files| circles(uses(&files), &EXCEPTIONS)).concat();
    assert_none("circles of files, to be mended or listed in EXCEPTIONS", &found);
}

#[test]
fn modules_with_a_folder_are_its_mod_rs() {
    let files = planted(&[("src/a.rs", ""), ("src/a/b.rs", ""), ("src/ab/mod.rs", "")]);
    assert_eq!(split_modules(&files), ["src/a.rs"]);
    let found = crates().map(|files| split_modules(&files)).concat();
    assert_none("files beside the folder of their module", &found);
}

#[test]
fn lines_are_short_and_comments_begin_with_their_subject() {
    let long = ["x", "|"].map(|first| format!("//! {first}{}", "x".repeat(COLUMNS)));
    let text = format!("a\n{}\n{}\n    /// Whether so.\n// Often.", long[0], long[1]);
    let expected = ["src/a.rs:2: 115 columns", "src/a.rs:4: a comment begins with Whether"];
    assert_eq!(bad_lines(&planted(&[("src/a.rs", &text)])), expected);
    let folders = ["src", "crates", "glsl", "tests"];
    let complaints = folders.map(|folder| bad_lines(&files_of(folder))).concat();
    assert_none("lines that are hard to read", &complaints);
}

#[test]
fn only_gpu_is_unsafe() {
    let block = "// unsafe\n#![deny(unsafe_code)] fn f() { unsafe { g() } }";
    let files =
        planted(&[("src/gpu/a.rs", block), ("src/film/a.rs", block), ("src/b.rs", "//unsafe")]);
    assert_eq!(unsafe_files(&files), ["src/film/a.rs"]);
    let found = crates().map(|files| unsafe_files(&files)).concat();
    assert_none("files outside src/gpu that say unsafe", &found);
}
