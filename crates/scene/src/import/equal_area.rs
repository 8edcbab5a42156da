//! Square equal-area maps of the sphere \[Clarberg 2008\] → lat-long environment maps.

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;

use crate::{
    EnvironmentMap,
    math::{equal_area::square_from_direction, frame::direction_from_lat_long},
};

/// Points of a texel of the lat-long map, along each side, whose mean it is; toward the poles, where
/// texels are narrow, fewer in a row.
const POINTS: u32 = 6;
/// Share of the brightest by which centre and corners of a texel may differ for their mean to stand for it: a
/// texel of the lat-long map is smaller than one of the square.
const LIKE: f32 = 0.02;

/// Resamples a square map, whose `texels` are those of `side` rows. `light_from_world` turns a
/// direction of the renderer to one of the map, up to its length.
///
/// Every texel is the mean of the map over points of it, and a factor for each channel keeps the mean
/// radiance of the sphere, which in an equal-area map is that of the texels.
pub(crate) fn resample(
    texels: &[Vec3],
    side: u32,
    light_from_world: Mat3,
    source: String,
) -> EnvironmentMap {
    let (width, height) = (2 * side.max(32), side.max(32));
    let lookup = |direction: Vec3| {
        let uv = square_from_direction((light_from_world * direction).normalize_or(Vec3::Z));
        let [column, row] =
            uv.to_array().map(|at| ((at * side as f32) as u32).min(side - 1) as usize);
        texels[row * side as usize + column]
    };
    let size = Vec2::new(width as f32, height as f32);
    let texel = |index: u32| {
        let corner = Vec2::new((index % width) as f32, (index / width) as f32);
        let at =
            |x: f32, y: f32| lookup(direction_from_lat_long((corner + Vec2::new(x, y)) / size));
        let few =
            [(0.5, 0.5), (0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9)].map(|(x, y)| at(x, y));
        let [least, most] = few
            .iter()
            .fold([few[0]; 2], |[least, most], texel| [least.min(*texel), most.max(*texel)]);
        if (most - least).cmple(LIKE * most).all() {
            return few.iter().sum::<Vec3>() / few.len() as f32;
        }
        let narrow = (std::f32::consts::PI * (corner.y + 0.5) / size.y).sin();
        let across = (POINTS as f32 * narrow).ceil() as u32;
        let point = |index: u32| {
            let inside = Vec2::new((index % across) as f32, (index / across) as f32) + 0.5;
            at(inside.x / across as f32, inside.y / POINTS as f32)
        };
        (0..across * POINTS).map(point).sum::<Vec3>() / (across * POINTS) as f32
    };
    let mut resampled: Vec<Vec3> = (0..width * height).into_par_iter().map(texel).collect();
    let row_mean = |row: usize| -> glam::DVec3 {
        let texels = &resampled[row * width as usize..(row + 1) * width as usize];
        let edge = |row: usize| (std::f64::consts::PI * row as f64 / f64::from(height)).cos();
        let weight = 0.5 * (edge(row) - edge(row + 1)) / f64::from(width);
        texels.iter().map(|texel| texel.as_dvec3() * weight).sum()
    };
    let found: glam::DVec3 = (0..height as usize).map(row_mean).sum();
    let expected: glam::DVec3 = texels.iter().map(|texel| texel.as_dvec3()).sum();
    let expected = expected / texels.len() as f64;
    let factor = Vec3::from_array(std::array::from_fn(|channel| {
        let factor = (expected[channel] / found[channel]) as f32;
        if factor.is_finite() { factor } else { 1.0 }
    }));
    resampled.iter_mut().for_each(|texel| *texel *= factor);
    EnvironmentMap { width, height, texels: resampled, rotation_rad: 0.0, source }
}
