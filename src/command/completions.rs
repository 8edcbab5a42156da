//! `fenestra completions` and `fenestra manual`: what shells and `man` read, made of the command line.

use std::path::PathBuf;

use crate::error::{Error, Result};

/// Arguments of `completions`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Shell that reads the script.
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}

/// Arguments of `manual`.
#[derive(Debug, clap::Args)]
pub struct ManualArguments {
    /// Folder for the pages, such as ~/.local/share/man/man1.
    pub folder: PathBuf,
}

/// Prints the script that completes commands and options.
///
/// # Errors
/// Standard output cannot be written.
pub fn run(arguments: &Arguments, mut command: clap::Command) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "fenestra", &mut script);
    super::print_line(String::from_utf8_lossy(&script).trim_end())
}

/// Writes a page for the program and one for each command.
///
/// # Errors
/// A folder that cannot be made or written to.
pub fn manual(arguments: &ManualArguments, command: clap::Command) -> Result<()> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(told_in_full(command), folder))
        .map_err(|source| Error::io(folder, "write", source))
}

/// Shows the options that `-h` hides: their pages would lack the text.
fn told_in_full(command: clap::Command) -> clap::Command {
    command.mut_args(|argument| argument.hide_short_help(false)).mut_subcommands(told_in_full)
}
