//! Mirrors, dielectrics and panes: Fresnel reflectance against closed forms, samples that follow their
//! density, reciprocity, and conservation of energy.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::{f32::consts::E, f64::consts::PI};

use fenestra::{
    brdf::fresnel::fresnel_dielectric,
    shader::{
        constants::{MATERIAL_DIELECTRIC, MATERIAL_MIRROR, MATERIAL_THIN_DIELECTRIC},
        structs::Material,
    },
};
use glam::{DVec3, Vec3, vec3};
use rayon::prelude::*;

use crate::{
    support::{
        materials::{direction, hemisphere, specular, uniform},
        statistics,
    },
    twin::specular::{
        dielectric_evaluate_and_pdf, fresnel_interface, pane_reflectance, pane_transmittance,
        relative_index, scatter,
    },
};

/// Polar angles of the outgoing direction, in degrees.
const ANGLES_DEG: [f64; 5] = [0.0, 30.0, 55.0, 75.0, 87.0];

/// Returns the materials with a density.
fn rough() -> impl Iterator<Item = &'static Material> {
    specular().iter().filter(|material| material.alpha > 0.0)
}

/// Returns the first material of a kind.
fn first(kind: u32) -> Material {
    *specular().iter().find(|material| material.kind == kind).unwrap()
}

#[test]
fn interfaces_have_their_closed_forms() {
    for ior in [1.0_f32, 1.33, 1.5, 2.4] {
        for eta in [ior, 1.0 / ior] {
            let normal = ((eta - 1.0) / (eta + 1.0)).powi(2);
            assert!((fresnel_interface(1.0, eta) - normal).abs() < 1e-6, "{eta}");
            // At tanθ = η only the perpendicular part remains: ½((η² − 1)/(η² + 1))².
            let brewster = 0.5 * ((eta * eta - 1.0) / (eta * eta + 1.0)).powi(2);
            let cosine = 1.0 / (1.0 + eta * eta).sqrt();
            assert!((fresnel_interface(cosine, eta) - brewster).abs() < 1e-6, "{eta}");
            for index in 1_u16..50 {
                // Both sides of one ray see the same reflectance.
                let cosine = f32::from(index) / 50.0;
                let sine_squared = (1.0 - cosine * cosine) / (eta * eta);
                let found = fresnel_interface(cosine, eta);
                if sine_squared > 1.0001 {
                    assert_eq!(found, 1.0, "total reflection at {cosine}, {eta}");
                } else if sine_squared < 0.999 {
                    let beyond = fresnel_interface((1.0 - sine_squared).sqrt(), 1.0 / eta);
                    assert!((found - beyond).abs() < 1e-4, "{found} {beyond} at {cosine}, {eta}");
                }
                if eta >= 1.0 {
                    assert!((found - fresnel_dielectric(cosine, eta)).abs() < 1e-5);
                }
            }
        }
    }
    // The critical angle of glass is asin(1/1.5).
    let critical = (1.0_f32 - 1.0 / 2.25).sqrt();
    assert_eq!(fresnel_interface(critical - 1e-3, 1.0 / 1.5), 1.0);
    assert!(fresnel_interface(critical + 1e-2, 1.0 / 1.5) < 0.7);
}

#[test]
fn panes_sum_all_reflections_between_their_sides() {
    let mut pane = first(MATERIAL_THIN_DIELECTRIC);
    (pane.reflectance, pane.eta) = ([1.0; 3], [1.0; 3]);
    for index in 1_u16..=20 {
        let cosine = f32::from(index) / 20.0;
        let once = f64::from(fresnel_interface(cosine, pane.ior));
        let (mut reflected, mut transmitted) = (once, 0.0);
        let mut inside = 1.0 - once;
        for bounce in 0..2000 {
            *(if bounce % 2 == 0 { &mut transmitted } else { &mut reflected }) +=
                inside * (1.0 - once);
            inside *= once;
        }
        let found = [pane_reflectance(&pane, cosine).x, pane_transmittance(&pane, -cosine).x];
        assert!((f64::from(found[0]) - reflected).abs() < 1e-6, "{found:?} {reflected}");
        assert!((f64::from(found[1]) - transmitted).abs() < 1e-6, "{found:?} {transmitted}");
    }
}

/// Samples of smooth materials: Snell's law, and by choice the exact shares of both ways.
#[test]
fn smooth_materials_follow_snell_and_fresnel() {
    for material in specular().iter().filter(|material| material.alpha == 0.0) {
        for index in 0..500 {
            let outgoing = hemisphere(index, 1);
            for is_back in [false, true] {
                let eta = match material.kind {
                    MATERIAL_DIELECTRIC => relative_index(material, is_back),
                    _ => 1.0,
                };
                let low = scatter(material, outgoing, is_back, vec3(0.0, 0.3, 0.4));
                let high = scatter(material, outgoing, is_back, vec3(1.0 - 1e-7, 0.3, 0.4));
                for found in [low, high] {
                    let factor = if found.is_transmitted { eta } else { 1.0 };
                    let there = found.direction_local;
                    let tangential = outgoing.truncate() + factor * there.truncate();
                    assert!(tangential.length() < 1e-5, "{outgoing} {found:?}");
                    assert_eq!(there.z < 0.0, found.is_transmitted);
                    assert!((there.length() - 1.0).abs() < 1e-5);
                }
                if material.kind == MATERIAL_MIRROR {
                    assert!(low == high && low.weight == Vec3::from(material.reflectance));
                }
            }
            // Interfaces without a tint have weights that do not depend on the choice.
            if material.kind == MATERIAL_DIELECTRIC {
                for (is_back, u) in [(false, uniform(index, 2)), (true, uniform(index, 3))] {
                    let found = scatter(material, outgoing, is_back, u);
                    let eta = relative_index(material, is_back);
                    let expected = if found.is_transmitted { 1.0 / (eta * eta) } else { 1.0 };
                    assert!((found.weight.x - expected).abs() < 1e-4, "{found:?}");
                }
            }
        }
    }
}

/// The mean of many tinted samples is reflectance and transmittance of the pane.
#[test]
fn choices_between_passing_and_reflecting_are_unbiased() {
    let pane = first(MATERIAL_THIN_DIELECTRIC);
    let outgoing = direction(1.2, 0.4);
    let (mut sums, count) = ([DVec3::ZERO; 2], 100_000);
    for index in 0..count {
        let found = scatter(&pane, outgoing, false, uniform(index, 4));
        sums[usize::from(found.is_transmitted)] += found.weight.as_dvec3();
    }
    let expected = [pane_reflectance(&pane, outgoing.z), pane_transmittance(&pane, outgoing.z)];
    for (sum, expected) in sums.into_iter().zip(expected) {
        let mean = sum / f64::from(count);
        assert!((mean - expected.as_dvec3()).abs().max_element() < 6e-3, "{mean} {expected}");
    }
}

#[test]
fn weights_are_values_over_densities() {
    for (material, index) in rough().flat_map(|material| (0..4000).map(move |i| (material, i))) {
        let is_back = index % 2 == 0;
        let outgoing = hemisphere(index, 5);
        let found = scatter(material, outgoing, is_back, uniform(index, 6));
        assert!(found.weight.is_finite() && found.weight.min_element() >= 0.0, "{found:?}");
        // No energy is made: a white interface takes from every sample, but for normals of Beckmann's, which
        // are drawn as GGX's and masked less.
        let most = if material.cover_alpha > 0.0 { 4.0 / E * 1.768 } else { 1.0 };
        let eta = relative_index(material, is_back);
        let scale = if found.is_transmitted { eta * eta } else { 1.0 };
        if material.reflectance == material.eta {
            assert!((scale * found.weight).max_element() < most + 1e-4, "{found:?}");
        }
        let incident = found.direction_local.normalize();
        // Grazing directions and those near the critical angle amplify rounding.
        if found.weight == Vec3::ZERO || outgoing.z < 0.05 || incident.z.abs() < 0.05 {
            continue;
        }
        let (value, pdf) = dielectric_evaluate_and_pdf(material, outgoing, incident, is_back);
        let expected = value * incident.z.abs() / pdf;
        let difference = (found.weight - expected).abs().max_element();
        assert!(
            difference < 0.02 * expected.max_element(),
            "{found:?}, but {value} / {pdf} = {expected} for {material:?}"
        );
    }
}

/// Veach's reciprocity: f(i → o) / η_o² is the same in both directions, through the interface too.
#[test]
fn values_are_reciprocal_up_to_the_index() {
    for (material, index) in rough().flat_map(|material| (0..4000).map(move |i| (material, i))) {
        let is_back = index % 2 == 0;
        let outgoing = hemisphere(index, 7);
        let found = scatter(material, outgoing, is_back, uniform(index, 8));
        let incident = match index % 3 {
            0 => hemisphere(index, 9),
            _ => found.direction_local.normalize(),
        };
        if outgoing.z < 0.05 || incident.z.abs() < 0.05 {
            continue;
        }
        let there = dielectric_evaluate_and_pdf(material, outgoing, incident, is_back).0;
        // The other viewer looks from the other side: mirror the frame.
        let back = if incident.z > 0.0 {
            dielectric_evaluate_and_pdf(material, incident, outgoing, is_back).0
        } else {
            let mirrored = |d: Vec3| vec3(d.x, d.y, -d.z);
            let eta = relative_index(material, is_back);
            let (viewer, light) = (mirrored(incident), mirrored(outgoing));
            dielectric_evaluate_and_pdf(material, viewer, light, !is_back).0 / (eta * eta)
        };
        let difference = (there - back).abs().max_element();
        assert!(
            difference <= 2e-3 * there.max_element() + 1e-5,
            "{there} against {back} for {outgoing}, {incident} at {material:?}"
        );
    }
}

/// Rows of bins over the sphere, in equal steps of the polar angle.
const ROWS: usize = 48;
/// Bins of a row, in azimuth.
const COLUMNS: usize = 24;

/// Integrates the density over each bin.
fn masses(material: &Material, outgoing: Vec3, is_back: bool) -> Vec<f64> {
    const POINTS: usize = 24;
    let mass = |bin: usize| -> f64 {
        let sum: f64 = (0..POINTS * POINTS)
            .map(|point| {
                let middle = |index: usize| (index as f64 + 0.5) / POINTS as f64;
                let row = (bin / COLUMNS) as f64 + middle(point / POINTS);
                let column = (bin % COLUMNS) as f64 + middle(point % POINTS);
                let theta = row / ROWS as f64 * PI;
                let incident = direction(theta, column / COLUMNS as f64 * 2.0 * PI);
                let pdf = dielectric_evaluate_and_pdf(material, outgoing, incident, is_back).1;
                f64::from(pdf) * theta.sin()
            })
            .sum();
        sum * 2.0 * PI * PI / (ROWS * COLUMNS * POINTS * POINTS) as f64
    };
    (0..ROWS * COLUMNS).map(mass).collect()
}

/// Tests samples of both hemispheres against their density by χ². The mass that the density lacks is
/// the share of samples on the wrong side.
#[test]
fn samples_follow_their_density() {
    const SAMPLES: u32 = 100_000;
    let cases: Vec<(&Material, f64, bool)> = rough()
        .flat_map(|material| ANGLES_DEG.map(|angle| (material, angle)))
        .flat_map(|(material, angle)| [false, true].map(|is_back| (material, angle, is_back)))
        .collect();
    cases.into_par_iter().for_each(|(material, angle, is_back)| {
        let name = format!("{angle}°, from the back: {is_back}, {material:?}");
        let outgoing = direction(angle.to_radians(), 0.7);
        let masses = masses(material, outgoing, is_back);
        let mut observed = vec![0.0; masses.len()];
        let mut lost = 0.0;
        for index in 0..SAMPLES {
            let found = scatter(material, outgoing, is_back, uniform(index, 10));
            if found.weight == Vec3::ZERO {
                lost += 1.0 / f64::from(SAMPLES);
                continue;
            }
            let d = found.direction_local.as_dvec3().normalize();
            let row = (d.z.clamp(-1.0, 1.0).acos() / PI * ROWS as f64) as usize;
            let column =
                (d.y.atan2(d.x).rem_euclid(2.0 * PI) / (2.0 * PI) * COLUMNS as f64) as usize;
            observed[row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)] += 1.0;
        }
        let mass: f64 = masses.iter().sum();
        assert!((mass + lost - 1.0).abs() < 0.01, "{name}: ∫ pdf = {mass}, {lost} lost");
        // Bins at the edge of the refracted cone may have no point of the quadrature inside it.
        let ([counts, expected], [few, few_expected]) =
            statistics::part_rare_bins(&observed, &masses, SAMPLES);
        assert!(
            few <= few_expected + 1e-3 * f64::from(SAMPLES),
            "{name}: {few} samples where {few_expected} are expected"
        );
        let p_value = statistics::chi_square_p_value(&counts, &expected);
        assert!(p_value > 1e-6, "{name}: p = {p_value:e}");
    });
}

/// Follows rays through a slab of glass: every path leaves with the light that it entered with, and
/// as many pass as pass a pane.
#[test]
fn a_slab_of_glass_loses_nothing() {
    let glass = *specular()
        .iter()
        .find(|material| material.kind == MATERIAL_DIELECTRIC && material.alpha == 0.0)
        .unwrap();
    let mut pane = first(MATERIAL_THIN_DIELECTRIC);
    pane.eta = [1.0; 3];
    for (stream, angle) in (20..).zip(ANGLES_DEG) {
        let outgoing = direction(angle.to_radians(), 0.7);
        let (mut passed, count) = (0, 20_000);
        for index in 0..count {
            let mut found = scatter(&glass, outgoing, false, uniform(index, stream));
            let mut weight = found.weight.x;
            let mut is_upper = true;
            let mut is_inside = found.is_transmitted;
            for bounce in 1..1000 {
                if !is_inside {
                    break;
                }
                // The ray arrives at the other side, seen from within: mirror the frame.
                let viewer = vec3(
                    -found.direction_local.x,
                    -found.direction_local.y,
                    found.direction_local.z.abs(),
                );
                is_upper = !is_upper;
                found = scatter(&glass, viewer, true, uniform(index, 100 * stream + bounce));
                weight *= found.weight.x;
                is_inside = !found.is_transmitted;
            }
            assert!(!is_inside && (weight - 1.0).abs() < 1e-3, "{weight} after {angle}°");
            passed += u32::from(!is_upper);
        }
        let share = f64::from(passed) / f64::from(count);
        let expected = f64::from(pane_transmittance(&pane, outgoing.z).x);
        assert!((share - expected).abs() < 0.02, "{share} against {expected} at {angle}°");
    }
}
