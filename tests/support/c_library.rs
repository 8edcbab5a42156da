//! Libraries in C that make a device or a disk fail.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

/// Compiles `tests/support/<name>.c` and returns the library, in a folder of its own.
pub fn compile(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let library = folder.join(format!("lib{name}.so"));
    compile_to(&library, name, &["-ldl"]);
    library
}

/// Compiles `tests/support/<name>.c` with the compiler that links Rust programs.
pub fn compile_to(library: &Path, name: &str, options: &[&str]) {
    fs::create_dir_all(library.parent().unwrap()).unwrap();
    let source = format!("{}/tests/support/{name}.c", env!("CARGO_MANIFEST_DIR"));
    let mut compiler = Command::new("cc");
    compiler.args(["-O1", "-shared", "-fPIC", &source, "-o"]).arg(library).args(options);
    assert!(compiler.status().expect("setup installs a C compiler").success());
}

/// Puts `faulty_files.c` under a program: its files in `folder` fail by the variable `fault`.
pub fn fail_in(command: &mut Command, folder: &Path, fault: (&str, u64)) {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    let library = LIBRARY.get_or_init(|| compile("faulty_files"));
    command.env("LD_PRELOAD", library).env(fault.0, fault.1.to_string());
    command.env("FAULTY_FOLDER", folder.canonicalize().unwrap());
}
