//! `control-variates`: records and choices against their twin on the host, the picture with every parameter
//! against that of `mis`, an estimate without its uncontrolled part that is found, and what records bring.
//!
//! Images are compared by 12 block means × 3 channels of 8 + 8 replicates, as in `unbiased.rs`. |t| > 7.5
//! has a chance of 3e-6, so the 3 comparisons raise a false alarm once in 3,000 runs.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use bytemuck::{Pod, Zeroable};
use fenestra::{
    math::random::random_independent_2d,
    sampler::{
        Sampler,
        control_variates::{ControlVariatesParameters, RecordGrid},
    },
    scene::Scene,
    session::Settings,
    shader::{
        bindings::scene,
        rooms::control_variates::{
            CONSTANT_CONTROL_BITS, CONSTANT_CONTROL_CHOICE, CONSTANT_CONTROL_SHARE,
        },
        structs::SceneParameters,
    },
};
use glam::{DVec3, Vec3, vec3};

use crate::{
    support::{self, assert_error, render, replicates, scenes},
    twin::control_variates::{Candidate, Controlled, choose, control_of, entry, record_of},
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

fn own(control_share: f32, control_bits: bool, control_choice: bool) -> ControlVariatesParameters {
    let others = ControlVariatesParameters::default();
    ControlVariatesParameters { control_share, control_bits, control_choice, ..others }
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
        let own = own(control_share, control_bits, control_choice);
        let grid = RecordGrid { side, edge_per_distance: 0.1, largest_edge: 0.9 };
        let control = [
            (CONSTANT_CONTROL_SHARE, control_share.to_bits()),
            (CONSTANT_CONTROL_BITS, u32::from(control_bits)),
            (CONSTANT_CONTROL_CHOICE, u32::from(control_choice)),
        ];
        let answers: Vec<Answer> = support::run_probe(
            "control_variates",
            &[&control[..], &grid.constants()].concat(),
            &[(scene::PARAMETERS, bytemuck::bytes_of(&parameters))],
            &queries,
        );
        let (mut other_entries, mut other_choices, mut negative) = (0, 0, 0);
        for (query, answer) in queries.iter().zip(&answers) {
            let record = record_of(grid, query.position.into(), query.normal.into(), camera);
            other_entries += u32::from(answer.entry != entry(grid, record, query.direction.into()));
            let candidates = query
                .weights
                .map(|[x, y, z, visibility]| Candidate { weight: Vec3::new(x, y, z), visibility });
            let expected = choose(&own, &candidates, query.u);
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

/// Mean of the estimate over the choice, for every way in which the candidates may be visible.
#[test]
fn the_mean_is_the_light_of_the_visible_candidates() {
    let candidates = [
        Candidate { weight: vec3(1.0, 0.5, 0.2), visibility: 0.9 },
        Candidate { weight: vec3(0.2, 0.1, 3.0), visibility: 0.0 },
        Candidate { weight: Vec3::ZERO, visibility: 0.5 },
        Candidate { weight: vec3(0.0, 2.0, 0.1), visibility: 0.4 },
    ];
    const NUMBERS: u32 = 40_000;
    for (control_share, control_bits, control_choice) in
        [(1.0, true, true), (1.0, true, false), (0.5, false, true), (0.0, false, true)]
    {
        let own = own(control_share, control_bits, control_choice);
        let outcomes: Vec<Controlled> = (0..NUMBERS)
            .map(|index| choose(&own, &candidates, (index as f32 + 0.5) / NUMBERS as f32))
            .collect();
        for seen in 0..16_u32 {
            let is_seen = |index: usize| seen >> index & 1 == 1;
            let light = |outcome: &Controlled| {
                let is_seen = outcome.chosen.is_some_and(is_seen);
                outcome.rest + if is_seen { outcome.contribution } else { Vec3::ZERO }
            };
            let mean = |light: &dyn Fn(&Controlled) -> Vec3| {
                let sum: DVec3 = outcomes.iter().map(|outcome| light(outcome).as_dvec3()).sum();
                sum / f64::from(NUMBERS)
            };
            let seen_ones = candidates.iter().enumerate().filter(|(index, _)| is_seen(*index));
            let expected =
                0.25 * seen_ones.map(|(_, candidate)| candidate.weight.as_dvec3()).sum::<DVec3>();
            let off = (mean(&light) - expected).abs().max_element();
            assert!(off < 1e-3, "{own:?}, {seen:04b}: off by {off}");
            // An estimate that takes back too little of the control has another mean.
            let wrong = |outcome: &Controlled| {
                let control =
                    outcome.chosen.map_or(0.0, |index| control_of(&own, &candidates[index]));
                light(outcome) + 0.05 * control * outcome.contribution
            };
            let off = (mean(&wrong) - expected).abs().max_element();
            assert!(control_share == 0.0 || off > 5e-3, "{own:?}, {seen:04b}: {off}");
        }
    }
}

#[test]
fn certain_candidates_leave_no_variance() {
    let certain = |visibility| Candidate { weight: Vec3::ONE, visibility };
    let candidates = [certain(1.0), certain(0.0), certain(0.0), certain(1.0)];
    let own = ControlVariatesParameters::default();
    for index in 0..100 {
        let outcome = choose(&own, &candidates, (index as f32 + 0.5) / 100.0);
        let visibility = candidates[outcome.chosen.unwrap_or(0)].visibility;
        let light = outcome.rest + outcome.contribution * visibility;
        assert!((light - 0.5).abs().max_element() < 1e-6, "{outcome:?}");
    }
}

#[test]
fn darkness_has_no_ray() {
    let dark = [Candidate { weight: Vec3::ZERO, visibility: 0.5 }; 4];
    let outcome = choose(&ControlVariatesParameters::default(), &dark, 0.3);
    assert_eq!((outcome.chosen, outcome.rest), (None, Vec3::ZERO));
}

#[test]
fn a_record_expects_what_it_has_counted_or_what_all_have() {
    let grid = RecordGrid { side: 4, edge_per_distance: 0.1, largest_edge: 1.0 };
    let mut counts = vec![[0, 0]; grid.entries()];
    assert!(grid.expected(&counts).iter().all(|expected| *expected == 0.5), "nothing counted");
    (counts[3], counts[16 + 3], counts[5]) = ([1000, 1000], [1000, 0], [500, 0]);
    let expected = grid.expected(&counts);
    assert!((expected[3] - 1.0).abs() < 2e-3, "seen: {}", expected[3]);
    assert!(expected[16 + 3] < 2e-3 && expected[16 + 3] > 0.0, "blocked");
    assert!((expected[32 + 3] - 0.5).abs() < 1e-2, "half of all rays of this bin");
    assert!(expected[32 + 5] < 1e-2, "no ray of this bin");
    assert!((expected[0] - 0.4).abs() < 1e-2, "two fifths of all rays");
}

fn settings(assignments: &[&str]) -> Settings {
    let parameters = support::parameters(assignments);
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
    let reference = replicates::replicates(&scene, &mis, 40, 16);
    let cases: [&[&str]; 3] = [
        &["candidates=2", "record-side=4", "compensation=off"],
        &["control-choice=off", "record-pixels=4"],
        &["control-share=0.5", "control-bits=off", "candidates=8"],
    ];
    for (case, assignments) in cases.into_iter().enumerate() {
        let seed = 100 * (1 + case as u32);
        let values = replicates::replicates(&scene, &settings(assignments), seed, 8);
        replicates::assert_same(&format!("{assignments:?}"), &values, &reference, 0.03);
    }
}

/// Sum over the pixels of the variance of their mean, estimated from the samples. Shadow rays come in two
/// groups: whatever share of all each takes back of what records expect, the mean is the same.
fn variance(scene: &Scene, assignments: &[&str]) -> f64 {
    let settings = Settings { shadow_rays: 9, ..settings(assignments) };
    let (sums, _) = render(scene, settings, 16);
    (0..sums.pixel_count()).map(|pixel| sums.variance_of_mean(pixel).iter().sum::<f64>()).sum()
}

/// The same candidates with and without the control. In the open records that take every ray for visible
/// would bring something too; in the room, where true records have few bits to set, they would do much harm.
#[test]
fn records_lower_the_variance() {
    let _alone = support::alone();
    let things = vec![scenes::diffuse(Vec3::splat(0.6)), scenes::plastic(0.3)];
    for (scene, most) in [(scenes::open(things), 0.92), (room(), 1.25)] {
        let with = variance(&scene, &["candidates=8"]);
        let without = variance(&scene, &["candidates=8", "control-share=0"]);
        eprintln!("{}: {with:.4} with, {without:.4} without", scene.name);
        assert!(with < most * without, "{}: {with}, and {without} without", scene.name);
    }
}

#[test]
fn cohorts_that_share_paths_are_refused() {
    let parameters = settings(&["share-paths=4"]).parameters;
    assert_error(
        Sampler::ControlVariates.check(&parameters, 4, &[]),
        &["share-paths=4", "expected auto or off"],
    );
    let parameters = settings(&["candidates=1"]).parameters;
    assert_error(Sampler::ControlVariates.check(&parameters, 1, &[]), &["[2, 4, 6, 8]"]);
}
