//! Environment maps of Mitsuba on the grid of Fenestra's.
//!
//! Mitsuba's texel columns have centres at (i + ½)/width as Fenestra's, but its rows lie at
//! j/(height − 1), on the poles too. Its middle looks along +Z, Fenestra's along −Z.

use std::{f32::consts::PI, path::Path};

use glam::{DMat3, DMat4, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use crate::{EnvironmentMap, error::Result, math::frame::direction_from_lat_long};

/// Most texels for which rows are doubled to keep the file's sharpness.
const MAX_DOUBLED_TEXELS: usize = 1 << 26;
/// Rounding of half precision in a mean of rows.
const MEAN_TOLERANCE: f32 = 2e-3;
/// Tilt of the vertical axis that counts as rounding of the file.
const AXIS_TOLERANCE: f64 = 1e-4;

/// Reads a map and turns it by the rotation of `matrix`; none if the matrix has no inverse.
///
/// # Errors
/// Those of [`EnvironmentMap::load`].
pub(super) fn load(
    path: &Path,
    scale: f32,
    matrix: DMat4,
    warnings: &mut Vec<String>,
) -> Result<Option<EnvironmentMap>> {
    let mut own = Vec::new();
    let mut map = EnvironmentMap::load(path, scale, &mut own)?;
    if let Some(texels) = halved(&map) {
        map.texels = texels;
        map.height /= 2;
        // The file's rows were more than twice as many as they tell.
        own.retain(|warning| !warning.contains("twice as wide"));
    } else {
        map.texels = resampled_rows(&map);
        map.height = (map.texels.len() / map.width as usize) as u32;
    }
    warnings.append(&mut own);
    let linear = DMat3::from_mat4(matrix);
    let axes = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::try_normalize);
    let [Some(x), Some(y), Some(z)] = axes else { return Ok(None) };
    let turned = DMat3::from_cols(x, y, z);
    if turned.determinant().abs() < 1e-6 {
        return Ok(None);
    }
    if y.distance(DVec3::Y) < AXIS_TOLERANCE && turned.determinant() > 0.0 {
        map.rotation_rad = (z.x.atan2(z.z) as f32 + PI).rem_euclid(2.0 * PI);
        return Ok(Some(map));
    }
    map.rotation_rad = PI;
    let map_from_world = turned.inverse();
    let (width, height) = (map.width as usize, map.height as usize);
    let size = Vec2::new(width as f32, height as f32);
    let texel = |index: usize| {
        let at = Vec2::new((index % width) as f32, (index / width) as f32);
        let direction = direction_from_lat_long((at + 0.5) / size);
        let own = map_from_world * direction.as_dvec3();
        map.radiance(own.normalize_or(DVec3::Y).as_vec3())
    };
    let texels = (0..width * height).into_par_iter().map(texel).collect();
    warnings.push(format!(
        "{}: turned about another axis than +Y, or mirrored; resampled at its {width}×{height} \
         texels",
        path.display()
    ));
    Ok(Some(EnvironmentMap { texels, rotation_rad: 0.0, ..map }))
}

/// Rows of a map that Fenestra has exported: the odd ones, if all even ones are means of them.
fn halved(map: &EnvironmentMap) -> Option<Vec<Vec3>> {
    let (width, height) = (map.width as usize, map.height as usize);
    if height < 3 || height.is_multiple_of(2) {
        return None;
    }
    let row = |index: usize| &map.texels[index * width..(index + 1) * width];
    let is_mean = |index: usize| {
        let above = row(if index == 0 { 1 } else { index - 1 });
        let below = row(if index + 1 == height { index - 1 } else { index + 1 });
        row(index).iter().zip(above.iter().zip(below)).all(|(own, (above, below))| {
            let mean = 0.5 * *above + 0.5 * *below;
            own.abs_diff_eq(mean, MEAN_TOLERANCE * mean.max_element())
        })
    };
    let are_means = (0..height).step_by(2).all(is_mean);
    are_means.then(|| (1..height).step_by(2).flat_map(|index| row(index).to_vec()).collect())
}

/// Rows at the heights of Fenestra's, twice as many, so that little sharpness is lost: between two rows
/// of the file, those at ¼ and ¾.
fn resampled_rows(map: &EnvironmentMap) -> Vec<Vec3> {
    let (width, height) = (map.width as usize, map.height as usize);
    if height < 2 {
        return map.texels.clone();
    }
    let doubled = 2 * (height - 1);
    let rows = if width * doubled <= MAX_DOUBLED_TEXELS { doubled } else { height };
    let mut texels = Vec::with_capacity(width * rows);
    for row in 0..rows {
        let place = (row as f64 + 0.5) / rows as f64 * (height - 1) as f64;
        let above = (place as usize).min(height - 2);
        let share = (place - above as f64) as f32;
        let of_row = |row: usize| &map.texels[row * width..(row + 1) * width];
        let pairs = of_row(above).iter().zip(of_row(above + 1));
        texels.extend(pairs.map(|(above, below)| above.lerp(*below, share)));
    }
    texels
}
