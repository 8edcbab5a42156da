//! The viewer: a pinhole or thin-lens perspective camera.

use glam::Vec3;

/// Right-handed perspective camera that looks from `position` to `look_at`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Centre of projection, metres.
    pub position: Vec3,
    /// Point at the centre of the image, metres.
    pub look_at: Vec3,
    /// Direction that points up in the image; need not be orthogonal to the view.
    pub up: Vec3,
    /// Angle between the bottom and top edges of the image, degrees.
    pub vertical_fov_deg: f32,
    /// Radius of the thin lens, metres; 0 for a pinhole.
    pub aperture_radius: f32,
    /// Distance along the view axis from the lens to the plane of focus, metres.
    pub focus_distance: f32,
}
