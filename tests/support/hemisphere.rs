//! Bins over the hemisphere above a surface, and points of a quadrature over the sphere.

use std::f64::consts::PI;

use glam::DVec3;

use super::materials;

/// Bins in polar angle above the horizon.
const BIN_ROWS: usize = 12;
/// Bins in azimuth.
pub const BIN_COLUMNS: usize = 24;
/// All bins; the last one holds the directions below the horizon.
pub const BINS: usize = BIN_ROWS * BIN_COLUMNS + 1;

/// Returns the bin of a direction in the local frame.
pub fn bin(local: DVec3) -> usize {
    if local.z <= 0.0 {
        return BINS - 1;
    }
    let theta = local.x.hypot(local.y).atan2(local.z);
    let phi = local.y.atan2(local.x).rem_euclid(2.0 * PI);
    let row = ((theta / (0.5 * PI) * BIN_ROWS as f64) as usize).min(BIN_ROWS - 1);
    let column = ((phi / (2.0 * PI) * BIN_COLUMNS as f64) as usize).min(BIN_COLUMNS - 1);
    row * BIN_COLUMNS + column
}

/// Returns local directions of a quadrature with `rows` × 2 `rows` cells of equal solid angle, one
/// drawn at random in each cell so that edges of regions do no harm.
pub fn quadrature(rows: usize) -> impl ExactSizeIterator<Item = DVec3> {
    let columns = 2 * rows;
    (0..rows * columns).map(move |cell| {
        let u = materials::uniform(cell as u32, 31).as_dvec3();
        let cosine = 1.0 - 2.0 * ((cell / columns) as f64 + u.x) / rows as f64;
        let phi = ((cell % columns) as f64 + u.y) * 2.0 * PI / columns as f64;
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        glam::dvec3(sine * phi.cos(), sine * phi.sin(), cosine)
    })
}
