//! BRDF × cosine → mixtures of lobes in the local frame, one per view elevation.
//!
//! View `v` of n stands at `θ = (v + ½)/n · 90°` from the normal, toward +x; an isotropic BRDF needs no
//! azimuth. Lobes of equal index correspond between views: each view starts from its neighbour's lobes,
//! turned with the mirror direction as far as they are narrow, so that [`BrdfFit::lobes_at`] can interpolate.

use std::{f64::consts::FRAC_PI_2, time::Instant};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    cache::{self, Cache},
    component::Component,
    config::{self, Method, check_count},
    expectation::maximize,
    fitted::{BrdfFit, BrdfSummary, BrdfView, Fit, view_theta},
    growth::grow,
    hemisphere::{HemisphereTarget, sample_hemisphere},
    judge::{FitErrors, judge_hemisphere},
    points::PointSet,
    squared_error::minimize_squared_error,
};
use crate::{
    brdf::{self, MaterialTables},
    error::{Error, Result},
    math::colour::luminance,
    srbf::Lobe,
};

/// Parameters of a BRDF fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrdfOptions {
    /// Lobes per view, 1 to [`config::MAX_LOBES`].
    pub lobes: usize,
    /// Elevations of the view, 1 to [`config::MAX_VIEWS`].
    pub views: usize,
    /// Objective.
    pub method: Method,
}

/// Fits a material, or reads the fit from the cache. `name` appears in messages; `progress`
/// receives the share of the work that is done.
///
/// # Errors
/// The material reflects nothing in any view; lobes or views are out of range. A cache that cannot
/// be read or written only logs a warning.
///
/// # Panics
/// `material_index` is out of range.
pub fn brdf_lobes(
    tables: &MaterialTables,
    material_index: usize,
    name: &str,
    options: BrdfOptions,
    cache: Option<&Cache>,
    progress: &mut dyn FnMut(f64),
) -> Result<BrdfFit> {
    let start = Instant::now();
    check_count(options.lobes, "lobes", config::MAX_LOBES)?;
    check_count(options.views, "view elevations", config::MAX_VIEWS)?;
    let view = |theta: f64| sample_view(tables, material_index, theta);
    // Sample the views and the elevations halfway between, which judge the interpolation.
    let targets: Vec<HemisphereTarget> = (0..2 * options.views - 1)
        .into_par_iter()
        .map(|index| view((index as f64 + 1.0) / (2 * options.views) as f64 * FRAC_PI_2))
        .collect();
    // The samples determine the fit, so they name the cache file.
    let header = format!("brdf {} {} {:?}", options.lobes, options.views, options.method);
    let values: Vec<f64> =
        targets.iter().flat_map(|target| target.samples.iter().map(|s| s.value)).collect();
    let key = cache::key(&[header.as_bytes(), bytemuck::cast_slice(&values)]);
    if let Some(Fit::Brdf(fit)) = cache.and_then(|cache| cache.load(&key)) {
        let seconds = start.elapsed().as_secs_f64();
        return Ok(BrdfFit { source: name.to_owned(), seconds, is_cached: true, ..fit });
    }
    let mut fit = fit_views(&targets, name, options, progress)?;
    fit.seconds = start.elapsed().as_secs_f64();
    if let Some(cache) = cache {
        cache.store(&key, &Fit::Brdf(fit.clone()));
    }
    Ok(fit)
}

/// Samples the luminance of BRDF × cosine for a view at `theta` from the normal.
fn sample_view(tables: &MaterialTables, material_index: usize, theta: f64) -> HemisphereTarget {
    let outgoing_local = Vec3::new(theta.sin() as f32, 0.0, theta.cos() as f32);
    let value = |direction: DVec3| {
        let incident_local = direction.as_vec3();
        let value = brdf::evaluate(tables, material_index, outgoing_local, incident_local);
        f64::from(luminance(value)) * direction.z
    };
    sample_hemisphere(&value, DVec3::new(-theta.sin(), 0.0, theta.cos()))
}

fn fit_views(
    targets: &[HemisphereTarget],
    name: &str,
    options: BrdfOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<BrdfFit> {
    let fail = |message: String| Error::Fit { what: name.to_owned(), message };
    let points: Vec<PointSet> =
        targets.iter().step_by(2).map(|target| PointSet::new(&target.patches)).collect();
    if points.iter().all(PointSet::is_empty) {
        return Err(fail(
            "the material reflects nothing in any view that a sampled light could show; expected a \
             value above 0, so neither black nor a mirror or glass"
                .into(),
        ));
    }
    let mut fitted = chain(&points, options, progress);
    if options.method == Method::L2 {
        let views = fitted.par_iter().zip(targets.par_iter().step_by(2));
        fitted = views.map(|(components, target)| minimize_view(target, components)).collect();
    } else {
        for (components, points) in fitted.iter_mut().zip(&points) {
            for component in components {
                component.share *= points.energy;
            }
        }
    }
    let mut notes = Vec::new();
    let empty = points.iter().filter(|points| points.is_empty()).count();
    if empty > 0 {
        notes.push(format!("{empty} of {} views reflect nothing", points.len()));
    }
    let count = fitted.iter().map(Vec::len).max().unwrap_or(0);
    if count < options.lobes {
        notes.push(format!("{} lobes asked for, {count} used at most", options.lobes));
    }
    let view = |(index, components): (usize, &Vec<Component>)| {
        // Shares are integrals here.
        let mut lobes: Vec<Lobe> = components.iter().map(|component| component.lobe(1.0)).collect();
        lobes.resize(count, Lobe { axis: Vec3::Z, bandwidth: 1.0, amplitude: 0.0 });
        let target = &targets[2 * index];
        BrdfView {
            theta: view_theta(index, options.views) as f32,
            albedo: target.energy() as f32,
            errors: judge_hemisphere(target, &lobes),
            lobes,
        }
    };
    let mut fit = BrdfFit {
        source: name.to_owned(),
        method: options.method,
        requested_lobes: options.lobes,
        views: fitted.iter().enumerate().map(view).collect(),
        summary: BrdfSummary::default(),
        notes,
        seconds: 0.0,
        is_cached: false,
    };
    fit.summary = summarize(&fit, targets);
    progress(1.0);
    Ok(fit)
}

/// Fits all views, lobes of equal index corresponding; shares are relative to the view's energy.
fn chain(
    points: &[PointSet],
    options: BrdfOptions,
    progress: &mut dyn FnMut(f64),
) -> Vec<Vec<Component>> {
    let count = points.len();
    let mut fitted: Vec<Vec<Component>> = vec![Vec::new(); count];
    let mut base = count / 3;
    if points[base].is_empty() {
        base = points.iter().position(|points| !points.is_empty()).unwrap_or(base);
    }
    fitted[base] = grow(&points[base], options.lobes, &mut |_| ());
    let mut done = 1;
    let outward = (base + 1..count).map(|view| (view - 1, view));
    let inward = (0..base).rev().map(|view| (view + 1, view));
    for (neighbour, view) in outward.chain(inward) {
        let mut components = fitted[neighbour].clone();
        if !points[view].is_empty() {
            let turn = view_theta(view, count) - view_theta(neighbour, count);
            for component in &mut components {
                follow(component, turn);
            }
            maximize(&points[view], &mut components, config::VIEW_STEPS, config::VIEW_TOLERANCE);
        } else {
            for component in &mut components {
                component.share = 0.0;
            }
        }
        fitted[view] = components;
        done += 1;
        progress(0.9 * done as f64 / count as f64);
    }
    fitted
}

/// Turns a lobe with the mirror direction as the view turns `turn` radians away from the normal.
/// Wide lobes stay.
fn follow(component: &mut Component, turn: f64) {
    let part = component.bandwidth / (component.bandwidth + config::FOLLOWING_BANDWIDTH);
    let (s, c) = (-turn * part).sin_cos();
    let DVec3 { x, y, z } = component.axis;
    component.axis = DVec3::new(c * x + s * z, y, c * z - s * x);
    // Give a lobe without energy the chance to gain some here.
    component.share = component.share.max(1e-4);
}

/// Lowers the squared error of a view. Shares of the result are integrals.
fn minimize_view(target: &HemisphereTarget, components: &[Component]) -> Vec<Component> {
    let square: f64 = target.samples.iter().map(|s| s.solid_angle * s.value * s.value).sum();
    if square <= 0.0 {
        return components.to_vec();
    }
    let (mut components, energy) =
        minimize_squared_error(&target.patches, square, components, &mut |_| ());
    for component in &mut components {
        component.share *= energy;
    }
    components
}

fn summarize(fit: &BrdfFit, targets: &[HemisphereTarget]) -> BrdfSummary {
    let limit = config::SUMMARY_ANGLE_DEG.to_radians() as f32;
    let is_counted = |(index, view): &(usize, &BrdfView)| *index == 0 || view.theta <= limit;
    let counted = fit.views.iter().enumerate().filter(is_counted);
    let errors: Vec<&FitErrors> = counted.map(|(_, view)| &view.errors).collect();
    let mean = |figure: fn(&FitErrors) -> f64| {
        errors.iter().map(|errors| figure(errors)).sum::<f64>() / errors.len() as f64
    };
    let between = fit.views.windows(2).zip(targets.iter().skip(1).step_by(2));
    let chi_squared_between = between.filter_map(|(pair, target)| {
        let theta = 0.5 * (pair[0].theta + pair[1].theta);
        (theta <= limit).then(|| judge_hemisphere(target, &fit.lobes_at(theta)).chi_squared)
    });
    BrdfSummary {
        mean: FitErrors {
            relative_l2: mean(|errors| errors.relative_l2),
            chi_squared: mean(|errors| errors.chi_squared),
            kullback_leibler: mean(|errors| errors.kullback_leibler),
            energy_captured: mean(|errors| errors.energy_captured),
        },
        largest_chi_squared: errors.iter().map(|errors| errors.chi_squared).fold(0.0, f64::max),
        largest_chi_squared_between: chi_squared_between.fold(0.0, f64::max),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::hemisphere::HemisphereSample;

    /// Views near the horizon, which no lobes can match, belong to no figure of the summary.
    #[test]
    fn summaries_leave_out_the_last_views() {
        const VIEWS: usize = 9;
        let target = sample_hemisphere(&|_| 1.0, DVec3::Z);
        assert!(target.samples.iter().all(|HemisphereSample { value, .. }| *value == 1.0));
        let targets = vec![target; 2 * VIEWS - 1];
        let summary = |last: Lobe| {
            let plain = Lobe { axis: Vec3::Z, bandwidth: 1.0, amplitude: 1.0 };
            let view = |index: usize| {
                let lobes = vec![if index + 1 == VIEWS { last } else { plain }];
                let errors = judge_hemisphere(&targets[2 * index], &lobes);
                BrdfView { theta: view_theta(index, VIEWS) as f32, albedo: 1.0, errors, lobes }
            };
            let fit = BrdfFit {
                source: String::new(),
                method: Method::Em,
                requested_lobes: 1,
                views: (0..VIEWS).map(view).collect(),
                summary: BrdfSummary::default(),
                notes: Vec::new(),
                seconds: 0.0,
                is_cached: false,
            };
            summarize(&fit, &targets)
        };
        let expected = summary(Lobe { axis: Vec3::Z, bandwidth: 1.0, amplitude: 1.0 });
        assert!(expected.largest_chi_squared_between > 0.0);
        assert_eq!(summary(Lobe { axis: Vec3::X, bandwidth: 300.0, amplitude: 1.0 }), expected);
    }
}
