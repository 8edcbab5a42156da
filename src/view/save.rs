//! Files that the window writes: its picture, the film, and the camera.

use std::path::PathBuf;

use crate::{
    error::Result,
    files::write_text,
    film::{Image, picture::write_png},
    scene::Camera,
};

/// Number of written views that the window offers.
const MOST_VIEWS: u32 = 99;

/// Returns a camera as a scene file without anything else.
pub(super) fn camera_toml(camera: &Camera) -> String {
    // Shortest decimals that read back as the same numbers.
    let vector = |value: glam::Vec3| format!("[{:?}, {:?}, {:?}]", value.x, value.y, value.z);
    let mut text = format!(
        "[camera]\nposition = {}\nlook_at = {}\nup = {}\nvertical_fov_deg = {:?}\n",
        vector(camera.position),
        vector(camera.look_at),
        vector(camera.up),
        camera.vertical_fov_deg
    );
    if camera.shift != [0.0; 2] {
        text += &format!("shift = {:?}\n", camera.shift);
    }
    if camera.mirrored {
        text += "mirrored = true\n";
    }
    if camera.aperture_radius > 0.0 {
        let (radius, distance) = (camera.aperture_radius, camera.focus_distance);
        text += &format!("aperture_radius = {radius:?}\nfocus_distance = {distance:?}\n");
    }
    text
}

/// Names of the files of one press of the key, in the working folder: `NAME.view-1.png`, `.exr` and `.toml`,
/// with the first number that none of them has.
pub(super) fn names(scene: &str) -> [PathBuf; 3] {
    let of = |number: u32| {
        ["png", "exr", "toml"].map(|kind| format!("{scene}.view-{number}.{kind}").into())
    };
    let is_free = |number: &u32| of(*number).iter().all(|path: &PathBuf| !path.exists());
    of((1..u32::MAX).find(is_free).unwrap_or(u32::MAX))
}

/// Returns the files of cameras that the window of a scene has written, by number.
pub(super) fn views(scene: &str) -> Vec<PathBuf> {
    let of = |number: u32| PathBuf::from(format!("{scene}.view-{number}.toml"));
    (1..=MOST_VIEWS).map(of).filter(|file| file.exists()).collect()
}

/// Writes width and pixels of the window, the film to the left with its metadata, and the camera. Fails with
/// [`crate::Error::Io`] and the cause.
pub(super) fn write(
    [png, exr, toml]: &[PathBuf; 3],
    (width, pixels): (u32, &[[u8; 3]]),
    film: &Image,
    camera: &Camera,
) -> Result<()> {
    write_png(png, width, pixels)?;
    film.write_exr(exr)?;
    write_text(toml, &camera_toml(camera))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::Scene;

    #[test]
    fn cameras_come_back_from_their_files() {
        let text = "[camera]\nposition = [0.1, 2, 5]\nlook_at = [0.7, 1, 0]\nup = [0.1, 1, 0]\n\
                    vertical_fov_deg = 33.3\nfocus_distance = 3.25\n";
        for more in ["", "shift = [0, 0.3]\n", "mirrored = true\n", "aperture_radius = 0.01\n"] {
            let read = |text: &str| Scene::parse(Path::new("a.toml"), text).unwrap().camera;
            let camera = read(&(text.to_owned() + more));
            let again = read(&camera_toml(&camera));
            // Without a lens nothing is out of focus.
            let focus_distance = again.focus_distance;
            let expected =
                if more.starts_with('a') { camera } else { Camera { focus_distance, ..camera } };
            assert_eq!(again, expected, "{more}");
        }
    }
}
