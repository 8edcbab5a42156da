//! Processes killed at every moment at which their files change, disks that fill at any byte, and
//! disks that fail to keep what was written: the last checkpoint stays whole and is continued to the bit.
//! The faults are those of `support/faulty_files.c`.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fs, path::Path};

use fenestra::film::{Attribute, Checkpoint, Image, checkpoint::guide_paths};

use crate::support::{
    c_library,
    command::{Folder, Run, program, roofed_ball, words},
};

/// Choices by measurement would differ from render to render.
const GUIDED: &str =
    "render scene.toml -q --sampler=guided --set=candidates=1 --set=share-paths=off -o out.exr";
const PICTURE: &str = "out.exr";
const CHECKPOINT: &str = "out.checkpoint.exr";
/// Messages of the library.
const BEFORE_RENAME: &str = "killed before a file is renamed";
const BEFORE_REMOVAL: &str = "killed before a file is removed";

/// A folder with a scene and the checkpoint of two samples.
fn folder() -> Folder {
    let folder = Folder::with_yard([24, 16], &roofed_ball());
    render(&folder, None, &["--spp=2", "--checkpoint-interval=1h"]).assert(0, &[]);
    folder
}

/// Renders with a fault, which is a variable of the library and its value.
fn render(folder: &Folder, fault: Option<(&str, u64)>, options: &[&str]) -> Run {
    let mut command = program(folder.path());
    if let Some(fault) = fault {
        c_library::fail_in(&mut command, folder.path(), fault);
    }
    Run::of(&command.args(words(GUIDED)).args(options).output().unwrap())
}

/// Returns the samples of the checkpoint, which must be whole, as its guide must be.
fn samples(folder: &Folder) -> u32 {
    let read = Checkpoint::read_with_guide(&folder.path().join(CHECKPOINT));
    let (checkpoint, guide) = read.unwrap();
    assert!(guide.is_some());
    checkpoint.sums.sample_count
}

fn picture(folder: &Folder) -> Image {
    folder.image(PICTURE)
}

fn assert_no_leftovers(folder: &Folder) {
    let files = folder.files();
    assert!(files.iter().all(|name| !name.ends_with(".tmp")), "{files:?}");
}

/// Each process goes on where the one before was killed: at every moment of the first checkpoint, which
/// are those of the guide, of the film and of the removal of older guides, and at the first moment of
/// the second. Then nothing is left to render, and the moments are those of the picture, the
/// statistics and the last checkpoint.
#[test]
fn processes_killed_at_every_moment_resume_to_the_bit() {
    let folder = folder();
    fs::remove_file(folder.path().join(PICTURE)).unwrap();
    let mut kills = Vec::new();
    let mut kill = |run: &Run| {
        assert_eq!(run.status, None, "{}", run.messages);
        kills.push(run.messages.lines().last().unwrap_or_default().to_owned());
        kills.clone()
    };
    let mut kept = samples(&folder);
    for moment in 0.. {
        let options = ["--spp=100000", "--checkpoint-interval=1ms", "--resume"];
        let kills = kill(&render(&folder, Some(("FAULTY_MOMENT", moment)), &options));
        let found = samples(&folder);
        // Before and after the guide is renamed, before the film is, and after: the fourth goes on.
        assert!(if moment < 3 { found == kept } else { found > kept }, "{found} after {kept}");
        kept = found;
        if moment > 3 && kills.last().unwrap() == BEFORE_RENAME {
            break;
        }
    }
    assert!(!folder.path().join(PICTURE).exists());

    let whole = Folder::new();
    whole.write("scene.toml", fs::read(folder.path().join("scene.toml")).unwrap());
    let spp = format!("--spp={kept}");
    render(&whole, None, &[&spp]).assert(0, &[]);
    let options = [&spp, "--checkpoint-interval=1h", "--resume", "--stats=stats.json"];
    for moment in 0.. {
        let run = render(&folder, Some(("FAULTY_MOMENT", moment)), &options);
        assert_eq!(samples(&folder), kept);
        if folder.path().join(PICTURE).exists() {
            assert!(picture(&folder).channels == picture(&whole).channels);
        }
        if let Ok(text) = fs::read(folder.path().join("stats.json")) {
            serde_json::from_slice::<serde_json::Value>(&text).unwrap();
        }
        if run.status == Some(0) {
            break;
        }
        kill(&run);
    }
    assert!(folder.path().join(PICTURE).exists() && folder.path().join("stats.json").exists());
    // Guides that no checkpoint names go with the next checkpoint.
    assert_eq!(guide_paths(&folder.path().join(CHECKPOINT)).unwrap().len(), 1);
    let count = |kind: &str| kills.iter().filter(|kill| *kill == kind).count();
    eprintln!("{} kills, {} before a rename", kills.len(), count(BEFORE_RENAME));
    // The guide, the film and the next guide; then the picture, the statistics, the guide and the film.
    assert_eq!(count(BEFORE_RENAME), 3 + 4);
    assert!(count(BEFORE_REMOVAL) > 0);
}

#[test]
fn a_disk_that_fills_at_any_byte_keeps_the_last_checkpoint() {
    let folder = folder();
    let path = folder.path().join(CHECKPOINT);
    let [guide] = guide_paths(&path).unwrap().try_into().unwrap();
    let size = |path: &Path| fs::metadata(path).unwrap().len();
    // Files in the order in which they are written. Another render may be compressed to other sizes.
    let sizes = [size(&folder.path().join(PICTURE)), size(&guide), size(&path)];
    let mut limits = Vec::new();
    let mut start = 0;
    for size in sizes {
        limits.extend([start + 1, start + size / 2]);
        start += size;
    }
    let options = ["--resume", "--spp=3", "--checkpoint-interval=1h"];
    for bytes in limits {
        let run = render(&folder, Some(("FAULTY_BYTES", bytes)), &options);
        run.assert(75, &["cannot write: No space left on device"]);
        assert_eq!(samples(&folder), 2, "{bytes} bytes");
        let count = picture(&folder).attributes["samplesPerPixel"].clone();
        assert!([2, 3].map(Attribute::Integer).contains(&count), "{count:?} at {bytes} bytes");
        assert_no_leftovers(&folder);
    }
    render(&folder, None, &options).assert(0, &[]);
    let resumed = picture(&folder).channels;
    render(&folder, None, &["--spp=3"]).assert(0, &[]);
    assert!(resumed == picture(&folder).channels);
}

#[test]
fn a_checkpoint_leaves_room_for_the_image() {
    let folder = folder();
    let options = ["--spp=8", "--checkpoint-interval=1ms"];
    let run = render(&folder, Some(("FAULTY_FREE", 1000)), &options);
    run.assert(0, &["out.checkpoint.exr: removed, the disk has room for the image only"]);
    assert!(folder.path().join(PICTURE).exists());
}

/// The folder of a file that was renamed may fail too: then both names are sound.
#[test]
fn a_disk_that_loses_what_was_written_is_an_error() {
    let folder = folder();
    let options = ["--resume", "--spp=3", "--checkpoint-interval=1h"];
    // File and folder of the guide and of the film, after those of the picture.
    for sync in 2..6 {
        let run = render(&folder, Some(("FAULTY_SYNC", sync)), &options);
        run.assert(75, &["cannot write: Input/output error"]);
        assert_eq!(samples(&folder), if sync < 5 { 2 } else { 3 }, "sync {sync}");
        picture(&folder);
        assert_no_leftovers(&folder);
    }
}
