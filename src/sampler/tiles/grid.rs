//! Sectors of the directions from the camera: twin of `sector_of` in `glsl/tiles/sectors.glsl`.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, vec3};

use super::parameters::TilesParameters;
use crate::{
    math::equal_area::square_from_direction, sampler::regions::cell_edges, scene::Scene,
    shader::structs::SceneParameters,
};

/// Most entries of all sectors together: 32 MiB of counts, and as much of probabilities.
const MOST_ENTRIES: usize = 1 << 22;

/// The square of directions from the camera, cut into sectors of equal solid angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SectorGrid {
    /// Sectors along each side of the square.
    pub side: u32,
}

impl SectorGrid {
    /// Returns the grid for camera and film of a scene: as fine as the parameters ask for, unless the entries
    /// for `tiles` tiles would be too many.
    pub fn new(scene: &Scene, parameters: &TilesParameters, tiles: usize) -> Self {
        let [angle, _] = cell_edges(scene, parameters.sector_pixels as f32);
        let most = (MOST_ENTRIES / tiles.max(1)).isqrt() as u32;
        let wanted = (4.0 * PI).sqrt() / angle;
        Self { side: (wanted.ceil() as u32).clamp(1, most) }
    }

    /// Number of sectors.
    pub fn sectors(&self) -> usize {
        (self.side * self.side) as usize
    }

    /// Sector of a place as `camera` sees it, moved by `shift` sectors.
    pub fn sector_of(&self, camera: &SceneParameters, position: Vec3, shift: Vec2) -> u32 {
        let [right, up, forward] =
            [camera.camera_right, camera.camera_up, camera.camera_forward].map(Vec3::from);
        let away = position - Vec3::from(camera.camera_position);
        let far = away.length();
        let direction = if far > 0.0 { away / far } else { forward };
        let at = square_from_direction(vec3(
            direction.dot(right),
            direction.dot(up),
            direction.dot(forward),
        ));
        let last = Vec2::splat((self.side - 1) as f32);
        let place = (at * self.side as f32 + shift).clamp(Vec2::ZERO, last);
        place.y as u32 * self.side + place.x as u32
    }
}
