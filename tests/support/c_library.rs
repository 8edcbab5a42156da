//! Libraries in C that make a device or a disk fail.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

/// Compiles `tests/support/<name>.c`, with the compiler that links Rust programs, and returns the
/// library, in a folder of its own.
pub fn compile(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&folder).unwrap();
    let library = folder.join(format!("lib{name}.so"));
    let source = format!("{}/tests/support/{name}.c", env!("CARGO_MANIFEST_DIR"));
    let mut compiler = Command::new("cc");
    compiler.args(["-O1", "-shared", "-fPIC", &source, "-o"]).arg(&library).arg("-ldl");
    assert!(compiler.status().expect("a C compiler").success());
    library
}

/// Puts `faulty_files.c` under a program: its files in `folder` fail by the variable `fault`.
pub fn fail_in(command: &mut Command, folder: &Path, fault: (&str, u64)) {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    let library = LIBRARY.get_or_init(|| compile("faulty_files"));
    command.env("LD_PRELOAD", library).env(fault.0, fault.1.to_string());
    command.env("FAULTY_FOLDER", folder.canonicalize().unwrap());
}
