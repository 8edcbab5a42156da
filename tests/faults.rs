//! Renders that are killed, run out of space or are hung up: what was rendered before is kept,
//! continues to the bit, and damage to it is noticed.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    fs::{self, File},
    path::Path,
    process::{self, Command, Stdio},
    thread,
    time::{Duration, Instant, SystemTime},
};

use fenestra::{
    film::{Attribute, Checkpoint, Image, Metadata, SampleRange, merge::merge_checkpoints},
    scene::files::write_atomically,
};

use crate::support::{
    self, assert_error, checkpoint,
    command::{self, Folder, Run, Running, program},
};

fn folder() -> Folder {
    Folder::with_yard([24, 16], command::BALL)
}

const GUIDED: [&str; 6] = ["render", "scene.toml", "-q", "--sampler=guided", "-o", "out.exr"];

fn channels(folder: &Folder, name: &str) -> impl PartialEq + std::fmt::Debug + use<> {
    folder.image(name).channels
}

#[test]
fn a_killed_render_resumes_to_the_bit() {
    let folder = folder();
    let run = |options: &[&str]| folder.run(&[&GUIDED[..], options].concat()).assert(0, &[]);
    run(&["--spp=40"]);
    let whole = channels(&folder, "out.exr");
    let path = folder.path().join("out.checkpoint.exr");
    let mut kept = 0;
    for delay in [5, 60] {
        let mut child = program(folder.path())
            .args(GUIDED)
            .args(["--spp=1000000", "--checkpoint-interval=1ms", "--resume"])
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Let it render for a while after its first checkpoint.
        for _ in 0..1000 {
            if path.exists() {
                break;
            }
            thread::sleep(Duration::from_millis(20));
        }
        thread::sleep(Duration::from_millis(delay));
        child.kill().unwrap();
        child.wait().unwrap();
        let samples = Checkpoint::read(&path).unwrap().sums.sample_count;
        if samples < 40 {
            run(&["--spp=40", "--resume"]);
            assert!(channels(&folder, "out.exr") == whole, "killed at {samples} samples");
            kept += 1;
        } else {
            Checkpoint::read_with_guide(&path).unwrap().1.unwrap();
            fs::remove_file(&path).unwrap();
        }
    }
    assert!(kept > 0, "no kill came early enough to be continued");
}

#[test]
fn no_flipped_bit_of_a_checkpoint_passes() {
    let folder = Folder::new();
    let path = folder.path().join("room.checkpoint.exr");
    let checkpoint = checkpoint();
    checkpoint.write(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    let mut refused = 0;
    for position in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[position] ^= 1 << (position % 8);
        fs::write(&path, &damaged).unwrap();
        // Bits that the sums do not depend on, such as the chromaticities, may flip.
        match Checkpoint::read(&path) {
            Ok(read) => assert!(read == checkpoint, "bit of byte {position}"),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > bytes.len() / 2, "{refused} of {}", bytes.len());
    for length in (0..bytes.len()).step_by(97) {
        fs::write(&path, &bytes[..length]).unwrap();
        assert!(Checkpoint::read(&path).is_err(), "{length} bytes");
    }
}

#[test]
fn impossible_numbers_are_refused() {
    let folder = Folder::new();
    let path = folder.path().join("room.checkpoint.exr");
    let refuse = |checkpoint: &Checkpoint, text: &str| {
        checkpoint.write(&path).unwrap();
        assert_error(Checkpoint::read(&path), &[text]);
    };
    let good = checkpoint();
    for seconds in [f64::NAN, f64::INFINITY, -1.0, 1e12] {
        let metadata = Metadata { seconds, ..good.metadata.clone() };
        refuse(&Checkpoint { metadata, ..good.clone() }, "fenestra.seconds: expected 0 to");
    }
    let with = |sample_ranges: Vec<SampleRange>| {
        let metadata = Metadata { sample_ranges, ..good.metadata.clone() };
        Checkpoint { metadata, ..good.clone() }
    };
    let range = |first: u32, count: u32| SampleRange { seed: 1, first, count };
    refuse(&with(vec![range(u32::MAX, 2)]), "1:4294967295+2 passes the last sample of a seed");
    refuse(&with(vec![range(0, 4), range(3, 3)]), "1:0+4 and 1:3+3 share samples");
    refuse(&with(vec![]), "0 samples per pixel");
    for layer in ["compensation", "albedo"] {
        let mut damaged = good.clone();
        let sums = &mut damaged.sums;
        sums.albedo = vec![[0.5; 3]; 8];
        let values = if layer == "albedo" { &mut sums.albedo } else { &mut sums.compensation };
        values[3][1] = f32::INFINITY;
        refuse(&damaged, "1 pixels with sums that are not finite");
    }
    good.write(&path).unwrap();
    let mut image = Image::read_exr(&path).unwrap();
    image.channels.get_mut("ShadowRays.Traced").unwrap()[2] = -1.0;
    assert_error(Checkpoint::from_image(&image, &path), &["expected a count, found -1"]);

    // All samples of a seed are 2³², one more than a count holds.
    let half = |first: u32, count: u32| {
        let mut half = with(vec![range(first, count)]);
        half.sums.sample_count = count;
        half
    };
    let (first, second) = (half(0, 1 << 31), half(1 << 31, 1 << 31));
    let parts = [(Path::new("a"), &first), (Path::new("b"), &second)];
    assert_error(merge_checkpoints(&parts), &["exceed 4294967295"]);
    let mut joined = first.metadata.clone();
    joined.add_ranges(&second.metadata);
    assert_eq!(joined.sample_count(), 1 << 32);
}

#[test]
fn a_render_ends_at_the_last_sample_of_its_seed() {
    let folder = folder();
    let options = ["render", "scene.toml", "-o", "out.exr", "--time=20s"];
    folder
        .run(&[&options[..], &["--sample-offset=4294967230"]].concat())
        .assert(0, &["stopped at the last sample of the seed"]);
    let image = folder.image("out.exr");
    let ranges = Attribute::Text("0:4294967230+65".to_owned());
    assert_eq!(image.attributes["fenestra.sample_ranges"], ranges);
}

#[test]
fn an_infinite_error_is_refused() {
    let options = ["render", "scene.toml", "-o", "out.exr", "--error=inf"];
    folder().run(&options).assert(2, &["--error inf", "expected a finite number"]);
}

#[test]
fn a_guide_may_name_its_environment_in_any_script() {
    use fenestra::sampler::guided::GuideState;
    let folder = folder();
    folder.run(&[&GUIDED[..], &["--spp=1", "--save-guide=a.guide"]].concat()).assert(0, &[]);
    let path = folder.path().join("a.guide");
    let mut state = GuideState::from_bytes(&fs::read(&path).unwrap(), &path).unwrap();
    state.origin.environment = "дом с окнами на юг".to_owned();
    fs::write(&path, state.to_bytes().unwrap()).unwrap();
    folder
        .run(&[&GUIDED[..], &["--spp=1", "--load-guide=a.guide"]].concat())
        .assert(2, &["the guide belongs to another environment: map дом с окнами"]);
}

/// A folder lies where the checkpoint should go.
#[test]
fn a_failing_checkpoint_does_not_cost_the_image() {
    let folder = folder();
    fs::create_dir(folder.path().join("out.checkpoint.exr")).unwrap();
    for sampler in ["mis", "guided"] {
        let options = format!(
            "render scene.toml --sampler={sampler} --spp=20 --checkpoint-interval=1ms --png \
             --stats=stats.json -o out.exr"
        );
        let run = folder.run(&command::words(&options));
        run.assert(1, &["out.checkpoint.exr: cannot write", "the next checkpoint tries again"]);
        assert!(run.messages.contains("wrote out.exr, out.png, stats.json"), "{}", run.messages);
        let image = folder.image("out.exr");
        assert_eq!(image.attributes["samplesPerPixel"], Attribute::Integer(20));
        fs::remove_file(folder.path().join("out.exr")).unwrap();
    }
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

#[test]
fn hangups_and_terminations_are_interrupts() {
    for signal in ["HUP", "TERM"] {
        let folder = folder();
        let options = ["render", "scene.toml", "--spp=100000000", "-o", "out.exr"];
        let run = Running::start(folder.path(), &options, "device: ").signal(signal);
        run.assert(130, &["interrupted", "wrote out.exr, out.checkpoint.exr"]);
        let image = folder.image("out.exr");
        assert!(image.channels["R"].iter().all(|sample| sample.is_finite()));
        Checkpoint::read(&folder.path().join("out.checkpoint.exr")).unwrap();
    }
}

#[test]
fn an_interrupt_ends_a_render_within_a_sample() {
    let folder = folder();
    // A sample takes longer than the quarter of a second that an interrupt leaves it.
    let [size, rays] = if support::is_software() {
        ["--size=640x480", "--shadow-rays=64"]
    } else {
        ["--size=3840x2160", "--shadow-rays=1024"]
    };
    let options = ["render", "scene.toml", "--sampler=mis", rays, size];
    let options = [&options[..], &["--spp=1000", "-o", "out.exr"]].concat();
    let run = Running::start(folder.path(), &options, "device: ").signal("TERM");
    run.assert(130, &["interrupted", "wrote out.exr, out.checkpoint.exr"]);
    let image = folder.image("out.exr");
    assert!(
        image.channels["R"].iter().all(|value| value.is_finite()) && image.channels["R"][0] > 0.0
    );
    assert!(image.attributes.contains_key("fenestra.ahead"), "{:?}", image.attributes);
    folder
        .run(&["merge", "out.checkpoint.exr", "-o", "merged.exr"])
        .assert(1, &["it was interrupted within a sample of the film"]);
}

#[test]
fn a_checkpoint_that_nobody_asked_for_goes_with_the_end() {
    let folder = folder();
    let run = |options: &[&str], written: &str| {
        let options =
            [&["render", "scene.toml", "-o", "out.exr", "--spp=100000000"], options].concat();
        let run = Running::start(folder.path(), &options, "device: ").signal("TERM");
        run.assert(130, &["interrupted", written]);
    };
    run(&["--no-checkpoint"], "wrote out.exr\n");
    assert_eq!(folder.files(), ["out.exr", "scene.toml"]);
    run(&[], "wrote out.exr, out.checkpoint.exr\n");
    let done = ["render", "scene.toml", "-o", "out.exr", "--resume", "--spp=1"];
    folder.run(&[&done[..], &["--checkpoint-interval=1h"]].concat()).assert(0, &[]);
    assert_eq!(folder.files().len(), 4, "asked for: {:?}", folder.files());
    folder.run(&done).assert(0, &["stopped by --spp"]);
    assert_eq!(folder.files(), ["out.exr", "scene.toml"]);
}

/// Standard errors that take no message: a full disk, and a pipe and a terminal that are closed.
fn dead_ends() -> [(&'static str, Stdio); 3] {
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let (_, pipe) = std::io::pipe().unwrap();
    let terminal = nix::pty::openpty(None, None).unwrap().slave;
    [("full disk", full.into()), ("closed pipe", pipe.into()), ("closed terminal", terminal.into())]
}

#[test]
fn messages_that_cannot_be_written_cost_nothing() {
    let folder = folder();
    let output = folder.path().join("out.exr");
    let run = |arguments: &[&str], messages: Stdio| {
        program(folder.path()).args(arguments).stderr(messages).status().unwrap().code()
    };
    for (name, messages) in dead_ends() {
        let status = run(&["render", "scene.toml", "--spp=2", "-o", "out.exr"], messages);
        assert_eq!((status, output.exists()), (Some(0), true), "{name}");
        fs::remove_file(&output).unwrap();
    }
    for command in ["bench", "compare", "convert", "export", "info", "merge", "study", "view"] {
        for (name, messages) in dead_ends() {
            let status = run(&[command, "missing.exr", "other.exr"], messages);
            assert!(matches!(status, Some(1 | 2)), "{command}, {name}: {status:?}");
        }
    }
}

#[test]
fn a_hangup_whose_message_cannot_be_written_keeps_the_picture() {
    for (name, messages) in dead_ends() {
        let folder = folder();
        let options = ["--spp=100000000", "--checkpoint-interval=1s", "-o", "out.exr"];
        let mut render = program(folder.path());
        render.args(["render", "scene.toml"]).args(options).stderr(messages);
        let mut child = render.spawn().unwrap();
        let start = Instant::now();
        while !folder.path().join("out.checkpoint.exr").exists() {
            assert!(start.elapsed().as_secs() < 120, "{name}: no checkpoint");
            thread::sleep(Duration::from_millis(20));
        }
        command::send("TERM", child.id());
        assert_eq!(child.wait().unwrap().code(), Some(130), "{name}");
        assert!(folder.path().join("out.exr").exists(), "{name}");
    }
}

#[test]
fn names_do_not_steer_the_terminal() {
    let folder = folder();
    let text = fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let steering = text.replace("material = \"clay\"", "material = \"\\u001b[2J\\u009b31m\"");
    assert_ne!(steering, text);
    folder.write("scene.toml", &steering);
    let run = folder.run(&["info", "scene.toml"]);
    run.assert(1, &["\\u001b[2J\\u009b31m"]);
    assert!(!run.messages.contains(['\u{1b}', '\u{9b}']), "{:?}", run.messages);
    let run = folder.run(&["info", "room\nerror: no disk.exr"]);
    run.assert(1, &["error: room\n"]);
    assert!(!run.messages.contains("\nerror: no disk"), "{:?}", run.messages);
}

/// Runs the program through the shell, after `before`.
fn run_after(folder: &Folder, before: &str, arguments: &str) -> Run {
    let program = env!("CARGO_BIN_EXE_fenestra");
    let line = format!("{before}; exec {program} {arguments}");
    let mut shell = Command::new("sh");
    command::prepare(&mut shell, folder.path());
    shell.args(["-c", &line]);
    Run::of(&shell.output().unwrap())
}

#[test]
fn an_ignored_hangup_stays_ignored() {
    let folder = folder();
    // The program's own id is that of the shell.
    let before = "trap '' HUP; (sleep 1; kill -HUP $$) & true";
    run_after(&folder, before, "render scene.toml --time 3s -o out.exr").assert(0, &["wrote out"]);
}

#[test]
fn a_limit_of_file_sizes_is_an_error_and_no_signal() {
    let folder = folder();
    folder.run(&["render", "scene.toml", "--spp=1", "-o", "out.exr"]).assert(0, &[]);
    // Blocks of 512 bytes. Drivers need not survive such a limit, so none is loaded.
    let run = run_after(&folder, "ulimit -f 1", "convert out.exr copy.exr");
    run.assert(1, &["copy.exr: cannot write: File too large"]);
    assert!(!folder.path().join("copy.exr").exists());
    assert!(folder.files().iter().all(|name| !name.ends_with(".tmp")), "{:?}", folder.files());
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_files_is_named_before_the_work() {
    let run = folder().run(&["render", "scene.toml", "-o", "/proc/out.exr"]);
    run.assert(1, &["error: /proc/out.exr: cannot write"]);
    assert!(!run.messages.contains("device: "), "{}", run.messages);
}

/// Three processes at once find no pipelines, then one finds damaged ones. Fits have tests of their own.
#[test]
fn shared_and_damaged_pipelines_change_no_picture() {
    let folder = folder();
    let cache = folder.path().join("cache");
    let names = ["a.exr", "b.exr", "c.exr"];
    let start = |name: &&str| {
        let mut command = program(folder.path());
        command.env("XDG_CACHE_HOME", &cache);
        command.args(["render", "scene.toml", "-q", "--spp=2", "--sampler=cosine", "-o", name]);
        command.stderr(Stdio::piped()).spawn().unwrap()
    };
    let end = |child: process::Child| Run::of(&child.wait_with_output().unwrap()).assert(0, &[]);
    let running: Vec<_> = names.iter().map(start).collect();
    running.into_iter().for_each(end);
    let picture = channels(&folder, "a.exr");
    assert!(names.iter().all(|name| channels(&folder, name) == picture));
    let files = || {
        let entries = fs::read_dir(cache.join("fenestra/pipelines")).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect::<Vec<_>>()
    };
    let whole: Vec<_> = files().into_iter().map(|path| (fs::read(&path).unwrap(), path)).collect();
    assert_eq!(whole.len(), 1);
    for (bytes, path) in &whole {
        let mut damaged = bytes.clone();
        let middle = damaged.len() / 2;
        damaged[middle] ^= 0x10;
        fs::write(path, &damaged).unwrap();
    }
    end(start(&"d.exr"));
    assert!(channels(&folder, "d.exr") == picture);
    for (bytes, path) in &whole {
        let anew = fs::read(path).unwrap();
        let mut damaged = bytes.clone();
        damaged[bytes.len() / 2] ^= 0x10;
        assert!(anew != damaged, "{} is written anew", path.display());
        // Drivers of GPUs fill their cache as they please.
        assert!(anew.len() == bytes.len() || !support::is_software(), "{}", path.display());
    }
}
