//! Parsers of option values that several commands share.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
    sync::Arc,
};

use super::self_test;
use crate::{
    error::{Error, Result},
    film::Window,
    gpu::{Device, Tracer},
    scene::{Scene, load::LoadOptions},
};

/// Group of options in help: the scene and what it leaves open.
pub(super) const SCENE: &str = "Scene";
/// Group: camera and film.
pub(super) const CAMERA: &str = "Camera";
/// Group: how light is sampled.
pub(super) const SAMPLING: &str = "Sampling";
/// Group: when a render ends.
pub(super) const STOPPING: &str = "Stopping";
/// Group: what is shown and written.
pub(crate) const OUTPUT: &str = "Output";
/// Group: files beside the picture.
pub(super) const FILES: &str = "Files";
/// Group: what computes.
pub(crate) const MACHINE: &str = "Machine";

/// Options of what renders.
#[derive(Clone, Debug, clap::Args)]
pub struct DeviceOptions {
    /// Device to use, by index or part of its name; see `fenestra devices`.
    #[arg(long, value_name = "INDEX|NAME", help_heading = MACHINE, hide_short_help = true)]
    pub device: Option<String>,
    /// Part of the machine that traces rays. The host traces for software devices alone, by the library
    /// Embree.
    #[arg(long, value_enum, value_name = "PART", default_value = "auto")]
    #[arg(help_heading = MACHINE, hide_short_help = true)]
    pub tracer: Tracer,
}

impl DeviceOptions {
    /// Opens the device, once it has passed the self-test. Fails as [`Device::open_traced`] and the test do.
    pub(crate) fn open(&self, validate: bool) -> Result<Arc<Device>> {
        Device::open_checked(self.device.as_deref(), validate, self.tracer, None, self_test::check)
    }

    /// Opens the device and prints it, unless `quiet`. Fails as [`DeviceOptions::open`].
    pub(crate) fn announce(&self, validate: bool, quiet: bool) -> Result<Arc<Device>> {
        let device = self.open(validate)?;
        if !quiet {
            self_test::announce(&device);
        }
        Ok(device)
    }
}

/// Options of what a scene file may leave open.
#[derive(Clone, Debug, clap::Args)]
pub struct SceneOptions {
    /// Environment map that lights the scene, instead of its own.
    #[arg(long, value_name = "MAP", help_heading = SCENE)]
    environment: Option<PathBuf>,
    /// Turn the environment map about +Y, counter-clockwise seen from above, degrees.
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, help_heading = SCENE)]
    #[arg(hide_short_help = true)]
    rotate_environment: Option<f32>,
    /// Camera of a glTF or Mitsuba file, by name or number from 0. Default: the first with perspective.
    #[arg(long, value_name = "NAME|N", help_heading = CAMERA, hide_short_help = true)]
    camera: Option<String>,
    /// Variant of the materials of a glTF file, by name; `info` lists them.
    #[arg(long, value_name = "NAME", help_heading = SCENE, hide_short_help = true)]
    variant: Option<String>,
    /// Place of the camera, instead of the scene's; it keeps its direction without --look-at.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    #[arg(help_heading = CAMERA, hide_short_help = true)]
    look_from: Option<[f32; 3]>,
    /// Point in the middle of the picture, instead of the scene's.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    #[arg(help_heading = CAMERA, hide_short_help = true)]
    look_at: Option<[f32; 3]>,
    /// Vertical field of view in degrees, instead of the scene's.
    #[arg(long, value_name = "DEG", help_heading = CAMERA, hide_short_help = true)]
    fov: Option<f32>,
    /// Folder that files named by a Mitsuba or pbrt scene may lie in, beside the scene's own.
    #[arg(long, value_name = "FOLDER", help_heading = SCENE, hide_short_help = true)]
    allow_root: Option<PathBuf>,
    /// Fail if loading the scene gives any warning, such as a part of a file that is left out.
    #[arg(long, help_heading = SCENE, hide_short_help = true)]
    strict: bool,
}

impl SceneOptions {
    /// Loads a scene and logs its warnings. Fails as [`Scene::load_with`], and under `--strict` for any
    /// warning.
    pub(crate) fn load(&self, path: &Path) -> Result<Scene> {
        let scene = self.load_at(path, None)?;
        scene.warnings.iter().for_each(|warning| log::warn!("{warning}"));
        Ok(scene)
    }

    /// Loads a scene at a time of its animation, seconds, and leaves its warnings to the caller.
    pub(crate) fn load_at(&self, path: &Path, time: Option<f64>) -> Result<Scene> {
        let scene = Scene::load_with(
            path,
            &LoadOptions {
                environment: self.environment.clone(),
                rotation_deg: self.rotate_environment,
                camera: self.camera.clone(),
                variant: self.variant.clone(),
                look_from: self.look_from,
                look_at: self.look_at,
                vertical_fov_deg: self.fov,
                allow_root: self.allow_root.clone(),
                time: time.map(|seconds| seconds as f32),
            },
        )?;
        check_strict(self.strict, &scene)?;
        Ok(scene)
    }
}

/// Fails under `--strict` if loading `scene` left anything out; lists the warnings.
pub(crate) fn check_strict(strict: bool, scene: &Scene) -> Result<()> {
    if !strict || scene.warnings.is_empty() {
        return Ok(());
    }
    let (count, list) = (scene.warnings.len(), scene.warnings.join("\n  "));
    Err(Error::scene(&scene.path, format!("--strict: {count} warnings:\n  {list}")))
}

/// Parses so many numbers between commas.
fn parse_numbers<T: FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let numbers = text.split(',').map(|part| part.trim().parse().ok());
    numbers.collect::<Option<Vec<T>>>()?.try_into().ok()
}

/// Parses `x0,y0,x1,y1` in pixels, upper bounds excluded.
pub(crate) fn parse_crop(text: &str) -> Result<Window, String> {
    match parse_numbers(text) {
        Some([x, y, x1, y1]) if x < x1 && y < y1 => {
            Ok(Window { x, y, width: x1 - x, height: y1 - y })
        }
        _ => {
            Err(format!("expected x0,y0,x1,y1 in pixels with x0 < x1 and y0 < y1, found {text:?}"))
        }
    }
}

/// Parses `x,y` in pixels.
pub(crate) fn parse_pixel(text: &str) -> Result<[u32; 2], String> {
    parse_numbers(text)
        .ok_or_else(|| format!("expected x,y in pixels from the upper left, found {text:?}"))
}

/// Parses `x,y,z` in metres.
fn parse_point(text: &str) -> Result<[f32; 3], String> {
    parse_numbers(text)
        .filter(|point: &[f32; 3]| point.iter().all(|number| number.is_finite()))
        .ok_or_else(|| format!("expected x,y,z, found {text:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_three_coordinates() {
        assert_eq!(parse_point("1, -2.5,3e1"), Ok([1.0, -2.5, 30.0]));
        for wrong in ["", "1,2", "1,2,3,4", "1,2,nan", "a,b,c"] {
            assert!(parse_point(wrong).is_err(), "{wrong}");
        }
    }
}
