//! Sampling tables of an environment map: the exact density of its bilinear radiance.
//!
//! [`EnvironmentMap`] → [`EnvironmentTables`], the contents of the device buffers
//! `environment_rows` and `environment_cells`, which `glsl/include/environment.glsl` samples.
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

use glam::Vec3;
use rayon::prelude::*;

use super::EnvironmentMap;
use crate::math::{colour::luminance, write_cumulative};

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

/// Weight of a texel in tables with a compensation.
fn weight_of(texel: Vec3, compensation: f32) -> f32 {
    (luminance(texel) - compensation).max(0.0)
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
    /// Number of entries of [`EnvironmentTables::cells`] for a map of so many texels.
    pub fn cell_count(width: u32, height: u32) -> usize {
        let width = width as usize;
        (width + guide_size(width) + 1) * (height as usize + 1)
    }

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
        let mut cells = vec![0.0; Self::cell_count(map.width, map.height)];
        let stride = cells.len() / row_count;
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
}
