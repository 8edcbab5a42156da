//! Directions of environment maps: twin of `environment_pdf`, `environment_sample` and
//! `environment_sample_cell` in `glsl/include/environment.glsl`.

use std::f32::consts::PI;

use fenestra::{
    math::{colour::luminance, frame::sin_cos_pi},
    scene::environment::{EnvironmentMap, EnvironmentTables},
};
use glam::{Vec2, Vec3};

/// Smallest sin θ at which densities are evaluated; keeps them finite at the poles.
const MIN_SIN_THETA: f32 = 1e-7;
/// Largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

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

/// Sampling by the tables of a map.
pub trait EnvironmentSampling {
    /// Cumulative probabilities of the rows of cells.
    fn row_cumulative(&self, map: &EnvironmentMap) -> &[f32];

    /// Cumulative probabilities of the cells of one row.
    fn cell_cumulative(&self, map: &EnvironmentMap, row: usize) -> &[f32];

    /// Density of [`Self::sample`] per steradian at a direction whose radiance is
    /// `map.radiance(direction)`.
    fn pdf(&self, map: &EnvironmentMap, direction: Vec3, radiance: Vec3) -> f32;

    /// Samples a direction with the density [`Self::pdf`] from two numbers in [0, 1).
    fn sample(&self, map: &EnvironmentMap, u: [f32; 2]) -> EnvironmentSample;

    /// Samples a direction within the cell `[column, row]` from two numbers in [0, 1), with density
    /// proportional to the weight in (u, v). The sample's pdf is that of [`Self::sample`], over the
    /// whole map.
    fn sample_cell(&self, map: &EnvironmentMap, cell: [u32; 2], u: [f32; 2]) -> EnvironmentSample;
}

impl EnvironmentSampling for EnvironmentTables {
    fn row_cumulative(&self, map: &EnvironmentMap) -> &[f32] {
        &self.rows[..=map.height as usize]
    }

    fn cell_cumulative(&self, map: &EnvironmentMap, row: usize) -> &[f32] {
        row_of(self, map, row).0
    }

    fn pdf(&self, map: &EnvironmentMap, direction: Vec3, radiance: Vec3) -> f32 {
        if self.total <= 0.0 {
            return 0.0;
        }
        let sin_theta = (direction.x * direction.x + direction.z * direction.z).sqrt();
        let v = sin_theta.atan2(direction.y) / PI;
        let row = ((v * map.height as f32 + 0.5) as u32).min(map.height);
        let weight = if self.compensation > 0.0 {
            let (column, row, position) = map.locate(direction);
            weight_at(self, map, [column, row], position)
        } else {
            luminance(radiance)
        };
        density(self, map, weight, row, sin_theta)
    }

    fn sample(&self, map: &EnvironmentMap, u: [f32; 2]) -> EnvironmentSample {
        if self.total <= 0.0 {
            return EnvironmentSample { direction: Vec3::Y, radiance: Vec3::ZERO, pdf: 0.0 };
        }
        let row_guide = &self.rows[2 * (map.height as usize + 1)..];
        let (row, before, after) = search(self.row_cumulative(map), row_guide, u[1]);
        let row_remainder = ((u[1] - before) / (after - before)).min(BELOW_ONE);
        let (cumulative, guide) = row_of(self, map, row);
        let (column, before, after) = search(cumulative, guide, u[0]);
        let column_remainder = ((u[0] - before) / (after - before)).min(BELOW_ONE);
        self.sample_cell(map, [column as u32, row as u32], [column_remainder, row_remainder])
    }

    fn sample_cell(
        &self,
        map: &EnvironmentMap,
        [column, row]: [u32; 2],
        u: [f32; 2],
    ) -> EnvironmentSample {
        let (width, height) = (map.width, map.height);
        // Sample the bilinear patch: its marginal along v, then its row at that v.
        let texels = texels_of(map, [column, row]);
        let [l00, l10, l01, l11] = texels.map(|texel| self.weight(texel));
        let y = sample_linear(l00 + l10, l01 + l11, u[1]);
        let x = sample_linear(lerp(l00, l01, y), lerp(l10, l11, y), u[0]);
        let [c00, c10, c01, c11] = texels;
        let radiance = c00.lerp(c10, x).lerp(c01.lerp(c11, x), y);
        let weight = if self.compensation > 0.0 {
            weight_at(self, map, [column, row], Vec2::new(x, y))
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
        let cosine = if northern { theta.y } else { -theta.y };
        let direction = Vec3::new(-theta.x * azimuth.x, cosine, theta.x * azimuth.y);
        let (s, c) = map.rotation_rad.sin_cos();
        EnvironmentSample {
            direction: Vec3::new(
                c * direction.x + s * direction.z,
                direction.y,
                c * direction.z - s * direction.x,
            ),
            radiance,
            pdf: density(self, map, weight, row, theta.x),
        }
    }
}

/// Cumulative probabilities of the cells of one row, and their guide.
fn row_of<'a>(
    tables: &'a EnvironmentTables,
    map: &EnvironmentMap,
    row: usize,
) -> (&'a [f32], &'a [f32]) {
    let stride = tables.cells.len() / (map.height as usize + 1);
    tables.cells[row * stride..][..stride].split_at(map.width as usize)
}

/// Radiance at the four texel centres around a cell.
fn texels_of(map: &EnvironmentMap, [column, row]: [u32; 2]) -> [Vec3; 4] {
    let next = if column + 1 == map.width { 0 } else { column + 1 };
    let (upper, lower) = (row.saturating_sub(1), row.min(map.height - 1));
    [[column, upper], [next, upper], [column, lower], [next, lower]]
        .map(|[column, row]| map.texels[(row * map.width + column) as usize])
}

/// Weight at a position inside a cell, interpolated between its texels.
fn weight_at(
    tables: &EnvironmentTables,
    map: &EnvironmentMap,
    cell: [u32; 2],
    position: Vec2,
) -> f32 {
    let [w00, w10, w01, w11] = texels_of(map, cell).map(|texel| tables.weight(texel));
    lerp(lerp(w00, w10, position.x), lerp(w01, w11, position.x), position.y)
}

fn density(
    tables: &EnvironmentTables,
    map: &EnvironmentMap,
    weight: f32,
    row: u32,
    sin_theta: f32,
) -> f32 {
    let mean_sine = tables.rows[(map.height + 1 + row) as usize];
    weight * mean_sine / (tables.total * 2.0 * PI * PI * sin_theta.max(MIN_SIN_THETA))
}

/// Draws a position in [0, 1) with density proportional to the line from `a` to `b`.
fn sample_linear(a: f32, b: f32, u: f32) -> f32 {
    let sum = a + b;
    let start = if sum > 0.0 { a / sum } else { 0.5 };
    let end = 1.0 - start;
    let divisor = start + lerp(start * start, end * end, u).sqrt();
    if divisor > 0.0 { (u / divisor).min(BELOW_ONE) } else { 0.0 }
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
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
