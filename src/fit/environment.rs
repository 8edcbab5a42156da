//! Environment map → mixture of lobes in the frame of the map.

use std::time::Instant;

use glam::{DVec3, Vec3};

use super::{
    cache::{self, Cache},
    colour::{divergence_colours, least_squares_colours},
    component::{Component, kernel_integral},
    config::{self, Method, check_count},
    fitted::{EnvironmentFit, EnvironmentLobe, Fit},
    grid::{ColouredPatch, Grid, patch_count},
    growth::grow,
    judge::{FitErrors, judge_environment},
    points::{Patch, PointSet},
    squared_error::minimize_squared_error,
};
use crate::{
    error::{Error, Result},
    math::colour::luminance,
    scene::EnvironmentMap,
};

/// Parameters of an environment fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnvironmentOptions {
    /// Lobes, 1 to [`MAX_LOBES`](super::config::MAX_LOBES).
    pub lobes: usize,
    /// Objective.
    pub method: Method,
}

/// Fits a map, or reads the fit from the cache. The fit does not depend on the map's rotation, see
/// [`EnvironmentFit::world_lobes`]. `progress` receives the fraction of the work done so far.
///
/// # Errors
/// The map is black or holds values that are negative or not finite; lobes are out of range. A
/// cache that cannot be read or written only logs a warning.
pub fn environment_lobes(
    map: &EnvironmentMap,
    options: EnvironmentOptions,
    cache: Option<&Cache>,
    progress: &mut dyn FnMut(f64),
) -> Result<EnvironmentFit> {
    let start = Instant::now();
    check_count(options.lobes, "lobes", config::MAX_LOBES)?;
    let key = key(map, options);
    if let Some(Fit::Environment(fit)) = cache.and_then(|cache| cache.load(&key)) {
        let seconds = start.elapsed().as_secs_f64();
        return Ok(EnvironmentFit { source: map.source.clone(), seconds, is_cached: true, ..fit });
    }
    let mut fit = fit_map(map, options, progress)?;
    fit.seconds = start.elapsed().as_secs_f64();
    if let Some(cache) = cache {
        cache.store(&key, &Fit::Environment(fit.clone()));
    }
    Ok(fit)
}

/// Name of the cache file, from everything the fit depends on.
fn key(map: &EnvironmentMap, options: EnvironmentOptions) -> String {
    let header =
        format!("environment {} {:?} {} {}", options.lobes, options.method, map.width, map.height);
    cache::key(&[header.as_bytes(), bytemuck::cast_slice(&map.texels)])
}

fn fit_map(
    map: &EnvironmentMap,
    options: EnvironmentOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<EnvironmentFit> {
    let fail = |message: String| Error::Fit { what: map.source.clone(), message };
    let is_sound = |texel: &Vec3| texel.is_finite() && texel.min_element() >= 0.0;
    if let Some(index) = map.texels.iter().position(|texel| !is_sound(texel)) {
        let (x, y) = (index % map.width as usize, index / map.width as usize);
        let texel = map.texels[index];
        return Err(fail(format!(
            "texel ({x}, {y}) is {texel}; expected finite radiance that is not negative"
        )));
    }
    let grid = Grid::new(map);
    let patches = grid.patches(patch_count(options.lobes));
    let luminance_patches: Vec<Patch> = patches.iter().map(|patch| patch.patch).collect();
    let energy: f64 = luminance_patches.iter().map(|patch| patch.energy).sum();
    if energy <= 0.0 {
        return Err(fail("the map is black; expected light from somewhere".into()));
    }
    let points = PointSet::new(&luminance_patches);
    let mut notes = Vec::new();
    if points.len() < options.lobes {
        notes.push(format!(
            "{} lobes asked for, but light comes from {} places only",
            options.lobes,
            points.len()
        ));
    }
    let l2 = options.method == Method::L2;
    let em_part = if l2 { 0.3 } else { 0.9 };
    let components = grow(&points, options.lobes, &mut |share| progress(em_part * share));
    let (components, fitted_energy) = if l2 {
        let square = squared_integral(&grid);
        minimize_squared_error(&luminance_patches, square, &components, &mut |share| {
            progress(0.3 + 0.6 * share);
        })
    } else {
        (components, energy)
    };
    let mut components: Vec<Component> =
        components.into_iter().filter(|component| component.share > 0.0).collect();
    components.sort_by(|a, b| b.share.total_cmp(&a.share));
    if components.len() < options.lobes.min(points.len()) {
        notes.push(format!(
            "{} lobes asked for, {} have any light",
            options.lobes,
            components.len()
        ));
    }
    let lobes = coloured_lobes(&patches, &components, fitted_energy, options.method);
    let mut fit = EnvironmentFit {
        source: map.source.clone(),
        method: options.method,
        requested_lobes: options.lobes,
        lobes,
        errors: FitErrors::default(),
        notes,
        seconds: 0.0,
        is_cached: false,
    };
    fit.errors = judge_environment(&grid, energy, &fit.components());
    progress(1.0);
    Ok(fit)
}

/// `∫L²` of luminance over the sphere.
fn squared_integral(grid: &Grid) -> f64 {
    let row = |y: usize| {
        let cells = &grid.radiance[y * grid.width..(y + 1) * grid.width];
        let sum: f64 = cells.iter().map(|texel| f64::from(luminance(*texel)).powi(2)).sum();
        sum * grid.cell_solid_angle(y)
    };
    (0..grid.height).map(row).sum()
}

/// Gives lobes their colours by the method of the fit.
fn coloured_lobes(
    patches: &[ColouredPatch],
    components: &[Component],
    energy: f64,
    method: Method,
) -> Vec<EnvironmentLobe> {
    let amplitudes: Vec<f64> =
        components.iter().map(|c| energy * c.share / kernel_integral(c.bandwidth)).collect();
    let colours = match method {
        Method::Em => divergence_colours(patches, components),
        Method::L2 => {
            let start: Vec<DVec3> = amplitudes.iter().map(|a| DVec3::splat(*a)).collect();
            least_squares_colours(patches, components, &start)
        }
    };
    let lobe = |((component, amplitude), colour): ((&Component, &f64), &DVec3)| EnvironmentLobe {
        axis: component.axis.as_vec3().to_array(),
        bandwidth: component.bandwidth as f32,
        colour: colour.as_vec3().to_array(),
        amplitude: *amplitude as f32,
    };
    components.iter().zip(&amplitudes).zip(&colours).map(lobe).collect()
}
