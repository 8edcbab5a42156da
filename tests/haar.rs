//! `haar`: nodes and densities against their twin on the host, samples against densities by χ², the integral
//! of the density, the cache's weights as the thesis words them, a wrong density that is found, and the
//! picture against another sampler's.
//!
//! A probe puts paths in front of surfaces of every kind, and passes of a render make their nodes. Seeds
//! are fixed; others would raise a false alarm once in some thousand runs.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use fenestra::{
    brdf::MaterialTables,
    gpu::{Commands, DescriptorSet},
    math::{equal_area::direction_from_square, frame::frame_from_normal, octahedron},
    pass::{Kernel, Pass, SceneBuffers, Steps, Surfaces, WaveBuffers},
    sampler::{
        Parameters, Sampler,
        haar::{
            HaarSteps, NodeSize,
            tree::{Tree, node_centre, place_in_square},
        },
    },
    session::{Settings, window_of},
    shader::{
        rooms::haar::{CONSTANT_HAAR_DEPTH, CONSTANT_HAAR_LEVEL, HAAR_NODES},
        rooms::product::{CONSTANT_BRDF_SHARE, CONSTANT_ENVIRONMENT_SHARE},
        structs::Wave,
    },
};
use glam::{Vec2, Vec3, vec3};
use half::f16;

use crate::{
    support::{
        self, PathInput, materials, replicates, scenes,
        statistics::{chi_square_p_value, z_of_mean},
    },
    twin::haar::{Product, node_reflectance},
};

/// Samples per path and state of the cache.
const SAMPLES: u32 = 10_000;
/// Rays per hit, one more than the tests teach.
const SHADOW_RAYS: u32 = 5;
/// Level of the bins of the χ² test, and of the places where densities are summed.
const BIN_LEVEL: u32 = 4;
const PLACE_LEVEL: u32 = 6;
/// Chance of a false alarm of one χ² test; there are 12.
const FALSE_ALARM: f64 = 1e-5;
/// Limit of |z|, exceeded with a chance of 7e-6; 12 are tested.
const Z_LIMIT: f64 = 4.5;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Query {
    path: u32,
    draws: u32,
    direction: [f32; 3],
    technique: f32,
    direction_numbers: [f32; 2],
    lobe: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    direction: [f32; 3],
    pdf: f32,
    node_pdf: f32,
    node_share: f32,
    environment_share: f32,
    environment_pdf: f32,
    brdf_pdf: f32,
    total: f32,
    integrand: [f32; 3],
}

impl Answer {
    fn direction(&self) -> Vec3 {
        self.direction.into()
    }

    fn integrand(&self) -> f64 {
        self.integrand.iter().map(|value| f64::from(*value)).sum()
    }
}

/// Returns diffuse, plastic, conductor and measured surfaces, seen from different angles.
fn surfaces() -> Vec<PathInput> {
    let surface = |material, normal: Vec3, theta: f32, phi: f32| {
        let normal = normal.normalize();
        let (sine, cosine) = theta.sin_cos();
        let local = vec3(sine * phi.cos(), sine * phi.sin(), cosine);
        PathInput::new(material, normal, frame_from_normal(normal).to_world(local))
    };
    vec![
        surface(0, vec3(0.1, 1.0, 0.2), 0.5, 0.1),
        surface(1, vec3(0.0, 1.0, 0.0), 0.2, 1.0),
        surface(1, vec3(-1.0, 0.4, 0.3), 1.2, 2.0),
        surface(2, vec3(-0.3, 0.8, -0.4), 0.8, 3.0),
        surface(2, vec3(0.2, -0.9, 0.5), 0.6, 4.0),
        surface(3, vec3(-0.5, 0.5, 0.6), 1.0, 5.0),
    ]
}

/// Passes and buffers around one wave of paths, one per surface.
struct Paths {
    surfaces: Vec<PathInput>,
    parameters: Parameters,
    tables: MaterialTables,
    tree: Tree,
    scene: SceneBuffers,
    nodes: DescriptorSet,
    waves: WaveBuffers,
    steps: HaarSteps,
    wave: Wave,
}

impl Paths {
    /// Makes paths with their product and an empty cache.
    fn new(assignments: &[&str]) -> Self {
        let (device, parameters) = (support::device(), support::parameters(assignments));
        let (scene, surfaces) = (scenes::open(scenes::every_kind()), surfaces());
        let buffers =
            SceneBuffers::new(device, &scene, window_of(&Settings::default(), &scene)).unwrap();
        let tree = Tree::new(&scene.environment);
        let size = NodeSize::new(&parameters, SHADOW_RAYS);
        let waves =
            WaveBuffers::new(device, 64, 1 << 17, 1, size.demand(), Surfaces::default()).unwrap();
        let steps = HaarSteps::new(&parameters, tree.depth, buffers.surfaces, SHADOW_RAYS);
        let nodes = size.set(device, &tree, waves.capacity).unwrap();
        let wave = Wave {
            pixel_count: surfaces.len() as u32,
            sample_count: 1,
            shadow_ray_count: 1,
            total_shadow_rays: SHADOW_RAYS,
            ..Wave::default()
        };
        let tables = MaterialTables::new(&scene.materials).unwrap();
        let paths =
            Self { surfaces, parameters, tables, tree, scene: buffers, nodes, waves, steps, wave };
        PathInput::put(&paths.surfaces, &paths.waves);
        paths.run(paths.steps.prepare(&paths.wave));
        paths
    }

    fn level(&self) -> u32 {
        self.parameters.haar.level
    }

    fn run(&self, kernels: Vec<Kernel>) {
        let device = support::device();
        for kernel in kernels {
            let pass = Pass::new(device, kernel).unwrap();
            let mut commands = Commands::begin(device).unwrap();
            let sets = [&self.scene.set, &self.nodes, &self.waves.set];
            pass.record(&mut commands, &sets, &self.wave, None).unwrap();
            commands.submit_and_wait().unwrap();
        }
        support::assert_silent();
    }

    /// Teaches the caches the outcome of one shadow ray per path.
    fn learn(&self, outcomes: &[(Vec3, bool)]) {
        let surfaces = self.surfaces.iter().zip(outcomes);
        let inputs: Vec<_> = surfaces.map(|(path, outcome)| path.with_outcome(*outcome)).collect();
        PathInput::put(&inputs, &self.waves);
        self.run(self.steps.after_shadow_rays(&self.wave));
    }

    /// Returns the nodes of a path in Morton order.
    fn nodes_of(&self, path: usize) -> Vec<f32> {
        let (count, stride) = (1_usize << (2 * self.level()), self.surfaces.len());
        let halves: Vec<u16> = self.nodes.buffer(HAAR_NODES).download(count * stride).unwrap();
        let node = |node: usize| halves[4 * (node / 4 * stride + path) + node % 4];
        (0..count).map(|index| f16::from_bits(node(index)).to_f32()).collect()
    }

    fn probe(&self, queries: &[Query]) -> Vec<Answer> {
        let shares = self.parameters.product;
        let constants = [
            (CONSTANT_BRDF_SHARE, shares.brdf_share.to_bits()),
            (CONSTANT_ENVIRONMENT_SHARE, shares.environment_share.to_bits()),
            (CONSTANT_HAAR_LEVEL, self.level()),
            (CONSTANT_HAAR_DEPTH, self.tree.depth),
        ];
        let sets = [&self.scene.set, &self.nodes, &self.waves.set];
        let push = bytemuck::bytes_of(&self.wave);
        support::run_probe_with("haar", &constants, &sets, push, queries)
    }

    /// Draws directions of one path; from its nodes alone if `only_nodes`.
    fn samples(
        &self,
        path: usize,
        stream: u32,
        count: u32,
        only_nodes: bool,
    ) -> Vec<(Query, Answer)> {
        let query = |index| {
            let a = materials::uniform(index, 40 * stream + path as u32);
            let b = materials::uniform(index, 40 * stream + 20 + path as u32);
            Query {
                path: path as u32,
                draws: 1,
                direction: [0.0; 3],
                technique: if only_nodes { 0.0 } else { a.x },
                direction_numbers: [a.y, a.z],
                lobe: b.x,
            }
        };
        let queries: Vec<Query> = (0..count).map(query).collect();
        let answers = self.probe(&queries);
        queries.into_iter().zip(answers).collect()
    }

    /// Evaluates the densities of one path at places of equal solid angle over the whole sphere.
    fn places(&self, path: usize) -> Vec<Answer> {
        let query = |place| Query {
            path: path as u32,
            draws: 0,
            direction: direction_from_square(place_in_square(PLACE_LEVEL, place, Vec2::splat(0.5)))
                .into(),
            technique: 0.0,
            direction_numbers: [0.0; 2],
            lobe: 0.0,
        };
        let queries: Vec<Query> = (0..1 << (2 * PLACE_LEVEL)).map(query).collect();
        self.probe(&queries)
    }
}

/// Sum over places of a density per steradian.
fn integral(places: &[Answer], value: impl Fn(&Answer) -> f64) -> f64 {
    places.iter().map(value).sum::<f64>() * 4.0 * PI / places.len() as f64
}

/// True if two numbers agree within `tolerance` of the larger.
fn close(a: f32, b: f32, tolerance: f32) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}

#[test]
fn nodes_and_densities_are_those_of_the_twin() {
    let _alone = support::alone();
    for level in ["haar-level=3", "haar-level=5"] {
        let paths = Paths::new(&[level]);
        for (path, surface) in paths.surfaces.iter().enumerate() {
            let nodes = paths.nodes_of(path);
            let frame = frame_from_normal(surface.normal);
            let outgoing = frame.to_local(surface.outgoing);
            let material = paths.tables.materials[surface.material as usize];
            let mut above = 0;
            for (index, node) in nodes.iter().enumerate() {
                let centre = node_centre(paths.level(), index as u32);
                let expected = node_reflectance(
                    &paths.tables.words,
                    &material,
                    outgoing,
                    frame.to_local(centre),
                    paths.level(),
                );
                above += u32::from(*node > 0.0);
                let is_close = close(*node, expected, 2e-3) || (node - expected).abs() < 2e-4;
                assert!(is_close, "{level}, path {path}, node {index}: {node}, not {expected}");
            }
            assert!(above as usize * 3 > nodes.len(), "{level}, path {path}: {above} nodes");
            let product = Product::new(&paths.tree, paths.level(), nodes);
            let samples = paths.samples(path, 1, SAMPLES / 5, true);
            let (total, tolerance) =
                (samples[0].1.total, if support::is_software() { 1e-4 } else { 3e-4 });
            assert!(
                close(product.total(), total, tolerance),
                "{level}, path {path}: {total}, {product:?}"
            );
            // Rounding decides at the edges of nodes.
            let differs = |(query, answer): &&(Query, Answer)| {
                let (direction, pdf) = product.sample(query.direction_numbers.into());
                !close(answer.node_pdf, pdf, 1e-3) || direction.distance(answer.direction()) > 1e-3
            };
            let count = samples.iter().filter(differs).count();
            assert!(count * 200 < samples.len(), "{level}, path {path}: {count} samples differ");
            let places = paths.places(path);
            let differs =
                |answer: &&Answer| !close(answer.node_pdf, product.pdf(answer.direction()), 1e-3);
            let count = places.iter().filter(differs).count();
            assert!(count * 200 < places.len(), "{level}, path {path}: {count} densities differ");
        }
    }
}

/// Compares samples of one path with its densities; returns z of an estimate with the right density and with
/// that of nodes as they were before anything was learned.
fn samples_follow_the_density(
    paths: &Paths,
    path: usize,
    before: &Product<'_>,
    stream: u32,
) -> [f64; 2] {
    let (samples, places) = (paths.samples(path, stream, SAMPLES, false), paths.places(path));
    let name = format!("path {path}, stream {stream}");
    // Constant over the texels of a small map: this sum is exact.
    let nodes = integral(&places, |answer| f64::from(answer.node_pdf));
    assert!((nodes - 1.0).abs() < 1e-4, "{name}: the nodes integrate to {nodes}");
    let bin = |place: usize| place >> (2 * (PLACE_LEVEL - BIN_LEVEL));
    let mut expected = vec![0.0; 1 << (2 * BIN_LEVEL)];
    for (place, answer) in places.iter().enumerate() {
        expected[bin(place)] += f64::from(answer.pdf);
    }
    let whole: f64 = expected.iter().sum::<f64>() * 4.0 * PI / places.len() as f64;
    let mut observed = vec![0.0; expected.len()];
    let side = 1_u32 << BIN_LEVEL;
    let mut lost = 0.0;
    for (query, answer) in &samples {
        let shares = answer.node_share + answer.environment_share;
        if query.technique >= shares && answer.direction().dot(paths.surfaces[path].normal) <= 0.0 {
            // BRDF samples below the horizon have no density.
            lost += 1.0 / f64::from(SAMPLES);
            continue;
        }
        assert!(answer.pdf > 0.0, "{name}: drawn with density {}", answer.pdf);
        let at = fenestra::math::equal_area::square_from_direction(answer.direction());
        let [x, y] = (at * side as f32).min(Vec2::splat(side as f32 - 1.0)).to_array();
        let spread = |x: u32| (0..BIN_LEVEL).map(|bit| (x >> bit & 1) << (2 * bit)).sum::<u32>();
        observed[(spread(x as u32) | spread(y as u32) << 1) as usize] += 1.0;
    }
    assert!(
        (whole + lost - 1.0).abs() < 0.02,
        "{name}: the density integrates to {whole}, {lost} lost"
    );
    let p = chi_square_p_value(&observed, &expected);
    assert!(p > FALSE_ALARM, "{name}: p = {p:e}");
    let truth = integral(&places, Answer::integrand);
    let z_with = |pdf: &dyn Fn(&Answer) -> f64| {
        let value = |(_, answer): &(Query, Answer)| {
            let pdf = pdf(answer);
            if pdf > 0.0 { answer.integrand() / pdf } else { 0.0 }
        };
        z_of_mean(&samples.iter().map(value).collect::<Vec<_>>(), truth)
    };
    let z = z_with(&|answer| f64::from(answer.pdf));
    let stale = z_with(&|answer| {
        let surplus = before.pdf(answer.direction()) - answer.node_pdf;
        f64::from(answer.pdf + answer.node_share * surplus)
    });
    eprintln!("{name}: integral {whole:.4}, lost {lost:.4}, p {p:.3}, z {z:.2}, stale {stale:.2}");
    assert!(z.abs() < Z_LIMIT, "{name}: z = {z}");
    [z, stale]
}

/// Weighs the nodes with an empty cache and after four blocked directions.
#[test]
fn samples_follow_the_density_whatever_is_cached() {
    let _alone = support::alone();
    let paths = Paths::new(&["haar-level=4", "haar-cache=on", "environment-share=0.1"]);
    let count = paths.surfaces.len();
    let first: Vec<Vec<f32>> = (0..count).map(|path| paths.nodes_of(path)).collect();
    let products: Vec<Product<'_>> =
        first.iter().map(|nodes| Product::new(&paths.tree, paths.level(), nodes.clone())).collect();
    let follow = |stream| -> Vec<f64> {
        let of_path = |(path, product)| samples_follow_the_density(&paths, path, product, stream);
        products.iter().enumerate().map(of_path).map(|[_, stale]| stale).collect()
    };
    assert!(follow(1).iter().all(|stale| stale.abs() < Z_LIMIT), "nothing is known yet");
    let drawn: Vec<Vec<(Query, Answer)>> =
        (0..count).map(|path| paths.samples(path, 9, SHADOW_RAYS, true)).collect();
    let mut blocked: Vec<Vec<Vec3>> = vec![Vec::new(); count];
    for round in 0..SHADOW_RAYS - 1 {
        let is_visible = round == 2;
        let directions = drawn.iter().map(|samples| samples[round as usize].1.direction());
        let outcomes: Vec<(Vec3, bool)> =
            directions.map(|direction| (direction, is_visible)).collect();
        paths.learn(&outcomes);
        for (blocked, (direction, _)) in blocked.iter_mut().zip(outcomes) {
            // As the cache holds it.
            let held = octahedron::unpack(octahedron::pack(direction));
            blocked.extend((!is_visible).then_some(held));
        }
    }
    for (path, nodes) in first.iter().enumerate() {
        weights_are_those_of_the_thesis(&paths, path, nodes, &blocked[path]);
    }
    let found = follow(2).iter().filter(|stale| stale.abs() > Z_LIMIT).count();
    assert!(found >= 2, "weights ignored: found {found} times");
}

/// Compares the nodes of a path with (1 / (1 + Num))² of what they were.
fn weights_are_those_of_the_thesis(paths: &Paths, path: usize, first: &[f32], blocked: &[Vec3]) {
    let mut lowered = 0;
    for (index, (node, first)) in paths.nodes_of(path).iter().zip(first).enumerate() {
        let centre = node_centre(paths.level(), index as u32);
        let distances = || blocked.iter().map(|direction| 1.0 - centre.dot(*direction));
        if distances().any(|distance| (distance / 0.0707 - 1.0).abs() < 0.01) {
            // Rounding decides.
            continue;
        }
        let near = distances().filter(|distance| *distance < 0.0707).count() as f32;
        let expected = first / (1.0 + near).powi(2);
        lowered += u32::from(near > 0.0 && *first > 0.0);
        let is_close = close(*node, expected, 5e-3) || (node - expected).abs() < 2e-4;
        assert!(is_close, "path {path}, node {index}: {node}, not {expected}, {near} near");
    }
    assert!(lowered >= 3, "path {path}: {lowered} nodes lost weight");
}

/// `tests/unbiased.rs` has the default in other scenes.
#[test]
fn pictures_with_other_parameters_agree() {
    let _alone = support::alone();
    let scene = scenes::room(vec![
        scenes::diffuse(Vec3::splat(0.6)),
        scenes::copper(0.3),
        scenes::plastic(0.3),
    ]);
    let settings = |sampler, assignments: &[&str]| {
        let parameters = support::parameters(assignments);
        Settings { sampler, depth: 2, parameters, ..Settings::default() }
    };
    let reference = replicates::replicates(&scene, &settings(Sampler::Mis, &[]), 4000, 32);
    for assignments in [
        &["haar-level=4", "environment-share=0", "brdf-share=0.1"][..],
        &["haar-cache=on", "environment-share=0", "k=4", "tau=2"],
    ] {
        let values = replicates::replicates(&scene, &settings(Sampler::Haar, assignments), 9000, 8);
        replicates::assert_same(&format!("{assignments:?}"), &values, &reference, 0.0);
    }
}
