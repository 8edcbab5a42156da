//! Counts of the pilot → probabilities of the tiles in every sector.

use rayon::prelude::*;

use super::SectorGrid;
use crate::{
    sampler::regions::Partition,
    shader::rooms::tiles::{TILE_RESPONSE_UNITS, TILE_SCALE},
};

/// Rays of the surroundings that a sector leans on, where it has counted little itself.
const PRIOR_RAYS: f64 = 0.5;
/// Sectors along each side of the surroundings.
const SURROUNDINGS: usize = 4;
/// Part of the mean that is left to the BRDF: a quarter stays where all tiles are alike.
const COMPENSATION: f64 = 0.75;
/// Share of the map's energy below which a tile is left to the BRDF.
const LEAST_SHARE: f64 = 1e-9;

/// A tile in a sector, as the device reads it: bits of the probability over the tile's share of the map's
/// energy; sum of the probabilities up to and including it, in [`TILE_SCALE`]ths.
pub type Entry = [u32; 2];

/// Makes entries of counts.
#[derive(Clone, Debug)]
pub struct TileCache {
    /// Share of each tile in the map's energy; 0 if it is not drawn.
    shares: Vec<f64>,
    /// Solid angle of each tile, as a fraction of the sphere.
    solid_angles: Vec<f64>,
    floor: f64,
    compensates: bool,
}

/// Mean squared cosine of the rays that were counted, with [`PRIOR_RAYS`] rays of mean `prior`.
fn mean_square([rays, units]: [f64; 2], prior: f64) -> f64 {
    (units / f64::from(TILE_RESPONSE_UNITS) + PRIOR_RAYS * prior) / (rays + PRIOR_RAYS)
}

fn added(sum: [f64; 2], count: [u32; 2]) -> [f64; 2] {
    [sum[0] + f64::from(count[0]), sum[1] + f64::from(count[1])]
}

impl TileCache {
    /// Makes entries for the tiles of `partition`. The share `floor` of the probability follows the map
    /// alone; the rest, if it `compensates`, leaves to the BRDF what is dim or hardly seen.
    pub fn new(partition: &Partition, floor: f64, compensates: bool) -> Self {
        let tiles = partition.regions.iter();
        let share = |share: f64| if share > LEAST_SHARE { share } else { 0.0 };
        Self {
            shares: tiles.clone().map(|tile| share(tile.share)).collect(),
            solid_angles: tiles.map(|tile| tile.solid_angle).collect(),
            floor,
            compensates,
        }
    }

    /// Number of tiles.
    pub fn tiles(&self) -> usize {
        self.shares.len()
    }

    /// Entries of a sector for the pilot: half by the map, half alike for all tiles with light, so that it
    /// learns of all.
    pub fn untrained(&self) -> Vec<Entry> {
        let lit = self.shares.iter().filter(|share| **share > 0.0).count();
        let alike = 0.5 / lit.max(1) as f64;
        self.entries(|tile| 0.5 * self.shares[tile] + alike)
    }

    /// Entries of all sectors by rays and their summed squares of cosines, by sector and tile.
    ///
    /// The response of a tile is the root mean square of what its light brings to diffuse surfaces: the
    /// cosine of a visible ray, 0 of a blocked one. Probabilities by flux times response leave the least
    /// variance that one choice for all surfaces of a sector allows. A sector that has counted little expects
    /// as much as the 4×4 sectors around, these as much as all.
    ///
    /// # Panics
    /// There are not two counts for every tile in every sector.
    pub fn learned(&self, grid: SectorGrid, counts: &[[u32; 2]]) -> Vec<Entry> {
        let (tiles, side) = (self.tiles(), grid.side as usize);
        assert_eq!(counts.len(), grid.sectors() * tiles, "two counts for every tile and sector");
        let of_all: Vec<[f64; 2]> = (0..tiles)
            .into_par_iter()
            .map(|tile| counts.iter().skip(tile).step_by(tiles).copied().fold([0.0; 2], added))
            .collect();
        let of_all: Vec<f64> = of_all.iter().map(|sum| mean_square(*sum, 1.0)).collect();
        let blocks = side.div_ceil(SURROUNDINGS);
        let around: Vec<f64> = (0..blocks * blocks)
            .into_par_iter()
            .flat_map_iter(|block| {
                let [x, y] = [block % blocks, block / blocks].map(|at| at * SURROUNDINGS);
                let rows = y..(y + SURROUNDINGS).min(side);
                let columns = x..(x + SURROUNDINGS).min(side);
                let mut sums = vec![[0.0; 2]; tiles];
                for sector in rows.flat_map(|y| columns.clone().map(move |x| y * side + x)) {
                    for (sum, count) in sums.iter_mut().zip(&counts[sector * tiles..]) {
                        *sum = added(*sum, *count);
                    }
                }
                let priors = of_all.iter();
                sums.into_iter().zip(priors).map(|(sum, prior)| mean_square(sum, *prior))
            })
            .collect();
        let of_sector = |(sector, counts): (usize, &[[u32; 2]])| {
            let block = sector / side / SURROUNDINGS * blocks + sector % side / SURROUNDINGS;
            let priors = &around[block * tiles..][..tiles];
            let responses: Vec<f64> = counts
                .iter()
                .zip(priors)
                .map(|(count, prior)| mean_square(added([0.0; 2], *count), *prior).sqrt())
                .collect();
            let weights = self.weights(&responses);
            let sum: f64 = weights.iter().sum();
            let learned = if sum > 0.0 { (1.0 - self.floor) / sum } else { 0.0 };
            self.entries(|tile| learned * weights[tile] + self.floor * self.shares[tile])
        };
        counts.par_chunks(tiles).enumerate().flat_map_iter(of_sector).collect()
    }

    /// Flux times response of each tile, less a part of the mean over all directions, which the BRDF's own
    /// rays cover.
    fn weights(&self, responses: &[f64]) -> Vec<f64> {
        let mut weights: Vec<f64> =
            self.shares.iter().zip(responses).map(|(share, seen)| share * seen).collect();
        let sum: f64 = weights.iter().sum();
        let least = if self.compensates { COMPENSATION * sum } else { 0.0 };
        for (weight, angle) in weights.iter_mut().zip(&self.solid_angles) {
            *weight = (*weight - least * angle).max(0.0);
        }
        weights
    }

    /// Entries of a sector by the weight of each tile, positive where there is light. Each tile with light
    /// gets at least one part of [`TILE_SCALE`], and exactly the probability that is written down.
    fn entries(&self, weight: impl Fn(usize) -> f64) -> Vec<Entry> {
        let weights: Vec<f64> = self
            .shares
            .iter()
            .enumerate()
            .map(|(tile, share)| if *share > 0.0 { weight(tile) } else { 0.0 })
            .collect();
        let lit = weights.iter().filter(|weight| **weight > 0.0).count() as u32;
        if lit == 0 {
            // Nothing is sampled from a black map, but the search ends at a tile.
            return vec![[0, TILE_SCALE]; self.tiles()];
        }
        let whole: f64 = weights.iter().sum();
        let (mut passed, mut sum, mut before) = (0, 0.0, 0);
        let entry = |(weight, share): (&f64, &f64)| {
            if *weight <= 0.0 {
                return [0, before];
            }
            passed += 1;
            sum += weight;
            let end = passed + (sum / whole * f64::from(TILE_SCALE - lit)).round() as u32;
            let probability = f64::from(end - before) / f64::from(TILE_SCALE);
            before = end;
            [((probability / share) as f32).to_bits(), end]
        };
        weights.iter().zip(&self.shares).map(entry).collect()
    }
}
