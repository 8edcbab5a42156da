//! Devices that compute wrong, crash, run out of memory or are lost, by a Vulkan layer that fails on
//! request (`support/faulty_layer.c`).
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{fs, process::Command};

use fenestra::film::{Checkpoint, checkpoint::remove_checkpoint};

use crate::support::{
    command::{BALL, Folder, Run, program, words},
    faulty_layer,
};

fn folder() -> Folder {
    Folder::with_yard([64, 48], BALL)
}

/// Renders with the layer; `faults` are its variables.
fn render(folder: &Folder, faults: &[(&str, u64)], options: &[&str]) -> Run {
    let mut command = program(folder.path());
    faulty_layer::insert(&mut command, faults);
    command.args(["render", "scene.toml", "-o", "out.exr"]).args(options);
    Run::of(&command.output().unwrap())
}

/// The first use of a device tests it, and only a driver that passes is remembered.
#[test]
fn a_driver_that_computes_wrong_or_crashes_is_refused() {
    const IMAGE_FETCH: u64 = 95;
    const BALLOT: u64 = 339;
    let folder = folder();
    let render = |fault: (&str, u64), setting: &str| {
        let mut command = program(folder.path());
        faulty_layer::insert(&mut command, &[fault]);
        command.env("XDG_CACHE_HOME", folder.path().join("cache")).env("LP_SETTING", setting);
        command.args(words("render scene.toml -q --spp=1 -o out.exr --sampler=cosine"));
        Run::of(&command.output().unwrap())
    };
    for (fault, part) in [
        (("FAULTY_OPCODE", IMAGE_FETCH), "closest hits: "),
        (("FAULTY_OPCODE", BALLOT), "subgroup ballots: "),
        (("FAULTY_CRASH", 1), "the driver crashes (SIGABRT)"),
    ] {
        render(fault, "").assert(75, &["fails the self-test: ", part, "help: ", "./setup"]);
        assert!(!folder.path().join("out.exr").exists());
    }
    let sound = ("FAULTY_BYTES", u64::MAX);
    let records = || fs::read_dir(folder.path().join("cache/fenestra/self-tests")).unwrap().count();
    render(sound, "").assert(0, &[]);
    assert_eq!(records(), 1);
    render(("FAULTY_OPCODE", BALLOT), "").assert(0, &[]);
    render(("FAULTY_OPCODE", BALLOT), "other").assert(75, &["fails the self-test: "]);
    assert_eq!(records(), 1);
}

#[test]
fn a_lost_device_ends_in_one_message_and_keeps_the_checkpoint() {
    let folder = folder();
    let path = folder.path().join("out.checkpoint.exr");
    let picture = || folder.image("out.exr").channels;
    let mut kept = 0;
    for sampler in ["--sampler=mis", "--sampler=guided"] {
        // The first is an upload; the last comes some samples after the first checkpoint.
        for submission in [1, 70, 110] {
            let faults = [("FAULTY_SUBMISSION", submission)];
            let options = [sampler, "--spp=1000000", "--checkpoint-interval=1ms"];
            let run = render(&folder, &faults, &options);
            run.assert(75, &["the device is lost", "help: ", "--resume"]);
            assert_eq!(run.messages.matches("error: ").count(), 1, "{}", run.messages);
            if !path.exists() {
                continue;
            }
            let (checkpoint, guide) = Checkpoint::read_with_guide(&path).unwrap();
            assert_eq!(guide.is_some(), sampler == "--sampler=guided");
            let spp = format!("--spp={}", checkpoint.sums.sample_count + 6);
            render(&folder, &[], &[sampler, "-q", &spp, "--resume"]).assert(0, &[]);
            let resumed = picture();
            render(&folder, &[], &[sampler, "-q", &spp]).assert(0, &[]);
            assert!(resumed == picture(), "{sampler} lost at submission {submission}");
            remove_checkpoint(&path).unwrap();
            kept += 1;
        }
    }
    assert!(kept >= 2, "{kept} devices were lost after a checkpoint");
}

/// A process that was stopped finds its wait over, and goes on.
#[test]
fn waits_that_end_early_are_repeated_before_a_pass_is_given_up() {
    let folder = folder();
    let options = ["-q", "--sampler=mis", "--spp=2"];
    let picture = || folder.image("out.exr").channels;
    render(&folder, &[], &options).assert(0, &[]);
    let expected = picture();
    render(&folder, &[("FAULTY_WAITS", 119)], &options).assert(0, &[]);
    assert!(picture() == expected);
    let run = render(&folder, &[("FAULTY_WAITS", 120)], &options);
    run.assert(75, &["error: ", "took longer than 120 s"]);
}

/// The driver frees memory twice where `vkCreateDevice` finds too little.
#[test]
fn a_limit_of_address_space_is_an_error_before_the_driver_is_loaded() {
    let folder = folder();
    let mut shell = Command::new("sh");
    let line = "ulimit -v 500000; exec \"$0\" render scene.toml --spp 1 -o out.exr";
    shell.args(["-c", line, env!("CARGO_BIN_EXE_fenestra")]).current_dir(folder.path());
    let run = Run::of(&shell.output().unwrap());
    run.assert(1, &["not enough memory: the Vulkan driver asks for ", "that ulimit -v allows"]);
}

/// From no memory at all to enough: a message, then smaller waves, then the same picture.
#[test]
fn a_device_out_of_memory_takes_smaller_waves_before_it_refuses() {
    let folder = folder();
    let options = ["-q", "--sampler=mis", "--spp=2"];
    render(&folder, &[], &options).assert(0, &[]);
    let picture = folder.image("out.exr").channels;
    let (mut refused, mut smaller) = (0, 0);
    for megabytes in [0, 30, 60, 75, 90, 105, 300] {
        let run = render(&folder, &[("FAULTY_BYTES", megabytes << 20)], &options);
        let is_smaller = run.messages.contains(" paths at a time");
        if run.status == Some(0) {
            let same = folder.image("out.exr").channels;
            assert!(same == picture, "{megabytes} MiB");
            smaller += u32::from(is_smaller);
        } else {
            run.assert(1, &["error: the device is out of memory: buffer ", " asks for ", "help: "]);
            assert_eq!(smaller, 0, "{megabytes} MiB are too little, less was enough");
            refused += 1;
        }
    }
    assert!(refused > 0 && smaller > 0, "{refused} refused, {smaller} with smaller waves");
}
