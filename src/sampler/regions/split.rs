//! Splits the cells of the map greedily into rectangles: energy and weight of every cell →
//! rectangles with little E^¼ · Ω^¾, where E is the weighted energy and Ω the weighted solid angle.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    math::{colour::luminance, refinement::refine},
    scene::environment::{EnvironmentMap, mean_sine},
};

/// Number of rectangles that are the parents of all later ones.
pub const PARENT_COUNT: usize = 64;

/// Energy and solid angle of every cell of a map, unnormalised.
#[derive(Debug)]
pub struct MapCells {
    pub width: usize,
    /// Rows, one more than the map has.
    pub rows: usize,
    pub energy: Vec<f64>,
    /// Solid angle of one cell by row, as a fraction of the sphere.
    pub row_angle: Vec<f64>,
    /// Sine and cosine of the azimuth at the centre of every column.
    azimuth: Vec<(f64, f64)>,
    /// Rotation of the map about +y, radians.
    rotation_rad: f64,
}

impl MapCells {
    /// Cells of `map`, each with the mean luminance of its four corners × its solid angle as energy.
    pub fn new(map: &EnvironmentMap) -> Self {
        let (width, rows) = (map.width as usize, map.height as usize + 1);
        let texel = |column: usize, row: usize| {
            f64::from(luminance(map.texels[row * width + column % width]))
        };
        let mut energy = Vec::with_capacity(width * rows);
        let mut row_angle = Vec::with_capacity(rows);
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
        }
        let turn = 2.0 * std::f64::consts::PI / width as f64;
        let azimuth = (1..=width).map(|column| (column as f64 * turn).sin_cos()).collect();
        Self { width, rows, energy, row_angle, azimuth, rotation_rad: f64::from(map.rotation_rad) }
    }

    /// Unit mean direction of a rectangle in the world, weighted by energy, or by solid angle if it is black.
    pub fn direction_of(&self, rectangle: Rectangle) -> DVec3 {
        let pi = std::f64::consts::PI;
        let energies = rectangle.rows().map(|row| &self.energy[rectangle.cells(row, self.width)]);
        let dark = energies.flatten().sum::<f64>() <= 0.0;
        let mut sum = DVec3::ZERO;
        for row in rectangle.rows() {
            let theta = pi * row as f64 / (self.rows - 1) as f64;
            let (sin_theta, cos_theta) = theta.sin_cos();
            for column in rectangle.columns() {
                let (sin_azimuth, cos_azimuth) = self.azimuth[column];
                let weight =
                    if dark { self.row_angle[row] } else { self.energy[row * self.width + column] };
                let direction =
                    DVec3::new(-sin_theta * sin_azimuth, cos_theta, sin_theta * cos_azimuth);
                sum += weight * direction;
            }
        }
        let in_map = sum.normalize_or(DVec3::Y);
        let (s, c) = self.rotation_rad.sin_cos();
        DVec3::new(c * in_map.x + s * in_map.z, in_map.y, c * in_map.z - s * in_map.x)
    }
}

/// Summed-area tables of weighted energy and solid angle (Crow 1984).
pub struct SummedAreas<'a> {
    cells: &'a MapCells,
    /// Energy and solid angle summed over all cells above and to the left.
    sums: Vec<[f64; 2]>,
}

impl<'a> SummedAreas<'a> {
    /// Sums over `cells`, each multiplied by the `weight` of its index.
    pub fn new(cells: &'a MapCells, weight: impl Fn(usize) -> f64 + Sync) -> Self {
        let (width, rows) = (cells.width, cells.rows);
        let mut sums = vec![[0.0; 2]; (width + 1) * (rows + 1)];
        let (_, below) = sums.split_at_mut(width + 1);
        below.par_chunks_mut(width + 1).enumerate().for_each(|(row, sums)| {
            let mut running = [0.0; 2];
            for (column, sum) in sums[1..].iter_mut().enumerate() {
                let weight = weight(row * width + column);
                running[0] += weight * cells.energy[row * width + column];
                running[1] += weight * cells.row_angle[row];
                *sum = running;
            }
        });
        for row in 1..rows {
            let (above, sums) = sums.split_at_mut((row + 1) * (width + 1));
            for (sum, above) in sums.iter_mut().zip(&above[row * (width + 1)..]).take(width + 1) {
                *sum = [above[0] + sum[0], above[1] + sum[1]];
            }
        }
        Self { cells, sums }
    }

    /// Cost of a rectangle, E^¼ Ω^¾.
    fn cost(&self, rectangle: Rectangle) -> f64 {
        let (Range { start: c0, end: c1 }, Range { start: r0, end: r1 }) =
            (rectangle.columns(), rectangle.rows());
        let at = |column: usize, row: usize| self.sums[row * (self.cells.width + 1) + column];
        let of = |index: usize| {
            (at(c1, r1)[index] - at(c0, r1)[index] - at(c1, r0)[index] + at(c0, r0)[index]).max(0.0)
        };
        of(0).powf(0.25) * of(1).powf(0.75)
    }

    /// Splits a rectangle across its longer side where the costs of the halves are most alike;
    /// `None` for a single cell.
    fn split(&self, rectangle: Rectangle) -> Option<[Rectangle; 2]> {
        let [columns, rows] = rectangle.size;
        let middle = rectangle.first[1] + rows / 2;
        let pi = std::f64::consts::PI;
        let sine = (pi * f64::from(middle) / (self.cells.rows - 1) as f64).sin().max(1e-3);
        let width = f64::from(columns) * 2.0 * pi / self.cells.width as f64 * sine;
        let height = f64::from(rows) * pi / (self.cells.rows - 1) as f64;
        let axis = usize::from(columns == 1 || (rows > 1 && height > width));
        let length = rectangle.size[axis];
        if length < 2 {
            return None;
        }
        let halves = |at: u32| {
            let (mut low, mut high) = (rectangle, rectangle);
            low.size[axis] = at;
            high.first[axis] += at;
            high.size[axis] = length - at;
            [low, high]
        };
        // Bisect: the difference of the costs grows with the position.
        let (mut first, mut last) = (1, length - 1);
        while first < last {
            let at = u32::midpoint(first, last);
            let [low, high] = halves(at);
            if self.cost(low) < self.cost(high) {
                first = at + 1;
            } else {
                last = at;
            }
        }
        Some(halves(first))
    }
}

/// A rectangle of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// First column and row of cells.
    pub first: [u32; 2],
    /// Number of columns and rows.
    pub size: [u32; 2],
    /// Index of the parent among the first [`PARENT_COUNT`] rectangles.
    pub parent: usize,
}

impl Rectangle {
    fn along(&self, axis: usize) -> Range<usize> {
        let first = self.first[axis] as usize;
        first..first + self.size[axis] as usize
    }

    /// Range of its columns.
    pub fn columns(&self) -> Range<usize> {
        self.along(0)
    }

    /// Range of its rows.
    pub fn rows(&self) -> Range<usize> {
        self.along(1)
    }

    /// Indices of its cells in a row of the map.
    pub fn cells(&self, row: usize, width: usize) -> Range<usize> {
        let Range { start, end } = self.columns();
        row * width + start..row * width + end
    }
}

/// Walks the linked list `next` from index 0.
fn list_order(next: &[usize]) -> Vec<usize> {
    std::iter::successors(Some(0), |&index| Some(next[index]).filter(|&next| next != usize::MAX))
        .collect()
}

/// Splits the whole map into `region_count` rectangles, or fewer if it runs out of cells to split. Returns
/// them in the order of the tree, so that neighbours in that order are mostly neighbours in the map.
pub fn split_greedily(sums: &SummedAreas, region_count: usize) -> Vec<Rectangle> {
    let size = [sums.cells.width, sums.cells.rows].map(|count| count as u32);
    let whole = Rectangle { first: [0, 0], size, parent: 0 };
    let mut rectangles = vec![whole];
    // Next rectangle in the order of the tree
    let mut next = vec![usize::MAX];
    // Black rectangles need no split.
    let priority = |rectangle: &Rectangle| Some(sums.cost(*rectangle)).filter(|cost| *cost > 0.0);
    refine(&mut rectangles, region_count, priority, |rectangles, index| {
        let Some([low, high]) = sums.split(rectangles[index]) else { return };
        rectangles[index] = low;
        rectangles.push(high);
        next.push(next[index]);
        next[index] = rectangles.len() - 1;
        if rectangles.len() <= PARENT_COUNT {
            // Later halves inherit the parent that is set last.
            for (rank, index) in list_order(&next).into_iter().enumerate() {
                rectangles[index].parent = rank;
            }
        }
    });
    list_order(&next).into_iter().map(|index| rectangles[index]).collect()
}
