//! Bounces of the sampler `guided`: they follow the cells' beliefs, bring what the BRDF reflects
//! whatever these are, and teach the cells.
//!
//! Seeds are fixed; others would raise a false alarm once in some hundred runs.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::{
    brdf::MaterialTables,
    gpu::{Commands, Pipeline},
    math::{
        frame::frame_from_normal,
        random::{hash_4d, random_independent_2d},
    },
    pass::{PathDemand, SceneBuffers, Surfaces, WaveBuffers},
    sampler::{
        Parameters, Sampler,
        guided::{
            ARRIVAL_DIRECTIONS, Guide, GuideBuffers, GuideSize, GuideState, GuidedParameters,
        },
        regions::FACE_COUNT,
    },
    scene::Scene,
    session::{Settings, window_of},
    shader::{
        bindings::wave,
        constants::CONSTANT_MATERIAL_KINDS,
        rooms::guided::CONSTANT_BOUNCE_CANDIDATES,
        spirv,
        structs::{PathState, Ray, Wave},
    },
};
use glam::{Vec3, vec3};

use crate::{
    support::{
        self, PathInput,
        guide::Guide as _,
        materials,
        replicates::{self, BLOCK},
        scenes,
        statistics::{self, estimates, largest_t},
    },
    twin::{brdf, guided::arrival_direction, random::random_2d},
};

/// Pixels, and samples per pixel, of the paths before one surface.
const PIXELS: u32 = 1024;
const SAMPLES: u32 = 32;

fn guided(depth: u32) -> Settings {
    let parameters = Parameters { candidates: Some(1), ..Parameters::default() };
    Settings { sampler: Sampler::Guided, depth, parameters, ..Settings::default() }
}

#[test]
fn the_shader_tells_directions_apart_as_the_host_does() {
    let mut directions: Vec<Vec3> = (0..20_000)
        .map(|number| uniform_direction(random_independent_2d(number, 0, 0, 1)))
        .collect();
    directions.extend([Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z]);
    let count = directions.len();
    let output: Vec<u32> = support::run_probe("arriving", &[], &[], &directions);
    let mut seen = [0_u32; ARRIVAL_DIRECTIONS];
    let mut differing = 0;
    for (direction, shader) in directions.iter().zip(&output) {
        let host = arrival_direction(*direction);
        seen[host] += 1;
        differing += u32::from(host != *shader as usize);
    }
    // Rounding decides where two of them meet.
    assert!(differing <= 4, "{differing} of {count} differ");
    let mean = count as u32 / ARRIVAL_DIRECTIONS as u32;
    assert!(seen.iter().all(|seen| (mean / 4..3 * mean).contains(seen)), "{seen:?}");
}

/// A floor of one material, and the direction from it to the camera.
struct Floor {
    scene: Scene,
    normal: Vec3,
    outgoing: Vec3,
}

fn floors() -> Vec<(&'static str, Floor)> {
    let measured = materials::measured_plastic();
    let floor = |material, normal: Vec3, outgoing: Vec3| Floor {
        scene: scenes::room(vec![material]),
        normal: normal.normalize(),
        outgoing: outgoing.normalize(),
    };
    vec![
        ("diffuse", floor(scenes::diffuse(vec3(0.7, 0.5, 0.3)), Vec3::Y, vec3(0.3, 0.8, 0.1))),
        ("plastic", floor(scenes::plastic(0.3), vec3(0.1, 1.0, -0.2), vec3(0.9, 0.5, 0.1))),
        ("copper", floor(scenes::copper(0.4), vec3(0.0, 1.0, 0.1), vec3(-0.3, 0.8, 0.4))),
        ("measured", floor(measured, Vec3::Y, vec3(0.2, 0.7, -0.5))),
    ]
}

/// Light that a guide may believe in: a lot from a few directions, next to nothing from most.
fn belief(direction: usize) -> f32 {
    let [x, ..] = hash_4d([direction as u32, 5, 6, 7]);
    if x % 8 == 0 { 1.0 } else { 0.001 * (x >> 16) as f32 / 65536.0 }
}

/// Returns such beliefs in every cell, and the light by direction that passes read of a cell.
fn arriving() -> (GuideState, Vec<f32>) {
    let words = |cell_direction: usize| {
        let light = 1e6 * belief(cell_direction % ARRIVAL_DIRECTIONS);
        [1e6_f32.to_bits(), light.to_bits()]
    };
    let words: Vec<[u32; 2]> = (0..FACE_COUNT * ARRIVAL_DIRECTIONS).map(words).collect();
    let scene = scenes::room(vec![scenes::diffuse(Vec3::splat(0.5))]);
    let partition = fenestra::sampler::regions::Partition::new(&scene.environment, 256);
    let learned = Guide::new(256, FACE_COUNT, 8).with_bounces(&words, 1);
    let snapshot = learned.snapshot(&partition);
    let read = snapshot.arriving[2 * ARRIVAL_DIRECTIONS..][..ARRIVAL_DIRECTIONS].to_vec();
    (GuideState { arrivals: words, ..GuideState::default() }, read)
}

/// Returns direction and throughput of the paths after a bounce off the floor with these beliefs, in an epoch
/// of a render with these seeds.
fn bounce(
    floor: &Floor,
    candidates: u32,
    beliefs: &GuideState,
    [epoch_seed, seed]: [u32; 2],
) -> Vec<(Vec3, Vec3)> {
    let device = support::device();
    let scene = &floor.scene;
    let buffers = SceneBuffers::new(device, scene, window_of(&Settings::default(), scene)).unwrap();
    let paths = PIXELS * SAMPLES;
    // Leave room for the cells of faces only.
    let parameters = GuidedParameters { guide_memory: 1, ..GuidedParameters::default() };
    let size = GuideSize { pixels: PIXELS, paths, shadow_rays: 1, has_bounces: true };
    let mut guide = GuideBuffers::new(device, scene, &parameters, size).unwrap();
    let state = guide.state().unwrap();
    guide.restore(&GuideState { arrivals: beliefs.arrivals.clone(), ..state }).unwrap();
    let waves =
        WaveBuffers::new(device, PIXELS, 1 << 17, 1, PathDemand::default(), Surfaces::default())
            .unwrap();
    assert!(waves.capacity >= paths);
    let input = PathInput::new(0, floor.normal, floor.outgoing);
    PathInput::put(&vec![input; paths as usize], &waves);
    let states = vec![PathState { throughput: [1.0; 3], ..PathState::default() }; paths as usize];
    waves.set.buffer(wave::PATHS).upload(bytemuck::cast_slice(&states)).unwrap();

    let kinds = (CONSTANT_MATERIAL_KINDS, buffers.surfaces.material_kinds);
    let create = |name: &str, constants: &[(u32, u32)]| {
        Pipeline::new(device, name, spirv::pass(name), constants).unwrap()
    };
    let sample = create("sample_guided", &[kinds]);
    let bounce = create("bounce_guided", &[kinds, (CONSTANT_BOUNCE_CANDIDATES, candidates)]);
    let learn = create("learn_arrivals", &[kinds]);
    let wave = Wave {
        pixel_count: PIXELS,
        sample_count: SAMPLES,
        shadow_ray_count: 1,
        total_shadow_rays: 1,
        epoch_seed,
        seed,
        ..Wave::default()
    };
    let sets = [&buffers.set, &guide.set, &waves.set];
    let push = bytemuck::bytes_of(&wave);
    let mut commands = Commands::begin(device).unwrap();
    // Find the cell.
    commands.dispatch(&sample, &sets, push, paths).unwrap();
    commands.dispatch(&bounce, &sets, push, paths).unwrap();
    commands.dispatch(&learn, &sets, push, paths).unwrap();
    commands.submit_and_wait().unwrap();
    let rays: Vec<Ray> = waves.set.buffer(wave::RAYS).download(paths as usize).unwrap();
    let states: Vec<PathState> = waves.set.buffer(wave::PATHS).download(paths as usize).unwrap();
    // Sixteen samples teach, then one in four, each by the direction of its ray.
    let mut untaught = [0_i64; ARRIVAL_DIRECTIONS];
    for (path, ray) in (0_u32..).zip(&rays) {
        let sample = path / PIXELS;
        if ray.is_active != 0 && (sample < 16 || sample.is_multiple_of(4)) {
            untaught[arrival_direction(ray.direction.into())] += 1;
        }
    }
    let taught = guide.state().unwrap().pending_arrivals;
    for (index, [count, _]) in taught.iter().enumerate() {
        untaught[index % ARRIVAL_DIRECTIONS] -= i64::from(*count);
    }
    // Rounding decides where two directions meet.
    let difference = untaught.iter().map(|count| count.abs()).sum::<i64>();
    assert!(!taught.is_empty() && difference < 16, "{difference} of {paths}");
    support::assert_silent();
    rays.iter()
        .zip(&states)
        .map(|(ray, state)| (Vec3::from(ray.direction), Vec3::from(state.throughput)))
        .collect()
}

/// Computes on the host the chance of every direction to be kept: the mean chance of its candidates
/// over random numbers. The last entry is for candidates below the horizon, where paths end.
fn chances(floor: &Floor, candidates: u32, light: &[f32]) -> Vec<f64> {
    let tables = MaterialTables::new(&floor.scene.materials).unwrap();
    let frame = frame_from_normal(floor.normal);
    let outgoing_local = frame.to_local(floor.outgoing);
    let rotation = vec3(1.0 / candidates as f32, 0.618_034, 0.754_878);
    let mut chances = vec![0.0; ARRIVAL_DIRECTIONS + 1];
    let count = 1 << 17;
    for number in 0..count {
        let [x, y] = random_2d(0, number, 0, 9);
        let [z, _] = random_2d(0, number, 1, 9);
        let mut u = vec3(x, y, z);
        let mut drawn = Vec::new();
        for _ in 0..candidates {
            let incident_local = brdf::sample(&tables, 0, outgoing_local, u);
            let direction = arrival_direction(frame.to_world(incident_local));
            let is_above = incident_local.z > 0.0;
            let bin = if is_above { direction } else { ARRIVAL_DIRECTIONS };
            drawn.push((bin, f64::from(light[direction])));
            u = (u + rotation).fract();
        }
        let sum: f64 = drawn.iter().map(|(_, light)| light).sum();
        for (bin, light) in drawn {
            chances[bin] += light / sum / f64::from(count);
        }
    }
    chances
}

/// Integrates the red of BRDF · cosine over every direction's solid angle.
fn reflected(floor: &Floor) -> Vec<f64> {
    let tables = MaterialTables::new(&floor.scene.materials).unwrap();
    let frame = frame_from_normal(floor.normal);
    let outgoing_local = frame.to_local(floor.outgoing);
    let mut reflected = vec![0.0; ARRIVAL_DIRECTIONS];
    let count = 1 << 20;
    for number in 0..count {
        let direction = uniform_direction(random_2d(1, number, 0, 9));
        let incident_local = frame.to_local(direction);
        if incident_local.z > 0.0 {
            let (value, _) = brdf::evaluate_and_pdf(&tables, 0, outgoing_local, incident_local);
            reflected[arrival_direction(direction)] +=
                f64::from(value.x * incident_local.z) * 4.0 * std::f64::consts::PI
                    / f64::from(count);
        }
    }
    reflected
}

/// Maps two numbers in [0, 1) to a direction, uniform over the sphere.
fn uniform_direction([x, y]: [f32; 2]) -> Vec3 {
    let height = 1.0 - 2.0 * y;
    let (sin, cos) = (2.0 * std::f32::consts::PI * x).sin_cos();
    let radius = (1.0 - height * height).max(0.0).sqrt();
    vec3(radius * cos, height, radius * sin)
}

/// Directions are kept with the chances that the host computes, and bring on average what the BRDF
/// reflects, direction by direction, although seven in eight directions are believed dark.
#[test]
fn bounces_bring_what_the_brdf_reflects() {
    let _alone = support::alone();
    let (beliefs, light) = arriving();
    for (name, floor) in floors() {
        let expected = reflected(&floor);
        for candidates in [2, 4, 8] {
            let bounces = bounce(&floor, candidates, &beliefs, [0xb0c + candidates, 0]);
            let mut counts = vec![0.0; ARRIVAL_DIRECTIONS + 1];
            let mut sums = vec![[0.0; 2]; ARRIVAL_DIRECTIONS];
            for (direction, throughput) in &bounces {
                let red = f64::from(throughput.x);
                let is_above = direction.dot(floor.normal) > 0.0;
                let direction = arrival_direction(*direction);
                counts[if is_above { direction } else { ARRIVAL_DIRECTIONS }] += 1.0;
                sums[direction][0] += red;
                sums[direction][1] += red * red;
            }
            let p = statistics::chi_square_p_value(&counts, &chances(&floor, candidates, &light));
            let alike = vec![1.0; ARRIVAL_DIRECTIONS];
            let unguided = chances(&floor, candidates, &alike);
            let wrong = statistics::chi_square_p_value(&counts, &unguided);
            let count = bounces.len() as f64;
            let mut worst = 0.0_f64;
            let mut biased = 0.0_f64;
            for (bin, (sum, expected)) in sums.iter().zip(&expected).enumerate() {
                if *expected < 1e-3 {
                    continue;
                }
                let mean = sum[0] / count;
                let error = ((sum[1] / count - mean * mean) / count).sqrt();
                worst = worst.max((mean - expected).abs() / error.max(1e-3 * expected));
                // The result if the choice were not divided by its chance.
                let wrong = counts[bin] / count * expected / unguided[bin].max(1e-9);
                biased = biased.max((wrong - expected).abs() / error.max(1e-3 * expected));
            }
            eprintln!("{name}, {candidates}: p {p:.3}, {wrong:.1e}; |z| {worst:.2}, {biased:.1}");
            assert!(p > 1e-4 && wrong < 1e-9, "{name}, {candidates}: p = {p}, unguided {wrong}");
            assert!(worst < 5.5 && biased > 10.0, "{name}, {candidates}: {worst}, {biased}");
        }
    }
}

/// All numbers of a bounce are those of the epoch: of the render's own, some have shaped the beliefs.
#[test]
fn bounces_take_the_numbers_of_their_epoch() {
    let _alone = support::alone();
    let (beliefs, _) = arriving();
    let (_, floor) = floors().swap_remove(0);
    let [first, same, other] =
        [[1, 1], [1, 2], [2, 1]].map(|seeds| bounce(&floor, 4, &beliefs, seeds));
    assert!(first == same);
    let repeated = first.iter().zip(&other).filter(|(one, other)| one.0 == other.0).count();
    assert!(100 * repeated < first.len(), "{repeated} of {} directions", first.len());
}

/// Images agree with those of unguided bounces whatever the cells believe, from nothing learned on,
/// and with as many candidates as there may be.
#[test]
fn images_are_those_of_unguided_bounces() {
    let _alone = support::alone();
    let mut scene = scenes::mixed_room();
    (scene.film.width, scene.film.height) = (16, 16);
    // Estimate the means over blocks and channels.
    let replicates = |candidates: u32, beliefs: Option<&GuideState>, samples: u32| {
        let mut settings = guided(4);
        settings.parameters.guided.bounce_candidates = candidates;
        let rows = replicates::rows(&scene, &settings, 500..516, samples, BLOCK, |renderer| {
            if let Some(beliefs) = beliefs {
                renderer.restore_guide(beliefs).unwrap();
            }
        });
        let grey =
            |row: &Vec<f64>| row.chunks(3).map(|rgb| rgb.iter().sum::<f64>() / 3.0).collect();
        estimates(&rows.iter().map(grey).collect::<Vec<_>>())
    };
    let reference = replicates(1, None, 32);
    let mut taught = support::renderer(&scene, guided(4));
    taught.render_pass(4).unwrap();
    let mut beliefs = taught.guide_state().unwrap().unwrap();
    for (index, words) in beliefs.arrivals.iter_mut().enumerate() {
        // Give every cell another belief.
        *words = [1e4_f32.to_bits(), (1e4 * belief(index)).to_bits()];
    }
    for (name, candidates, beliefs) in
        [("4", 4, None), ("16", 16, None), ("4, misled", 4, Some(&beliefs))]
    {
        let worst = largest_t(&replicates(candidates, beliefs, 16), &reference);
        eprintln!("{name}: |t| {worst:.2}");
        assert!(worst < 6.0, "{name}: |t| = {worst}");
    }
}

/// Every bounce ray teaches the cell it left, by the light that the cell at its hit reflects.
#[test]
fn every_bounce_teaches() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let mut renderer = support::renderer(&scene, guided(3));
    renderer.render_pass(2).unwrap();
    let before = renderer.totals().bounce_rays;
    // Render a sample after a rebuild.
    renderer.render_pass(1).unwrap();
    let rays = renderer.totals().bounce_rays - before;
    let state = renderer.guide_state().unwrap().unwrap();
    let counted = |words: &[[u32; 2]]| -> [u64; 2] {
        words.iter().fold([0; 2], |sum, [rays, light]| {
            [sum[0] + u64::from(*rays), sum[1] + u64::from(*light)]
        })
    };
    let [found, light] = counted(&state.pending_arrivals);
    assert!(rays > 500, "{rays}");
    assert_eq!(found, rays);
    // The cells of this room reflect 64 units on average.
    assert!((4.0..400.0).contains(&(light as f64 / found as f64)), "{light} of {found} rays");
    // Unguided bounces keep nothing.
    for (depth, candidates) in [(1, 4), (3, 1)] {
        let mut settings = guided(depth);
        settings.parameters.guided.bounce_candidates = candidates;
        let mut renderer = support::renderer(&scene, settings);
        renderer.render_pass(3).unwrap();
        let state = renderer.guide_state().unwrap().unwrap();
        assert!(state.arrivals.is_empty() && state.pending_arrivals.is_empty());
    }
    support::assert_silent();
}

/// A render that continues another goes on with what bounces taught, to the bit; so may another depth.
#[test]
fn what_bounces_taught_is_kept() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    let renderer = |depth| support::renderer(&scene, guided(depth));
    let mut whole = renderer(3);
    whole.render_pass(21).unwrap();
    for stop in [3, 19] {
        let mut first = renderer(3);
        first.render_pass(stop).unwrap();
        let (sums, state) = (first.sums().unwrap(), first.guide_state().unwrap().unwrap());
        assert!(state.arrivals.iter().any(|words| *words != [0; 2]));
        let mut second = renderer(3);
        second.restore(&sums).unwrap();
        second.restore_guide(&state).unwrap();
        second.render_pass(21 - stop).unwrap();
        assert!(second.sums().unwrap() == whole.sums().unwrap(), "after {stop}");
        let mut direct = renderer(1);
        direct.restore_guide(&state).unwrap();
        direct.render_pass(1).unwrap();
    }
    // A guide of direct light knows nothing of bounces.
    let mut direct = renderer(1);
    direct.render_pass(4).unwrap();
    let state = direct.guide_state().unwrap().unwrap();
    let mut deep = renderer(3);
    deep.restore_guide(&state).unwrap();
    deep.render_pass(2).unwrap();
    assert!(!deep.guide_state().unwrap().unwrap().pending_arrivals.is_empty());
    support::assert_silent();
}
