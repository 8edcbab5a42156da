//! `control-variates`: records and choices against their twin on the host, the picture with every parameter
//! against that of `mis`, an estimate without its uncontrolled part that is found, and what records bring.
//!
//! Images are compared by 12 block means × 3 channels of 8 + 8 replicates, as in `unbiased.rs`. |t| > 7.5
//! has a chance of 3e-6, so the 3 comparisons raise a false alarm once in 3,000 runs.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod support;

use bytemuck::{Pod, Zeroable};
use fenestra::{
    math::random::random_independent_2d,
    renderer::Settings,
    sampler::{
        Parameters, Sampler,
        control_variates::{ControlVariatesParameters, RecordGrid, controlled::Candidate},
    },
    scene::Scene,
    shader::{
        bindings::{probe, scene},
        constants::{CONSTANT_CONTROL_BITS, CONSTANT_CONTROL_CHOICE, CONSTANT_CONTROL_SHARE},
        structs::SceneParameters,
    },
};
use glam::Vec3;
use support::{
    render,
    replicates::{self, LIMIT},
    scenes,
    statistics::Comparison,
};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Query {
    position: [f32; 3],
    normal: [f32; 3],
    direction: [f32; 3],
    u: f32,
    /// Weight and expected visibility of four candidates.
    weights: [[f32; 4]; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    entry: u32,
    chosen: u32,
    contribution: [f32; 3],
    rest: [f32; 3],
}

fn queries(count: u32) -> Vec<Query> {
    let query = |index: u32| {
        let number = |dimension| random_independent_2d(index, 7, dimension, 3);
        let vector = |dimension| {
            Vec3::new(number(dimension)[0], number(dimension)[1], number(dimension + 1)[0]) - 0.5
        };
        let weight = |candidate: u32| {
            let ([a, b], [c, v]) = (number(20 + 2 * candidate), number(21 + 2 * candidate));
            // Some bring no light, some are certain.
            let scale = if b < 0.2 { 0.0 } else { 10.0 * b };
            [a * scale, b * scale, c * scale, (2.0 * v - 0.5).clamp(0.0, 1.0)]
        };
        Query {
            position: (20.0 * vector(0)).into(),
            normal: vector(2).normalize().into(),
            direction: vector(4).normalize().into(),
            u: number(6)[0],
            weights: [0, 1, 2, 3].map(weight),
        }
    };
    (0..count).map(query).collect()
}

fn is_close(a: [f32; 3], b: Vec3) -> bool {
    (Vec3::from(a) - b).abs().max_element() <= 1e-3 * (1.0 + b.abs().max_element())
}

#[test]
fn the_shader_agrees() {
    let _alone = support::alone();
    let camera = Vec3::new(1.0, 2.0, 3.0);
    let parameters =
        SceneParameters { camera_position: camera.into(), ..SceneParameters::default() };
    let queries = queries(4000);
    for (control_share, control_bits, control_choice, side) in
        [(1.0, true, true, 16), (0.6, false, true, 5), (1.0, false, false, 32)]
    {
        let own = ControlVariatesParameters {
            control_share,
            control_bits,
            control_choice,
            ..ControlVariatesParameters::default()
        };
        let grid = RecordGrid { side, edge_per_distance: 0.1, largest_edge: 0.9 };
        let control = [
            (CONSTANT_CONTROL_SHARE, control_share.to_bits()),
            (CONSTANT_CONTROL_BITS, u32::from(control_bits)),
            (CONSTANT_CONTROL_CHOICE, u32::from(control_choice)),
        ];
        let output = support::run_specialized_probe(
            include_bytes!(concat!(env!("OUT_DIR"), "/test/control_variates.spv")),
            &[&control[..], &grid.constants()].concat(),
            &[
                (scene::PARAMETERS, bytemuck::bytes_of(&parameters)),
                (probe::PROBE_INPUT, bytemuck::cast_slice(&queries)),
            ],
            queries.len() * size_of::<Answer>(),
            queries.len() as u32,
        );
        let answers: &[Answer] = bytemuck::cast_slice(&output);
        let (mut other_entries, mut other_choices, mut negative) = (0, 0, 0);
        for (query, answer) in queries.iter().zip(answers) {
            let record = grid.record_of(query.position.into(), query.normal.into(), camera);
            other_entries += u32::from(answer.entry != grid.entry(record, query.direction.into()));
            let candidates = query
                .weights
                .map(|[x, y, z, visibility]| Candidate { weight: Vec3::new(x, y, z), visibility });
            let expected = own.choose(&candidates, query.u);
            // Rounding decides between candidates now and then.
            if expected.chosen.unwrap_or(0) as u32 == answer.chosen {
                let is_same = is_close(answer.contribution, expected.contribution)
                    && is_close(answer.rest, expected.rest);
                assert!(is_same, "{answer:?}, not {expected:?}");
            } else {
                other_choices += 1;
            }
            negative += u32::from(answer.rest.iter().any(|rest| *rest < 0.0));
        }
        assert!(other_entries < 20 && other_choices < 20, "{other_entries}, {other_choices}");
        assert!(negative > 100, "only {negative} below zero: nothing is tested there");
    }
}

fn settings(assignments: &[&str]) -> Settings {
    let mut parameters = Parameters::default();
    for assignment in assignments {
        parameters.set(assignment).unwrap();
    }
    Settings { sampler: Sampler::ControlVariates, parameters, ..Settings::default() }
}

/// Diffuse things and metal in a room with a window, where records of every kind occur.
fn room() -> Scene {
    scenes::room(vec![scenes::diffuse(Vec3::splat(0.6)), scenes::copper(0.3)])
}

#[test]
fn parameters_change_no_image() {
    let _alone = support::alone();
    let scene = room();
    let mis = Settings { shadow_rays: 16, ..Settings::default() };
    let mis = Settings { sampler: Sampler::Mis, ..mis };
    let reference = replicates::replicates(&scene, &mis, 40, 32);
    let cases: [&[&str]; 3] = [
        &["candidates=2", "record-side=4", "compensation=off"],
        &["control-choice=off", "record-pixels=4"],
        &["control-share=0.5", "control-bits=off", "candidates=8"],
    ];
    for (case, assignments) in cases.into_iter().enumerate() {
        let seed = 100 * (1 + case as u32);
        let values = replicates::replicates(&scene, &settings(assignments), seed, 16);
        let Comparison { largest_t, ratio, largest_t_with_bias } =
            Comparison::new(&values, &reference);
        eprintln!("{assignments:?}: largest |t| {largest_t:.2}, ratio {ratio:.4}");
        assert!(largest_t < LIMIT, "{assignments:?}: |t| = {largest_t}");
        let is_judged = largest_t_with_bias > LIMIT || (ratio - 1.0).abs() < 0.03;
        assert!(is_judged, "{assignments:?}: too noisy to judge");
    }
}

/// Sum over the pixels of the variance of their mean, estimated from the samples.
fn variance(scene: &Scene, assignments: &[&str]) -> f64 {
    let (sums, _) = render(scene, settings(assignments), 16);
    (0..sums.pixel_count()).map(|pixel| sums.variance_of_mean(pixel).iter().sum::<f64>()).sum()
}

/// The same candidates with and without the control. In the open records that take every ray for visible
/// would bring something too, in the room only true ones do.
#[test]
fn records_lower_the_variance() {
    let _alone = support::alone();
    let things = vec![scenes::diffuse(Vec3::splat(0.6)), scenes::plastic(0.3)];
    for (scene, most) in [(scenes::open(things), 0.85), (room(), 0.9)] {
        let with = variance(&scene, &["candidates=8"]);
        let without = variance(&scene, &["candidates=8", "control-share=0"]);
        eprintln!("{}: {with:.4} with, {without:.4} without", scene.name);
        assert!(with < most * without, "{}: {with}, and {without} without", scene.name);
    }
}

#[test]
fn tiles_that_share_paths_are_refused() {
    let parameters = settings(&["share-tiles=4"]).parameters;
    let error = Sampler::ControlVariates.check(&parameters, 4, &[]).unwrap_err().to_string();
    assert!(error.contains("share-tiles=4") && error.contains("expected auto or off"), "{error}");
    let parameters = settings(&["candidates=1"]).parameters;
    let error = Sampler::ControlVariates.check(&parameters, 1, &[]).unwrap_err().to_string();
    assert!(error.contains("[2, 4, 6, 8]"), "{error}");
}
