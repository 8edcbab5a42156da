//! The render command from its options to its files: stop rules, layers, previews, checkpoints.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use fenestra::film::{Attribute, Image, Statistics, checkpoint::guide_paths};

use crate::support::command::{self, Folder};

/// Renders with these options and returns image and statistics.
fn render(folder: &Folder, output: &str, options: &[&str]) -> (Image, Statistics) {
    let mut arguments = vec!["render", "scene.toml", "-o", output, "--stats", "stats.json"];
    arguments.extend(options);
    folder.run(&arguments).assert(0, &[]);
    (folder.image(output), folder.json("stats.json"))
}

fn folder() -> Folder {
    Folder::with_yard([40, 24], command::BALL)
}

#[test]
fn the_first_rule_that_is_reached_ends_the_render() {
    let folder = folder();
    let run = |options: &[&str]| render(&folder, "out.exr", options).1;

    let quick = run(&["--quick"]);
    assert_eq!((quick.stop_reason.as_str(), quick.samples_per_pixel), ("spp", 16));
    let both = run(&["--spp", "3", "--time", "1h"]);
    assert_eq!((both.stop_reason.as_str(), both.samples_per_pixel), ("spp", 3));
    let time = run(&["--spp", "100000000", "--time", "300ms"]);
    assert_eq!(time.stop_reason, "time");
    // It ends with the nearest sample, which may be a little earlier.
    assert!(time.seconds > 0.2 && time.samples_per_pixel > 1, "{} s", time.seconds);
    let error = run(&["--error", "0.2", "--spp", "100000"]);
    assert_eq!(error.stop_reason, "error");
    let reached = error.relative_standard_error.unwrap();
    assert!(reached <= 0.2 && error.samples_per_pixel < 100_000, "{reached}");
    // Sixteen samples are those of a quick picture without another rule.
    let quick = run(&["--quick", "--error", "0.02"]);
    assert_eq!(quick.stop_reason, "error", "after {} samples", quick.samples_per_pixel);
}

#[test]
fn what_a_file_asks_for_is_taken_where_no_option_says_otherwise() {
    let folder = Folder::new();
    let text = r#"<scene version="3.0.0">
        <integrator type="path">
            <integer name="max_depth" value="6"/><integer name="rr_depth" value="3"/>
        </integrator>
        <sensor type="perspective">
            <sampler type="independent"><integer name="sample_count" value="2"/></sampler>
            <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="8"/></film>
        </sensor>
        <emitter type="constant"/>
        <shape type="sphere"><point name="center" x="0" y="0" z="4"/></shape>
    </scene>"#;
    folder.write("room.xml", text);
    let render = |options: &[&str]| {
        let command = ["render", "room.xml", "--sampler=mis", "--stats=stats.json"];
        let run = folder.run(&[&command, options].concat());
        run.assert(0, &[]);
        let found: Statistics = folder.json("stats.json");
        let roulette = found.sampler_parameters["roulette-depth"].clone();
        (run.messages, (found.samples_per_pixel, found.depth, roulette))
    };
    let (said, found) = render(&[]);
    assert!(said.contains("asks for depth 5, roulette from vertex 3, 2 samples"), "{said}");
    assert_eq!(found, (2, 5, "3".into()));
    let (said, found) = render(&["--spp=1", "--depth=4", "--roulette-depth=2"]);
    assert!(!said.contains("asks for"), "{said}");
    assert_eq!(found, (1, 4, "2".into()));
    let (said, found) = render(&["--quality=preview"]);
    assert!(!said.contains("2 samples"), "{said}");
    assert_eq!(found, (64, 5, "3".into()));
}

#[test]
fn rays_are_counted_by_kind() {
    let folder = folder();
    let pixels = 40 * 24;
    let options = command::words("--spp 4 --sampler cosine --depth 1 --aov Visible");
    let (image, direct) = render(&folder, "out.exr", &options);
    assert_eq!(direct.rays["camera"], 4 * pixels);
    assert_eq!(direct.rays["bounce"], 0);
    // Five where a ray meets a surface, but for those below the horizon of an interpolated normal.
    let rays = direct.rays["shadow"] as f64 / (5 * 4 * pixels) as f64;
    assert!((0.5..=1.0).contains(&rays), "{rays} of all");
    let share = direct.visible_share.unwrap();
    assert!((0.5..1.0).contains(&share), "an open scene: {share}");
    let [shares, counts] = ["Visible.Y", "ShadowRays.Y"].map(|name| &image.channels[name]);
    let visible: f32 = shares.iter().zip(counts).map(|(share, count)| share * count).sum();
    let found = f64::from(visible / counts.iter().sum::<f32>());
    assert!((found / share - 1.0).abs() < 1e-4, "{found} of the layer, {share} of all");
    let (_, deep) = render(&folder, "out.exr", &["--spp", "4", "--depth", "3", "--sampler", "mis"]);
    assert!(deep.rays["bounce"] > 0 && deep.rays["shadow"] > direct.rays["shadow"] / 2);
    assert_eq!(deep.dropped_samples, 0);
    assert!(deep.host_ms["load"] > 0.02, "files are read in milliseconds: {:?}", deep.host_ms);
    for pass in ["camera", "trace", "sample", "shadow", "gather", "bounce", "accumulate"] {
        assert!(deep.gpu_ms[pass] > 0.0, "{pass}");
    }
}

#[test]
fn layers_preview_and_window_are_written() {
    let folder = folder();
    let options = command::words(
        "--spp 2 --aov Albedo,N,P,Visible,Variance,SampleCount --png --crop 10,5,30,20 --validate",
    );
    let (image, statistics) = render(&folder, "sub/out.exr", &options);
    assert_eq!((image.width, image.height, image.origin), (20, 15, [10, 5]));
    assert_eq!(image.film_size, [40, 24]);
    for channel in ["R", "Albedo.G", "N.Y", "P.Z", "Visible.Y", "Variance.B", "SampleCount.Y"] {
        assert!(image.channels.contains_key(channel), "{channel}");
    }
    assert!(image.channels["SampleCount.Y"].iter().all(|count| *count == 2.0));
    // The floor of reflectance 0.6 fills the lower edge.
    let albedo = image.channels["Albedo.R"].last().unwrap();
    assert!((albedo - 0.6).abs() < 1e-5, "{albedo}");
    assert!((image.channels["N.Y"].last().unwrap() - 1.0).abs() < 1e-4);
    assert!(matches!(image.attributes["samplesPerPixel"], Attribute::Integer(2)));
    assert!(folder.path().join("sub/out.png").exists());
    assert_eq!((statistics.width, statistics.height), (20, 15));
}

#[test]
fn a_render_continued_from_its_checkpoint_has_the_same_bits() {
    let folder = folder();
    let with = |more: &[&'static str]| [&["--depth", "2", "--aov", "CryptoObject"], more].concat();
    let (whole, _) = render(&folder, "whole.exr", &with(&["--spp", "9"]));
    render(&folder, "part.exr", &with(&["--spp", "4", "--checkpoint-interval", "1h"]));
    let (part, statistics) = render(&folder, "part.exr", &with(&["--spp", "9", "--resume"]));
    assert_eq!(statistics.samples_per_pixel, 9);
    assert_eq!(part.channels, whole.channels);
    assert!(!folder.path().join("part.checkpoint.exr").exists(), "nothing is left to continue");
    let attribute = |name: &str| part.attributes[&format!("cryptomatte/3ae39a5/{name}")].clone();
    assert_eq!(attribute("name"), Attribute::Text("CryptoObject".into()));
    assert_eq!(attribute("conversion"), Attribute::Text("uint32_to_float32".into()));
    let Attribute::Text(manifest) = attribute("manifest") else { panic!("no text") };
    let names: serde_json::Map<_, _> = serde_json::from_str(&manifest).unwrap();
    // Every identifier in the picture has a name, and so has what a file leaves without one.
    assert!(names.contains_key("unnamed"), "{manifest}");
    for id in part.channels["CryptoObject00.R"].iter().filter(|id| **id != 0.0) {
        let found = serde_json::Value::from(format!("{:08x}", id.to_bits()));
        assert!(names.values().any(|named| *named == found), "{found} in {manifest}");
    }
    // Two halves add up to the whole.
    for (name, offset) in [("a.exr", "0"), ("b.exr", "8")] {
        render(&folder, name, &with(&["--spp", "8", "--sample-offset", offset]));
    }
    folder.run(&["merge", "a.exr", "b.exr", "-o", "ab.exr"]).assert(0, &[]);
    let merged = folder.image("ab.exr");
    let (both, _) = render(&folder, "both.exr", &with(&["--spp", "16"]));
    for (name, values) in both.channels.iter().filter(|(name, _)| name.starts_with("Crypto")) {
        assert_eq!(merged.channels[name], *values, "{name}");
    }
    assert_eq!(merged.attributes["cryptomatte/3ae39a5/manifest"], Attribute::Text(manifest));
}

#[test]
fn light_groups_of_parts_add_up_to_the_merged_picture() {
    let folder = folder();
    let lamp = "[[lamp]]\ntype = \"point\"\nposition = [1, 2, 1]\nintensity = [4, 5, 6]\n\
                light_group = \"key\"\n";
    let text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap() + lamp;
    folder.write("scene.toml", text);
    let options = ["render", "scene.toml", "--depth", "2", "--spp", "2", "--aov", "LightGroups"];
    for (name, seed) in [("a.exr", "0"), ("b.exr", "1")] {
        let line = "--aov light-groups: guided shares no paths (share-paths=off)";
        folder.run(&[&options[..], &["--seed", seed, "-o", name]].concat()).assert(0, &[line]);
    }
    folder.run(&["merge", "a.exr", "b.exr", "-o", "ab.exr"]).assert(0, &[]);
    let merged = folder.image("ab.exr");
    for channel in ["R", "G", "B"] {
        let [sky, key] = ["environment", "key"]
            .map(|group| &merged.channels[&format!("Combined_{group}.{channel}")]);
        assert!(key.iter().any(|value| *value > 0.0));
        for (whole, (sky, key)) in merged.channels[channel].iter().zip(sky.iter().zip(key)) {
            assert!((sky + key - whole).abs() < 1e-5 * (1.0 + whole), "{sky} + {key}: {whole}");
        }
    }
    let shared = [&options[..], &["--set", "share-paths=4"]].concat();
    folder.run(&shared).assert(2, &["expected --set share-paths=off"]);
}

#[test]
fn what_guided_learned_is_kept_with_the_checkpoint_and_in_files() {
    let folder = folder();
    let options = |spp: &'static str| ["--sampler", "guided", "--spp", spp];
    let (whole, _) = render(&folder, "whole.exr", &options("9"));
    let keep = [&options("4")[..], &["--checkpoint-interval", "1h"]].concat();
    render(&folder, "part.exr", &keep);
    let guides = || guide_paths(&folder.path().join("part.checkpoint.exr")).unwrap();
    let [guide] = guides().try_into().unwrap();
    let resume = [&options("9")[..], &["--resume", "--checkpoint-interval", "1h"]].concat();
    let (part, _) = render(&folder, "part.exr", &resume);
    assert_eq!(part.channels, whole.channels);
    assert!(!guide.exists());
    let [guide] = guides().try_into().unwrap();
    // A checkpoint without its guide, or with the guide of another moment, is refused.
    std::fs::remove_file(&guide).unwrap();
    let refuse = |texts: &[&str]| {
        let arguments = ["render", "scene.toml", "-o", "part.exr", "--sampler", "guided"];
        folder.run(&[&arguments[..], &["--spp", "12", "--resume"]].concat()).assert(1, texts);
    };
    refuse(&["part.checkpoint.", ".guide: cannot read"]);
    render(&folder, "other.exr", &[&options("2")[..], &["--save-guide", "other.guide"]].concat());
    std::fs::copy(folder.path().join("other.guide"), &guide).unwrap();
    refuse(&["damaged, or not the guide of part.checkpoint.exr"]);

    let pinned = ["--load-guide", "other.guide", "--set", "candidates=1"];
    let loaded = [&options("3")[..], &pinned].concat();
    let (_, statistics) = render(&folder, "loaded.exr", &loaded);
    assert_eq!(statistics.rays["camera"], 3 * 40 * 24, "no training");
    let arguments = ["render", "scene.toml", "--load-guide", "other.guide", "--sampler", "mis"];
    folder.run(&arguments).assert(2, &["--load-guide other.guide", "expected --sampler guided"]);
}

#[test]
fn a_render_makes_the_fits_it_needs_and_keeps_them() {
    let folder = folder();
    let cache = folder.path().join("cache");
    let render = |name: &str| {
        let options = ["--sampler", "visibility", "--spp", "1", "--set", "environment-lobes=8"];
        let mut command = command::program(folder.path());
        command.env("XDG_CACHE_HOME", &cache).args(["render", "scene.toml", "-o", name]);
        let run = command::Run::of(&command.args(options).output().unwrap());
        run.assert(0, &[]);
        std::fs::read(folder.path().join(name)).unwrap()
    };
    let fits = || {
        let mut paths: Vec<_> = std::fs::read_dir(cache.join("fenestra/fits"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        paths.sort();
        paths
    };
    render("first.exr");
    let kept = fits();
    assert!(kept.len() >= 2, "one of the environment, one of a material: {kept:?}");
    let content = std::fs::read(&kept[0]).unwrap();
    // A damaged fit is made anew.
    std::fs::write(&kept[0], &content[..content.len() / 2]).unwrap();
    render("second.exr");
    assert_eq!(fits(), kept);
    assert_eq!(std::fs::read(&kept[0]).unwrap().len(), content.len());
    let info = folder.run(&["info", "second.exr"]);
    info.assert(0, &[]);
    assert!(info.output.contains("fenestra.fit_hashes.environment"), "{}", info.output);
    folder.run(&["compare", "first.exr", "second.exr", "--fail-above", "mse=0"]).assert(0, &[]);
}
