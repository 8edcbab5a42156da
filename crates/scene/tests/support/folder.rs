//! Temporary folders, and a scene to vary.
#![allow(dead_code, reason = "two test programs use a part each")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{
    fs,
    path::{Path, PathBuf},
};

use tempfile::TempDir;

/// Formats a scene file: `object` stands on a floor, both of the material `clay`, before a camera
/// 3 m away. `clay`, `object` and `environment` are the keys of their tables.
pub fn yard([width, height]: [u32; 2], environment: &str, clay: &str, object: &str) -> String {
    format!(
        r#"
[camera]
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.3, 0.0]
vertical_fov_deg = 45.0

[film]
width = {width}
height = {height}

[environment]
{environment}

[[material]]
name = "clay"
{clay}

[[object]]
shape = "box"
size = [4.0, 0.2, 4.0]
material = "clay"
translate = [0.0, -0.1, 0.0]

[[object]]
{object}
material = "clay"
"#
    )
}

/// Object of a [`yard`]: a ball of 1 m on the floor.
pub const BALL: &str = "shape = \"sphere\"\nradius = 0.5\ntranslate = [0.0, 0.5, 0.0]";

/// Environment of a [`yard`]: a sky in a map so small that a process makes it in no time.
pub const SKY: &str = "sky = { width = 64 }";

/// A temporary folder for one test.
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
        fs::create_dir_all(path.parent().unwrap()).expect("the temporary folder can be written");
        fs::write(&path, content).expect("the temporary folder can be written");
        path
    }

    /// Returns the sorted names of the files in this folder.
    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.path())
            .expect("the temporary folder can be read")
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}
