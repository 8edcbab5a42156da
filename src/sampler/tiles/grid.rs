//! Sectors of the directions from the camera, which `glsl/tiles/sectors.glsl` looks up.

use std::f32::consts::PI;

use super::parameters::TilesParameters;
use crate::{sampler::regions::cell_edges, scene::Scene};

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
}
