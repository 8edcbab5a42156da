//! The environment as nested rectangles of its sampling cells, each with an exact table of its own.
//!
//! [`EnvironmentMap`] → [`Partition`]. The atoms are those of
//! [`EnvironmentTables`](crate::scene::environment::EnvironmentTables): `height + 1` rows of `width`
//! cells between texel centres, a cell's share of the whole density being P_cell. Greedy splits of
//! the rectangle with the largest E^¼ · Ω^¾ (E its share of the energy, Ω its solid angle) give
//! rectangles that are small where the map is bright without leaving the dark parts coarse.
//!
//! A region r is chosen first, then one of its cells by an alias table with P_cell / P_region, then
//! a direction in the cell's bilinear patch. Hence p(ω|r) = pdf(ω) / P_region with the pdf of the
//! whole map: one table per region and no residual of any fit.

use std::{cmp::Ordering, collections::BinaryHeap};

use glam::{DVec3, Vec3};

use super::alias::{AliasEntry, alias_table};
use crate::scene::environment::{EnvironmentMap, luminance, mean_sine};

/// Number of regions that are the angular parents of all others.
pub const PARENT_COUNT: usize = 64;

/// Scale of the thresholds of the cells' alias tables.
pub const CELL_SCALE: u64 = 1 << 32;

/// A rectangle of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// First column and row of cells.
    pub first: [u32; 2],
    /// Columns and rows of cells.
    pub size: [u32; 2],
    /// Share of the map's energy ∫ lum L dω: P_region.
    pub share: f64,
    /// Solid angle as a share of the sphere.
    pub solid_angle: f64,
    /// Unit mean direction in the world, weighted by energy.
    pub direction: DVec3,
    /// Index of the parent among the first [`PARENT_COUNT`] rectangles.
    pub parent: usize,
    /// First entry of the region's alias table.
    pub first_entry: usize,
}

/// A map split into regions.
#[derive(Clone, Debug)]
pub struct Partition {
    /// The regions; none overlap, together they are the map.
    pub regions: Vec<Region>,
    /// Number of parents: [`PARENT_COUNT`] unless the map has fewer cells or regions.
    pub parent_count: usize,
    /// Alias tables over the cells of each region, row by row.
    pub entries: Vec<AliasEntry>,
    /// Region of every cell, `height + 1` rows of `width`.
    pub region_of_cell: Vec<u16>,
    /// Columns of cells.
    pub width: u32,
    /// Rows of cells, one more than the map has.
    pub rows: u32,
}

/// Energy and solid angle of every cell, unnormalised, and sums over rectangles.
struct Cells {
    width: usize,
    rows: usize,
    /// Energy per cell.
    energy: Vec<f64>,
    /// Sums of `energy` over all cells above and to the left.
    sums: Vec<f64>,
    /// Solid angle of one cell by row, as a share of the sphere, and its running sums.
    row_angle: Vec<f64>,
    row_angle_sums: Vec<f64>,
}

impl Cells {
    fn new(map: &EnvironmentMap) -> Self {
        let (width, rows) = (map.width as usize, map.height as usize + 1);
        let texel = |column: usize, row: usize| {
            f64::from(luminance(map.texels[row * width + column % width]))
        };
        let mut energy = Vec::with_capacity(width * rows);
        let mut row_angle = Vec::with_capacity(rows);
        let mut row_angle_sums = vec![0.0];
        for row in 0..rows {
            let (upper, lower) = (row.saturating_sub(1), row.min(rows - 2));
            let height = if row == 0 || row + 1 == rows { 0.5 } else { 1.0 };
            let sine = height * mean_sine(row as u32, map.height);
            let edge: Vec<f64> =
                (0..width).map(|column| texel(column, upper) + texel(column, lower)).collect();
            energy.extend(
                (0..width).map(|column| 0.25 * sine * (edge[column] + edge[(column + 1) % width])),
            );
            row_angle.push(sine);
        }
        let whole: f64 = row_angle.iter().sum::<f64>() * width as f64;
        for angle in &mut row_angle {
            *angle /= whole;
            row_angle_sums.push(row_angle_sums.last().copied().unwrap_or(0.0) + *angle);
        }
        let mut sums = vec![0.0; (width + 1) * (rows + 1)];
        for row in 0..rows {
            let mut running = 0.0;
            for column in 0..width {
                running += energy[row * width + column];
                sums[(row + 1) * (width + 1) + column + 1] =
                    sums[row * (width + 1) + column + 1] + running;
            }
        }
        Self { width, rows, energy, sums, row_angle, row_angle_sums }
    }

    fn energy_of(&self, rectangle: Rectangle) -> f64 {
        let [c0, r0] = rectangle.first;
        let [c1, r1] = [c0 + rectangle.size[0], r0 + rectangle.size[1]];
        let at = |column: usize, row: usize| self.sums[row * (self.width + 1) + column];
        (at(c1, r1) - at(c0, r1) - at(c1, r0) + at(c0, r0)).max(0.0)
    }

    fn solid_angle_of(&self, rectangle: Rectangle) -> f64 {
        let [_, r0] = rectangle.first;
        (self.row_angle_sums[r0 + rectangle.size[1]] - self.row_angle_sums[r0])
            * rectangle.size[0] as f64
    }

    /// What the greedy splits make small: E^¼ Ω^¾.
    fn cost(&self, rectangle: Rectangle) -> f64 {
        self.energy_of(rectangle).powf(0.25) * self.solid_angle_of(rectangle).powf(0.75)
    }

    /// Splits across the longer side where the two costs are nearest to each other.
    fn split(&self, rectangle: Rectangle) -> Option<[Rectangle; 2]> {
        let [columns, rows] = rectangle.size;
        let middle = rectangle.first[1] + rows / 2;
        let pi = std::f64::consts::PI;
        let sine = (pi * middle as f64 / (self.rows - 1) as f64).sin().max(1e-3);
        let width = columns as f64 * 2.0 * pi / self.width as f64 * sine;
        let height = rows as f64 * pi / (self.rows - 1) as f64;
        let axis = usize::from(columns == 1 || (rows > 1 && height > width));
        let length = rectangle.size[axis];
        if length < 2 {
            return None;
        }
        let halves = |at: usize| {
            let (mut low, mut high) = (rectangle, rectangle);
            low.size[axis] = at;
            high.first[axis] += at;
            high.size[axis] = length - at;
            [low, high]
        };
        // The difference grows with the position: bisect.
        let (mut first, mut last) = (1, length - 1);
        while first < last {
            let at = usize::midpoint(first, last);
            let [low, high] = halves(at);
            if self.cost(low) < self.cost(high) {
                first = at + 1;
            } else {
                last = at;
            }
        }
        Some(halves(first))
    }

    /// Sum of directions in the frame of the map, weighted by energy, or by solid angle where there
    /// is none.
    fn direction_of(&self, rectangle: Rectangle) -> DVec3 {
        let pi = std::f64::consts::PI;
        let dark = self.energy_of(rectangle) <= 0.0;
        let mut sum = DVec3::ZERO;
        for row in rectangle.first[1]..rectangle.first[1] + rectangle.size[1] {
            let theta = pi * row as f64 / (self.rows - 1) as f64;
            let (sin_theta, cos_theta) = theta.sin_cos();
            for column in rectangle.first[0]..rectangle.first[0] + rectangle.size[0] {
                let azimuth = 2.0 * pi * (column as f64 + 1.0) / self.width as f64;
                let weight =
                    if dark { self.row_angle[row] } else { self.energy[row * self.width + column] };
                let direction =
                    DVec3::new(-sin_theta * azimuth.sin(), cos_theta, sin_theta * azimuth.cos());
                sum += weight * direction;
            }
        }
        sum.normalize_or(DVec3::Y)
    }
}

#[derive(Clone, Copy, Debug)]
struct Rectangle {
    first: [usize; 2],
    size: [usize; 2],
}

/// A rectangle in the queue of those to split; ties go to the one that was made first.
struct Queued {
    cost: f64,
    index: usize,
}

impl PartialEq for Queued {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Queued {}

impl PartialOrd for Queued {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Queued {
    fn cmp(&self, other: &Self) -> Ordering {
        self.cost.total_cmp(&other.cost).then(other.index.cmp(&self.index))
    }
}

/// Indices from 0 on, each followed by `next` of it.
fn in_order(next: &[usize]) -> Vec<usize> {
    std::iter::successors(Some(0), |&index| Some(next[index]).filter(|&next| next != usize::MAX))
        .collect()
}

impl Partition {
    /// Splits `map` into `region_count` regions, or as many as it has cells that can be split.
    ///
    /// # Panics
    /// If `region_count` is not from 1 to 1024.
    pub fn new(map: &EnvironmentMap, region_count: usize) -> Self {
        assert!((1..=1024).contains(&region_count), "1 to 1024 regions");
        let cells = Cells::new(map);
        let whole = Rectangle { first: [0, 0], size: [cells.width, cells.rows] };
        let mut rectangles = vec![whole];
        let mut parents: Option<Vec<usize>> = None;
        let mut parent_count = 1;
        let mut queue = BinaryHeap::from([Queued { cost: cells.cost(whole), index: 0 }]);
        // What comes after each rectangle in the order of the tree, so that neighbours in that order
        // are mostly neighbours in the map.
        let mut next = vec![usize::MAX];
        while rectangles.len() < region_count {
            if rectangles.len() == PARENT_COUNT && parents.is_none() {
                let mut ranks = vec![0; PARENT_COUNT];
                for (rank, index) in in_order(&next).into_iter().enumerate() {
                    ranks[index] = rank;
                }
                parents = Some(ranks);
                parent_count = PARENT_COUNT;
            }
            // What is black need not be told apart.
            let Some(Queued { index, cost }) = queue.pop() else { break };
            if cost <= 0.0 {
                break;
            }
            let Some([low, high]) = cells.split(rectangles[index]) else { continue };
            rectangles[index] = low;
            rectangles.push(high);
            next.push(next[index]);
            next[index] = rectangles.len() - 1;
            if let Some(parents) = &mut parents {
                parents.push(parents[index]);
            }
            for index in [index, rectangles.len() - 1] {
                queue.push(Queued { cost: cells.cost(rectangles[index]), index });
            }
        }
        let order = in_order(&next);
        let parents: Vec<usize> = parents.map_or_else(
            || {
                parent_count = rectangles.len();
                (0..rectangles.len()).collect()
            },
            |parents| order.iter().map(|&index| parents[index]).collect(),
        );
        let rectangles: Vec<Rectangle> = order.iter().map(|&index| rectangles[index]).collect();

        let energy: f64 = cells.energy.iter().sum();
        let mut regions = Vec::with_capacity(rectangles.len());
        let mut entries = Vec::with_capacity(cells.energy.len());
        let mut region_of_cell = vec![0; cells.energy.len()];
        let (s, c) = f64::from(map.rotation_rad).sin_cos();
        for (index, (rectangle, parent)) in rectangles.iter().zip(parents).enumerate() {
            let mut weights = Vec::with_capacity(rectangle.size[0] * rectangle.size[1]);
            for row in rectangle.first[1]..rectangle.first[1] + rectangle.size[1] {
                let first = row * cells.width + rectangle.first[0];
                weights.extend_from_slice(&cells.energy[first..][..rectangle.size[0]]);
                region_of_cell[first..][..rectangle.size[0]].fill(index as u16);
            }
            let in_map = cells.direction_of(*rectangle);
            regions.push(Region {
                first: rectangle.first.map(|value| value as u32),
                size: rectangle.size.map(|value| value as u32),
                // Summed again: differences of large sums would lose what is dim.
                share: if energy > 0.0 { weights.iter().sum::<f64>() / energy } else { 0.0 },
                solid_angle: cells.solid_angle_of(*rectangle),
                direction: DVec3::new(
                    c * in_map.x + s * in_map.z,
                    in_map.y,
                    c * in_map.z - s * in_map.x,
                ),
                parent,
                first_entry: entries.len(),
            });
            entries.extend(alias_table(&weights, CELL_SCALE).unwrap_or_else(|| {
                // A black region is never chosen.
                vec![AliasEntry { threshold: CELL_SCALE, alias: 0 }; weights.len()]
            }));
        }
        Self {
            regions,
            parent_count,
            entries,
            region_of_cell,
            width: map.width,
            rows: map.height + 1,
        }
    }

    /// Index of the region of `map` that a unit direction lies in.
    pub fn region_of(&self, map: &EnvironmentMap, direction: Vec3) -> usize {
        let (column, row, _) = map.locate(direction);
        usize::from(self.region_of_cell[(row * self.width + column) as usize])
    }

    /// Column and row of the cell that `bits` choose in region `index`, as the shader does: the
    /// first word the column of the alias table, the second keeps it or takes the alias.
    pub fn choose_cell(&self, index: usize, bits: [u32; 2]) -> [u32; 2] {
        let region = &self.regions[index];
        let count = region.size[0] * region.size[1];
        let own = ((u64::from(bits[0]) * u64::from(count)) >> 32) as u32;
        let entry = self.entries[region.first_entry + own as usize];
        let chosen = if u64::from(bits[1]) < entry.threshold { own } else { entry.alias };
        [region.first[0] + chosen % region.size[0], region.first[1] + chosen / region.size[0]]
    }
}
