//! `[[camera.keyframe]]` → the camera at a time.

use glam::Vec3;

use super::Loader;
use crate::{
    error::{Error, Result},
    file::{CameraEntry, Entry, KeyframeEntry, SceneFile},
    math::keys::{between, monotone},
};

impl Loader<'_> {
    /// Returns the camera at the time of the options: that of the key frames, each number along a smooth
    /// curve that never leaves the range of its two keys; before the first and after the last it stands.
    /// Without a time or key frames, the camera of `[camera]`.
    pub(super) fn camera_at(&self, file: &SceneFile) -> Result<CameraEntry> {
        let mut keys = Vec::new();
        for Entry { keys: frame, .. } in &file.keyframes {
            let camera = completed(frame, &file.camera);
            let at = |error: Error| match error {
                Error::Scene { message, .. } => {
                    self.error(format!("camera.keyframe at {} s: {message}", frame.time))
                }
                other => other,
            };
            self.camera(&camera).map_err(at)?;
            keys.push(camera);
        }
        let times: Vec<f32> = file.keyframes.iter().map(|frame| frame.keys.time).collect();
        let ascend = times.iter().all(|time| time.is_finite()) && times.is_sorted_by(|a, b| a < b);
        self.check(ascend, || {
            format!("camera.keyframe: expected times that ascend, found {times:?}")
        })?;
        let Some(time) = self.options.time.filter(|_| !keys.is_empty()) else {
            return Ok(file.camera.clone());
        };
        let place = between(&times, time);
        let number =
            |of: &dyn Fn(&CameraEntry) -> f32| monotone(&times, |key| of(&keys[key]), place);
        let vector = |of: &dyn Fn(&CameraEntry) -> [f32; 3]| {
            std::array::from_fn(|axis| number(&|camera| of(camera)[axis]))
        };
        Ok(CameraEntry {
            position: vector(&|camera| camera.position),
            look_at: vector(&|camera| camera.look_at),
            up: vector(&|camera| camera.up),
            vertical_fov_deg: number(&|camera| camera.vertical_fov_deg),
            aperture_radius: number(&|camera| camera.aperture_radius),
            focus_distance: keys
                .iter()
                .any(|camera| camera.focus_distance.is_some())
                .then(|| number(&focus_distance)),
        })
    }
}

fn completed(frame: &KeyframeEntry, camera: &CameraEntry) -> CameraEntry {
    CameraEntry {
        position: frame.position.unwrap_or(camera.position),
        look_at: frame.look_at.unwrap_or(camera.look_at),
        up: frame.up.unwrap_or(camera.up),
        vertical_fov_deg: frame.vertical_fov_deg.unwrap_or(camera.vertical_fov_deg),
        aperture_radius: frame.aperture_radius.unwrap_or(camera.aperture_radius),
        focus_distance: frame.focus_distance.or(camera.focus_distance),
    }
}

fn focus_distance(camera: &CameraEntry) -> f32 {
    let [from, to] = [camera.position, camera.look_at].map(Vec3::from);
    camera.focus_distance.unwrap_or(from.distance(to))
}
