//! Sampling tables of an environment map: the exact density of its bilinear radiance.
//!
//! [`EnvironmentMap`] → [`EnvironmentTables`], the contents of the device buffers
//! `environment_rows` and `environment_cells`. Twin of `environment_pdf` and `environment_sample`
//! in `glsl/include/environment.glsl`.
//!
//! Sampling chooses a cell between four texel centres, then a point inside it. There are
//! `height + 1` rows of `width` cells; the first and last rows are half as high, since v is clamped
//! there. A cell has probability P = s(row) · ∬ lum L du dv / total, where s(row) is the mean of
//! sin θ over the v of its row and total makes the sum 1. Inside, (u, v) is drawn exactly from the
//! bilinear patch. Hence, per steradian,
//!
//! pdf(ω) = lum L(ω) · s(row) / (total · 2π² sin θ),
//!
//! and no table per cell is needed. Within a row, L/pdf varies only with sin θ. Cumulative
//! probabilities are single precision, so a cell's probability within its row is off by up to 2⁻²⁴,
//! with errors of opposite sign in its neighbours.
//!
//! Compensated tables have max(lum L − C, 0) at the texel centres in place of lum L, bilinear in
//! between: under multiple importance sampling the BRDF's samples cover what is below C [Karlík et
//! al. 2019, "MIS Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling"].
//! They draw nothing where all four texels around are below C.

use std::f64::consts::PI;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::EnvironmentMap;
use crate::math::colour::luminance;
use crate::math::frame::sin_cos_pi;

/// Smallest sin θ at which densities are evaluated; keeps them finite at the poles.
const MIN_SIN_THETA: f32 = 1e-7;

/// Largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Luminance C that compensated tables subtract, in means of the map over the sphere: at least half of
/// the energy is left, and without contrast the density stays as it is. Chosen by measurement
/// (`docs/experiments.md`, mis_compensation).
const COMPENSATION: f64 = 0.5;

/// Contents of the device buffers that sample an environment map.
#[derive(Clone, Debug)]
pub struct EnvironmentTables {
    /// `2 * (height + 1)` numbers: the cumulative probability up to and including each row of cells
    /// (1 from the last row that is not black on), then the mean of sin θ over each row. Then the
    /// guide of the former (see `guide_size`).
    pub rows: Vec<f32>,
    /// For each of the `height + 1` rows: `width` cumulative probabilities within the row, up to
    /// and including each cell (1 from the last cell that is not black on; all 1 in a black row),
    /// then their guide.
    pub cells: Vec<f32>,
    /// Σ s(row) · ∬ lum L du dv over all cells; 0 for a black map, whose samples have pdf 0.
    pub total: f32,
    /// Luminance C that the weight of every texel lacks; 0 without compensation.
    pub compensation: f32,
}

/// Sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentSample {
    /// Unit direction in the world.
    pub direction: Vec3,
    /// Radiance from that direction.
    pub radiance: Vec3,
    /// Density per steradian; 0 if the map is black and nothing can be sampled.
    pub pdf: f32,
}

/// Mean of sin θ over row `row` of cells, in closed form.
pub fn mean_sine(row: u32, height: u32) -> f64 {
    let row_angle = PI / f64::from(height);
    let half = 0.5 * row_angle;
    if row == 0 || row == height {
        // (1 − cos half) / half without cancellation.
        2.0 * (0.5 * half).sin().powi(2) / half
    } else {
        (row_angle * f64::from(row.min(height - row))).sin() * half.sin() / half
    }
}

/// Draws a position in [0, 1) with density proportional to the line from `a` to `b`.
fn sample_linear(a: f32, b: f32, u: f32) -> f32 {
    let sum = a + b;
    let start = if sum > 0.0 { a / sum } else { 0.5 };
    let end = 1.0 - start;
    let divisor = start + lerp(start * start, end * end, u).sqrt();
    if divisor > 0.0 { (u / divisor).min(BELOW_ONE) } else { 0.0 }
}

/// Weight of a texel in tables with a compensation.
fn weight_of(texel: Vec3, compensation: f32) -> f32 {
    (luminance(texel) - compensation).max(0.0)
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// Writes the cumulative distribution of `weights` in single precision and returns their sum.
/// Entries never decrease, repeat where a weight is 0, and are 1 from the last positive weight on.
fn write_cumulative(weights: impl Iterator<Item = f64> + Clone, cumulative: &mut [f32]) -> f64 {
    let sum: f64 = weights.clone().sum();
    let last = weights.clone().enumerate().filter(|(_, weight)| *weight > 0.0).last();
    let last = last.map_or(0, |(index, _)| index);
    let mut running = 0.0;
    for (index, (weight, entry)) in weights.zip(cumulative.iter_mut()).enumerate() {
        running += weight;
        *entry = if index >= last { 1.0 } else { ((running / sum) as f32).min(1.0) };
    }
    sum
}

/// Number of intervals in the guide of a cumulative distribution of `count` entries: a power of
/// two, so that u · size is exact, and at least half of `count`.
///
/// Entry k of the guide is the first index whose cumulative probability exceeds k / size; the last
/// entry is the last index. A u in interval k is found between entries k and k + 1. Chen & Asau
/// 1974, "On Generating Random Variates from an Empirical Distribution".
pub(super) fn guide_size(count: usize) -> usize {
    if count > 2 { 1 << (count - 1).ilog2() } else { 1 }
}

/// Writes the guide of `cumulative`, `guide_size + 1` entries, as numbers that `f32` holds exactly.
fn write_guide(cumulative: &[f32], guide: &mut [f32]) {
    let size = guide.len() - 1;
    let mut index = 0;
    for (interval, entry) in guide.iter_mut().enumerate() {
        let start = interval as f32 / size as f32;
        while index + 1 < cumulative.len() && cumulative[index] <= start {
            index += 1;
        }
        *entry = index as f32;
    }
}

/// Finds the first entry above `u`; returns its index, the entry before it and the entry.
fn search(cumulative: &[f32], guide: &[f32], u: f32) -> (usize, f32, f32) {
    let interval = (u * (guide.len() - 1) as f32) as usize;
    let (mut first, mut last) = (guide[interval] as usize, guide[interval + 1] as usize);
    while first < last {
        let middle = (first + last) / 2;
        if cumulative[middle] > u {
            last = middle;
        } else {
            first = middle + 1;
        }
    }
    let before = if first > 0 { cumulative[first - 1] } else { 0.0 };
    (first, before, cumulative[first])
}

/// Returns the luminance C to subtract from `map`, from its texels at their centres.
fn compensation(map: &EnvironmentMap) -> f32 {
    let rows = map.texels.par_chunks(map.width as usize).enumerate().map(|(row, texels)| {
        let sine = (PI * (row as f64 + 0.5) / f64::from(map.height)).sin();
        let sum: f64 = texels.iter().map(|texel| f64::from(luminance(*texel))).sum();
        [sine * sum, sine * texels.len() as f64]
    });
    // Collect before summing: the order of a parallel sum is not fixed.
    let rows: Vec<[f64; 2]> = rows.collect();
    let sum = |index: usize| rows.iter().map(|row| row[index]).sum::<f64>();
    let compensation = (COMPENSATION * sum(0) / sum(1)) as f32;
    if compensation.is_normal() { compensation } else { 0.0 }
}

impl EnvironmentTables {
    /// Builds the tables of `map` in O(texels), in parallel over rows, summed in double precision.
    pub fn new(map: &EnvironmentMap) -> Self {
        Self::with_compensation(map, 0.0)
    }

    /// Builds the tables of `map` for samples that are weighed against those of BRDFs.
    pub fn compensated(map: &EnvironmentMap) -> Self {
        Self::with_compensation(map, compensation(map))
    }

    fn with_compensation(map: &EnvironmentMap, compensation: f32) -> Self {
        let (width, height) = (map.width as usize, map.height);
        let row_count = height as usize + 1;
        let stride = width + guide_size(width) + 1;
        let mut cells = vec![0.0; stride * row_count];
        let row_weights: Vec<f64> = cells
            .par_chunks_mut(stride)
            .enumerate()
            .map(|(row, chunk)| {
                let (cumulative, guide) = chunk.split_at_mut(width);
                let row = row as u32;
                let texel_row = |row: u32| &map.texels[row as usize * width..][..width];
                let (upper, lower) =
                    (texel_row(row.saturating_sub(1)), texel_row(row.min(height - 1)));
                let edge: Vec<f64> = upper
                    .iter()
                    .zip(lower)
                    .map(|(a, b)| {
                        let weight = |texel| f64::from(weight_of(texel, compensation));
                        weight(*a) + weight(*b)
                    })
                    .collect();
                let weights = (0..width).map(|column| {
                    edge[column] + edge[if column + 1 == width { 0 } else { column + 1 }]
                });
                let row_height = if row == 0 || row == height { 0.5 } else { 1.0 };
                let sum = write_cumulative(weights, cumulative);
                write_guide(cumulative, guide);
                0.25 * row_height * mean_sine(row, height) * sum
            })
            .collect();
        let mut rows = vec![0.0; row_count];
        let sum = write_cumulative(row_weights.iter().copied(), &mut rows);
        let mut guide = vec![0.0; guide_size(row_count) + 1];
        write_guide(&rows, &mut guide);
        rows.extend((0..=height).map(|row| mean_sine(row, height) as f32));
        rows.extend(guide);
        let total = (sum / (width as f64 * f64::from(height))) as f32;
        Self { rows, cells, total: if total.is_normal() { total } else { 0.0 }, compensation }
    }

    /// Weight of a texel in the density: its luminance above the compensation.
    pub fn weight(&self, texel: Vec3) -> f32 {
        weight_of(texel, self.compensation)
    }

    /// Cumulative probabilities of the rows of cells of `map`.
    pub fn row_cumulative(&self, map: &EnvironmentMap) -> &[f32] {
        &self.rows[..=map.height as usize]
    }

    /// Cumulative probabilities of the cells of one row of `map`.
    pub fn cell_cumulative(&self, map: &EnvironmentMap, row: usize) -> &[f32] {
        self.row(map, row).0
    }

    /// Cumulative probabilities of the cells of one row, and their guide.
    fn row(&self, map: &EnvironmentMap, row: usize) -> (&[f32], &[f32]) {
        let width = map.width as usize;
        let stride = width + guide_size(width) + 1;
        self.cells[row * stride..][..stride].split_at(width)
    }

    /// Density of [`Self::sample`] per steradian at a direction whose radiance is
    /// `map.radiance(direction)`. Twin of `environment_pdf`.
    pub fn pdf(&self, map: &EnvironmentMap, direction: Vec3, radiance: Vec3) -> f32 {
        if self.total <= 0.0 {
            return 0.0;
        }
        let sin_theta = (direction.x * direction.x + direction.z * direction.z).sqrt();
        let v = sin_theta.atan2(direction.y) / std::f32::consts::PI;
        let row = ((v * map.height as f32 + 0.5) as u32).min(map.height);
        let weight = if self.compensation > 0.0 {
            let (column, row, position) = map.locate(direction);
            self.weight_at(map, [column, row], position)
        } else {
            luminance(radiance)
        };
        self.density(map, weight, row, sin_theta)
    }

    /// Weight at a position inside a cell, interpolated between its texels.
    fn weight_at(&self, map: &EnvironmentMap, [column, row]: [u32; 2], position: Vec2) -> f32 {
        let cell = map.cell(column, row);
        let [w00, w10, w01, w11] =
            [cell.c00, cell.c10, cell.c01, cell.c11].map(|texel| self.weight(texel));
        lerp(lerp(w00, w10, position.x), lerp(w01, w11, position.x), position.y)
    }

    fn density(&self, map: &EnvironmentMap, weight: f32, row: u32, sin_theta: f32) -> f32 {
        let mean_sine = self.rows[(map.height + 1 + row) as usize];
        let pi = std::f32::consts::PI;
        weight * mean_sine / (self.total * 2.0 * pi * pi * sin_theta.max(MIN_SIN_THETA))
    }

    /// Samples a direction with the density [`Self::pdf`] from two numbers in [0, 1). Twin of
    /// `environment_sample`.
    pub fn sample(&self, map: &EnvironmentMap, u: [f32; 2]) -> EnvironmentSample {
        if self.total <= 0.0 {
            return EnvironmentSample { direction: Vec3::Y, radiance: Vec3::ZERO, pdf: 0.0 };
        }
        let height = map.height;
        let row_guide = &self.rows[2 * (height as usize + 1)..];
        let (row, before, after) = search(self.row_cumulative(map), row_guide, u[1]);
        let row_remainder = ((u[1] - before) / (after - before)).min(BELOW_ONE);
        let (cumulative, guide) = self.row(map, row);
        let (column, before, after) = search(cumulative, guide, u[0]);
        let column_remainder = ((u[0] - before) / (after - before)).min(BELOW_ONE);
        self.sample_cell(map, [column as u32, row as u32], [column_remainder, row_remainder])
    }

    /// Samples a direction within the cell `[column, row]` from two numbers in [0, 1), with density
    /// proportional to the weight in (u, v). The sample's pdf is that of [`Self::sample`], over the
    /// whole map. Twin of `environment_sample_cell`.
    pub fn sample_cell(
        &self,
        map: &EnvironmentMap,
        [column, row]: [u32; 2],
        u: [f32; 2],
    ) -> EnvironmentSample {
        let (width, height) = (map.width, map.height);
        // Sample the bilinear patch: its marginal along v, then its row at that v.
        let cell = map.cell(column, row);
        let [l00, l10, l01, l11] =
            [cell.c00, cell.c10, cell.c01, cell.c11].map(|texel| self.weight(texel));
        let y = sample_linear(l00 + l10, l01 + l11, u[1]);
        let x = sample_linear(lerp(l00, l01, y), lerp(l10, l11, y), u[0]);
        let radiance = cell.interpolate(Vec2::new(x, y));
        let weight = if self.compensation > 0.0 {
            self.weight_at(map, [column, row], Vec2::new(x, y))
        } else {
            luminance(radiance)
        };

        // Measure the polar angle from the nearer pole, in rows, so that it keeps its relative
        // accuracy; the first and last rows are half cells.
        let northern = 2 * row <= height;
        let from_pole = if row == 0 {
            0.5 * y
        } else if row == height {
            0.5 * (1.0 - y)
        } else if northern {
            row as f32 - 0.5 + y
        } else {
            (height - row) as f32 + 0.5 - y
        };
        let theta = sin_cos_pi(from_pole / height as f32);
        let u = column as f32 + 0.5 + x;
        let u = if u >= width as f32 { u - width as f32 } else { u };
        let azimuth = sin_cos_pi(2.0 * u / width as f32);
        let direction = Vec3::new(
            -theta.x * azimuth.x,
            if northern { theta.y } else { -theta.y },
            theta.x * azimuth.y,
        );
        EnvironmentSample {
            direction: map.world_from_map(direction),
            radiance,
            pdf: self.density(map, weight, row, theta.x),
        }
    }
}
