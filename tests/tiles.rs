//! `tiles`: probabilities and draws against their twin on the host, samples against densities by χ², the
//! integral of the density, a wrong density that is found, odd environments, the picture with every
//! parameter against that of `mis`, and what the cache brings.
//!
//! Images are compared by 12 block means × 3 channels of 8 + 8 replicates, as in `unbiased.rs`. |t| > 7.5
//! has a chance of 3e-6, so the 3 comparisons raise a false alarm once in 3,000 runs.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use fenestra::{
    brdf::MaterialTables,
    gpu::Commands,
    math::{equal_area::direction_from_square, frame::frame_from_normal, random::hash_4d},
    pass::{Pass, PathDemand, SceneBuffers, Steps, Surfaces, WaveBuffers},
    sampler::{
        Sampler,
        pilot::Tables,
        rays::RaySteps,
        regions::Partition,
        tiles::{self, Entry, SectorGrid, TileBuffers, TileCache},
    },
    scene::{
        Geometry, Scene,
        environment::{EnvironmentMap, EnvironmentTables},
    },
    session::{Settings, window_of},
    shader::{
        bindings,
        rooms::tiles::{CONSTANT_TILES, TILE_RESPONSE_UNITS, TILE_SCALE},
        structs::{SceneParameters, ShadowRay, Wave},
    },
};
use glam::{DVec3, Vec2, Vec3, vec2, vec3};

use crate::{
    support::{
        self, PathInput,
        hemisphere::{self, BINS},
        render, replicates,
        scenes::{self, map},
        statistics::chi_square_p_value,
    },
    twin::{
        brdf,
        tiles::{TileDensity, sector_of},
    },
};

/// Chance of a false alarm of one χ² test; there are 12.
const FALSE_ALARM: f64 = 1e-5;

/// The sky, black and constant maps, one bright texel, and fewer cells than tiles.
fn maps() -> [EnvironmentMap; 6] {
    [
        scenes::sky(),
        map(32, 16, |_, _| Vec3::ZERO),
        map(32, 16, |_, _| Vec3::splat(2.0)),
        map(32, 16, |i, j| Vec3::splat(if (i, j) == (8, 6) { 1e6 } else { 0.0 })),
        map(2, 1, |i, _| Vec3::splat(i as f32)),
        map(1, 1, |_, _| Vec3::ONE),
    ]
}

/// Counts of sectors that see light from one side, each from another, among 100 rays to every tile.
fn one_sided(partition: &Partition, grid: SectorGrid) -> Vec<[u32; 2]> {
    let of_sector = |sector: u32| {
        let angle = f64::from(sector);
        let side = DVec3::new(angle.cos(), 0.3, angle.sin());
        let count = move |direction: DVec3| {
            let response = direction.dot(side).max(0.0) * f64::from(TILE_RESPONSE_UNITS);
            [100, 100 * response as u32]
        };
        partition.regions.iter().map(move |tile| count(tile.direction))
    };
    (0..grid.sectors() as u32).flat_map(of_sector).collect()
}

const GRID: SectorGrid = SectorGrid { side: 3 };

/// Probabilities of the tiles of one sector, which `entries` promise and the search delivers.
fn probabilities(partition: &Partition, entries: &[Entry]) -> Vec<f64> {
    let mut before = 0;
    let probability = |(tile, [ratio, end]): (usize, &Entry)| {
        let drawn = f64::from(end - before) / f64::from(TILE_SCALE);
        before = *end;
        let promised = f64::from(f32::from_bits(*ratio)) * partition.regions[tile].share;
        assert!((promised - drawn).abs() <= 1e-6 * drawn, "tile {tile}: {drawn}, not {promised}");
        drawn
    };
    entries.iter().enumerate().map(probability).collect()
}

#[test]
fn every_tile_with_light_keeps_a_probability() {
    const FLOOR: f64 = 0.05;
    for (index, map) in maps().iter().enumerate() {
        for count in [8, 128] {
            let partition = Partition::new(map, count);
            let cache = TileCache::new(&partition, FLOOR, count == 8);
            let tiles = cache.tiles();
            let nothing = vec![[0, 0]; GRID.sectors() * tiles];
            let blocked = vec![[1000, 0]; nothing.len()];
            let mut once = blocked.clone();
            once[tiles] = [1000, 1000 * TILE_RESPONSE_UNITS];
            let states = [
                cache.untrained().repeat(GRID.sectors()),
                cache.learned(GRID, &nothing),
                cache.learned(GRID, &blocked),
                cache.learned(GRID, &once),
                cache.learned(GRID, &one_sided(&partition, GRID)),
            ];
            for (state, entries) in states.iter().enumerate() {
                let name = format!("map {index}, {count} tiles, state {state}");
                for of_sector in entries.chunks(tiles) {
                    if map.is_black() {
                        assert!(of_sector.iter().all(|entry| *entry == [0, TILE_SCALE]), "{name}");
                        continue;
                    }
                    assert_eq!(of_sector[tiles - 1][1], TILE_SCALE, "{name}");
                    for (drawn, tile) in
                        probabilities(&partition, of_sector).iter().zip(&partition.regions)
                    {
                        let least = 0.99 * FLOOR * tile.share - 1e-7;
                        assert!(*drawn >= least, "{name}: {drawn} of a share {}", tile.share);
                        assert_eq!(*drawn > 0.0, tile.share > 1e-9, "{name}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_sector_follows_its_counts_or_those_around_it() {
    let partition = Partition::new(&maps()[2], 8);
    const RAYS: u32 = 1 << 20;
    let cache = TileCache::new(&partition, 0.01, false);
    let grid = SectorGrid { side: 9 };
    let tiles = cache.tiles();
    let mut counts = vec![[0, 0]; grid.sectors() * tiles];
    // All rays are blocked but those of one sector, and of another one far away, to one tile each.
    for (sector, seen) in [(0, 1), (8, 5)] {
        for tile in 0..tiles {
            let units = if tile == seen { RAYS * TILE_RESPONSE_UNITS } else { 0 };
            counts[sector * tiles + tile] = [RAYS, units];
        }
    }
    let learned = cache.learned(grid, &counts);
    let of_sector = |sector: usize| probabilities(&partition, &learned[sector * tiles..][..tiles]);
    assert!(of_sector(0)[1] > 0.95, "what it has seen: {:?}", of_sector(0));
    assert!(of_sector(8)[5] > 0.95, "what it has seen: {:?}", of_sector(8));
    assert!(of_sector(3 * 9 + 3)[1] > 0.95, "as around: {:?}", of_sector(30));
    assert!(of_sector(3 * 9 + 8)[5] > 0.95, "as around: {:?}", of_sector(35));
    let far = of_sector(4 * 9 + 4);
    assert!(far[1] > 0.3 && far[5] > 0.3, "as everywhere: {far:?}");
}

/// Number of samples of a χ² test.
const SAMPLES: u32 = 40_000;
/// Bins of a χ² test along each side of the square of directions, and parts of a bin.
const SIDE: u32 = 16;
const PARTS: u32 = 24;

/// Integrates a density over the bins.
fn expected(density: &TileDensity<'_>) -> Vec<f64> {
    let mut bins = vec![0.0; (SIDE * SIDE) as usize];
    let places = SIDE * PARTS;
    for (x, y) in (0..places).flat_map(|y| (0..places).map(move |x| (x, y))) {
        let at = vec2(x as f32 + 0.5, y as f32 + 0.5) / places as f32;
        bins[(y / PARTS * SIDE + x / PARTS) as usize] +=
            f64::from(density.pdf(direction_from_square(at))) * 4.0 * PI
                / f64::from(places * places);
    }
    bins
}

#[test]
fn samples_follow_the_density_which_integrates_to_one() {
    let maps = maps();
    for map in [&maps[0], &maps[2], &maps[3]] {
        let (tables, partition) = (EnvironmentTables::new(map), Partition::new(map, 64));
        let cache = TileCache::new(&partition, 0.1, true);
        let (untrained, counts) = (cache.untrained(), one_sided(&partition, GRID));
        let learned = cache.learned(GRID, &counts);
        let of = |entries| TileDensity { map, tables: &tables, partition: &partition, entries };
        let densities =
            [of(&untrained), of(&learned[..cache.tiles()])].map(|of| (of, expected(&of)));
        for (index, (density, expected)) in densities.iter().enumerate() {
            let whole: f64 = expected.iter().sum();
            assert!((whole - 1.0).abs() < 0.01, "the density integrates to {whole}");
            let mut observed = vec![0.0; expected.len()];
            for sample in 0..SAMPLES {
                let more = hash_4d([sample, 1, 2, index as u32]);
                let bits = hash_4d([sample, 3, 4, index as u32]);
                let drawn = density.sample([bits[0], bits[1]], more);
                let pdf = density.pdf(drawn.direction);
                // Rounding decides at the edges of tiles and cells.
                assert!(drawn.pdf > 0.0 && pdf >= 0.0, "{drawn:?}");
                let at = fenestra::math::equal_area::square_from_direction(drawn.direction);
                let [x, y] = (at * SIDE as f32).min(Vec2::splat(SIDE as f32 - 1.0)).to_array();
                observed[(y as u32 * SIDE + x as u32) as usize] += 1.0;
            }
            let p = chi_square_p_value(&observed, expected);
            let wrong = chi_square_p_value(&observed, &densities[1 - index].1);
            eprintln!("{}×{}: integral {whole:.4}, p {p:.3}, {wrong:.1e}", map.width, map.height);
            assert!(p > FALSE_ALARM, "p = {p:e}");
            let is_one_tile = map.texels.iter().filter(|texel| texel.x > 0.0).count() == 1;
            assert!(is_one_tile || wrong < FALSE_ALARM, "as if of the other state: p = {wrong:e}");
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Query {
    position: [f32; 3],
    direction: [f32; 3],
    sector: u32,
    bits: [u32; 2],
    more_bits: [u32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    sector: u32,
    pdf: f32,
    direction: [f32; 3],
    radiance: [f32; 3],
    sampled_pdf: f32,
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 2e-3 * a.abs().max(b.abs())
}

/// Scene, tiles and cache around one camera.
struct Cache {
    scene: Scene,
    partition: Partition,
    entries: Vec<Entry>,
    buffers: TileBuffers,
    scene_buffers: SceneBuffers,
    parameters: SceneParameters,
    steps: RaySteps,
    tiles: u32,
}

impl Cache {
    fn new(scene: Scene, tiles: usize, is_learned: bool) -> Self {
        let device = support::device();
        let partition = Partition::new(&scene.environment, tiles);
        let cache = TileCache::new(&partition, 0.1, true);
        let entries = if is_learned {
            cache.learned(GRID, &one_sided(&partition, GRID))
        } else {
            cache.untrained().repeat(GRID.sectors())
        };
        let window = window_of(&Settings::default(), &scene);
        let scene_buffers = SceneBuffers::new(device, &scene, window).unwrap();
        let forward = (scene.camera.look_at - scene.camera.position).normalize();
        let right = forward.cross(scene.camera.up).normalize();
        let parameters = SceneParameters {
            camera_position: scene.camera.position.into(),
            camera_right: right.into(),
            camera_up: right.cross(forward).into(),
            camera_forward: forward.into(),
            ..SceneParameters::default()
        };
        let tiles = cache.tiles() as u32;
        let steps = tiles::steps(cache.tiles(), false, scene_buffers.surfaces);
        let buffers = TileBuffers::new(device, &partition, GRID, cache).unwrap();
        buffers.upload(&entries).unwrap();
        Self { scene, partition, entries, buffers, scene_buffers, parameters, steps, tiles }
    }

    fn density<'a>(&'a self, tables: &'a EnvironmentTables, sector: u32) -> TileDensity<'a> {
        let tiles = self.partition.regions.len();
        let entries = &self.entries[sector as usize * tiles..][..tiles];
        TileDensity { map: &self.scene.environment, tables, partition: &self.partition, entries }
    }

    fn probe(&self, queries: &[Query]) -> Vec<Answer> {
        let sets = [&self.scene_buffers.set, self.buffers.set()];
        support::run_probe_with("tiles", &[(CONSTANT_TILES, self.tiles)], &sets, &[], queries)
    }
}

#[test]
fn the_shader_agrees() {
    let _alone = support::alone();
    let diffuse = || vec![scenes::diffuse(Vec3::splat(0.5))];
    for (index, map) in maps().into_iter().enumerate() {
        let scene = Scene { environment: map, ..scenes::open(diffuse()) };
        let cache = Cache::new(scene, 128, true);
        let tables = EnvironmentTables::new(&cache.scene.environment);
        let query = |query| {
            let word = |dimension| hash_4d([query, dimension, 5, 6]);
            let number = |dimension| {
                let [x, y, z, _] = word(dimension).map(|bits| bits as f32 / u32::MAX as f32 - 0.5);
                vec3(x, y, z)
            };
            let [a, b, ..] = word(0);
            Query {
                position: (20.0 * number(1)).into(),
                direction: number(3).normalize().into(),
                sector: query % GRID.sectors() as u32,
                bits: [a, b],
                more_bits: word(4),
            }
        };
        let mut queries: Vec<Query> = (0..2000).map(query).collect();
        queries[0].position = cache.parameters.camera_position;
        let (mut sectors, mut pdfs, mut draws) = (0, 0, 0);
        for (query, answer) in queries.iter().zip(cache.probe(&queries)) {
            let position = query.position.into();
            let sector = sector_of(GRID, &cache.parameters, position);
            let density = cache.density(&tables, query.sector);
            let drawn = density.sample(query.bits, query.more_bits);
            let is_same = drawn.direction.distance(answer.direction.into()) < 1e-3
                && close(drawn.pdf, answer.sampled_pdf)
                && drawn.radiance.distance(answer.radiance.into())
                    <= 2e-3 * drawn.radiance.length();
            // Rounding decides at edges of sectors, tiles and cells.
            sectors += u32::from(sector != answer.sector);
            pdfs += u32::from(!close(density.pdf(query.direction.into()), answer.pdf));
            draws += u32::from(!is_same);
        }
        assert!(sectors + pdfs + draws < 20, "map {index}: {sectors}, {pdfs}, {draws} differ");
    }
}

/// Paths of each surface, and rays of each.
const PATHS: u32 = 512;
const SHADOW_RAYS: u32 = 8;

/// Draws rays at surfaces of every kind by the pass itself, and compares them with the mixture of the twins.
#[test]
fn rays_follow_the_density_that_they_are_divided_by() {
    let _alone = support::alone();
    let device = support::device();
    let surface = |index: u32| {
        let normal = vec3(0.3 * index as f32 - 0.4, 1.0, 0.2).normalize();
        let outgoing = frame_from_normal(normal).to_world(vec3(0.6, 0.0, 0.8));
        PathInput::new(index, normal, outgoing)
    };
    let inputs: Vec<PathInput> = (0..4 * PATHS).map(|path| surface(path / PATHS)).collect();
    let mut of_states: Vec<[Vec<f64>; 4]> = Vec::new();
    for is_learned in [false, true] {
        let cache = Cache::new(scenes::open(scenes::every_kind()), 128, is_learned);
        let waves = WaveBuffers::new(
            device,
            4 * PATHS,
            4 * PATHS,
            SHADOW_RAYS,
            PathDemand::default(),
            Surfaces::default(),
        )
        .unwrap();
        PathInput::put(&inputs, &waves);
        let wave = Wave {
            pixel_count: 4 * PATHS,
            sample_count: 1,
            pixel_stride: 1,
            shadow_ray_count: SHADOW_RAYS,
            total_shadow_rays: SHADOW_RAYS,
            seed: 3,
            ..Wave::default()
        };
        for kernel in cache.steps.sample(&wave) {
            let pass = Pass::new(device, kernel).unwrap();
            let mut commands = Commands::begin(device).unwrap();
            let sets = [&cache.scene_buffers.set, cache.buffers.set(), &waves.set];
            pass.record(&mut commands, &sets, &wave, None).unwrap();
            commands.submit_and_wait().unwrap();
        }
        support::assert_silent();
        let count = (4 * PATHS * SHADOW_RAYS) as usize;
        let rays: Vec<ShadowRay> =
            waves.set.buffer(bindings::wave::SHADOW_RAYS).download(count).unwrap();

        let tables = EnvironmentTables::new(&cache.scene.environment);
        let brdfs = MaterialTables::new(&cache.scene.materials).unwrap();
        // The product_state probe puts all paths at the origin.
        let sector = sector_of(GRID, &cache.parameters, Vec3::ZERO);
        let density = cache.density(&tables, sector);
        of_states.push([0, 1, 2, 3].map(|material: usize| {
            let name = format!("material {material}, learned {is_learned}");
            let PathInput { normal, outgoing, .. } = surface(material as u32);
            let frame = frame_from_normal(normal);
            let outgoing = frame.to_local(outgoing);
            let evaluate = |direction: Vec3| {
                let incident = frame.to_local(direction);
                let (value, brdf_pdf) =
                    brdf::evaluate_and_pdf(&brdfs, material, outgoing, incident);
                let light = cache.scene.environment.radiance(direction);
                let integrand = (value * light * incident.z.max(0.0)).element_sum();
                let pdf = 0.5 * (brdf_pdf + density.pdf(direction));
                (integrand, f64::from(brdf_pdf), f64::from(pdf))
            };
            let mut expected = vec![0.0; BINS];
            let locals = hemisphere::quadrature(192);
            let solid_angle = 4.0 * PI / locals.len() as f64;
            let mut from_brdf = 0.0;
            for local in locals {
                let (_, brdf_pdf, pdf) = evaluate(frame.to_world(local.as_vec3()));
                expected[hemisphere::bin(local)] += solid_angle * pdf;
                from_brdf += solid_angle * brdf_pdf;
            }
            let lost = 0.5 * (1.0 - from_brdf);
            let whole = expected.iter().sum::<f64>() + lost;
            assert!((whole - 1.0).abs() < 0.01 && lost > -0.01, "{name}: {whole}, {lost} lost");
            expected[BINS - 1] += lost.max(0.0);
            let mut observed = vec![0.0; BINS];
            let mut differ = 0;
            for ray in (0..SHADOW_RAYS).flat_map(|ray| {
                let first = (ray * 4 * PATHS + material as u32 * PATHS) as usize;
                &rays[first..first + PATHS as usize]
            }) {
                let direction = Vec3::from(ray.direction);
                observed[hemisphere::bin(frame.to_local(direction).as_dvec3())] += 1.0;
                let contribution = Vec3::from(ray.contribution).element_sum();
                if contribution > 0.0 {
                    let (integrand, _, pdf) = evaluate(direction);
                    let found = f64::from(integrand / contribution);
                    differ += u32::from((found - pdf).abs() > 0.01 * pdf);
                }
            }
            assert!(differ < PATHS * SHADOW_RAYS / 200, "{name}: {differ} densities differ");
            let p = chi_square_p_value(&observed, &expected);
            eprintln!("{name}: integral {whole:.4}, lost {lost:.4}, p {p:.3}, {differ} differ");
            assert!(p > FALSE_ALARM, "{name}: p = {p:e}");
            if let Some(untrained) = of_states.first() {
                let p = chi_square_p_value(&observed, &untrained[material]);
                assert!(p < FALSE_ALARM, "{name}: as if untrained, p = {p:e}");
            }
            expected
        }));
    }
}

fn settings(assignments: &[&str], depth: u32) -> Settings {
    let parameters = support::parameters(assignments);
    Settings { sampler: Sampler::Tiles, parameters, depth, ..Settings::default() }
}

/// Diffuse things and metal in a room with a window.
fn room() -> Scene {
    scenes::room(vec![scenes::diffuse(Vec3::splat(0.6)), scenes::copper(0.3)])
}

#[test]
fn parameters_change_no_image() {
    let _alone = support::alone();
    let scene = room();
    let mis = Settings { shadow_rays: 16, ..Settings::default() };
    let reference = replicates::replicates(&scene, &mis, 40, 16);
    let cases: [&[&str]; 3] = [
        &["environment-tiles=8", "sector-pixels=1", "tile-floor=0.001", "pilot-samples=2"],
        &["environment-tiles=1024", "pilot-samples=1"],
        &["sector-pixels=256", "compensation=off", "pilot-samples=1"],
    ];
    for (case, assignments) in cases.into_iter().enumerate() {
        let seed = 100 * (1 + case as u32);
        let values = replicates::replicates(&scene, &settings(assignments, 1), seed, 8);
        replicates::assert_same(&format!("{assignments:?}"), &values, &reference, 0.03);
    }
}

/// Sum over the pixels of the variance of their mean, estimated from the samples, and the share of the shadow
/// rays that were visible.
fn variance_and_visible(scene: &Scene, settings: Settings) -> [f64; 2] {
    let (sums, totals) = render(scene, settings, 16);
    let of_pixel = |pixel| sums.variance_of_mean(pixel).iter().sum::<f64>();
    let visible = totals.shadow_rays_visible as f64 / totals.shadow_rays_traced as f64;
    [(0..sums.pixel_count()).map(of_pixel).sum(), visible]
}

/// A cache that knows what is blocked brings much in the room, seen with the window behind the camera, and
/// one that knows horizons much in the open.
#[test]
fn the_cache_lowers_the_variance() {
    let _alone = support::alone();
    let mut room = room();
    (room.camera.position, room.camera.look_at) = (vec3(-1.7, 1.6, 1.5), vec3(0.6, 0.4, -0.8));
    let things = vec![scenes::diffuse(Vec3::splat(0.6)), scenes::plastic(0.3)];
    for (scene, least_visible) in [(room, 1.4), (scenes::open(things), 1.0)] {
        let of = |floor| variance_and_visible(&scene, settings(&[floor, "pilot-samples=4"], 1));
        let [with, without] = [of("tile-floor=0.1"), of("tile-floor=1")];
        eprintln!("{}: {with:?} with, {without:?} without", scene.name);
        assert!(with[0] < 0.8 * without[0], "{}: {with:?}, not {without:?}", scene.name);
        let sees = with[1] > least_visible * without[1];
        assert!(sees, "{}: {with:?}, not {without:?}", scene.name);
    }
}

#[test]
fn odd_environments_are_rendered() {
    let _alone = support::alone();
    let mut scene = room();
    (scene.film.width, scene.film.height) = (8, 8);
    for (index, map) in maps().into_iter().enumerate().filter(|(index, _)| index % 2 == 1) {
        scene.environment = map;
        let (sums, totals) = render(&scene, settings(&[], 2), 2);
        assert_eq!(totals.dropped_samples, 0, "map {index}");
        let whole: f64 = (0..sums.pixel_count()).map(|pixel| sums.mean(pixel)[1]).sum();
        assert!(whole.is_finite() && (index > 1 || whole == 0.0), "map {index}: {whole}");
    }
    scene.geometry = Geometry::default();
    let (sums, _) = render(&scene, settings(&[], 2), 2);
    assert!((sums.mean(5)[1] - 1.0).abs() < 1e-5, "nothing but the sky: {:?}", sums.mean(5));
}
