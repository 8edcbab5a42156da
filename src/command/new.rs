//! `fenestra new`: writes a first scene.

use std::{fs, io, path::PathBuf};

use crate::{
    error::{Error, Result},
    files,
};

/// Scene that is written, with comments for whoever edits it.
const FIRST_SCENE: &str = include_str!("first_scene.toml");

/// Arguments of `new`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder for the scene; must be empty or not exist.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// Writes `scene.toml` into the folder and prints the command that renders it.
///
/// # Errors
/// A folder that is not empty, or that cannot be written.
pub fn run(arguments: &Arguments) -> Result<()> {
    let folder = &arguments.folder;
    let is_empty = match fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(source) if source.kind() == io::ErrorKind::NotFound => true,
        Err(source) => return Err(Error::io(folder, "read", source)),
    };
    if !is_empty {
        return Err(Error::usage(format!(
            "{}: the folder is not empty; expected a new or an empty one",
            folder.display()
        )));
    }
    let scene = folder.join("scene.toml");
    files::write_text(&scene, FIRST_SCENE)?;
    super::print_line(&format!("fenestra render {} --quick --png", scene.display()))
}
