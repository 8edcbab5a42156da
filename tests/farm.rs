//! The scripts of `docs/farm`, run as a scheduler runs them.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{
    env, fs,
    os::unix::fs::PermissionsExt,
    process::{Child, Command},
    thread,
    time::Duration,
};

use fenestra::film::Image;

use crate::support::command::{self, Folder, Run, program};

const SPP: &str = "400";
const OPTIONS: &str = "--sampler=mis --depth=2 --checkpoint-interval=1ms";

fn task(folder: &Folder, number: u32) -> Child {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/farm/task.sh");
    let binary = std::path::Path::new(env!("CARGO_BIN_EXE_fenestra")).parent().unwrap();
    let path = format!("{}:{}", binary.display(), env::var("PATH").unwrap());
    let mut task = Command::new(script);
    command::prepare(&mut task, folder.path());
    task.envs([("PATH", &*path), ("SCENE", "scene.toml"), ("OUT", "out"), ("SPP", SPP)])
        .envs([("WIDTH", "24"), ("HEIGHT", "15"), ("BANDS", "2"), ("OPTIONS", OPTIONS)])
        .env("SLURM_ARRAY_TASK_ID", number.to_string());
    task.spawn().unwrap()
}

/// As many tasks as there are bands of all seeds, counted from 0.
#[test]
fn a_farm_is_submitted_as_one_array() {
    let folder = Folder::new();
    let sbatch = folder.write("sbatch", "#!/bin/sh\necho \"$@\"\n");
    fs::set_permissions(sbatch, fs::Permissions::from_mode(0o755)).unwrap();
    let mut script = Command::new(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/farm/submit.sh"));
    script.envs([("SEEDS", "3"), ("BANDS", "4")]);
    let path = format!("{}:{}", folder.path().display(), env::var("PATH").unwrap());
    Run::of(&script.env("PATH", path).output().unwrap())
        .assert_output(&["--array=0-11 ", "farm/task.sh\n"]);
}

#[test]
fn tasks_of_a_farm_give_the_bits_of_one_process() {
    let folder = Folder::with_yard([24, 15], command::BALL);
    let mut tasks = [0, 1, 2, 3].map(|number| (number, task(&folder, number)));
    // One is preempted as soon as it has something to lose.
    let checkpoint = folder.path().join("out/band1.seed1.checkpoint.exr");
    let preempted = &mut tasks[3].1;
    while !checkpoint.exists() && preempted.try_wait().unwrap().is_none() {
        thread::sleep(Duration::from_millis(1));
    }
    command::send("TERM", preempted.id());
    for (number, mut child) in tasks {
        let mut status = child.wait().unwrap().code();
        if number == 3 {
            assert_eq!(status, Some(130), "retry");
            status = task(&folder, number).wait().unwrap().code();
        }
        assert_eq!(status, Some(0), "task {number}");
    }
    let seeds = ["0", "1"];
    for seed in seeds {
        let name = format!("whole{seed}.exr");
        let whole = ["render", "scene.toml", "-q", "--spp", SPP, "--sampler=mis", "--depth=2"];
        let rest = ["--seed", seed, "-o", &name];
        assert!(program(folder.path()).args(whole).args(rest).status().unwrap().success());
    }
    let merged = |parts: &[&str], name: &str| {
        folder.run(&[&["merge", "-q", "-o", name], parts].concat()).assert(0, &[]);
        folder.image(name)
    };
    let names = |band: u32| seeds.map(|seed| format!("out/band{band}.seed{seed}.exr"));
    let parts = [names(0), names(1)].concat();
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    let farm = merged(&parts, "farm.exr");
    let whole = merged(&["whole0.exr", "whole1.exr"], "whole.exr");
    assert!(farm.channels["R"].iter().any(|value| *value > 0.0));
    assert_eq!((farm.width, farm.height), (24, 15));
    assert!(farm.channels == whole.channels, "the bits of one process");
    // Channels of some bands alone cannot be joined.
    for path in names(0).map(|name| folder.path().join(name)) {
        let mut band = Image::read_exr(&path).unwrap();
        band.channels.insert("Z".to_owned(), vec![1.0; band.pixel_count()]);
        band.write_exr(&path).unwrap();
    }
    let run = folder.run(&[&["merge", "-q", "-o", "farm.exr"], &parts[..]].concat());
    run.assert(0, &["not every part has channels Z; left out"]);
}
