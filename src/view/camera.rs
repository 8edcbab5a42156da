//! A camera that moves: orbit, turn, pan, zoom, fly.

use glam::{Quat, Vec3};

use crate::scene::Camera;

/// Least angle between the view and the vertical, radians: there, left and right would swap.
const POLE: f32 = 0.03;
/// Share of the first distance to the centre of the picture that flying covers in a second.
const PACE: f32 = 0.35;

/// The camera, where it started, and how fast it flies.
#[derive(Clone, Debug)]
pub(crate) struct Rig {
    home: Camera,
    camera: Camera,
    metres_per_second: f32,
}

impl Rig {
    /// Starts at the camera of the scene.
    pub(crate) fn new(camera: Camera) -> Self {
        let distance = (camera.look_at - camera.position).length();
        Self { home: camera, camera, metres_per_second: PACE * distance.max(1e-3) }
    }

    /// The camera now.
    pub(crate) fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns to the start.
    pub(crate) fn go_home(&mut self) {
        self.camera = self.home;
    }

    /// Moves around the centre of the picture by angles in radians, to the right and up.
    pub(crate) fn orbit(&mut self, right: f32, up: f32) {
        let offset = self.camera.position - self.camera.look_at;
        self.camera.position = self.camera.look_at + self.turned(offset, -right, up);
    }

    /// Turns on the spot by angles in radians, to the right and up.
    pub(crate) fn turn(&mut self, right: f32, up: f32) {
        let offset = self.camera.look_at - self.camera.position;
        self.camera.look_at = self.camera.position + self.turned(offset, -right, up);
    }

    /// Turns `offset` about the vertical, then toward it, but not to the poles.
    fn turned(&self, offset: Vec3, about: f32, toward: f32) -> Vec3 {
        let vertical = self.camera.up.normalize_or(Vec3::Y);
        let offset = Quat::from_axis_angle(vertical, about) * offset;
        let angle = offset.angle_between(vertical);
        let wanted = (angle - toward).clamp(POLE, std::f32::consts::PI - POLE);
        let axis = vertical.cross(offset).normalize_or(Vec3::X);
        Quat::from_axis_angle(axis, wanted - angle) * offset
    }

    /// Moves sideways, in heights of the picture at its centre.
    pub(crate) fn pan(&mut self, right: f32, up: f32) {
        let distance = (self.camera.look_at - self.camera.position).length();
        let height = 2.0 * distance * (0.5 * self.camera.vertical_fov_deg).to_radians().tan();
        let [axis_right, axis_up, _] = self.axes();
        self.shift(height * (right * axis_right + up * axis_up));
    }

    /// Multiplies the distance to the centre of the picture.
    pub(crate) fn zoom(&mut self, factor: f32) {
        let offset = self.camera.position - self.camera.look_at;
        self.camera.position = self.camera.look_at + offset * factor;
    }

    /// Flies to the right, up and forward, each −1 to 1, for some seconds.
    pub(crate) fn fly(&mut self, direction: Vec3, seconds: f32) {
        let [right, up, forward] = self.axes();
        let way = direction.x * right + direction.y * up + direction.z * forward;
        self.shift(way * (seconds * self.metres_per_second));
    }

    fn shift(&mut self, way: Vec3) {
        self.camera.position += way;
        self.camera.look_at += way;
    }

    fn axes(&self) -> [Vec3; 3] {
        let forward = (self.camera.look_at - self.camera.position).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(self.camera.up).normalize_or(Vec3::X);
        [right, right.cross(forward), forward]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig() -> Rig {
        Rig::new(Camera {
            position: Vec3::new(0.0, 1.0, 4.0),
            look_at: Vec3::new(0.0, 1.0, 0.0),
            up: Vec3::Y,
            vertical_fov_deg: 90.0,
            aperture_radius: 0.0,
            focus_distance: 4.0,
        })
    }

    fn assert_near(found: Vec3, expected: [f32; 3]) {
        assert!(found.distance(expected.into()) < 1e-4, "{found} instead of {expected:?}");
    }

    #[test]
    fn motions_go_where_they_say() {
        let quarter = std::f32::consts::FRAC_PI_2;
        let mut moved = rig();
        moved.orbit(-quarter, 0.0);
        assert_near(moved.camera().position, [4.0, 1.0, 0.0]);
        assert_near(moved.camera().look_at, [0.0, 1.0, 0.0]);
        let mut moved = rig();
        moved.orbit(0.0, 0.5 * quarter);
        assert_near(moved.camera().position, [0.0, 1.0 + 8.0_f32.sqrt(), 8.0_f32.sqrt()]);
        let mut moved = rig();
        moved.turn(quarter, 0.0);
        assert_near(moved.camera().look_at, [4.0, 1.0, 4.0]);
        let mut moved = rig();
        moved.pan(0.5, 0.25);
        assert_near(moved.camera().position, [4.0, 3.0, 4.0]);
        let mut moved = rig();
        moved.zoom(0.5);
        assert_near(moved.camera().position, [0.0, 1.0, 2.0]);
        let mut moved = rig();
        moved.fly(Vec3::Z, 1.0);
        assert_near(moved.camera().position, [0.0, 1.0, 4.0 - 4.0 * PACE]);
        moved.go_home();
        assert_eq!(moved.camera(), rig().camera());
    }

    #[test]
    fn the_poles_are_not_crossed() {
        let mut moved = rig();
        for _ in 0..10 {
            moved.orbit(0.3, 1.0);
            let offset = moved.camera().position - moved.camera().look_at;
            assert!((offset.length() - 4.0).abs() < 1e-3, "{offset}");
        }
        let offset = moved.camera().position - moved.camera().look_at;
        assert!(offset.angle_between(Vec3::Y) < 0.04, "{offset}");
    }
}
