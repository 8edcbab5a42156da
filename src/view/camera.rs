//! A camera that moves: orbit, turn, pan, zoom, fly.

use glam::{Quat, Vec3};

use crate::scene::Camera;

/// Least angle between the view and the vertical, radians: there, left and right would swap.
const POLE: f32 = 0.03;
/// Share of the reach that flying covers in a second.
const PACE: f32 = 0.6;
/// Share of the points in the picture that are nearer than the reach.
const NEAR_SHARE: f32 = 0.1;
/// Least reach, as a share of the first: in front of a wall the camera still moves.
const LEAST_REACH: f32 = 0.02;

/// The camera, where it started, and how fast it flies.
#[derive(Clone, Debug)]
pub(crate) struct Rig {
    home: Camera,
    pub(crate) camera: Camera,
    /// Distance to the nearest things in the picture, metres; at first that to its centre.
    reach: f32,
    least_reach: f32,
    /// Factor of the speed of flying.
    pub(crate) speed: f32,
}

impl Rig {
    /// Starts at the camera of the scene.
    pub(crate) fn new(camera: Camera) -> Self {
        let distance = (camera.look_at - camera.position).length();
        let reach = distance.max(1e-3);
        Self { home: camera, camera, reach, least_reach: LEAST_REACH * reach, speed: 1.0 }
    }

    /// Adapts the speed to the points that a picture shows, metres: near things are approached slowly, and
    /// a large scene is crossed as fast as a small one. A picture without any leaves it.
    pub(crate) fn adapt(&mut self, points: impl Iterator<Item = Vec3>) {
        let mut distances: Vec<f32> =
            points.map(|point| point.distance(self.camera.position)).collect();
        let near = (NEAR_SHARE * distances.len() as f32) as usize;
        if near < distances.len() {
            let (_, reach, _) = distances.select_nth_unstable_by(near, f32::total_cmp);
            self.reach = reach.max(self.least_reach);
        }
    }

    /// Focuses on a point, metres.
    pub(crate) fn focus(&mut self, point: Vec3) {
        let [_, _, forward] = self.camera.axes();
        self.camera.focus_distance = (point - self.camera.position).dot(forward).max(1e-3);
    }

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
        let about = if self.camera.mirrored { -about } else { about };
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
        let [axis_right, axis_up, _] = self.camera.axes();
        self.shift(height * (right * axis_right + up * axis_up));
    }

    /// Multiplies the distance to the centre of the picture.
    pub(crate) fn zoom(&mut self, factor: f32) {
        let offset = self.camera.position - self.camera.look_at;
        self.camera.position = self.camera.look_at + offset * factor;
    }

    /// Flies to the right, up and forward, each −1 to 1, for some seconds.
    pub(crate) fn fly(&mut self, direction: Vec3, seconds: f32) {
        let [right, up, forward] = self.camera.axes();
        let way = direction.x * right + direction.y * up + direction.z * forward;
        self.shift(way * (seconds * PACE * self.speed * self.reach));
    }

    fn shift(&mut self, way: Vec3) {
        self.camera.position += way;
        self.camera.look_at += way;
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
            shift: [0.0; 2],
            mirrored: false,
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
        assert_near(moved.camera.position, [4.0, 1.0, 0.0]);
        assert_near(moved.camera.look_at, [0.0, 1.0, 0.0]);
        let mut moved = rig();
        moved.orbit(0.0, 0.5 * quarter);
        assert_near(moved.camera.position, [0.0, 1.0 + 8.0_f32.sqrt(), 8.0_f32.sqrt()]);
        let mut moved = rig();
        moved.turn(quarter, 0.0);
        assert_near(moved.camera.look_at, [4.0, 1.0, 4.0]);
        let mut mirrored = rig();
        mirrored.camera.mirrored = true;
        mirrored.turn(quarter, 0.0);
        assert_near(mirrored.camera.look_at, [-4.0, 1.0, 4.0]);
        mirrored.go_home();
        mirrored.camera.mirrored = true;
        mirrored.orbit(quarter, 0.0);
        assert_near(mirrored.camera.position, [4.0, 1.0, 0.0]);
        mirrored.go_home();
        mirrored.camera.mirrored = true;
        mirrored.fly(Vec3::X, 1.0);
        assert_near(mirrored.camera.position, [-4.0 * PACE, 1.0, 4.0]);
        let mut moved = rig();
        moved.pan(0.5, 0.25);
        assert_near(moved.camera.position, [4.0, 3.0, 4.0]);
        let mut moved = rig();
        moved.zoom(0.5);
        assert_near(moved.camera.position, [0.0, 1.0, 2.0]);
        let mut moved = rig();
        moved.fly(Vec3::Z, 1.0);
        assert_near(moved.camera.position, [0.0, 1.0, 4.0 - 4.0 * PACE]);
        let mut slow = rig();
        slow.speed = 0.25;
        slow.fly(Vec3::Z, 1.0);
        assert_near(slow.camera.position, [0.0, 1.0, 4.0 - PACE]);
        moved.focus(Vec3::new(3.0, 1.0, 1.0));
        assert_near(Vec3::X * moved.camera.focus_distance, [3.0 - 4.0 * PACE, 0.0, 0.0]);
        moved.go_home();
        assert_eq!(moved.camera, rig().camera);
    }

    #[test]
    fn flying_does_not_leave_a_room() {
        // Walls of a room of four metres, seen through a camera whose centre lies far beyond.
        let mut moved = rig();
        moved.camera.look_at.z = -100.0;
        let wall = || (0..100).map(|i| Vec3::new(0.02 * i as f32 - 1.0, 1.0, 0.0));
        for _ in 0..100 {
            moved.adapt(wall());
            moved.fly(Vec3::Z, 0.02);
        }
        // Right before a wall it still moves.
        let mut close = moved.clone();
        close.adapt([moved.camera.position + 1e-4 * Vec3::NEG_Z].into_iter());
        close.fly(Vec3::X, 1.0);
        assert_near(
            close.camera.position - moved.camera.position,
            [4.0 * LEAST_REACH * PACE, 0.0, 0.0],
        );
        let left = moved.camera.position.z;
        assert!((0.5..2.5).contains(&left), "{left} m before the wall after two seconds");
        // A scene a thousand times as large is crossed in the same time, and no point changes nothing.
        let mut far = rig();
        far.adapt([Vec3::new(0.0, 1.0, -3996.0)].into_iter());
        far.adapt(std::iter::empty());
        far.fly(Vec3::Z, 1.0);
        assert_near(far.camera.position / 1000.0, [0.0, 0.001, 0.004 - 4.0 * PACE]);
    }

    #[test]
    fn the_poles_are_not_crossed() {
        for up in [1.0, -1.0] {
            let mut moved = rig();
            for _ in 0..10 {
                moved.orbit(0.3, up);
                let offset = moved.camera.position - moved.camera.look_at;
                assert!((offset.length() - 4.0).abs() < 1e-3, "{offset}");
            }
            let offset = moved.camera.position - moved.camera.look_at;
            let angle = offset.angle_between(up * Vec3::Y);
            assert!((angle - POLE).abs() < 1e-3, "{offset}");
        }
    }
}
