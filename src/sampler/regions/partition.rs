//! Splits the environment into rectangles of its sampling cells, each with an exact table of its
//! own: [`EnvironmentMap`] → [`Partition`].
//!
//! The cells are those of [`EnvironmentTables`](crate::scene::environment::EnvironmentTables): `height + 1`
//! rows of `width` cells between texel centres, each with its share P_cell of the whole density. Greedy
//! splits of the rectangle with the largest E^¼ · Ω^¾ (E its share of the energy, Ω its solid angle) give
//! rectangles that are small where the map is bright without leaving the dark parts coarse. Later splits
//! weight both by how much the scene sees of each region.
//!
//! Sampling chooses a region r, then one of its cells by an alias table with P_cell / P_region,
//! then a direction in the bilinear patch of the cell. Hence p(ω|r) = pdf(ω) / P_region with the
//! pdf of the whole map: one table per region and no residual of any fit.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::scene::environment::EnvironmentMap;
use crate::{
    math::alias::{AliasEntry, alias_table},
    sampler::regions::split::{MapCells, PARENT_COUNT, Rectangle, SummedAreas, split_greedily},
};

/// Upper bound of the number of regions: their index has ten bits on the device.
pub const MAX_REGIONS: usize = 1024;

/// Scale of the thresholds of the alias tables.
pub const CELL_SCALE: u64 = 1 << 32;

/// A rectangle of cells, and what is drawn in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// The rectangle.
    pub rectangle: Rectangle,
    /// P_region, the share of the map's energy ∫ lum L dω.
    pub share: f64,
    /// Solid angle as a fraction of the sphere.
    pub solid_angle: f64,
    /// Unit mean direction in the world, weighted by energy.
    pub direction: DVec3,
    /// First entry of the region's alias table.
    pub first_entry: usize,
}

/// A map split into regions.
#[derive(Clone, Debug)]
pub struct Partition {
    /// Regions, which cover the map without overlap.
    pub regions: Vec<Region>,
    /// Alias tables over the cells of each region, row by row, one region after another.
    pub entries: Vec<AliasEntry>,
    /// Region of every cell, `height + 1` rows of `width`.
    pub region_of_cell: Vec<u16>,
    cells: Arc<MapCells>,
}

impl Partition {
    /// Splits `map` into `region_count` regions, or fewer if it runs out of cells to split.
    ///
    /// # Panics
    /// If `region_count` is not from 1 to 1024.
    pub fn new(map: &EnvironmentMap, region_count: usize) -> Self {
        assert!((1..=MAX_REGIONS).contains(&region_count), "1 to 1024 regions");
        let cells = Arc::new(MapCells::new(map));
        let rectangles = split_greedily(&SummedAreas::new(&cells, |_| 1.0), region_count);
        Self::assemble(cells, &rectangles)
    }

    /// Splits the same map again into `region_count` regions or fewer, weighting each cell by the
    /// `importance` of its present region. `None` if the result has fewer regions than asked for
    /// and than now.
    ///
    /// # Panics
    /// If there are not as many importances as regions or more than 1024 regions are asked for.
    pub fn split_by(&self, importance: &[f64], region_count: usize) -> Option<Self> {
        assert_eq!(importance.len(), self.regions.len(), "an importance for every region");
        assert!(region_count <= MAX_REGIONS, "at most 1024 regions");
        let weight = |cell: usize| importance[usize::from(self.region_of_cell[cell])];
        let rectangles = split_greedily(&SummedAreas::new(&self.cells, weight), region_count);
        (rectangles.len() >= region_count.min(self.regions.len()))
            .then(|| Self::assemble(Arc::clone(&self.cells), &rectangles))
    }

    /// Returns first alias entry, columns + 65,536 · rows, bits of one over the share of the energy (0
    /// where there is none) and first column + 65,536 · first row of every region, and all alias entries,
    /// as devices read them.
    pub(in crate::sampler) fn tables(&self) -> (Vec<[u32; 4]>, Vec<[u32; 2]>) {
        let regions = self.regions.iter().map(|region| {
            let Rectangle { first: [column, row], size: [columns, rows], .. } = region.rectangle;
            let inverse = if region.share > 0.0 { (1.0 / region.share) as f32 } else { 0.0 };
            let inverse = inverse.min(f32::MAX).to_bits();
            [region.first_entry as u32, columns | rows << 16, inverse, column | row << 16]
        });
        let aliases = self
            .entries
            .par_iter()
            .map(|entry| [u32::try_from(entry.threshold).unwrap_or(u32::MAX), entry.alias]);
        (regions.collect(), aliases.collect())
    }

    /// Returns first column and row, columns, rows and parent of every region, for a file.
    pub fn rectangles(&self) -> Vec<[u32; 5]> {
        let of = |region: &Region| {
            let Rectangle { first: [column, row], size: [columns, rows], parent } =
                region.rectangle;
            [column, row, columns, rows, parent as u32]
        };
        self.regions.iter().map(of).collect()
    }

    /// Splits the same map into regions that [`Self::rectangles`] returned. `None` unless they
    /// cover the map without overlap and are no more than [`MAX_REGIONS`].
    pub fn with_rectangles(&self, rectangles: &[[u32; 5]]) -> Option<Self> {
        let [width, rows] = [self.cells.width, self.cells.rows].map(|count| count as u32);
        let mut is_covered = vec![false; self.region_of_cell.len()];
        let mut found = Vec::with_capacity(rectangles.len());
        for &[column, row, columns, count, parent] in rectangles {
            let is_inside = column.checked_add(columns).is_some_and(|end| end <= width)
                && row.checked_add(count).is_some_and(|end| end <= rows)
                && columns > 0
                && count > 0
                && (parent as usize) < rectangles.len().min(PARENT_COUNT);
            if !is_inside {
                return None;
            }
            let (first, size) = ([column, row], [columns, count]);
            let rectangle = Rectangle { first, size, parent: parent as usize };
            for row in rectangle.rows() {
                for cell in &mut is_covered[rectangle.cells(row, self.cells.width)] {
                    if std::mem::replace(cell, true) {
                        return None;
                    }
                }
            }
            found.push(rectangle);
        }
        let is_whole = found.len() <= MAX_REGIONS && is_covered.iter().all(|&cell| cell);
        is_whole.then(|| Self::assemble(Arc::clone(&self.cells), &found))
    }

    /// Finds, for every region of this partition, the regions of `other`, of the same map, that it
    /// overlaps, with the share of its energy in each.
    pub fn shares_in(&self, other: &Self) -> Vec<Vec<(usize, f64)>> {
        let width = self.cells.width;
        let shares = |region: &Region| {
            let mut energy = vec![0.0; other.regions.len()];
            let rectangle = region.rectangle;
            for cells in rectangle.rows().map(|row| rectangle.cells(row, width)) {
                let others = &other.region_of_cell[cells.clone()];
                for (other, cell) in others.iter().zip(&self.cells.energy[cells]) {
                    energy[usize::from(*other)] += cell;
                }
            }
            let whole: f64 = energy.iter().sum();
            let parts = energy.into_iter().enumerate().filter(|(_, part)| *part > 0.0);
            parts.map(|(region, part)| (region, part / whole)).collect()
        };
        self.regions.par_iter().map(shares).collect()
    }

    fn assemble(cells: Arc<MapCells>, rectangles: &[Rectangle]) -> Self {
        let energy: f64 = cells.energy.iter().sum();
        let mut region_of_cell = vec![0; cells.energy.len()];
        for (index, rectangle) in rectangles.iter().enumerate() {
            for row in rectangle.rows() {
                region_of_cell[rectangle.cells(row, cells.width)].fill(index as u16);
            }
        }
        let tables: Vec<(f64, DVec3, Vec<AliasEntry>)> = rectangles
            .par_iter()
            .map(|rectangle| {
                let mut weights =
                    Vec::with_capacity((rectangle.size[0] * rectangle.size[1]) as usize);
                for row in rectangle.rows() {
                    weights.extend_from_slice(&cells.energy[rectangle.cells(row, cells.width)]);
                }
                let table = alias_table(&weights, CELL_SCALE).unwrap_or_else(|| {
                    // Nothing draws from a black region.
                    vec![AliasEntry { threshold: CELL_SCALE, alias: 0 }; weights.len()]
                });
                // Sum anew: differences of large sums would lose dim regions.
                (weights.iter().sum(), cells.direction_of(*rectangle), table)
            })
            .collect();
        let mut regions = Vec::with_capacity(rectangles.len());
        let mut entries = Vec::with_capacity(cells.energy.len());
        for (rectangle, (sum, direction, table)) in rectangles.iter().zip(tables) {
            regions.push(Region {
                rectangle: *rectangle,
                share: if energy > 0.0 { sum / energy } else { 0.0 },
                solid_angle: cells.row_angle[rectangle.rows()].iter().sum::<f64>()
                    * f64::from(rectangle.size[0]),
                direction,
                first_entry: entries.len(),
            });
            entries.extend(table);
        }
        Self { regions, entries, region_of_cell, cells }
    }

    /// Index of the region of `map` that holds a unit direction.
    pub fn region_of(&self, map: &EnvironmentMap, direction: Vec3) -> usize {
        let (column, row, _) = map.locate(direction);
        usize::from(self.region_of_cell[row as usize * self.cells.width + column as usize])
    }
}
