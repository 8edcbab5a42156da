//! Licences and sources of all dependencies, as `deny.toml` allows them; needs neither network nor
//! `cargo deny`, which checks advisories too.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{collections::BTreeSet, fs, path::Path, process::Command};

use serde_json::Value;

const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";
/// Platform that the licences are looked up for: that of the machine, whose crates are at hand.
const PLATFORM: &str = "x86_64-unknown-linux-gnu";

fn read(name: &str) -> toml::Table {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    fs::read_to_string(path).unwrap().parse().unwrap()
}

/// True if one of the ways through an SPDX expression takes only allowed licences. Exceptions after
/// `WITH` only permit more.
fn is_allowed(expression: &str, allowed: &BTreeSet<&str>) -> bool {
    let spaced = expression.replace('(', " ( ").replace(')', " ) ").replace('/', " OR ");
    let mut tokens = spaced.split_whitespace().peekable();
    let mut above: Vec<(Option<bool>, bool)> = Vec::new();
    // Sum of products so far, and product so far.
    let (mut sum, mut product) = (None, true);
    while let Some(token) = tokens.next() {
        match token {
            "(" => {
                above.push((sum, product));
                (sum, product) = (None, true);
            }
            ")" => {
                let value = sum.unwrap_or(false) || product;
                let Some((outer, before)) = above.pop() else { return false };
                (sum, product) = (outer, before && value);
            }
            "OR" => (sum, product) = (Some(sum.unwrap_or(false) || product), true),
            "AND" => {}
            licence => {
                if tokens.next_if_eq(&"WITH").is_some() {
                    tokens.next();
                }
                product &= allowed.contains(licence);
            }
        }
    }
    sum.unwrap_or(false) || product
}

#[test]
fn expressions_are_understood() {
    let allowed = BTreeSet::from(["MIT", "Zlib"]);
    for yes in [
        "MIT",
        "MIT OR GPL-3.0",
        "GPL-3.0/MIT",
        "Zlib AND (MIT OR Apache-2.0)",
        "(GPL-3.0 OR Zlib) AND MIT",
        "GPL-3.0 AND ISC OR MIT",
        "MIT WITH LLVM-exception",
    ] {
        assert!(is_allowed(yes, &allowed), "{yes}");
    }
    for no in [
        "GPL-3.0",
        "MIT AND GPL-3.0",
        "Zlib AND (ISC OR Apache-2.0)",
        "(MIT OR ISC) AND GPL-3.0",
        "ISC OR MIT AND GPL-3.0",
    ] {
        assert!(!is_allowed(no, &allowed), "{no}");
    }
}

#[test]
fn dependencies_come_from_the_registry_with_a_checksum() {
    let lock = read("Cargo.lock");
    let packages = lock["package"].as_array().unwrap();
    assert!(packages.len() > 50, "{}", packages.len());
    let own = ["fenestra", "fenestra-scene", "fenestra-python"];
    let is_own =
        |package: &toml::Value| package["name"].as_str().is_some_and(|name| own.contains(&name));
    for package in packages.iter().filter(|package| !is_own(package)) {
        assert_eq!(
            package.get("source").and_then(toml::Value::as_str),
            Some(REGISTRY),
            "{package}"
        );
        let checksum = package.get("checksum").and_then(toml::Value::as_str);
        assert!(checksum.is_some_and(|checksum| checksum.len() == 64), "{package}");
    }
}

#[test]
fn licences_of_dependencies_are_allowed() {
    let deny = read("deny.toml");
    let allowed = deny["licenses"]["allow"].as_array().unwrap();
    let allowed: BTreeSet<&str> = allowed.iter().filter_map(toml::Value::as_str).collect();
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(env!("CARGO_MANIFEST_DIR"));
    cargo.args(["metadata", "--offline", "--locked", "--format-version=1"]);
    let output = cargo.args(["--filter-platform", PLATFORM]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let used: BTreeSet<&str> = metadata["resolve"]["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|node| node["id"].as_str())
        .collect();
    let packages = metadata["packages"].as_array().unwrap();
    let packages: Vec<&Value> =
        packages.iter().filter(|package| used.contains(package["id"].as_str().unwrap())).collect();
    assert!(packages.len() > 50, "{}", packages.len());
    for package in packages {
        let licence = package["license"].as_str().unwrap_or("none");
        assert!(is_allowed(licence, &allowed), "{}: {licence}", package["name"]);
    }
}
