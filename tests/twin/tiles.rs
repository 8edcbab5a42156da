//! Directions through tiles and sectors of the directions from the camera: twin of `tiles.glsl` and
//! `sectors.glsl` in `glsl/tiles`.

use fenestra::{
    math::{equal_area::square_from_direction, random::unit_float},
    sampler::{
        regions::Partition,
        tiles::{Entry, SectorGrid},
    },
    scene::environment::{EnvironmentMap, EnvironmentTables},
    shader::structs::SceneParameters,
};
use glam::{Vec2, Vec3, vec3};

use super::{
    environment::{EnvironmentSample, EnvironmentSampling as _},
    regions::choose_cell,
};

/// The environment as the entries of one sector sample it.
#[derive(Clone, Copy, Debug)]
pub struct TileDensity<'a> {
    /// The environment.
    pub map: &'a EnvironmentMap,
    /// Its own density.
    pub tables: &'a EnvironmentTables,
    /// The tiles.
    pub partition: &'a Partition,
    /// Entries of the sector.
    pub entries: &'a [Entry],
}

impl TileDensity<'_> {
    fn ratio(&self, tile: usize) -> f32 {
        f32::from_bits(self.entries[tile][0])
    }

    /// Density per steradian of [`Self::sample`] at a unit direction.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let of_map = self.tables.pdf(self.map, direction, self.map.radiance(direction));
        self.ratio(self.partition.region_of(self.map, direction)) * of_map
    }

    /// Draws a tile and a cell by `bits`, and a direction in it by `more_bits`.
    pub fn sample(&self, bits: [u32; 2], more_bits: [u32; 4]) -> EnvironmentSample {
        // The first tile whose cumulative probability exceeds the number.
        let tile = self.entries.partition_point(|[_, end]| *end <= bits[0] >> 8);
        let cell = choose_cell(self.partition, tile, [bits[1], more_bits[2]]);
        let within = [unit_float(more_bits[0]), unit_float(more_bits[1])];
        let sample = self.tables.sample_cell(self.map, cell, within);
        let is_lit = self.tables.total > 0.0;
        let pdf = if is_lit { self.ratio(tile) * sample.pdf } else { 0.0 };
        EnvironmentSample { pdf, ..sample }
    }
}

/// Sector of a place as `camera` sees it.
pub fn sector_of(grid: SectorGrid, camera: &SceneParameters, position: Vec3) -> u32 {
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
    let last = Vec2::splat((grid.side - 1) as f32);
    let place = (at * grid.side as f32).clamp(Vec2::ZERO, last);
    place.y as u32 * grid.side + place.x as u32
}
