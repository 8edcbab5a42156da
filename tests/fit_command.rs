//! `fenestra fit`, and `fenestra info` on the files it writes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::fs;

use serde_json::Value;

use crate::support::command::{Folder, Run, pfm, program};

/// Encodes a grey map of 16 × 8 texels, one of them bright: the seventh of the fourth row from above.
fn sky() -> Vec<u8> {
    let mut texels = [[0.5; 3]; 16 * 8];
    texels[70] = [50.0; 3];
    pfm([16, 8], &texels)
}

#[test]
fn maps_are_fitted_pictured_and_described() {
    let folder = Folder::new();
    folder.write("sky.pfm", sky());
    let run = folder.run(&["fit", "env", "sky.pfm", "--lobes", "6", "--no-cache", "--json"]);
    run.assert(0, &[]);
    let value: Value = serde_json::from_str(&run.output).unwrap();
    assert_eq!(value["lobes"], 6);
    assert!(value["errors"]["chi_squared"].as_f64().unwrap() < 0.5, "{value}");
    assert!(value["seconds"].as_f64().unwrap() > 0.0);
    assert_eq!(folder.files(), ["sky.fit", "sky.pfm", "sky.png"]);
    // The map is on the left, 512 pixels wide.
    let picture = image::open(folder.path().join("sky.png")).unwrap().into_rgb8();
    let shown = [[208, 112], [304, 112], [208, 144]].map(|[x, y]| picture[(x, y)].0[1]);
    assert!(shown[0] == 255 && shown[1].max(shown[2]) < 100, "{shown:?}");

    let parts = ["environment fit of sky.pfm", "6 of 6", "chi squared", "energy captured"];
    folder.run(&["info", "sky.fit"]).assert_output(&parts);
    let mut bytes = fs::read(folder.path().join("sky.fit")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    folder.write("sky.fit", bytes);
    folder.run(&["info", "sky.fit"]).assert(1, &["sky.fit: damaged fit file"]);
    folder.write("sky.fit", "{}");
    folder.run(&["info", "sky.fit"]).assert(1, &["sky.fit: not a fit file"]);
}

#[test]
fn materials_are_fitted_in_words() {
    let folder = Folder::new();
    let spec = "plastic:diffuse=[0.5,0.2,0.1],alpha=0.2";
    let arguments =
        ["fit", "brdf", spec, "--lobes", "4", "--views", "6", "--no-cache", "-o", "out/coat.fit"];
    folder.run(&arguments).assert_output(&["lobes per view   4 of 4"]);
    assert!(folder.path().join("out/coat.png").is_file());
    folder.run(&["info", "out/coat.fit", "--json"]).assert(0, &[]);
}

#[test]
fn a_damaged_cache_is_a_warning() {
    let folder = Folder::new();
    folder.write("sky.pfm", sky());
    let fit = || {
        let mut command = program(folder.path());
        command.env("XDG_CACHE_HOME", folder.path().join("cache"));
        Run::of(&command.args(["fit", "env", "sky.pfm", "--lobes", "5"]).output().unwrap())
    };
    fit().assert(0, &[]);
    let second = fit();
    assert!(second.output.contains("read from the cache"), "{}", second.output);
    let cached = fs::read_dir(folder.path().join("cache/fenestra/fits")).unwrap();
    for file in cached {
        fs::write(file.unwrap().path(), "damaged").unwrap();
    }
    let third = fit();
    third.assert(0, &["not a fit file", "made again"]);
    assert!(!third.output.contains("read from the cache"), "{}", third.output);
}

#[test]
fn bad_input_is_named() {
    let folder = Folder::new();
    folder.write("sky.pfm", sky());
    folder.write("black.pfm", pfm([16, 8], &[[0.0; 3]; 16 * 8]));
    folder.write("lying.binary", [90_u32, 90, 180].map(u32::to_le_bytes).concat());
    folder.write("short.brdf", "31 400 410");
    let fit = |arguments: &[&str]| {
        folder.run(&[&["fit"], arguments, &["--no-cache", "--quiet"]].concat())
    };
    fit(&["env", "sky.pfm", "--lobes", "0"]).assert(2, &["0 lobes asked for; expected 1 to 4096"]);
    fit(&["env", "sky.pfm", "--lobes", "100000"]).assert(2, &["100000 lobes asked for"]);
    fit(&["env", "black.pfm"]).assert(1, &["black.pfm", "black"]);
    fit(&["env", "missing.hdr"]).assert(1, &["missing.hdr"]);
    fit(&["brdf", "lying.binary"]).assert(1, &["lying.binary"]);
    fit(&["brdf", "short.brdf"]).assert(1, &["short.brdf"]);
    fit(&["brdf", "velvet"]).assert(2, &["`velvet` is no BRDF", ".binary", "SCENE.toml#material"]);
    fit(&["brdf", "plastic:gloss=1"]).assert(2, &["`plastic:gloss=1`", "gloss"]);
    fit(&["brdf", "diffuse:reflectance=0"]).assert(1, &["reflects nothing"]);
    fit(&["brdf", "diffuse:reflectance=0.5", "--views", "0"]).assert(2, &["0 view elevations"]);
    assert_eq!(folder.files(), ["black.pfm", "lying.binary", "short.brdf", "sky.pfm"]);
}
