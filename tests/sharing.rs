//! Paths shared by the pixels of a cohort: the same picture as without, by z-test and in closed form.
//!
//! The reference is `mis` without sharing; 22 comparisons raise a false alarm once in about 900 runs.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{ops::Range, sync::Arc};

use fenestra::{
    film::Window,
    pass::Roulette,
    sampler::Sampler,
    scene::{
        Scene,
        lamp::{LampKind, Spot, SpotFalloff},
        material::{Anisotropy, ConductorFresnel, Emission, Material, MaterialKind},
        measured::MeasuredTable,
        texture::{Encoding, Texels, Texture, TextureUse},
    },
    session::Settings,
};
use glam::Vec3;

use crate::support::{
    self, materials,
    rays::scaled,
    render_passes as render,
    replicates::{self, REPLICATES},
    scenes,
    statistics::{Comparison, estimates, largest_t},
};

fn settings(sampler: Sampler, share_paths: &str, depth: u32) -> Settings {
    let mut settings = Settings { sampler, depth, ..Settings::default() };
    settings.parameters.candidates = (sampler == Sampler::Guided).then_some(1);
    settings.parameters.set(&format!("share-paths={share_paths}")).unwrap();
    settings
}

/// Edge of a block, a quarter of those in which cohorts lie: in whole ones sharing keeps the sum of a
/// diffuse surface's light, however it is spread.
const BLOCK: u32 = 4;
/// Largest |t| of a block. One of 144 values exceeds it with a chance of 5e-5.
const LIMIT: f64 = 9.0;

/// Means of blocks of pictures with different seeds.
fn rows(scene: &Scene, settings: &Settings, first_seed: u32, samples: u32) -> Vec<Vec<f64>> {
    replicates::rows(scene, settings, first_seed..first_seed + REPLICATES, samples, BLOCK, |_| {})
}

/// Compares pictures with shared paths with those of `mis` without.
fn agrees(scene: &Scene, shared: &[(Sampler, &str)], samples: u32, base: &Settings) {
    let unshared =
        Settings { parameters: settings(Sampler::Mis, "off", 1).parameters, ..base.clone() };
    let reference = estimates(&rows(scene, &unshared, 0, 2 * samples));
    for (sampler, edge) in shared {
        let own = settings(*sampler, edge, 1);
        let own = Settings { sampler: *sampler, parameters: own.parameters, ..base.clone() };
        let values = estimates(&rows(scene, &own, 1000, samples));
        let blocks = largest_t(&values, &reference);
        let mean = values.len() - 1;
        let Comparison { ratio, largest_t_with_bias, .. } =
            Comparison::new(&values[mean..], &reference[mean..]);
        let name = format!("{} depth {} {} {edge}", scene.name, base.depth, sampler.name());
        eprintln!(
            "{name}: largest |t| {blocks:.2}, ratio {ratio:.4}, mean a tenth too high \
             {largest_t_with_bias:.1}"
        );
        assert!(blocks < LIMIT, "{name}: |t| = {blocks}");
        assert!(largest_t_with_bias > LIMIT, "{name}: too noisy to judge");
    }
}

fn paint(base_color: Vec3, metallic: f32, roughness: f32) -> Material {
    Material::new("paint", materials::principled(base_color, metallic, roughness))
}

fn base(depth: u32) -> Settings {
    Settings { depth, ..Settings::default() }
}

const LARGER_EDGES: [(Sampler, &str); 3] =
    [(Sampler::Mis, "4"), (Sampler::Mis, "8"), (Sampler::Guided, "4")];

/// Fins on the floor hide from one vertex of a cohort what its neighbour sees.
#[test]
fn in_a_diffuse_room() {
    let _alone = support::alone();
    let mut scene = scenes::room(vec![scenes::diffuse(Vec3::splat(0.8))]);
    for fin in 0..12 {
        let centre = Vec3::new(-1.6 + 0.25 * fin as f32, 0.3, -0.6);
        scenes::add_box(&mut scene.geometry, centre, Vec3::new(0.02, 0.6, 1.8), 0);
    }
    agrees(&scene, &LARGER_EDGES, 32, &base(2));
}

#[test]
fn in_a_room_with_glossy_things() {
    let _alone = support::alone();
    let scene = scenes::room(vec![
        scenes::diffuse(Vec3::splat(0.8)),
        scenes::copper(0.1),
        scenes::plastic(0.2),
    ]);
    agrees(&scene, &[(Sampler::Mis, "2"), (Sampler::Guided, "4")], 32, &base(3));
}

/// Both ends of a connection have widths of 0.15 and 0.7.
#[test]
fn in_a_room_of_brushed_metal() {
    let _alone = support::alone();
    let fresnel = ConductorFresnel::Schlick { reflectance: Vec3::splat(0.9) };
    let mut metal = Material::new("metal", MaterialKind::Conductor { alpha: 0.15, fresnel });
    metal.surface.anisotropy = Anisotropy { strength: 0.8, rotation: 0.8, direction: None };
    agrees(&scenes::room(vec![metal]), &[(Sampler::Mis, "8")], 96, &base(2));
}

#[test]
fn in_a_room_of_plastic_and_of_paint() {
    let _alone = support::alone();
    let colour = Vec3::new(0.7, 0.6, 0.5);
    let [mut dull, bright] = [0.9, 0.1].map(|roughness| paint(colour, 0.4, roughness));
    // Texels of a half.
    let texels = Texels::Bytes(vec![[128, 128, 128, 255]]);
    let image = Texture { name: "half".into(), width: 1, height: 1, texels };
    let half = TextureUse { encoding: Encoding::Linear, ..TextureUse::new(Arc::new(image)) };
    dull.surface.roughness = Some(half.clone());
    dull.surface.metallic = Some(half);
    let mut scene = scenes::room(vec![dull, scenes::plastic(0.2), bright]);
    scene.geometry.uvs[0] = vec![[0.5; 2]; scene.geometry.positions.len()];
    agrees(&scene, &[(Sampler::Mis, "8"), (Sampler::Guided, "4")], 32, &base(3));
}

#[test]
fn with_roulette_from_the_first_bounce_on() {
    let _alone = support::alone();
    let scene = scenes::room(vec![scenes::diffuse(Vec3::new(0.8, 0.5, 0.3))]);
    let roulette = Settings { roulette: Roulette { vertex: 1, throughput: 1.0 }, ..base(5) };
    agrees(&scene, &[(Sampler::Mis, "4"), (Sampler::Guided, "8")], 32, &roulette);
}

#[test]
fn with_lamps_panes_mirrors_and_sheets() {
    let _alone = support::alone();
    let scene = scenes::glazed_room();
    agrees(&scene, &[(Sampler::Guided, "8")], 32, &base(4));
    agrees(&scene, &[(Sampler::Mis, "8")], 48, &base(2));
}

/// A wall stands on the floor, and its normals are bent toward it: from near it looks brighter than its area
/// tells, and from far darker. Bent the other way, they are turned for paths from near alone.
#[test]
fn before_a_wall_of_bent_normals() {
    let _alone = support::alone();
    for bend_deg in [40_f32, -40.0, -75.0] {
        agrees(&wall(bend_deg), &[(Sampler::Mis, "8")], 64, &base(2));
    }
}

fn wall(bend_deg: f32) -> Scene {
    let mut scene = scenes::plane(Vec3::splat(0.7), scenes::environment(16, |_| Vec3::ZERO));
    let first = scene.geometry.positions.len();
    scenes::add_box(&mut scene.geometry, Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.02, 2.0, 6.0), 0);
    let (sine, cosine) = bend_deg.to_radians().sin_cos();
    scene.geometry.normals[first..].fill([cosine, -sine, 0.0]);
    for x in [-2.5, 2.5] {
        scenes::add_point(&mut scene, Vec3::new(x, 1.0, 0.0), Vec3::splat(20.0));
    }
    scene.name = format!("wall bent by {bend_deg}°");
    scene
}

/// A sheet that leans by its normals toward a lit wall below it, which paths of other pixels find, stays
/// dark; and through a red pane before the camera all is red.
#[test]
fn nothing_is_shared_from_below_the_horizon_or_past_the_colour_of_a_pane() {
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::splat(0.7), scenes::environment(16, |_| Vec3::ZERO));
    scene.geometry.positions.iter_mut().for_each(|position| position[1] -= 1.0);
    let size = Vec3::new(0.1, 0.9, 4.0);
    scenes::add_box(&mut scene.geometry, Vec3::new(-0.5, -0.55, 0.0), size, 0);
    let first = scene.geometry.positions.len();
    // Columns 12 to 15 of the film, in a block with columns that see the floor.
    scenes::add_square(&mut scene.geometry, Vec3::new(11.35, 0.0, 0.0), 10.0, 0);
    scene.geometry.normals[first..].fill([-0.64, 0.77, 0.0]);
    scenes::add_point(&mut scene, Vec3::new(0.3, -0.5, 0.0), Vec3::splat(20.0));
    let red = MaterialKind::pane(1.5, Vec3::X);
    scene.materials.push(Material::new("red", red));
    // The second pane stands between first vertices and what they share: the wall and its lamp.
    let panes = [
        (scene.camera.position, Vec3::splat(0.1), 0.0),
        (Vec3::new(-0.1, -0.45, 0.0), Vec3::new(1.2, 1.0, 4.5), f32::MAX),
    ];
    for (at, size, most) in panes {
        let mut scene = scene.clone();
        scenes::add_box(&mut scene.geometry, at, size, 1);
        let picture = render(&scene, settings(Sampler::Mis, "8", 2), &[8]).sum;
        let brightest = |columns: Range<usize>, channel: usize| {
            let pixels = (0..picture.len()).filter(|pixel| columns.contains(&(pixel % 16)));
            pixels.map(|pixel| picture[pixel][channel]).fold(0.0, f32::max)
        };
        let [floor, sheet, green] =
            [(8..12, 0), (13..16, 0), (0..16, 1)].map(|(at, of)| brightest(at, of));
        assert!(floor > 1.0 && sheet <= most && green == 0.0, "{floor} {sheet} {green}");
    }
}

/// A white surface whose values come from a table shares light by direction, and is nearly as white.
#[test]
fn a_concave_white_body_vanishes_in_the_furnace() {
    let _alone = support::alone();
    let mut scene = scenes::concave_furnace();
    let table = MeasuredTable::tabulate(|_, _| Vec3::splat(std::f32::consts::FRAC_1_PI)).unwrap();
    let measured = MaterialKind::Measured { path: "white".into(), table: Arc::new(table) };
    let mean = |scene: &Scene, edge| {
        let settings = settings(Sampler::Cosine, edge, 24);
        let settings = Settings { roulette: Roulette::NEVER, ..settings };
        let (sums, _) = support::render(scene, settings, 64);
        replicates::film_mean(&sums).y
    };
    let shared = mean(&scene, "4");
    assert!((shared - 1.0).abs() < 4e-3, "{shared}");
    scene.materials[0].kind = measured;
    let (alone, shared) = (mean(&scene, "off"), mean(&scene, "4"));
    eprintln!("measured: {alone} alone, {shared} shared");
    assert!((shared - alone).abs() < 1e-3 && alone > 0.98, "{alone}, {shared}");
}

#[test]
fn the_same_seed_gives_the_same_bits_however_samples_are_grouped() {
    let _alone = support::alone();
    let scene = scenes::mixed_room();
    for (sampler, edge) in [(Sampler::Mis, "2"), (Sampler::Mis, "8"), (Sampler::Guided, "4")] {
        let settings = settings(sampler, edge, 3);
        let together = render(&scene, settings.clone(), &[18]);
        let apart = render(&scene, settings.clone(), &[1; 18]);
        assert!(together == apart, "{} {edge} differs", sampler.name());
    }
    // Direct light has no second vertices.
    let direct = |edge| render(&scene, settings(Sampler::Mis, edge, 1), &[2]);
    assert!(direct("off") == direct("8"));
    // Nor does a mirror reflect what another pixel could use.
    let mirror = MaterialKind::Mirror { reflectance: Vec3::splat(0.9) };
    let mirrors = scenes::room(vec![Material::new("mirror", mirror)]);
    let reflected = |edge| render(&mirrors, settings(Sampler::Mis, edge, 2), &[2]);
    assert!(reflected("off") == reflected("8"));
    let bounced = |edge| render(&scene, settings(Sampler::Mis, edge, 2), &[2]);
    assert!(bounced("off") != bounced("8"));
}

/// A room of these materials in turn, with a lamp besides the window.
fn lit_room(materials: Vec<Material>) -> Scene {
    let mut scene = scenes::room(materials);
    scenes::add_point(&mut scene, Vec3::new(0.3, 2.1, 0.4), Vec3::splat(2.0));
    scene
}

/// Peaks of lobes stay with their own path, and their feet are shared.
#[test]
fn in_a_room_of_narrow_lobes() {
    let _alone = support::alone();
    let scene = lit_room(vec![scenes::diffuse(Vec3::splat(0.7)), scenes::copper(0.1)]);
    agrees(&scene, &[(Sampler::Mis, "4"), (Sampler::Guided, "4")], 96, &base(2));
}

/// Spots on a wall of copper light the floor by the peaks of its lobes.
#[test]
fn before_a_wall_of_narrow_lobes() {
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::splat(0.7), scenes::environment(16, |_| Vec3::ZERO));
    scene.materials.push(scenes::copper(0.08));
    scenes::add_box(&mut scene.geometry, Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.02, 2.0, 6.0), 1);
    for x in [-2.0, 2.0] {
        let position = Vec3::new(x, 1.5, 0.0);
        let kind = LampKind::Spot(Spot {
            position,
            direction: (Vec3::new(0.0, 0.7, 0.0) - position).normalize(),
            intensity: Vec3::splat(50.0),
            inner_angle_rad: 0.3,
            outer_angle_rad: 0.5,
            falloff: SpotFalloff::default(),
        });
        scenes::add_lamp(&mut scene, kind);
    }
    scene.name = "wall of copper".into();
    agrees(&scene, &[(Sampler::Mis, "8")], 1024, &base(2));
}

/// A table that is black but for a cone of half vectors: what is black to one path is not to the next.
#[test]
fn in_a_room_measured_as_black_from_most_sides() {
    let _alone = support::alone();
    let table = MeasuredTable::tabulate(|outgoing, incident| {
        let is_lit = (outgoing + incident).normalize().z > 0.95;
        Vec3::splat(if is_lit { 1.5 } else { 0.0 })
    });
    let kind = MaterialKind::Measured { path: "cone".into(), table: Arc::new(table.unwrap()) };
    let scene = lit_room(vec![scenes::diffuse(Vec3::splat(0.6)), Material::new("cone", kind)]);
    agrees(&scene, &[(Sampler::Mis, "8")], 64, &base(2));
}

/// Nobody else sees a second vertex through a sheet, so its light stays with the path that went through.
#[test]
fn light_from_beyond_a_sheet_stays_with_its_own_path() {
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::splat(0.5), scenes::environment(16, |_| Vec3::ZERO));
    let mut sheet = scenes::diffuse(Vec3::ZERO);
    sheet.surface.opacity.factor = 0.5;
    scene.materials.push(sheet);
    scenes::add_box(&mut scene.geometry, 8.0 * Vec3::Y, Vec3::new(100.0, 1e-3, 100.0), 1);
    scenes::add_box(&mut scene.geometry, 12.0 * Vec3::Y, Vec3::new(40.0, 1.0, 40.0), 0);
    scenes::add_point(&mut scene, 10.0 * Vec3::Y, Vec3::splat(50.0));
    let picture = |edge, depth| render(&scene, settings(Sampler::Mis, edge, depth), &[8]).sum;
    let [alone, shared, direct] = [("off", 2), ("8", 2), ("off", 1)].map(|(e, d)| picture(e, d));
    for ((alone, shared), direct) in alone.iter().zip(&shared).zip(&direct) {
        assert!((alone[0] - shared[0]).abs() <= 1e-4 * alone[0], "{alone:?}, {shared:?}");
        assert!(alone[0] >= direct[0]);
    }
    let sum = |pixels: &[[f32; 3]]| pixels.iter().map(|pixel| pixel[0]).sum::<f32>();
    assert!(sum(&alone) > 1.02 * sum(&direct));
}

/// No length counts as a direction, and no distance but in square: twice as large a scene, whose lamp is four
/// times as strong, has the same picture.
#[test]
fn a_scene_of_twice_the_size_looks_the_same() {
    let _alone = support::alone();
    let mut glowing = paint(Vec3::new(0.7, 0.6, 0.5), 0.2, 0.4);
    let emission = Emission { radiance: Vec3::new(3.0, 2.0, 1.0), texture: None, two_sided: false };
    glowing.surface.emission = Some(emission);
    let scene = lit_room(vec![scenes::plastic(0.1), glowing, scenes::copper(0.3)]);
    let mut large = scene.clone();
    large.geometry = scaled(&scene.geometry, 2.0);
    large.camera.position *= 2.0;
    large.camera.look_at *= 2.0;
    for lamp in &mut large.lamps {
        if let LampKind::Point { position, intensity } = &mut lamp.kind {
            (*position, *intensity) = (2.0 * *position, 4.0 * *intensity);
        }
    }
    let [small, large] =
        [scene, large].map(|scene| render(&scene, settings(Sampler::Mis, "8", 3), &[2]));
    for (pixel, (small, large)) in small.sum.iter().zip(&large.sum).enumerate() {
        let is_same = |(one, other): (&f32, &f32)| (one - other).abs() <= 1e-4 * one.max(*other);
        assert!(small.iter().zip(large).all(is_same), "{pixel}: {small:?}, {large:?}");
    }
}

/// Errors of neighbours are their own, unless all pixels of a block are one cohort.
#[test]
fn neighbours_are_rarely_in_one_cohort() {
    let _alone = support::alone();
    let scene = scenes::room(vec![scenes::diffuse(Vec3::splat(0.8))]);
    for (edge, is_alike) in [("2", false), ("4", false), ("8", true)] {
        let settings = Settings { shadow_rays: 64, ..settings(Sampler::Mis, edge, 2) };
        let rows = replicates::rows(&scene, &settings, 0..32, 1, 1, |_| {});
        let means = estimates(&rows);
        let error = |row: &[f64], pixel: u32| {
            let green = 3 * pixel as usize + 1;
            (row[green] - means[green].mean) / means[green].mean.max(1e-3)
        };
        let (width, height) = (scene.film.width, scene.film.height);
        let covariance = |apart: u32| {
            let pixels = (0..width * height).filter(|pixel| pixel % width + apart < width);
            let products = rows.iter().flat_map(|row| {
                pixels.clone().map(|pixel| error(row, pixel) * error(row, pixel + apart))
            });
            products.sum::<f64>()
        };
        let correlation = covariance(1) / covariance(0);
        eprintln!("{edge}: {correlation:.3}");
        assert_eq!(correlation > 0.15, is_alike, "{edge}: {correlation}");
    }
}

/// Films that are no multiple of a cohort, or smaller than one, and crop windows.
#[test]
fn films_of_odd_sizes_and_crop_windows_have_the_same_mean() {
    let _alone = support::alone();
    let mut scene = scenes::room(vec![scenes::diffuse(Vec3::splat(0.8))]);
    let mean = |scene: &Scene, settings: Settings| {
        let sums = render(scene, settings, &[1024]);
        let pixels = sums.pixel_count();
        let variance: f64 = (0..pixels).map(|pixel| sums.variance_of_mean(pixel)[1]).sum();
        (replicates::film_mean(&sums).y, (variance / pixels as f64).sqrt())
    };
    let window = Window { x: 5, y: 3, width: 9, height: 13 };
    for (size, window) in [([3, 2], None), ([13, 9], None), ([32, 24], Some(window))] {
        (scene.film.width, scene.film.height) = (size[0], size[1]);
        let of = |edge| mean(&scene, Settings { window, ..settings(Sampler::Mis, edge, 3) });
        let ((plain, error), (shared, _)) = (of("off"), of("8"));
        eprintln!("{size:?}: {plain:.5} {shared:.5}, error of a pixel {error:.5}");
        // Errors of a pixel, though those of a cohort are alike: no more than about two of them.
        assert!((plain - shared).abs() < 5.0 * error, "{size:?}: {plain} {shared} {error}");
    }
}

/// Three first vertices and four places that paths may come to, by exact enumeration of all outcomes.
mod enumeration {
    const FIRST: usize = 3;
    const PLACES: usize = 4;
    /// Probability with which a path goes to a place, if it is visible.
    const PROBABILITY: [[f64; PLACES]; FIRST] =
        [[0.4, 0.3, 0.2, 0.1], [0.1, 0.1, 0.2, 0.6], [0.25, 0.25, 0.25, 0.25]];
    /// Any positive numbers that the weights take for these.
    const DENSITY: [[f64; PLACES]; FIRST] =
        [[0.5, 0.2, 0.2, 0.3], [0.2, 0.3, 0.1, 0.9], [0.1, 0.2, 0.3, 0.4]];
    const VISIBLE: [[bool; PLACES]; FIRST] =
        [[true, true, false, true], [false, true, true, true], [true, false, true, true]];
    const BRDF: [[f64; PLACES]; FIRST] =
        [[0.7, 0.1, 0.4, 0.2], [0.3, 0.9, 0.5, 0.1], [0.2, 0.6, 0.8, 0.3]];
    const LIGHT: [f64; PLACES] = [1.0, 5.0, 0.5, 2.0];

    /// Expected light of each first vertex.
    fn expected(sees_in_weights: impl Fn(usize, usize) -> bool) -> [f64; FIRST] {
        let mut sum = [0.0; FIRST];
        for outcome in 0..PLACES.pow(FIRST as u32) {
            let place = |path: usize| outcome / PLACES.pow(path as u32) % PLACES;
            let probability: f64 = (0..FIRST).map(|path| PROBABILITY[path][place(path)]).product();
            for path in 0..FIRST {
                let y = place(path);
                if !VISIBLE[path][y] {
                    continue;
                }
                let seen = (0..FIRST).filter(|first| sees_in_weights(*first, y));
                let density: f64 = seen.map(|first| DENSITY[first][y]).sum();
                let density_ratio = DENSITY[path][y] / PROBABILITY[path][y];
                for first in (0..FIRST).filter(|first| VISIBLE[*first][y]) {
                    sum[first] +=
                        probability * BRDF[first][y] * LIGHT[y] * (density_ratio / density);
                }
            }
        }
        sum
    }

    #[test]
    fn weights_are_right_with_visibility_and_wrong_without() {
        let with = expected(|first, y| VISIBLE[first][y]);
        let without = expected(|_, _| true);
        for first in 0..FIRST {
            let places = (0..PLACES).filter(|y| VISIBLE[first][*y]);
            let truth: f64 = places.map(|y| BRDF[first][y] * LIGHT[y]).sum();
            assert!((with[first] - truth).abs() < 1e-12, "{first}: {} {truth}", with[first]);
            assert!(without[first] < 0.95 * truth, "{first}: {} {truth}", without[first]);
        }
    }
}
