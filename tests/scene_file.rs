//! `docs/scene_file.md` follows the structs that the parser of scene files reads.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fmt::Write, fs, path::Path};

use crate::support::page;

/// A key of a table of the scene file.
struct Key {
    name: String,
    kind: String,
    default: String,
    about: String,
}

/// Text of a source file.
fn source(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/scene/src").join(path))
        .unwrap()
}

/// Text of every file that declares keys.
fn sources() -> String {
    let files = [
        "file/mod.rs",
        "file/read.rs",
        "file/material.rs",
        "file/value.rs",
        "lib.rs",
        "lamp.rs",
        "material.rs",
        "texture/mod.rs",
        "environment/court.rs",
        "environment/sky.rs",
        "environment/daylight.rs",
        "shapes/mod.rs",
        "shapes/blobs.rs",
        "shapes/extrude.rs",
        "shapes/grid.rs",
        "shapes/revolve.rs",
        "shapes/rounded_box.rs",
        "shapes/tube.rs",
    ];
    files.map(source).join("\n")
}

/// Part of `text` between two marks.
fn between<'a>(text: &'a str, start: &str, end: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(start)?;
    Some(rest.split_once(end)?.0)
}

/// A number as a scene file has it.
fn number(text: &str) -> String {
    let text = text.trim().replace("_f32", "");
    text.parse::<f32>().map_or(text, |number| number.to_string())
}

/// A value of Rust as a scene file has it.
fn value(text: &str) -> String {
    let text = text.trim();
    if let Some(inner) = between(text, "Uniform(", ")") {
        return number(inner);
    }
    if let Some(inner) = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
        let numbers: Vec<_> = inner.split(',').map(number).collect();
        return format!("[{}]", numbers.join(", "));
    }
    match text.rsplit_once("::") {
        Some((_, variant)) => format!("\"{}\"", snake(variant)),
        None => number(text),
    }
}

fn snake(variant: &str) -> String {
    let mut name = String::new();
    for letter in variant.chars() {
        if letter.is_uppercase() && !name.is_empty() {
            name.push('_');
        }
        name.extend(letter.to_lowercase());
    }
    name
}

/// Variants of an enum of words, and the default among them.
fn variants(all: &str, name: &str) -> Option<(Vec<String>, Option<String>)> {
    let body = between(all, &format!("enum {name} {{\n"), "\n}")?;
    let mut words = Vec::new();
    let (mut default, mut is_default) = (None, false);
    // A name that an attribute gives, empty for none.
    let mut given = None;
    for line in body.lines().map(str::trim) {
        if line == "#[default]" {
            is_default = true;
        } else if line == "#[serde(skip)]" {
            given = Some(String::new());
        } else if let Some(name) = between(line, "#[serde(rename = \"", "\")]") {
            given = Some(name.to_owned());
        } else if !line.starts_with("//") && !line.starts_with('#') {
            let word = given.take().unwrap_or_else(|| snake(line.trim_end_matches(',')));
            default = default.or(is_default.then(|| word.clone()));
            words.push(word);
        }
    }
    words.retain(|word| !word.is_empty());
    Some((words, default))
}

/// Words for a type.
fn kind(all: &str, rust: &str) -> String {
    let rust = rust.strip_prefix("Option<").and_then(|rest| rest.strip_suffix('>')).unwrap_or(rust);
    let word = match rust {
        "f32" => "number",
        "[f32; 2]" => "two numbers",
        "[f32; 3]" => "three numbers",
        "bool" => "true or false",
        "u32" | "usize" => "whole number",
        "[usize; 2]" => "two whole numbers",
        "[u32; 3]" => "three whole numbers",
        "String" | "Spanned<String>" => "text",
        "PathBuf" => "path",
        "NumberOrVector" => "number or three numbers",
        "NumberOr<2>" => "number or two numbers",
        "Textured<f32>" => "number or texture",
        "Textured<[f32; 3]>" => "colour or texture",
        "TextureEntry" => "texture",
        "CourtParameters" | "SkyParameters" | "DaylightParameters" => "table",
        "BTreeMap<String, String>" => "table of names",
        "Vec<[f32; 2]>" => "list of [x, y]",
        "Vec<[f32; 3]>" => "list of [x, y, z]",
        "Vec<Vec<f32>>" => "list of lists of numbers",
        "Vec<Blob>" | "Vec<Wave>" => "list of tables",
        "Radius" => "number or list of numbers",
        name => {
            let words = variants(all, name).unwrap_or_else(|| panic!("no words for {name}")).0;
            return words.iter().map(|word| format!("`\"{word}\"`")).collect::<Vec<_>>().join(", ");
        }
    };
    word.to_owned()
}

/// Default of a key from the attribute above it.
fn default(all: &str, attribute: &str, rust: &str) -> String {
    if let Some(function) = between(attribute, "default = \"", "\"") {
        if let Some(count) = between(function, "::<", ">") {
            return count.to_owned();
        }
        let body = between(all, &format!("fn {function}() -> "), "\n}").unwrap();
        let body = body.split_once('\n').unwrap().1;
        let constant = body.trim().strip_suffix(" as f32");
        return constant.map_or_else(
            || value(body),
            |name| number(between(all, &format!("const {name}: f64 = "), ";").unwrap()),
        );
    }
    match rust {
        "f32" => "0".to_owned(),
        "bool" => "false".to_owned(),
        "[f32; 2]" => "[0, 0]".to_owned(),
        "[f32; 3]" => "[0, 0, 0]".to_owned(),
        "NumberOrVector" | "NumberOr<2>" => "1".to_owned(),
        "BTreeMap<String, String>" => "{}".to_owned(),
        list if list.starts_with("Vec<") => "[]".to_owned(),
        name => format!("\"{}\"", variants(all, name).unwrap().1.unwrap()),
    }
}

/// Keys of a struct that the parser reads.
fn keys(all: &str, name: &str) -> Vec<Key> {
    let start = format!("struct {name} {{\n");
    let body = between(all, &start, "\n}").unwrap_or_else(|| panic!("no struct {name}"));
    let before = all.split_once(&start).unwrap().0;
    let attributes = before.rsplit("\n\n").next().unwrap();
    let own_default = attributes.contains("serde(default,").then(|| {
        let code = between(all, &format!("impl Default for {name} {{"), "\n}").unwrap();
        let code = between(code, "Self {", "}").unwrap();
        code.split_whitespace().collect::<Vec<_>>().join(" ") + ","
    });
    let (mut keys, mut about, mut attribute) = (Vec::new(), Vec::new(), String::new());
    for line in body.lines().map(str::trim) {
        if let Some(comment) = line.strip_prefix("///") {
            about.push(comment.trim().to_owned());
        } else if line.starts_with("#[") {
            line.clone_into(&mut attribute);
        } else {
            let declaration = line.trim_start_matches("pub ").trim_end_matches(',');
            let (name, rust) = declaration.split_once(": ").unwrap();
            let name = name.trim_start_matches("r#").to_owned();
            let mut about = std::mem::take(&mut about).join(" ");
            let attribute = std::mem::take(&mut attribute);
            let stated = about
                .split_once(" Default: ")
                .map(|(text, default)| (text.to_owned(), default.trim_end_matches('.').to_owned()));
            let default = if let Some((text, default)) = stated {
                about = text;
                default
            } else if let Some(code) = &own_default {
                let code = between(
                    code,
                    &format!("{name}: "),
                    if rust.starts_with('[') { "]," } else { "," },
                );
                let code = code.unwrap();
                value(&if rust.starts_with('[') { format!("{code}]") } else { code.to_owned() })
            } else if attribute.contains("default") {
                default(all, &attribute, rust)
            } else if rust.starts_with("Option<") {
                "none".to_owned()
            } else {
                "required".to_owned()
            };
            keys.push(Key { name, kind: kind(all, rust), default, about });
        }
    }
    keys
}

/// A table of keys.
fn table(all: &str, name: &str) -> String {
    let mut text = String::from("| key | value | default | |\n|---|---|---|---|\n");
    for Key { name, kind, default, about } in keys(all, name) {
        writeln!(text, "| `{name}` | {kind} | {default} | {about} |").unwrap();
    }
    text
}

/// Kinds that the parser tells apart, with the struct of each.
fn kinds(mark: &str, after: &str, suffix: &str) -> Vec<(String, String)> {
    let read = source("file/read.rs");
    let kind = |text: &str| {
        let (name, rest) = text.split_once("\", ")?;
        let entry = between(rest, mark, after)?;
        Some((name.to_owned(), format!("{entry}{suffix}")))
    };
    let kinds: Vec<_> = read.split("\n    (\"").filter_map(kind).collect();
    assert_eq!(kinds.len(), read.matches(mark).count(), "{mark}");
    kinds
}

#[test]
fn the_page_has_every_key_of_every_table() {
    let all = sources();
    let mut text = String::new();
    let mut section = |heading: &str, name: &str| {
        write!(text, "### {heading}\n\n{}\n", table(&all, name)).unwrap();
    };
    section("`[camera]`", "CameraEntry");
    section("`[[camera.keyframe]]`; what it leaves out is that of `[camera]`", "KeyframeEntry");
    section("`[film]`", "FilmSettings");
    section(
        "`[environment]`: exactly one of `map`, `constant`, `court`, `sky` and `daylight`",
        "EnvironmentEntry",
    );
    section("`court` in `[environment]`", "CourtParameters");
    section("`sky` in `[environment]`", "SkyParameters");
    section("`daylight` in `[environment]`; north is −Z", "DaylightParameters");
    section("`[[lamp]]`", "LampKeys");
    for (name, entry) in kinds("LampKindEntry::", "(", "Entry") {
        section(&format!("`[[lamp]]` with `type = \"{name}\"`"), &entry);
    }
    section("`[[portal]]`", "PortalKeys");
    section("`[[material]]`", "MaterialKeys");
    for (name, entry) in kinds("MaterialKindEntry::", "(", "Entry") {
        section(&format!("`[[material]]` with `type = \"{name}\"`"), &entry);
    }
    section("A texture", "TextureEntry");
    section("`[[object]]`", "ObjectKeys");
    for (name, entry) in kinds("read_shape::<shapes::", ">", "") {
        section(&format!("`[[object]]` with `shape = \"{name}\"`"), &entry);
    }
    section("One of the `balls` of `blobs`", "Blob");
    section("One of the `waves` of a `grid`", "Wave");
    section("`[[include]]`", "IncludeKeys");
    page::check("scene_file.md", "keys", &text);
}

#[test]
fn declarations_are_read_with_their_defaults() {
    let all = "/// A lamp.\n#[serde(deny_unknown_fields)]\npub struct Lamp {\n    /// Place,\n    \
               /// metres.\n    pub at: [f32; 3],\n    /// Power.\n    \
               #[serde(default = \"default_power\")]\n    pub power: f32,\n    \
               /// Kind. Default: bright.\n    r#type: Option<f32>,\n}\n\n\
               fn default_power() -> f32 {\n    2.50\n}\n";
    let expected = "| key | value | default | |\n|---|---|---|---|\n\
                    | `at` | three numbers | required | Place, metres. |\n\
                    | `power` | number | 2.5 | Power. |\n| `type` | number | bright | Kind. |\n";
    assert_eq!(table(all, "Lamp"), expected);
}
