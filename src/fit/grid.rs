//! Environment map as a fit sees it: radiance per cell of a lat-long grid in the frame of the map,
//! cut into patches and compared with a mixture.

use std::f64::consts::PI;

use glam::{DVec3, Vec2, Vec3};

use super::{config, points::Patch};
use crate::{
    math::{colour::luminance, frame::direction_from_lat_long, refinement::refine},
    scene::EnvironmentMap,
};

/// Smallest grid width. Coarser maps are resampled to resolve their bilinear slopes.
const MIN_WIDTH: usize = 512;
/// Sums kept per cell: luminance, red, green, blue, first moments of luminance.
const CHANNELS: usize = 7;

/// Parts along each side of a steep cell.
pub(crate) const STEEP_PARTS: usize = 4;
/// Share of the energy above which a steep cell is cut into its parts.
const HEAVY_SHARE: f64 = 1e-4;

/// Sums of a patch.
fn channels(patch: &ColouredPatch) -> [f64; CHANNELS] {
    let (colour, moment) = (patch.colour, patch.patch.moment);
    [patch.patch.energy, colour.x, colour.y, colour.z, moment.x, moment.y, moment.z]
}

/// Radiance per cell, row 0 at +Y.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Cells per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Radiance at the centre of each cell.
    pub radiance: Vec<Vec3>,
}

#[derive(Clone, Copy, Debug)]
struct Rectangle {
    x0: usize,
    y0: usize,
    x1: usize,
    y1: usize,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct ColouredPatch {
    /// Luminance.
    pub patch: Patch,
    /// Integral of red, green and blue over the patch.
    pub colour: DVec3,
}

impl Grid {
    /// The map without its rotation, at its own resolution or a multiple of it.
    pub(crate) fn new(map: &EnvironmentMap) -> Self {
        let (width, height) = (map.width as usize, map.height as usize);
        let factor = MIN_WIDTH.div_ceil(width.max(1));
        if factor <= 1 {
            return Self { width, height, radiance: map.texels.clone() };
        }
        let unturned = EnvironmentMap { rotation_rad: 0.0, ..map.clone() };
        let (width, height) = (factor * width, factor * height);
        let cell = |index: usize| {
            let (i, j) = (index % width, index / width);
            let uv = Vec2::new((i as f32 + 0.5) / width as f32, (j as f32 + 0.5) / height as f32);
            unturned.radiance(direction_from_lat_long(uv))
        };
        Self { width, height, radiance: (0..width * height).map(cell).collect() }
    }

    /// Direction of a point in cell coordinates; the centre of cell (x, y) is (x + ½, y + ½).
    pub(crate) fn direction(&self, x: f64, y: f64) -> DVec3 {
        let azimuth = 2.0 * PI * (x / self.width as f64 - 0.5);
        let theta = PI * y / self.height as f64;
        DVec3::new(theta.sin() * azimuth.sin(), theta.cos(), -theta.sin() * azimuth.cos())
    }

    /// Exact solid angle of a cell in row `y`, steradians.
    pub(crate) fn cell_solid_angle(&self, y: usize) -> f64 {
        let half = 0.5 * PI / self.height as f64;
        let theta = PI * (y as f64 + 0.5) / self.height as f64;
        // cos a − cos b = 2 sin((a + b)/2) sin((b − a)/2)
        2.0 * theta.sin() * half.sin() * 2.0 * PI / self.width as f64
    }

    fn cell(&self, x: usize, y: usize) -> Vec3 {
        self.radiance[y * self.width + x]
    }

    /// Radiance at a point in cell coordinates, bilinear between cell centres as in the renderer's lookup.
    pub(crate) fn lookup(&self, x: f64, y: f64) -> Vec3 {
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (u, v) = ((x - 0.5 - left) as f32, (y - 0.5 - top) as f32);
        let column = |offset: i64| (left as i64 + offset).rem_euclid(self.width as i64) as usize;
        let row = |offset: i64| (top as i64 + offset).clamp(0, self.height as i64 - 1) as usize;
        let upper = self.cell(column(0), row(0)).lerp(self.cell(column(1), row(0)), u);
        upper.lerp(self.cell(column(0), row(1)).lerp(self.cell(column(1), row(1)), u), v)
    }

    /// True if the brightest of a cell and its eight neighbours is over four times the darkest, so
    /// that the centre does not represent the cell.
    pub(crate) fn is_steep(&self, x: usize, y: usize) -> bool {
        let (mut darkest, mut brightest) = (f32::MAX, 0.0_f32);
        for row in y.saturating_sub(1)..=(y + 1).min(self.height - 1) {
            for column in [(x + self.width - 1) % self.width, x, (x + 1) % self.width] {
                let value = luminance(self.cell(column, row));
                (darkest, brightest) = (darkest.min(value), brightest.max(value));
            }
        }
        brightest > 4.0 * darkest
    }

    /// Cuts a cell into [`STEEP_PARTS`]² parts, with bilinear radiance as in the renderer's lookup.
    fn parts(&self, x: usize, y: usize) -> Vec<ColouredPatch> {
        let count = STEEP_PARTS * STEEP_PARTS;
        let solid_angle = self.cell_solid_angle(y) / count as f64;
        // The variance of a part is about solid angle / 12 along each of its sides.
        let extent = 1.0 - solid_angle / 12.0;
        let part = |index: usize| {
            let inside = |part: usize| (part as f64 + 0.5) / STEEP_PARTS as f64;
            let column = x as f64 + inside(index % STEEP_PARTS);
            let row = y as f64 + inside(index / STEEP_PARTS);
            let radiance = self.lookup(column, row);
            let energy = f64::from(luminance(radiance)) * solid_angle;
            let moment = energy * extent * self.direction(column, row);
            let patch = Patch { energy, moment, solid_angle };
            ColouredPatch { patch, colour: radiance.as_dvec3() * solid_angle }
        };
        (0..count).map(part).collect()
    }

    /// Summed-area table, `(width + 1) × (height + 1)` entries.
    fn summed_area(&self) -> Vec<[f64; CHANNELS]> {
        let stride = self.width + 1;
        let mut table = vec![[0.0; CHANNELS]; stride * (self.height + 1)];
        let azimuths: Vec<(f64, f64)> = (0..self.width)
            .map(|x| (2.0 * PI * ((x as f64 + 0.5) / self.width as f64 - 0.5)).sin_cos())
            .collect();
        for y in 0..self.height {
            let solid_angle = self.cell_solid_angle(y);
            let (sine, cosine) = (PI * (y as f64 + 0.5) / self.height as f64).sin_cos();
            // The extent of a cell pulls its mean direction inward.
            let (across, along) = (2.0 * PI / self.width as f64 * sine, PI / self.height as f64);
            let extent = 1.0 - (across * across + along * along) / 24.0;
            let mut row = [0.0; CHANNELS];
            for x in 0..self.width {
                let cell: [f64; CHANNELS] = if self.is_steep(x, y) {
                    self.parts(x, y).iter().fold([0.0; CHANNELS], |sum, part| {
                        let values = channels(part);
                        std::array::from_fn(|c| sum[c] + values[c])
                    })
                } else {
                    let texel = self.cell(x, y);
                    let energy = f64::from(luminance(texel)) * solid_angle;
                    let [r, g, b] = texel.to_array().map(|value| f64::from(value) * solid_angle);
                    let mean = [
                        extent * sine * azimuths[x].0,
                        extent * cosine,
                        -extent * sine * azimuths[x].1,
                    ];
                    [energy, r, g, b, energy * mean[0], energy * mean[1], energy * mean[2]]
                };
                let above = table[y * stride + x + 1];
                let entry = &mut table[(y + 1) * stride + x + 1];
                for c in 0..CHANNELS {
                    row[c] += cell[c];
                    entry[c] = above[c] + row[c];
                }
            }
        }
        table
    }

    /// Cuts the sphere into about `count` patches, small where energy and solid angle are large.
    /// Halves the rectangle with the largest √(energy · solid angle) until there are enough.
    pub(crate) fn patches(&self, count: usize) -> Vec<ColouredPatch> {
        let table = self.summed_area();
        let stride = self.width + 1;
        let cosine = |y: usize| (PI * y as f64 / self.height as f64).cos();
        let measure = |r: Rectangle| {
            let corner = |x: usize, y: usize| &table[y * stride + x];
            let (a, b) = (corner(r.x0, r.y0), corner(r.x1, r.y0));
            let (c, d) = (corner(r.x0, r.y1), corner(r.x1, r.y1));
            let sum = |channel: usize| {
                let value = d[channel] - b[channel] - c[channel] + a[channel];
                // Drop the rounding residue of a black rectangle next to a sun.
                if value.abs() < 1e-15 * d[channel].abs() { 0.0 } else { value }
            };
            let width = 2.0 * PI * (r.x1 - r.x0) as f64 / self.width as f64;
            let patch = Patch {
                energy: sum(0).max(0.0),
                moment: DVec3::new(sum(4), sum(5), sum(6)),
                solid_angle: width * (cosine(r.y0) - cosine(r.y1)),
            };
            ColouredPatch { patch, colour: DVec3::new(sum(1), sum(2), sum(3)).max(DVec3::ZERO) }
        };
        let measured = |rectangle: Rectangle| (rectangle, measure(rectangle));
        let is_cell = |r: &Rectangle| r.x1 - r.x0 == 1 && r.y1 - r.y0 == 1;
        let priority = |(r, ColouredPatch { patch, .. }): &(Rectangle, ColouredPatch)| {
            let size = (patch.energy * patch.solid_angle).sqrt();
            (!is_cell(r) && size > 0.0).then_some(size)
        };
        let mut pieces =
            vec![measured(Rectangle { x0: 0, y0: 0, x1: self.width, y1: self.height })];
        refine(&mut pieces, count, priority, |pieces, index| {
            let (parent, _) = pieces[index];
            let Rectangle { x0, y0, x1, y1 } = parent;
            // Halve the longer side, as measured on the sphere.
            let theta = PI * (y0 + y1) as f64 / (2 * self.height) as f64;
            let width = 2.0 * (x1 - x0) as f64 / self.width as f64 * theta.sin();
            let height = (y1 - y0) as f64 / self.height as f64;
            let [first, second] = if x1 - x0 > 1 && (width > height || y1 - y0 == 1) {
                let middle = (x0 + x1) / 2;
                [Rectangle { x1: middle, ..parent }, Rectangle { x0: middle, ..parent }]
            } else {
                let middle = (y0 + y1) / 2;
                [Rectangle { y1: middle, ..parent }, Rectangle { y0: middle, ..parent }]
            };
            pieces[index] = measured(first);
            pieces.push(measured(second));
        });
        // Resolve heavy cells: for a sun of a few texels, radiance within a cell matters.
        let total: f64 = pieces.iter().map(|(_, patch)| patch.patch.energy).sum();
        let mut patches: Vec<ColouredPatch> = pieces.iter().map(|(_, patch)| *patch).collect();
        for (index, (r, patch)) in pieces.iter().enumerate() {
            let is_heavy = patch.patch.energy > HEAVY_SHARE * total;
            if is_cell(r) && is_heavy && self.is_steep(r.x0, r.y0) {
                let parts = self.parts(r.x0, r.y0);
                patches[index] = parts[0];
                patches.extend(&parts[1..]);
            }
        }
        patches
    }
}

/// Number of patches for a fit of `lobes` lobes.
pub(crate) fn patch_count(lobes: usize) -> usize {
    (config::PATCHES_PER_LOBE * lobes).clamp(config::MIN_PATCHES, config::MAX_PATCHES)
}
