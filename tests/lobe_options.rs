//! `product` and `visibility` on the command line: impossible options are refused with a remedy,
//! sampling does without lobes that cannot be fitted, and biased options say so.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use fenestra::film::Statistics;

use crate::support::command::{self, Folder};

/// Writes a scene of a floor and a ball under an even sky.
fn scene(radiance: &str, reflectance: &str) -> Folder {
    let folder = Folder::new();
    let environment = format!("constant = {radiance}");
    let clay = format!("type = \"diffuse\"\nreflectance = {reflectance}");
    folder.write("scene.toml", command::yard([24, 16], &environment, &clay, command::BALL));
    folder
}

fn clay() -> Folder {
    scene("[1.0, 0.9, 0.8]", "[0.6, 0.4, 0.3]")
}

/// Renders two samples with few lobes and these options to out.exr.
fn run(folder: &Folder, options: &[&str]) -> command::Run {
    run_to(folder, "out.exr", "2", options)
}

fn run_to(folder: &Folder, output: &str, spp: &str, options: &[&str]) -> command::Run {
    let few = ["environment-lobes=8", "brdf-lobes=4", "views=4", "lobes=8"];
    let mut arguments = vec!["render", "scene.toml", "-o", output, "--spp", spp];
    arguments.extend(["--stats", "stats.json", "--validate"]);
    arguments.extend(few.iter().flat_map(|assignment| ["--set", assignment]));
    arguments.extend(options);
    folder.run(&arguments)
}

fn statistics(folder: &Folder) -> Statistics {
    folder.json("stats.json")
}

#[test]
fn what_cannot_be_rendered_is_refused_with_its_remedy() {
    let folder = clay();
    for (options, parts) in [
        (
            &["--set", "cache=pixel", "--depth", "2"][..],
            &["cache=pixel", "--depth 2", "use --depth 1 or cache=hit"][..],
        ),
        (
            &["--set", "brdf-share=0.7", "--set", "environment-share=0.7"],
            &["brdf-share=0.7 and environment-share=0.7", "at most 1"],
        ),
        (
            &["--set", "environment-lobes=1000", "--set", "brdf-lobes=64"],
            &["64000 products", "at most 25000"],
        ),
        (&["--set", "tau=wide"], &["--set tau=wide: expected 0 to 100"]),
        (&["--set", "lobe=3"], &["--set lobe: unknown parameter", "cache-capacity"]),
        (&["--set", "cache"], &["--set cache: expected key=value"]),
        (&["--shadow-rays", "0"], &["--shadow-rays"]),
        (&["--shadow-rays", "4097"], &["--shadow-rays 4097: expected at most 4096"]),
    ] {
        let options = [&["--sampler", "visibility"][..], options].concat();
        run(&folder, &options).assert(2, parts);
        assert!(!folder.path().join("out.exr").exists(), "{options:?} left an image");
    }
}

#[test]
fn a_render_whose_pixels_keep_caches_is_not_resumed_but_merged() {
    let folder = clay();
    let options = ["--sampler", "visibility", "--depth", "1", "--checkpoint-interval", "1h"];
    let pixel = [&options[..], &["--set", "cache=pixel"]].concat();
    run(&folder, &pixel).assert(0, &[]);
    let parts = ["--resume with --set cache=pixel", "--sample-offset 2", "use cache=hit"];
    run(&folder, &[&pixel[..], &["--resume"]].concat()).assert(2, &parts);
    let rest = [&pixel[..], &["--sample-offset", "2"]].concat();
    run_to(&folder, "rest.exr", "3", &rest).assert(0, &[]);
    let merge = ["merge", "out.checkpoint.exr", "rest.checkpoint.exr", "-o", "both.exr"];
    folder.run(&merge).assert(0, &[]);
}

#[test]
fn a_render_with_lobes_continued_from_its_checkpoint_has_the_same_bits() {
    let folder = clay();
    for sampler in ["product", "visibility"] {
        let options = ["--sampler", sampler, "--checkpoint-interval", "1h"];
        run_to(&folder, "whole.exr", "5", &options).assert(0, &[]);
        run(&folder, &options).assert(0, &[]);
        let resume = [&options[..], &["--resume"]].concat();
        run_to(&folder, "out.exr", "5", &resume).assert(0, &[]);
        assert_eq!(statistics(&folder).samples_per_pixel, 5);
        let channels = |name| folder.image(name).channels;
        assert_eq!(channels("out.exr"), channels("whole.exr"), "{sampler}");
        // Other lobes make another render.
        let others = [&resume[..], &["--set", "environment-lobes=9"]].concat();
        run_to(&folder, "out.exr", "6", &others).assert(1, &["environment-lobes: 8 against 9"]);
    }
}

#[test]
fn what_cannot_be_fitted_is_done_without() {
    for (folder, what) in [
        (scene("[0.0, 0.0, 0.0]", "[0.6, 0.4, 0.3]"), "the map is black"),
        (scene("[1.0, 0.9, 0.8]", "[0.0, 0.0, 0.0]"), "clay"),
    ] {
        for sampler in ["product", "visibility"] {
            let run = run(&folder, &["--sampler", sampler]);
            run.assert(0, &["sampling does without its lobes"]);
            assert!(run.messages.contains(what), "{what} in {}", run.messages);
            let image = folder.image("out.exr");
            // The floor fills the lower edge.
            assert_eq!(image.channels["R"].last(), Some(&0.0), "{what}, {sampler}");
            assert_eq!(statistics(&folder).dropped_samples, 0);
        }
    }
}

#[test]
fn the_walk_is_named_biased_and_stays_apart_from_unbiased_films() {
    let folder = clay();
    let options = ["--sampler", "product", "--set", "elevation=metropolis"];
    let run = run_to(&folder, "biased.exr", "2", &options);
    run.assert(0, &["elevation=metropolis", "so the image is biased"]);
    let info = folder.run(&["info", "biased.exr"]);
    assert!(info.output.contains("metropolis (biased)"), "{}", info.output);
    run_to(&folder, "out.exr", "2", &["--sampler", "product", "--sample-offset", "2"])
        .assert(0, &[]);
    let merge = folder.run(&["merge", "out.exr", "biased.exr", "-o", "merged.exr"]);
    merge.assert(1, &["elevation", "metropolis (biased)"]);
}
