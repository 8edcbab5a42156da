//! Runs the program itself, for its exit status and output.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    env,
    ffi::OsStr,
    fs,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, ChildStderr, Command, Output, Stdio},
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

use fenestra::film::Image;
use serde::de::DeserializeOwned;

pub use super::folder::{BALL, Folder, SKY, yard};

/// Prepares the program to run in `folder`; see [`prepare`].
pub fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fenestra"));
    prepare(&mut command, folder);
    command
}

/// Prepares a command that runs the program in `folder`. Its caches lie in the build folder, so that the
/// user's own stay untouched; lavapipe's is that of the tests' own devices, wherever the others are put, so
/// that each pipeline is compiled once.
pub fn prepare(command: &mut Command, folder: &Path) {
    command.current_dir(folder).env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    command.env_remove("RUST_LOG");
    let cache = env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    let home = || env::var_os("HOME").map(|home| PathBuf::from(home).join(".cache"));
    if let (None, Some(cache)) = (env::var_os("MESA_SHADER_CACHE_DIR"), cache.or_else(home)) {
        command.env("MESA_SHADER_CACHE_DIR", cache);
    }
}

/// Result of a run of the program.
pub struct Run {
    /// Exit status, absent after a signal.
    pub status: Option<i32>,
    /// Standard output.
    pub output: String,
    /// Standard error.
    pub messages: String,
}

impl Run {
    pub fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("output is UTF-8");
        Self {
            status: output.status.code(),
            output: text(&output.stdout),
            messages: text(&output.stderr),
        }
    }

    /// Fails unless the run succeeded and its output contains every part of `parts`.
    #[track_caller]
    pub fn assert_output(&self, parts: &[&str]) {
        self.assert(0, &[]);
        assert_parts(&self.output, parts);
    }

    /// Fails unless the exit status is `status` and the messages contain every part of `parts`.
    #[track_caller]
    pub fn assert(&self, status: i32, parts: &[&str]) {
        let messages = &self.messages;
        assert_eq!(self.status, Some(status), "exit status; messages:\n{messages}");
        assert_parts(messages, parts);
        assert!(!messages.contains("panicked"), "bad input is no reason to panic:\n{messages}");
    }
}

/// A run that is under way.
pub struct Running {
    child: Child,
    messages: BufReader<ChildStderr>,
}

impl Running {
    /// Starts the program in `folder` and waits for a message with this text. The program heeds
    /// signals also where the tests run under `nohup`, whose children ignore hangups.
    pub fn start(folder: &Path, arguments: &[&str], text: &str) -> Self {
        Self::start_with(None, folder, arguments, text)
    }

    /// As [`Running::start`], with a variable of the environment.
    pub fn start_with(
        variable: Option<(&str, &Path)>,
        folder: &Path,
        arguments: &[&str],
        text: &str,
    ) -> Self {
        let mut heeding = Command::new("env");
        heeding.args(["--default-signal=HUP,INT,TERM", env!("CARGO_BIN_EXE_fenestra")]);
        prepare(&mut heeding, folder);
        heeding.envs(variable);
        let mut child =
            heeding.args(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut messages = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains(text) {
            line.clear();
            assert_ne!(messages.read_line(&mut line).unwrap(), 0, "ended before {text:?}");
        }
        Self { child, messages }
    }

    /// Interrupts the run as Ctrl-C does and waits for its end, two minutes at most.
    pub fn interrupt(self) -> Run {
        self.signal("INT")
    }

    /// Sends a signal and waits for the end of the run, two minutes at most.
    pub fn signal(self, name: &str) -> Run {
        const LONGEST: Duration = Duration::from_secs(120);
        let Self { mut child, mut messages } = self;
        let rest = thread::spawn(move || {
            let mut text = String::new();
            messages.read_to_string(&mut text).map(|_| text)
        });
        send(name, child.id());
        let status = end_of(&mut child, LONGEST);
        let messages = rest.join().unwrap().unwrap();
        Run { status, output: String::new(), messages }
    }
}

/// Waits for the end of a process, which is killed after `longest`, and returns its exit status.
pub fn end_of(child: &mut Child, longest: Duration) -> Option<i32> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        if start.elapsed() > longest {
            child.kill().unwrap();
        }
        thread::sleep(Duration::from_millis(20));
    }
}

/// Sends a signal by the shell's own `kill`: the program of that name is not on every system.
pub fn send(signal: &str, process: u32) {
    let kill = format!("kill -{signal} {process}");
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
}

/// Material of a [`yard`].
pub const CLAY: &str = "type = \"diffuse\"\nreflectance = [0.6, 0.4, 0.3]";

/// Object of a [`yard`]: a ball under a roof that hides most of the sky, else `guided` learns nothing.
pub fn roofed_ball() -> String {
    let roof = "shape = \"box\"\nsize = [4.0, 0.1, 4.0]\ntranslate = [0.0, 1.2, 0.0]";
    format!("{BALL}\nmaterial = \"clay\"\n\n[[object]]\n{roof}")
}

/// Arguments of a line without quotes.
pub fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Encodes a PFM map of these texels.
pub fn pfm([width, height]: [usize; 2], texels: &[[f32; 3]]) -> Vec<u8> {
    let values = texels.as_flattened().iter().flat_map(|value| value.to_le_bytes());
    format!("PF\n{width} {height}\n-1.0\n").into_bytes().into_iter().chain(values).collect()
}

/// Fails unless `text` holds every part of `parts`.
#[track_caller]
pub fn assert_parts(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "expected {part:?} in:\n{text}");
    }
}

impl Folder {
    /// Makes a folder with `scene.toml`, an object of clay under the sky.
    pub fn with_yard(size: [u32; 2], object: &str) -> Self {
        let folder = Self::new();
        folder.write("scene.toml", yard(size, SKY, CLAY, object));
        folder
    }

    /// Writes an image of one colour.
    pub fn write_image(&self, name: &str, [width, height]: [u32; 2], colour: [f32; 3]) {
        let mut image = Image::new(width, height);
        image.insert_triple(["R", "G", "B"], &vec![colour; image.pixel_count()]);
        image.write_exr(&self.path().join(name)).unwrap();
    }

    /// Reads an image of this folder.
    #[track_caller]
    pub fn image(&self, name: impl AsRef<Path>) -> Image {
        Image::read_exr(&self.path().join(name)).unwrap()
    }

    /// Reads a JSON file of this folder.
    #[track_caller]
    pub fn json<T: DeserializeOwned>(&self, name: &str) -> T {
        serde_json::from_slice(&fs::read(self.path().join(name)).unwrap()).unwrap()
    }

    /// Runs the program in this folder.
    ///
    /// # Panics
    /// If it has not ended after ten minutes.
    #[track_caller]
    pub fn run(&self, arguments: &[impl AsRef<OsStr>]) -> Run {
        const LONGEST: Duration = Duration::from_secs(600);
        let mut command = program(self.path());
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().expect("the program starts");
        let id = child.id();
        let (sender, ended) = mpsc::channel();
        thread::spawn(move || sender.send(child.wait_with_output()));
        let Ok(output) = ended.recv_timeout(LONGEST) else {
            send("KILL", id);
            panic!("{command:?} has not ended");
        };
        Run::of(&output.expect("the output can be read"))
    }
}
