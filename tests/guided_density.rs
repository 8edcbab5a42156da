//! Directions that the sampler `guided` draws on the device follow the density that it divides by,
//! that density integrates to one, and estimates are right in every part of the sky: with untrained
//! and trained tables, on every kind of material.
//!
//! The film is so large that a pixel shows one point from one direction, and there is room for the
//! cells of faces only, so that all samples of a pixel read the same cell. The host computes the
//! densities: BRDF and map by their twins, regions from what the renderer reads back. Seeds are
//! fixed; others would raise a false alarm once in some hundred runs.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::f64::consts::PI;

use fenestra::{
    brdf::MaterialTables,
    film::Window,
    math::frame::{Frame, frame_from_normal},
    sampler::{
        Parameters, Sampler,
        guided::{CellReadback, GuideReadback, GuidedParameters, GuidedRay},
    },
    scene::{Scene, environment::EnvironmentTables, material::Material},
    session::{Renderer, Settings},
};
use glam::{Vec3, vec3};

use crate::{
    support::{
        self,
        hemisphere::{self, BIN_COLUMNS, BINS},
        materials, scenes, statistics,
    },
    twin::{brdf, environment::EnvironmentSampling as _},
};

/// Rays per surface and state, and per hit.
const RAYS: u32 = 1 << 15;
const SHADOW_RAYS: u32 = 8;
/// Rows of the quadrature over the sphere about the normal.
const ROWS: usize = 512;
/// Parts of the sky in which estimates are compared: 3 in polar angle × 8 in azimuth, and the rest.
const PARTS: usize = 25;
/// Limit of |z|, exceeded with a chance of 6e-7; about 1,200 are tested.
const Z_LIMIT: f64 = 5.0;

/// A point of a scene, seen by the camera.
struct Surface {
    name: &'static str,
    scene: Scene,
    pixel: [u32; 2],
    point: Vec3,
    material: usize,
}

/// Shows `point` of a room of two materials in a pixel of a film 1,024 times as large as usual.
fn surface(name: &'static str, materials: [Material; 2], material: usize, point: Vec3) -> Surface {
    let mut scene = scenes::room(materials.into());
    (scene.film.width, scene.film.height) = (32 << 10, 24 << 10);
    let camera = &scene.camera;
    let forward = (camera.look_at - camera.position).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let to_point = point - camera.position;
    let half = (0.5 * camera.vertical_fov_deg).to_radians().tan() * to_point.dot(forward);
    let (width, height) = (scene.film.width as f32, scene.film.height as f32);
    let x = 0.5 * width + 0.5 * height * to_point.dot(right) / half;
    let y = 0.5 * height - 0.5 * height * to_point.dot(up) / half;
    Surface { name, scene, pixel: [x as u32, y as u32], point, material }
}

/// Returns every kind of material on the floor and on top of the box, which both see the window.
fn surfaces() -> [Surface; 4] {
    let measured = materials::measured_plastic();
    let dull = || scenes::diffuse(vec3(0.6, 0.5, 0.4));
    let (floor, top) = (vec3(-0.1, 0.0, -0.9), vec3(0.5, 1.0, -0.7));
    [
        surface("diffuse floor", [dull(), scenes::plastic(0.25)], 0, floor),
        surface("plastic box", [dull(), scenes::plastic(0.25)], 1, top),
        surface("measured floor", [measured.clone(), scenes::copper(0.3)], 0, floor),
        surface("copper box", [measured, scenes::copper(0.3)], 1, top),
    ]
}

fn renderer(surface: &Surface, candidates: u32) -> Renderer {
    renderer_at_depth(surface, candidates, 1)
}

fn renderer_at_depth(surface: &Surface, candidates: u32, depth: u32) -> Renderer {
    let [x, y] = surface.pixel;
    let parameters = Parameters {
        candidates: Some(candidates),
        // Leave room for the cells of faces only.
        guided: GuidedParameters { guide_memory: 1, ..GuidedParameters::default() },
        ..Parameters::default()
    };
    let settings = Settings {
        sampler: Sampler::Guided,
        parameters,
        shadow_rays: SHADOW_RAYS,
        depth,
        window: Some(Window { x, y, width: 1, height: 1 }),
        ..Settings::default()
    };
    support::renderer(&surface.scene, settings)
}

/// The host's tables and frame for one surface.
struct Host<'a> {
    scene: &'a Scene,
    map: EnvironmentTables,
    brdf: MaterialTables,
    material: usize,
    frame: Frame,
    outgoing_local: Vec3,
}

/// Unoccluded integrand in a direction, and its densities.
#[derive(Clone, Copy)]
struct DirectionSample {
    integrand: f64,
    brdf_pdf: f64,
    map_pdf: f64,
}

impl<'a> Host<'a> {
    fn new(surface: &'a Surface, recorded: &GuideReadback) -> Self {
        assert!(recorded.position.distance(surface.point) < 0.01, "{}", recorded.position);
        let frame = frame_from_normal(recorded.normal);
        let outgoing = (surface.scene.camera.position - recorded.position).normalize();
        Self {
            scene: &surface.scene,
            map: EnvironmentTables::new(&surface.scene.environment),
            brdf: MaterialTables::new(&surface.scene.materials).unwrap(),
            material: surface.material,
            frame,
            outgoing_local: frame.to_local(outgoing),
        }
    }

    fn evaluate_direction(&self, direction: Vec3) -> DirectionSample {
        let incident_local = self.frame.to_local(direction);
        let radiance = self.scene.environment.radiance(direction);
        let (value, brdf_pdf) =
            brdf::evaluate_and_pdf(&self.brdf, self.material, self.outgoing_local, incident_local);
        let brought = value * radiance * incident_local.z.max(0.0);
        DirectionSample {
            integrand: f64::from(brought.element_sum()),
            brdf_pdf: f64::from(brdf_pdf),
            map_pdf: f64::from(self.map.pdf(&self.scene.environment, direction, radiance)),
        }
    }

    fn bin(&self, direction: Vec3) -> usize {
        hemisphere::bin(self.frame.to_local(direction).as_dvec3())
    }

    /// Directions of the quadrature with their solid angles.
    fn directions(&self) -> impl Iterator<Item = (Vec3, f64)> + '_ {
        let locals = hemisphere::quadrature(ROWS);
        let solid_angle = 4.0 * PI / locals.len() as f64;
        locals.map(move |local| (self.frame.to_world(local.as_vec3()), solid_angle))
    }
}

/// Returns the density of a cell's guided directions over that of the map, by region.
fn ratios(recorded: &GuideReadback, cell: &CellReadback) -> Vec<f64> {
    let regions = cell.regions.iter().zip(&recorded.partition.regions);
    // A black region is never drawn.
    let ratio = |share: f64, probability: f64| if share > 0.0 { probability / share } else { 0.0 };
    regions.map(|(known, region)| ratio(region.share, known.probability)).collect()
}

/// Finds the BRDF's share in the density of the one-sample model from what the rays were divided by.
/// Fails unless one share explains them all.
fn brdf_share(name: &str, host: &Host<'_>, rays: &[GuidedRay], ratios: &[f64]) -> f64 {
    let mut explained = Vec::new();
    for traced in rays.iter().filter(|traced| traced.region.is_some()) {
        let sampled = host.evaluate_direction(traced.ray.direction);
        let pdf = sampled.integrand / f64::from(traced.ray.contribution.element_sum());
        let guided = ratios[traced.region.unwrap()] * sampled.map_pdf;
        explained.push((pdf, sampled.brdf_pdf, guided));
    }
    assert!(explained.len() > rays.len() / 4, "{name}: {} rays brought anything", explained.len());
    let mut shares: Vec<f64> = explained
        .iter()
        .filter(|(_, brdf, guided)| (brdf - guided).abs() > 0.5 * brdf.max(*guided))
        .map(|(pdf, brdf, guided)| (pdf - guided) / (brdf - guided))
        .collect();
    shares.sort_by(f64::total_cmp);
    let share = shares[shares.len() / 2];
    assert!((0.02..0.98).contains(&share), "{name}: share {share}");
    // Host and device disagree about a few directions next to an edge.
    let differs = |(pdf, brdf, guided): &&(f64, f64, f64)| {
        (share * brdf + (1.0 - share) * guided - pdf).abs() > 0.01 * pdf
    };
    let wrong = explained.iter().filter(differs).count();
    assert!(wrong < explained.len() / 200, "{name}: {wrong} of {} pdfs differ", explained.len());
    share
}

/// Integrates both parts of the mixture over every bin. The last bin holds the lost BRDF samples.
fn expected_shares(name: &str, host: &Host<'_>, recorded: &GuideReadback) -> [Vec<f64>; 2] {
    let ratios = ratios(recorded, recorded.cell.as_ref().unwrap());
    let (mut from_brdf, mut guided) = (vec![0.0; BINS], vec![0.0; BINS]);
    for (direction, solid_angle) in host.directions() {
        let sampled = host.evaluate_direction(direction);
        let region = recorded.partition.region_of(&host.scene.environment, direction);
        let bin = host.bin(direction);
        from_brdf[bin] += solid_angle * sampled.brdf_pdf;
        guided[bin] += solid_angle * ratios[region] * sampled.map_pdf;
    }
    let whole: f64 = guided.iter().sum();
    assert!((whole - 1.0).abs() < 3e-3, "{name}: guided directions integrate to {whole}");
    let whole: f64 = from_brdf.iter().sum();
    assert!((0.5..1.003).contains(&whole), "{name}: the BRDF's density integrates to {whole}");
    from_brdf[BINS - 1] += (1.0 - whole).max(0.0);
    [from_brdf, guided]
}

fn mixed(share: f64, [from_brdf, guided]: &[Vec<f64>; 2]) -> Vec<f64> {
    from_brdf.iter().zip(guided).map(|(a, b)| share * a + (1.0 - share) * b).collect()
}

fn record(renderer: &mut Renderer, surface: &Surface) -> GuideReadback {
    let recorded =
        renderer.explain_learned(renderer.settings().seed, surface.pixel, RAYS).unwrap().unwrap();
    let recorded: Box<dyn std::any::Any> = recorded;
    let recorded = *recorded.downcast::<GuideReadback>().unwrap();
    support::assert_silent();
    assert_eq!(recorded.rays.len(), RAYS as usize);
    recorded
}

#[test]
fn paths_of_many_vertices_are_recorded_at_their_first() {
    let _alone = support::alone();
    let [floor, ..] = surfaces();
    let [short, long] =
        [1, 3].map(|depth| record(&mut renderer_at_depth(&floor, 1, depth), &floor));
    assert_eq!(short.position, long.position);
    for (short, long) in short.rays.iter().zip(&long.rays) {
        assert_eq!(short.ray.direction, long.ray.direction);
    }
}

#[test]
fn directions_follow_the_density_that_they_are_divided_by() {
    let _alone = support::alone();
    for surface in &surfaces() {
        let mut renderer = renderer(surface, 1);
        let mut untrained: Option<(f64, [Vec<f64>; 2])> = None;
        for state in ["untrained", "trained"] {
            let name = format!("{}, {state}", surface.name);
            let recorded = record(&mut renderer, surface);
            let host = Host::new(surface, &recorded);
            let cell = recorded.cell.as_ref().unwrap();
            let trials: f64 = cell.regions.iter().map(|region| region.trials).sum();
            assert_eq!(trials > 0.0, state == "trained", "{name}: {trials} rays counted");
            let share = brdf_share(&name, &host, &recorded.rays, &ratios(&recorded, cell));
            let mut observed = vec![0.0; BINS];
            for traced in &recorded.rays {
                observed[host.bin(traced.ray.direction)] += 1.0;
            }
            let parts = expected_shares(&name, &host, &recorded);
            let p = statistics::chi_square_p_value(&observed, &mixed(share, &parts));
            eprintln!("{name}: {trials} rays counted, BRDF share {share:.4}, p {p:.3}");
            assert!(p > 1e-4, "{name}: p = {p}");
            if let Some((share, parts)) = &untrained {
                // Directions drawn by what was learned do not follow the untrained density.
                let p = statistics::chi_square_p_value(&observed, &mixed(*share, parts));
                assert!(p < 1e-6, "{name}: as if untrained, p = {p}");
            }
            untrained = Some((share, parts));
            renderer.restart(5).unwrap();
            renderer.render_pass(64).unwrap();
        }
    }
}

/// Returns the part of the sky in which a bin lies; the last part is below the horizon.
fn part_of(bin: usize) -> usize {
    if bin == BINS - 1 { PARTS - 1 } else { bin / BIN_COLUMNS / 4 * 8 + bin % BIN_COLUMNS / 3 }
}

/// Compares estimates of the unoccluded map's light, in all and in every part, with the quadrature.
#[test]
fn every_part_of_the_sky_has_its_weight() {
    let _alone = support::alone();
    for surface in &surfaces() {
        for candidates in [1, 4, 8] {
            let mut renderer = renderer(surface, candidates);
            for state in ["untrained", "trained"] {
                let name = format!("{}, {candidates} candidates, {state}", surface.name);
                let recorded = record(&mut renderer, surface);
                let host = Host::new(surface, &recorded);
                let mut truth = [0.0; PARTS];
                for (direction, solid_angle) in host.directions() {
                    let part = part_of(host.bin(direction));
                    truth[part] += solid_angle * host.evaluate_direction(direction).integrand;
                }
                let whole: f64 = truth.iter().sum();
                let values: Vec<(usize, f64)> = recorded
                    .rays
                    .iter()
                    .map(|traced| {
                        let brought = f64::from(traced.ray.contribution.element_sum());
                        (part_of(host.bin(traced.ray.direction)), brought)
                    })
                    .collect();
                // Rays are stratified, so this overestimates the error.
                let all: Vec<f64> = values.iter().map(|(_, value)| *value).collect();
                let z = statistics::z_of_mean(&all, whole);
                let wrong = statistics::z_of_mean(&all, 1.05 * whole);
                let mut most = (0, 0.0);
                let mut compared = 0;
                for (part, truth) in truth.iter().enumerate() {
                    let here: Vec<f64> = values
                        .iter()
                        .map(|(other, value)| if *other == part { *value } else { 0.0 })
                        .collect();
                    // A few rays say nothing about the spread.
                    if here.iter().filter(|value| **value > 0.0).count() < 100 {
                        continue;
                    }
                    compared += 1;
                    let z = statistics::z_of_mean(&here, *truth);
                    if z.abs() > f64::abs(most.1) {
                        most = (part, z);
                    }
                }
                eprintln!("{name}: z {z:.2} ({wrong:.1}), {compared} parts, z {:.2}", most.1);
                assert!(z.abs() < Z_LIMIT, "{name}: z = {z}");
                assert!(wrong.abs() > Z_LIMIT, "{name}: too noisy to judge, z = {wrong}");
                assert!(compared > 8, "{name}: {compared} parts");
                assert!(most.1.abs() < Z_LIMIT, "{name}: part {}: z = {}", most.0, most.1);
                renderer.restart(6).unwrap();
                renderer.render_pass(64).unwrap();
            }
        }
    }
}
