//! Running the program itself: its exit status and what it prints.
#![allow(dead_code, reason = "every test binary uses a part of this")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use tempfile::TempDir;

/// The program, to run in `folder`. Its caches lie in the build folder, so that pipelines are
/// compiled once and the user's own caches are not touched.
pub fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fenestra"));
    command.current_dir(folder).env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    command.env_remove("RUST_LOG");
    command
}

/// What a run of the program left behind.
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

    /// Fails unless the exit status is `status` and every part of `parts` is among the messages.
    #[track_caller]
    pub fn assert(&self, status: i32, parts: &[&str]) {
        let messages = &self.messages;
        assert_eq!(self.status, Some(status), "exit status; messages:\n{messages}");
        for part in parts {
            assert!(messages.contains(part), "expected {part:?} in the messages:\n{messages}");
        }
        assert!(!messages.contains("panicked"), "bad input is no reason to panic:\n{messages}");
    }
}

/// A folder of its own for one test.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(TempDir::new().expect("a temporary folder"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(name);
        fs::write(&path, content).expect("the temporary folder can be written");
        path
    }

    /// Runs the program in this folder.
    pub fn run(&self, arguments: &[impl AsRef<OsStr>]) -> Run {
        Run::of(&program(self.path()).args(arguments).output().expect("the program starts"))
    }

    /// Names of the files in this folder, sorted.
    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.path())
            .expect("the temporary folder can be read")
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}
