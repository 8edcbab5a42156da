//! Pictures of fits: data, fit and difference side by side.
//!
//! Maps are lat-long. BRDFs are disks, one row per view: the hemisphere seen from above in orthographic
//! projection, the normal at the centre, the horizon at the rim, the view toward the right. Data and fit
//! share one exposure; the difference fit − data runs from blue (too little) over white to red (too much).

use std::path::Path;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    fitted::{BrdfFit, EnvironmentFit, EnvironmentLobe},
    grid::Grid,
};
use crate::{
    brdf::{self, MaterialTables},
    error::Result,
    film::{picture::write_png, sky::white},
    math::colour::{display_from_linear, luminance},
    scene::EnvironmentMap,
    srbf::{kernel_value, lobe_value},
};

/// Width of one lat-long panel, pixels.
const MAP_WIDTH: usize = 512;
/// Side of one hemisphere panel, pixels.
const DISK: usize = 192;
/// Most rows of a BRDF's picture.
const MAX_ROWS: usize = 6;
/// White line between panels, pixels.
const GAP: usize = 4;
/// Share of pixels that may be over-exposed.
const CLIPPED: f32 = 0.01;

/// Panels of linear colours; `None` is background.
struct Panels {
    width: usize,
    height: usize,
    data: Vec<Option<Vec3>>,
    fit: Vec<Option<Vec3>>,
}

impl Panels {
    /// Radiance shown as white: all but the brightest pixels of the data are below it.
    fn white(&self) -> f32 {
        let values = self.data.iter().flatten().map(|value| value.max_element());
        white(values.collect(), CLIPPED).max(1e-30)
    }

    /// Rows of display values: data, fit and difference.
    fn rows(&self) -> Vec<Vec<[u8; 3]>> {
        let white = self.white();
        let show = |value: Option<Vec3>| {
            value.map_or([255; 3], |value| (value / white).to_array().map(display_from_linear))
        };
        let difference = |data: Option<Vec3>, fit: Option<Vec3>| match (data, fit) {
            (Some(data), Some(fit)) => {
                // The square root shows small differences beside large ones.
                let relative = (luminance(fit) - luminance(data)) / white;
                let signed = relative.signum() * relative.abs().min(1.0).sqrt();
                colorous::RED_BLUE.eval_continuous(f64::from(0.5 - 0.5 * signed)).as_array()
            }
            _ => [255; 3],
        };
        let row = |y: usize| {
            let range = y * self.width..(y + 1) * self.width;
            let gap = std::iter::repeat_n([255; 3], GAP);
            let pairs = range.clone().map(|i| difference(self.data[i], self.fit[i]));
            let data = range.clone().map(|i| show(self.data[i]));
            let fit = range.map(|i| show(self.fit[i]));
            data.chain(gap.clone()).chain(fit).chain(gap).chain(pairs).collect()
        };
        (0..self.height).map(row).collect()
    }
}

fn write(path: &Path, stack: &[Panels]) -> Result<()> {
    let mut rows: Vec<Vec<[u8; 3]>> = Vec::new();
    for panels in stack {
        if let Some(above) = rows.last() {
            let blank = vec![[255; 3]; above.len()];
            rows.extend(std::iter::repeat_n(blank, GAP));
        }
        rows.extend(panels.rows());
    }
    let width = rows.first().map_or(0, Vec::len) as u32;
    write_png(path, width, &rows.concat())
}

/// Writes the picture of a fitted map as PNG, in the frame of the map. Fails with [`crate::Error::Io`] and
/// the cause.
pub(crate) fn write_environment(
    path: &Path,
    map: &EnvironmentMap,
    fit: &EnvironmentFit,
) -> Result<()> {
    let grid = Grid::new(map);
    let (width, height) = (MAP_WIDTH, MAP_WIDTH / 2);
    let pixel = |index: usize| {
        let x = ((index % width) as f64 + 0.5) * grid.width as f64 / width as f64;
        let y = ((index / width) as f64 + 0.5) * grid.height as f64 / height as f64;
        // Average a few lookups, since panels are smaller than most maps.
        let (step_x, step_y) =
            (0.25 * grid.width as f64 / width as f64, 0.25 * grid.height as f64 / height as f64);
        let data = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
            .map(|(i, j)| grid.lookup(x + i * step_x, y + j * step_y))
            .into_iter()
            .sum::<Vec3>()
            / 4.0;
        let direction = grid.direction(x, y).as_vec3();
        let value = |lobe: &EnvironmentLobe| {
            let kernel = kernel_value(Vec3::from_array(lobe.axis), lobe.bandwidth, direction);
            Vec3::from_array(lobe.colour) * kernel
        };
        (Some(data), Some(fit.lobes.iter().map(value).sum::<Vec3>()))
    };
    let (data, fit) = (0..width * height).into_par_iter().map(pixel).unzip();
    write(path, &[Panels { width, height, data, fit }])
}

/// Writes the picture of a fitted BRDF as PNG: up to six views from the normal to the horizon. Fails with
/// [`crate::Error::Io`] and the cause.
pub(crate) fn write_brdf(
    path: &Path,
    tables: &MaterialTables,
    material_index: usize,
    fit: &BrdfFit,
) -> Result<()> {
    let rows = fit.views.len().min(MAX_ROWS);
    let panels = |row: usize| {
        let view = &fit.views[row * (fit.views.len() - 1) / (rows - 1).max(1)];
        let theta = view.theta;
        let outgoing_local = Vec3::new(theta.sin(), 0.0, theta.cos());
        let pixel = |index: usize| {
            let side = DISK as f32;
            let x = ((index % DISK) as f32 + 0.5) / side * 2.0 - 1.0;
            let y = 1.0 - ((index / DISK) as f32 + 0.5) / side * 2.0;
            let squared = x * x + y * y;
            if squared >= 1.0 {
                return (None, None);
            }
            let incident_local = Vec3::new(x, y, (1.0 - squared).sqrt());
            let value = brdf::evaluate(tables, material_index, outgoing_local, incident_local);
            let data = luminance(value) * incident_local.z;
            let fit = view.lobes.iter().map(|lobe| lobe_value(lobe, incident_local)).sum();
            (Some(Vec3::splat(data)), Some(Vec3::splat(fit)))
        };
        let (data, fit) = (0..DISK * DISK).into_par_iter().map(pixel).unzip();
        Panels { width: DISK, height: DISK, data, fit }
    };
    let stack: Vec<Panels> = (0..rows).map(panels).collect();
    write(path, &stack)
}
