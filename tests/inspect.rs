//! `merge` and `info` on the command line.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::film::{Checkpoint, Image, Metadata, SampleRange, Sums};
use serde_json::Value;

use crate::support::{
    self,
    command::{self, Folder},
};

/// Makes a checkpoint of 4×2 pixels whose samples are all `value`.
fn checkpoint(seed: u32, count: u32, value: f32) -> Checkpoint {
    let mut sums = Sums::new([0, 0], 4, 2, [4, 2]);
    sums.sample_count = count;
    sums.sum = vec![[count as f32 * value; 3]; 8];
    sums.squares = vec![[count as f32 * value * value; 3]; 8];
    let metadata = Metadata {
        scene_hash: "ab12".to_owned(),
        sample_ranges: vec![SampleRange { seed, first: 0, count }],
        seconds: 2.0,
        ..support::checkpoint().metadata
    };
    Checkpoint { sums, metadata }
}

/// Writes `NAME.exr` and `NAME.checkpoint.exr` of one render.
fn write(folder: &Folder, name: &str, checkpoint: &Checkpoint) {
    let mut image = checkpoint.sums.to_image(&[]);
    checkpoint.metadata.store(&mut image);
    image.write_exr(&folder.path().join(format!("{name}.exr"))).unwrap();
    checkpoint.write(&folder.path().join(format!("{name}.checkpoint.exr"))).unwrap();
}

fn parts() -> Folder {
    let folder = Folder::new();
    write(&folder, "a", &checkpoint(1, 10, 1.0));
    write(&folder, "b", &checkpoint(2, 30, 2.0));
    folder
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON on standard output")
}

#[test]
fn images_are_merged_by_their_sample_counts() {
    let folder = parts();
    folder
        .run(&["merge", "a.exr", "b.exr", "-o", "new/out.exr"])
        .assert(0, &["new/out.exr: 40 samples per pixel from 2 parts"]);
    let path = folder.path().join("new/out.exr");
    let merged = Image::read_exr(&path).unwrap();
    // (10·1 + 30·2)/40.
    assert_eq!(merged.channels["R"], [1.75; 8]);
    let metadata = Metadata::load(&merged, &path).unwrap();
    assert_eq!((metadata.sample_count(), metadata.seconds), (40, 4.0));
    // A merged image is a part like any other.
    write(&folder, "c", &checkpoint(3, 40, 0.25));
    let run = folder.run(&["merge", "new/out.exr", "c.exr", "--output", "all.exr", "--json"]);
    run.assert(0, &[]);
    assert_eq!(json(&run.output)["samples_per_pixel"], 80);
    assert_eq!(json(&run.output)["sample_ranges"].as_array().unwrap().len(), 3);
    let merged = folder.image("all.exr");
    assert_eq!(merged.channels["G"], [1.0; 8]);
    // Bands of one size lie where they are.
    for (name, value) in [("upper", 1.0), ("lower", 2.0)] {
        let mut band = checkpoint(1, 4, value);
        band.sums.origin = [0, if name == "lower" { 2 } else { 0 }];
        band.sums.film_size = [4, 4];
        write(&folder, name, &band);
    }
    folder.run(&["merge", "upper.exr", "lower.exr", "-o", "bands.exr"]).assert(0, &[]);
    assert_eq!(folder.image("bands.exr").channels["B"], [[1.0; 8], [2.0; 8]].concat());
}

#[test]
fn checkpoints_are_merged_into_a_checkpoint_or_an_image() {
    let folder = parts();
    let arguments = ["merge", "a.checkpoint.exr", "b.checkpoint.exr", "--quiet", "-o"];
    let run = folder.run(&[&arguments[..], &["out.checkpoint.exr"]].concat());
    run.assert(0, &[]);
    assert_eq!(run.messages, "");
    let merged = Checkpoint::read(&folder.path().join("out.checkpoint.exr")).unwrap();
    assert_eq!(merged.sums.sum, vec![[70.0; 3]; 8]);
    assert_eq!(merged.sums.squares, vec![[130.0; 3]; 8]);
    folder.run(&[&arguments[..], &["out.exr"]].concat()).assert(0, &[]);
    let image = folder.image("out.exr");
    assert!(!Checkpoint::is_checkpoint(&image));
    assert_eq!(image.channels["SampleCount.Y"], [40.0; 8]);
    // Σx² − (Σx)²/n = 130 − 122.5, over n(n − 1) = 1560.
    assert!((image.channels["Variance.B"][5] - 7.5 / 1560.0).abs() < 1e-9);
    // An image and a checkpoint merge into an image, but not into a checkpoint.
    folder.run(&["merge", "a.exr", "b.checkpoint.exr", "-o", "mixed.exr"]).assert(0, &[]);
    let mixed = folder.image("mixed.exr");
    assert_eq!(mixed.channels["R"], [1.75; 8]);
    let run = folder.run(&["merge", "a.exr", "b.checkpoint.exr", "-o", "mixed.checkpoint.exr"]);
    run.assert(2, &["mixed.checkpoint.exr would be a checkpoint, but a.exr is an image"]);
}

#[test]
fn parts_that_share_samples_or_show_something_else_are_refused() {
    let folder = parts();
    write(&folder, "again", &checkpoint(1, 4, 1.0));
    let run = folder.run(&["merge", "a.exr", "again.exr", "-o", "out.exr"]);
    run.assert(1, &["again.exr: holds samples 0..4 of seed 1, but a.exr holds", "--seed"]);
    // Every two parts are compared, not each with the first alone.
    let run = folder.run(&["merge", "b.exr", "a.exr", "again.exr", "-o", "out.exr"]);
    run.assert(1, &["again.exr: holds samples 0..4 of seed 1, but a.exr holds"]);
    let mut other = checkpoint(7, 4, 1.0);
    other.metadata.scene_hash = "cd34".to_owned();
    other.metadata.sampler = "env".to_owned();
    write(&folder, "other", &other);
    let run = folder.run(&["merge", "a.exr", "other.checkpoint.exr", "-o", "out.exr"]);
    run.assert(1, &["not of one render with a.exr", "cd34 against ab12", "env against mis"]);
    folder.write_image("foreign.exr", [4, 2], [1.0; 3]);
    let run = folder.run(&["merge", "a.exr", "foreign.exr", "-o", "out.exr"]);
    run.assert(1, &["foreign.exr: no attribute fenestra."]);
    assert!(!folder.files().contains(&"out.exr".to_owned()));
}

#[test]
fn info_shows_channels_and_attributes_of_an_image() {
    let folder = parts();
    let run = folder.run(&["info", "b.exr"]);
    let parts = ["image of 4x2 pixels", "mean 2.000000e0", "fenestra.sampler = \"mis\""];
    run.assert_output(&parts);
    assert!(!run.output.contains("warning"), "{}", run.output);
    let report = json(&folder.run(&["info", "b.checkpoint.exr", "--json"]).output);
    assert_eq!(report["kind"], "checkpoint");
    assert_eq!(report["attributes"]["samplesPerPixel"], 30);
    assert_eq!(report["channels"]["Sum.R"]["maximum"], 60.0);
    assert_eq!(report["warnings"].as_array().unwrap().len(), 0);
}

#[test]
fn info_warns_of_samples_that_are_not_finite() {
    let folder = Folder::new();
    let mut image = Image::new(3, 1);
    image.channels.insert("Y".to_owned(), vec![f32::NAN, f32::NEG_INFINITY, f32::NAN]);
    image.write_exr(&folder.path().join("bad.exr")).unwrap();
    let parts = ["2 NaN, 1 infinite, 1 negative", "warning: channel Y: 3 samples are not finite"];
    folder.run(&["info", "bad.exr"]).assert_output(&parts);
}

#[test]
fn info_reads_environment_maps() {
    let folder = Folder::new();
    let texels = [[1.0, 2.0, 3.0], [f32::NAN, 5.0, 6.0]];
    folder.write("map.pfm", command::pfm([2, 1], &texels));
    // The NaN is reported.
    let parts = ["environment map of 2x1 texels", "warning: "];
    folder.run(&["info", "map.pfm"]).assert_output(&parts);
    let report = json(&folder.run(&["info", "map.pfm", "--json"]).output);
    assert_eq!(report["channels"]["G"]["maximum"], 2.0);
    assert_eq!(report["warnings"].as_array().unwrap().len(), 1);
}

#[test]
fn info_judges_measured_brdfs() {
    // Lambertian surfaces, of one albedo at every wavelength.
    let folder = Folder::new();
    let report = |albedo: f64| {
        let wavelengths: Vec<String> = (0..31).map(|step| (400 + 10 * step).to_string()).collect();
        let value = format!(" {}", albedo / std::f64::consts::PI).repeat(31);
        let mut text = format!("# grey in many directions\n31 {}\n", wavelengths.join(" "));
        for incident in [10.0_f64, 40.0, 70.0].map(f64::to_radians) {
            for outgoing in [10.0_f64, 40.0, 70.0].map(f64::to_radians) {
                for azimuth in [0.0_f64, 60.0, 120.0, 180.0].map(f64::to_radians) {
                    text += &format!("{incident} 0 {outgoing} {azimuth}{value}\n");
                }
            }
        }
        folder.write("grey.brdf", text);
        let run = folder.run(&["info", "grey.brdf", "--json"]);
        run.assert(0, &[]);
        json(&run.output)
    };
    let grey = report(0.5);
    // Equal energy is not quite the white of Rec.709, but has its luminance.
    let albedo = |channel: usize| grey["sanity"]["albedo"][1][channel].as_f64().unwrap();
    let luminance = 0.2126 * albedo(0) + 0.7152 * albedo(1) + 0.0722 * albedo(2);
    assert!((luminance - 0.5).abs() < 0.02, "{luminance}");
    assert!(grey["sanity"]["largest_reciprocity_error"].as_f64().unwrap() < 1e-3);
    let black = report(0.0)["warnings"].to_string();
    assert!(black.contains("black at every pair of directions"), "{black}");
}

#[test]
fn info_counts_what_a_scene_holds() {
    let folder = Folder::new();
    let object = "shape = \"box\"\nsize = [1, 1, 1]";
    folder.write("room.toml", command::yard([64, 48], command::SKY, command::CLAY, object));
    let run = folder.run(&["info", "room.toml"]);
    run.assert_output(&["scene room", "64x48 pixels", "clay (diffuse, 24 triangles)", "hash"]);
    let report = json(&folder.run(&["info", "room.toml", "--json"]).output);
    assert_eq!(report["triangles"], 24);
    assert_eq!(report["hash"].as_str().unwrap().len(), 64);
}

#[test]
fn info_without_a_file_describes_the_installation() {
    let version = concat!("Fenestra ", env!("CARGO_PKG_VERSION"));
    let parts = [version, "cache of fits: ", "fenestra devices"];
    Folder::new().run(&["info"]).assert_output(&parts);
    let report = json(&Folder::new().run(&["info", "--json"]).output);
    assert!(report["caches"]["pipelines"]["folder"].is_string(), "{report}");
}

#[test]
fn info_refuses_what_it_does_not_know() {
    let folder = Folder::new();
    folder.write("notes.txt", "hello");
    folder.run(&["info", "notes.txt"]).assert(1, &["notes.txt: unknown kind of file; expected"]);
    folder.run(&["info", "absent.txt"]).assert(1, &["absent.txt: cannot read"]);
    folder.run(&["info", "absent.exr"]).assert(1, &["absent.exr: cannot read"]);
    folder.run(&["info", "--map"]).assert(2, &["<FILE>"]);
}
