//! Directions through tiles on the host: twin of `glsl/tiles/tiles.glsl`.

use glam::Vec3;

use super::cache::Entry;
use crate::{
    math::random::unit_float,
    sampler::regions::Partition,
    scene::environment::{EnvironmentMap, EnvironmentSample, EnvironmentTables},
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
        let cell = self.partition.choose_cell(tile, [bits[1], more_bits[2]]);
        let within = [unit_float(more_bits[0]), unit_float(more_bits[1])];
        let sample = self.tables.sample_cell(self.map, cell, within);
        let is_lit = self.tables.total > 0.0;
        let pdf = if is_lit { self.ratio(tile) * sample.pdf } else { 0.0 };
        EnvironmentSample { pdf, ..sample }
    }
}
