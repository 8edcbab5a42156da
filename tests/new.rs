//! `fenestra new`: the first scene runs as printed, and nothing is overwritten.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use crate::support::command::Folder;

#[test]
fn the_first_scene_renders() {
    let folder = Folder::new();
    let run = folder.run(&["new", "first/try"]);
    run.assert(0, &[]);
    let mut arguments: Vec<&str> = run.output.split_whitespace().skip(1).collect();
    assert_eq!(arguments, ["render", "first/try/scene.toml", "--quick", "--png"]);
    arguments.extend(["--size=32x24", "--spp=4"]);
    folder.run(&arguments).assert(0, &[]);
    assert_eq!(folder.files(), ["first", "try.exr", "try.png"], "named after its folder");
    let image = folder.image("try.exr");
    assert_eq!([image.width, image.height], [32, 24]);
    let luminance = &image.channels["G"];
    let mean = luminance.iter().sum::<f32>() / luminance.len() as f32;
    assert!((0.05..5.0).contains(&mean), "{mean}");
}

#[test]
fn a_folder_with_content_is_refused() {
    let folder = Folder::new();
    folder.run(&["new", "."]).assert(0, &[]);
    assert_eq!(folder.files(), ["scene.toml"]);
    folder.write("scene.toml", "mine");
    folder.run(&["new", "."]).assert(2, &["not empty"]);
    folder.run(&["new", "scene.toml"]).assert(1, &["scene.toml", "cannot read"]);
    assert_eq!(std::fs::read(folder.path().join("scene.toml")).unwrap(), b"mine");
}
