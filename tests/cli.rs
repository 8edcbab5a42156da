//! The command line: help, exit statuses, and the messages of the commands that need no scene.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{fs, process::Stdio};

use crate::support::{
    command::{BALL, Folder, Run, program},
    is_software,
};

/// Makes a folder with `a.exr` and `b.exr` of values 1 and 1.1, and `wide.exr` of another size.
fn images() -> Folder {
    let folder = Folder::new();
    folder.write_image("a.exr", [8, 8], [1.0; 3]);
    folder.write_image("b.exr", [8, 8], [1.1; 3]);
    folder.write_image("wide.exr", [16, 8], [1.0; 3]);
    folder
}

/// Returns the commands that `--help` lists.
fn commands(folder: &Folder) -> Vec<String> {
    let help = folder.run(&["--help"]).output;
    let (_, list) = help.split_once("Commands:\n").expect("help lists the commands");
    list.lines()
        .take_while(|line| !line.is_empty())
        // Skip continuation lines of descriptions, which are indented further.
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_command_has_help() {
    let folder = Folder::new();
    let commands = commands(&folder);
    for expected in ["render", "study", "compare", "merge", "info", "devices"] {
        assert!(commands.iter().any(|command| command == expected), "{expected}: {commands:?}");
    }
    for name in commands.iter().filter(|name| *name != "help") {
        let help = folder.run(&[name.as_str(), "--help"]);
        assert_eq!(help.status, Some(0), "{name} --help: {}", help.messages);
        assert!(help.output.contains(&format!("Usage: fenestra {name}")), "{}", help.output);
    }
    assert_eq!(folder.files(), [""; 0], "help writes nothing");
}

#[test]
fn help_is_short_or_in_groups() {
    let folder = Folder::new();
    let [short, long] = ["-h", "--help"].map(|option| folder.run(&["render", option]).output);
    let groups = ["Scene:", "Camera:", "Sampling:", "Stopping:", "Output:", "Files:", "Machine:"];
    let places = groups.map(|group| long.find(&format!("\n{group}\n")).expect(group));
    assert!(places.is_sorted(), "{places:?}");
    let [short, long] = [short, long].map(|help| help.lines().count());
    assert!(short < 60 && 2 * short < long, "{short} and {long} lines");
    // No scene is needed to ask for the parameters.
    for arguments in [&["render", "--set", "help"][..], &["study", "--set=help"]] {
        let run = folder.run(arguments);
        assert_eq!(run.status, Some(0), "{}", run.messages);
        assert!(run.output.contains("\n  regions=16 to 1024; default 1024\n"), "{}", run.output);
    }
}

#[test]
fn shells_and_man_are_served() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish"] {
        let run = folder.run(&["completions", shell]);
        assert_eq!(run.status, Some(0), "{}", run.messages);
        assert!(run.output.contains("quality"), "{shell}");
    }
    folder.run(&["manual", "pages/man1"]).assert(0, &[]);
    let page = folder.path().join("pages/man1/fenestra-render.1");
    let page = fs::read_to_string(page).unwrap();
    // A group, and the text of an option that `-h` hides.
    assert!(page.contains("STOPPING") && page.contains("to render disjoint parts for"), "{page}");
    assert!(!folder.path().join("pages/man1/fenestra-self-test.1").exists(), "it is hidden");
}

#[test]
fn version_is_that_of_the_package() {
    let version = Folder::new().run(&["--version"]);
    assert_eq!(version.status, Some(0));
    assert_eq!(version.output.trim(), concat!("fenestra ", env!("CARGO_PKG_VERSION")));
}

#[test]
fn wrong_usage_exits_with_2() {
    let folder = images();
    let cases: &[(&[&str], &str)] = &[
        (&[], "Usage: fenestra"),
        (&["paint"], "unrecognized subcommand 'paint'"),
        (&["compare"], "required arguments were not provided"),
        (&["compare", "a.exr", "b.exr", "--colour"], "unexpected argument '--colour'"),
        (&["compare", "a.exr", "b.exr", "--fail-above", "relmse"], "expected METRIC=VALUE"),
        (&["compare", "a.exr", "b.exr", "--fail-above", "beauty=1"], "known metrics: "),
        (&["compare", "a.exr", "b.exr", "--fail-above", "mse=low"], "expected a finite number"),
        (
            &["compare", "a.exr", "b.exr", "--heatmap", "h.png", "--heatmap-high", "0"],
            "--heatmap-high 0: expected a positive number",
        ),
        (&["merge", "a.exr"], "--output <OUT.exr>"),
    ];
    for (arguments, message) in cases {
        folder.run(arguments).assert(2, &[message]);
    }
}

#[test]
fn a_missing_file_is_named() {
    let folder = images();
    for arguments in [
        &["compare", "a.exr", "absent.exr"][..],
        &["merge", "absent.exr", "--output=out.exr"],
        &["info", "absent.exr"],
    ] {
        let parts = ["error: absent.exr: cannot read: No such file"];
        folder.run(arguments).assert(1, &parts);
    }
    assert_eq!(folder.files(), ["a.exr", "b.exr", "wide.exr"], "nothing is written");
}

#[test]
fn a_truncated_or_foreign_image_is_named() {
    let folder = images();
    let bytes = fs::read(folder.path().join("a.exr")).unwrap();
    for length in [0, 3, bytes.len() / 2, bytes.len() - 1] {
        folder.write("short.exr", &bytes[..length]);
        let run = folder.run(&["compare", "short.exr", "b.exr"]);
        run.assert(1, &["error: short.exr: not a complete OpenEXR file"]);
    }
    folder.write("text.exr", "not an image, but long enough to hold the start of one");
    folder.run(&["compare", "a.exr", "text.exr"]).assert(1, &["text.exr: not a complete OpenEXR"]);
    folder.run(&["merge", "text.exr", "-o", "out.exr"]).assert(1, &["text.exr: not a complete"]);
}

#[test]
fn images_of_different_size_are_not_compared() {
    let parts = ["8x8 pixels at 0,0", "16x8 pixels at 0,0", "render both with one --size"];
    images().run(&["compare", "a.exr", "wide.exr"]).assert(1, &parts);
}

#[test]
fn comparison_prints_the_metrics_and_fails_over_a_threshold() {
    let folder = images();
    let run = folder.run(&["compare", "b.exr", "a.exr", "--json", "--fail-above", "mse=0.02"]);
    run.assert(0, &[]);
    let metrics: serde_json::Value = serde_json::from_str(&run.output).expect("JSON");
    let mse = metrics["mse"].as_f64().expect("mse is a number");
    assert!((mse - 0.01).abs() < 1e-6, "the squared error of 1.1 against 1 is 0.01, found {mse}");
    let run = folder.run(&["compare", "b.exr", "a.exr", "--fail-above", "mse=0.009"]);
    run.assert(3, &["error: mse is ", "above the threshold 0.009"]);
    let below = |value: &str| folder.run(&["compare", "b.exr", "a.exr", "--fail-below", value]);
    below("mse=0.009").assert(0, &[]);
    below("mse=0.02").assert(3, &["error: mse is ", "below the threshold 0.02"]);
    // Both halves of a reference count: that which meets the image leaves no error.
    let halves = ["compare", "b.exr", "a.exr", "--second-reference", "b.exr"];
    folder.run(&[&halves[..], &["--fail-above", "mse=0"]].concat()).assert(0, &[]);
}

#[test]
fn a_heatmap_is_written_into_a_new_folder() {
    let folder = images();
    folder.run(&["compare", "b.exr", "a.exr", "--heatmap", "new/folder/heat.png"]).assert(0, &[]);
    let png = fs::read(folder.path().join("new/folder/heat.png")).unwrap();
    assert_eq!(&png[..4], b"\x89PNG");
    let map = |pictures: &[&str], high: &str| {
        let scale = ["--heatmap", "h.png", "--heatmap-high", high];
        folder.run(&[&["compare"], pictures, &scale].concat()).assert(0, &[]);
        image::open(folder.path().join("h.png")).unwrap().into_rgb8()
    };
    // Where one half of the reference is met, (x − r₁)(x − r₂) is no error, whatever the other says.
    let met = map(&["b.exr", "a.exr", "--second-reference", "b.exr"], "1");
    assert_eq!(met, map(&["b.exr", "b.exr"], "1"));
    assert_ne!(met, map(&["b.exr", "a.exr"], "1"));
    // Colours are of errors, not of their squares: ten times as far, on ten times the scale.
    folder.write_image("far.exr", [8, 8], [2.0; 3]);
    let color = |map: image::RgbImage| map.get_pixel(map.width() / 2, 0).0;
    let near = color(map(&["b.exr", "a.exr"], "0.2"));
    assert_ne!(near, color(met));
    assert_eq!(near, color(map(&["far.exr", "a.exr"], "2")));
}

#[test]
fn a_full_disk_is_reported() {
    // Every write to this device fails for lack of space.
    let run = images().run(&["compare", "b.exr", "a.exr", "--heatmap", "/dev/full"]);
    run.assert(75, &["error: /dev/full: cannot write: No space left on device"]);
}

#[test]
fn a_closed_output_is_no_failure() {
    let folder = images();
    for options in [&["compare", "b.exr", "a.exr"][..], &["devices"], &["devices", "--json"]] {
        let mut command = program(folder.path());
        command.args(options).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        drop(child.stdout.take());
        Run::of(&child.wait_with_output().unwrap()).assert(0, &[]);
    }
}

#[cfg(unix)]
#[test]
fn a_system_that_refuses_threads_leaves_one() {
    let folder = images();
    let comparing = program(folder.path());
    // Stacks of 256 MiB do not all fit into the memory allowed. What one of them would have
    // taken is left to the program, so that it has memory to go on with.
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", "ulimit -v 1000000; exec \"$@\"", "sh"]);
    shell.arg(comparing.get_program()).args(["compare", "b.exr", "a.exr"]);
    shell.current_dir(folder.path()).env("RAYON_NUM_THREADS", "64");
    shell.env("RUST_MIN_STACK", (256 << 20).to_string()).env("MALLOC_ARENA_MAX", "1");
    Run::of(&shell.output().unwrap()).assert(0, &["the system refuses more threads"]);
}

#[test]
fn devices_lists_the_choice() {
    let folder = Folder::new();
    let run = folder.run(&["devices"]);
    run.assert(0, &[]);
    assert!(run.output.contains("<- chosen"), "{}", run.output);
    let run = folder.run(&["devices", "--json"]);
    let devices: serde_json::Value = serde_json::from_str(&run.output).expect("JSON");
    let chosen = devices.as_array().unwrap().iter().filter(|device| device["chosen"] == true);
    assert_eq!(chosen.count(), 1);
    let parts = ["no Vulkan device matches --device no such device", "help: ", "fenestra devices"];
    folder.run(&["devices", "--device", "no such device"]).assert(75, &parts);
}

#[test]
fn no_driver_is_explained() {
    let folder = Folder::new();
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        let mut command = program(folder.path());
        command.arg("devices").env_remove("VK_DRIVER_FILES").env_remove("VK_ICD_FILENAMES");
        command.env(variable, "/nonexistent");
        let run = Run::of(&command.output().unwrap());
        run.assert(75, &["finds no driver", "help: ", "./setup", variable]);
    }
}

#[test]
fn a_missing_loader_is_explained() {
    let folder = Folder::new();
    // The search ends at the first file of this name, which is no library.
    folder.write("libvulkan.so.1", "");
    folder.write("libvulkan.so", "");
    let mut command = program(folder.path());
    command.arg("devices").env("LD_LIBRARY_PATH", folder.path());
    let run = Run::of(&command.output().unwrap());
    run.assert(75, &["no Vulkan loader (libvulkan.so.1)", "help: ", "./setup"]);
}

/// Fills the driver's cache by other processes, and renders from it.
#[test]
fn kernels_are_compiled_in_other_processes() {
    if !is_software() {
        return;
    }
    let folder = Folder::with_yard([64, 48], BALL);
    let cache = folder.path().join("shaders");
    let run = |arguments: &[&str]| {
        let mut command = program(folder.path());
        Run::of(&command.env("MESA_SHADER_CACHE_DIR", &cache).args(arguments).output().unwrap())
    };
    let compile = |kernels: &str| {
        run(&["compile", "0", kernels]).assert(0, &[]);
        let mut folders = vec![cache.clone()];
        let mut bytes = 0;
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
                match entry.metadata().unwrap() {
                    found if found.is_dir() => folders.push(entry.path()),
                    found => bytes += found.len(),
                }
            }
        }
        bytes
    };
    let none = compile("[]");
    let one = compile(r#"[["deposit", []]]"#);
    assert!(one > none, "{one} bytes, {none} without the kernel");
    assert_eq!(compile(r#"[["deposit", []]]"#), one);
    run(&["compile", "0", r#"[["no_pass", []]]"#]).assert(2, &["no pass is no_pass"]);

    let picture = |name: &str, messages: &[&str]| {
        run(&["render", "scene.toml", "--spp=1", "-vv", "-o", name]).assert(0, messages);
        folder.image(name).channels
    };
    // The cache lacks most kernels of the first picture, and none of the second.
    let cold = picture("cold.exr", &["processes that compile ahead: "]);
    assert_eq!(picture("warm.exr", &[]), cold);
}
