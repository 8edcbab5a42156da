//! Renders that are killed, run out of space or are hung up: what was rendered before is kept,
//! continues to the bit, and damage to it is noticed.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

#[path = "support/command.rs"]
mod command;

use std::{
    fs::{self, File},
    path::Path,
    process::{self, Command, Stdio},
    thread,
    time::{Duration, SystemTime},
};

use command::{Folder, Run, Running, program};
use fenestra::{
    files::write_atomically,
    film::{
        Attribute, Checkpoint, Image, Metadata, SampleRange, Sums, checkpoint::guide_paths,
        merge::merge_checkpoints,
    },
};

fn folder() -> Folder {
    let folder = Folder::new();
    let clay = "type = \"diffuse\"\nreflectance = [0.6, 0.4, 0.3]";
    folder.write("scene.toml", command::yard([24, 16], "sky = {}", clay, command::BALL));
    folder
}

const GUIDED: [&str; 6] = ["render", "scene.toml", "-q", "--sampler=guided", "-o", "out.exr"];

fn channels(folder: &Folder, name: &str) -> impl PartialEq + std::fmt::Debug + use<> {
    Image::read_exr(&folder.path().join(name)).unwrap().channels
}

fn checkpoint() -> Checkpoint {
    let mut sums = Sums::new([0, 0], 4, 2, [4, 2]);
    for (index, value) in sums.sum.as_flattened_mut().iter_mut().enumerate() {
        *value = 1.0 + index as f32;
    }
    sums.squares = sums.sum.clone();
    sums.visible = vec![[3, 5]; 8];
    sums.sample_count = 6;
    let metadata = Metadata {
        version: "0.1.0".to_owned(),
        scene: "room".to_owned(),
        sampler: "mis".to_owned(),
        shadow_rays: 5,
        depth: 1,
        sample_ranges: vec![SampleRange { seed: 1, first: 2, count: 6 }],
        seconds: 1.5,
        ..Metadata::default()
    };
    Checkpoint { sums, metadata }
}

#[test]
fn leftovers_of_killed_processes_are_swept() {
    let folder = folder();
    let mut dead = Command::new("true").spawn().unwrap();
    dead.wait().unwrap();
    let hour_ago = SystemTime::now() - Duration::from_secs(3600);
    let leave = |name: String, is_old: bool| {
        let file = File::create(folder.path().join(&name)).unwrap();
        if is_old {
            file.set_modified(hour_ago).unwrap();
        }
        name
    };
    let swept = leave(format!(".fenestra-{}-aB3dE6.tmp", dead.id()), true);
    let kept = [
        leave(format!(".fenestra-{}-fresh0.tmp", dead.id()), false),
        leave(format!(".fenestra-{}-living.tmp", process::id()), true),
        leave(".fenestra-none.tmp".to_owned(), true),
        leave("fenestra-1-notes.tmp".to_owned(), true),
    ];
    // A temporary file carries the id of its process.
    let mut names = Vec::new();
    write_atomically(&folder.path().join("text"), |_| {
        names = folder.files();
        Ok(())
    })
    .unwrap();
    let own = format!(".fenestra-{}-", process::id());
    assert_eq!(names.iter().filter(|name| name.starts_with(&own)).count(), 2, "{names:?}");
    folder.run(&["render", "scene.toml", "--spp=1", "-o", "out.exr"]).assert(0, &[]);
    let files = folder.files();
    assert!(!files.contains(&swept), "{files:?}");
    assert!(kept.iter().all(|name| files.contains(name)), "{files:?}");
}
