//! Files that the window writes: its picture, the film, and the camera.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use crate::{
    error::Result,
    files::write_text,
    film::{Image, png::write_rgb8},
    scene::Camera,
};

/// Returns a camera as the table of a scene file.
pub(crate) fn camera_toml(camera: &Camera) -> String {
    // Shortest decimals that read back as the same numbers.
    let vector = |value: glam::Vec3| format!("[{:?}, {:?}, {:?}]", value.x, value.y, value.z);
    let mut text = format!(
        "[camera]\nposition = {}\nlook_at = {}\nup = {}\nvertical_fov_deg = {:?}\n",
        vector(camera.position),
        vector(camera.look_at),
        vector(camera.up),
        camera.vertical_fov_deg
    );
    if camera.aperture_radius > 0.0 {
        let (radius, distance) = (camera.aperture_radius, camera.focus_distance);
        let _ = write!(text, "aperture_radius = {radius:?}\nfocus_distance = {distance:?}\n");
    }
    text
}

/// Names of the files of one press of the key: `NAME.view-1.png`, `.exr` and `.toml`, with the first number
/// that none of them has.
pub(super) fn names(folder: &Path, scene: &str) -> [PathBuf; 3] {
    let of = |number: u32| {
        ["png", "exr", "toml"].map(|kind| folder.join(format!("{scene}.view-{number}.{kind}")))
    };
    let is_free = |number: &u32| of(*number).iter().all(|path| !path.exists());
    of((1..u32::MAX).find(is_free).unwrap_or(u32::MAX))
}

/// Content of the three files.
pub(crate) struct Saved<'a> {
    /// Width and height of the window, pixels.
    pub size: [u32; 2],
    /// Pixels of the window.
    pub pixels: &'a [[u8; 3]],
    /// The film to the left, with its metadata.
    pub film: &'a Image,
    /// The camera.
    pub camera: &'a Camera,
}

impl Saved<'_> {
    /// Writes the files.
    ///
    /// # Errors
    /// [`crate::Error::Io`] with the cause.
    pub(crate) fn write(&self, [png, exr, toml]: &[PathBuf; 3]) -> Result<()> {
        write_rgb8(png, self.size[0], self.size[1], self.pixels)?;
        self.film.write_exr(exr)?;
        write_text(toml, &camera_toml(self.camera))
    }
}
