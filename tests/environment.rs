//! The environment map: orientation, lookup, the density its tables sample, and the shader twin.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;

use fenestra::{
    math::{
        colour::luminance,
        frame::{direction_from_lat_long, lat_long_from_direction},
        random::{random_independent_1d, random_independent_2d},
    },
    scene::environment::{EnvironmentMap, EnvironmentTables},
    session::{Renderer, Settings},
    shader::{bindings::scene, constants::CONSTANT_COMPENSATION, structs::SceneParameters},
};
use glam::{Vec2, Vec3};

use crate::{
    support::{
        self, assert_error,
        scenes::{self, map},
        statistics::chi_square_p_value,
    },
    twin::{environment::EnvironmentSampling as _, random::random_2d},
};

/// Chance of a false alarm: a test fails by chance for less than one seed in a million.
const FALSE_ALARM: f64 = 1e-6;

/// Makes a map whose only texel that is not black is (column, row).
fn one_texel(width: u32, height: u32, column: u32, row: u32) -> EnvironmentMap {
    map(width, height, |i, j| if (i, j) == (column, row) { Vec3::ONE } else { Vec3::ZERO })
}

/// Makes a map of random texels, a third of them black.
fn random_map(width: u32, height: u32) -> EnvironmentMap {
    map(width, height, |i, j| {
        let channel = |channel| random_independent_1d(i, j, channel, 4);
        let black = random_independent_1d(i, j, 9, 4) < 0.33;
        if black { Vec3::ZERO } else { Vec3::new(channel(0), 3.0 * channel(1), channel(2)) }
    })
}

/// Returns the maps for tests of the density.
fn maps() -> Vec<(&'static str, EnvironmentMap)> {
    let mut turned = random_map(12, 6);
    turned.rotation_rad = 2.1;
    vec![
        ("random", random_map(16, 8)),
        ("random, turned", turned),
        ("odd height", random_map(10, 5)),
        ("not 2:1", random_map(7, 12)),
        ("one row", random_map(5, 1)),
        ("one texel in all", map(1, 1, |_, _| Vec3::new(0.2, 0.5, 4.0))),
        ("bright poles", map(16, 8, |_, j| Vec3::splat(if j % 7 == 0 { 50.0 } else { 0.01 }))),
        ("bright north pole", map(16, 8, |i, j| Vec3::splat(if j == 0 { i as f32 } else { 0.0 }))),
        ("sun", map(32, 16, |i, j| Vec3::splat(if (i, j) == (20, 3) { 1e5 } else { 0.3 }))),
        ("sun at the seam", one_texel(16, 8, 0, 4)),
        ("constant", EnvironmentMap::constant(Vec3::new(0.5, 1.0, 2.0), 3.0).unwrap()),
    ]
}

#[test]
fn a_single_bright_texel_shows_the_orientation() {
    // Each lookup falls between four of the 64×32 texels and sees a quarter of a bright one. Column
    // 32 starts at the centre, −Z; column 48 at three quarters, +X; row 0 is +Y.
    let brightest = |map: &EnvironmentMap| {
        let axes = [
            ("+X", Vec3::X),
            ("-X", -Vec3::X),
            ("+Y", Vec3::Y),
            ("-Y", -Vec3::Y),
            ("+Z", Vec3::Z),
            ("-Z", -Vec3::Z),
        ];
        let lit: Vec<&str> = axes
            .iter()
            .filter(|(_, direction)| map.radiance(*direction).x > 0.2)
            .map(|(name, _)| *name)
            .collect();
        lit.join(" ")
    };
    assert_eq!(brightest(&one_texel(64, 32, 32, 16)), "-Z");
    assert_eq!(brightest(&one_texel(64, 32, 48, 16)), "+X");
    assert_eq!(brightest(&one_texel(64, 32, 0, 16)), "+Z");
    assert_eq!(brightest(&one_texel(64, 32, 16, 16)), "-X");
    assert_eq!(brightest(&one_texel(64, 32, 32, 0)), "+Y");
    assert_eq!(brightest(&one_texel(64, 32, 32, 31)), "-Y");
    // Turned by 90 degrees, the centre looks along −X and the column right of it along −Z.
    let turned = |column| {
        let mut map = one_texel(64, 32, column, 16);
        map.rotation_rad = 90_f32.to_radians();
        brightest(&map)
    };
    assert_eq!(turned(32), "-X");
    assert_eq!(turned(48), "-Z");
}

#[test]
fn lookup_is_bilinear_between_texel_centres_wrapping_in_u_and_clamped_in_v() {
    let map = random_map(16, 8);
    let texel = |i: u32, j: u32| map.texels[(j * 16 + i) as usize];
    let at = |x: f32, y: f32| map.radiance(direction_from_lat_long(Vec2::new(x / 16.0, y / 8.0)));
    for (i, j) in [(0, 0), (5, 3), (15, 7), (8, 4)] {
        let centre = at(i as f32 + 0.5, j as f32 + 0.5);
        assert!(centre.distance(texel(i, j)) < 1e-5, "texel {i}, {j}");
    }
    let between = at(6.25, 3.75);
    let upper = texel(5, 3) * 0.25 + texel(6, 3) * 0.75;
    let lower = texel(5, 4) * 0.25 + texel(6, 4) * 0.75;
    assert!(between.distance(upper * 0.75 + lower * 0.25) < 1e-5);
    // The seam lies half a texel from either neighbour.
    for x in [0.0, 16.0] {
        assert!(at(x, 2.5).distance(0.5 * (texel(0, 2) + texel(15, 2))) < 1e-5);
    }
    // Beyond the centres of the first and last rows, v no longer matters.
    assert!(at(3.5, 0.1).distance(texel(3, 0)) < 1e-5);
    assert!(at(3.5, 7.9).distance(texel(3, 7)) < 1e-5);
}

/// Integrates the density over `split`² equal parts of every cell, row by row, by two-point Gauss
/// quadrature in (u, v), which is exact for a bilinear density.
fn cell_probabilities(map: &EnvironmentMap, tables: &EnvironmentTables, split: u32) -> Vec<f64> {
    let (width, height) = (map.width * split, (map.height + 1) * split);
    let turn = f64::from(map.rotation_rad) / (2.0 * PI);
    let mut probabilities = vec![0.0; (width * height) as usize];
    for (index, probability) in probabilities.iter_mut().enumerate() {
        let (i, j) = (index as u32 % width, index as u32 / width);
        // Clip to the half cells at the poles.
        let edge = |j: u32| {
            (f64::from(j) / f64::from(split) - 0.5).clamp(0.0, f64::from(map.height))
                / f64::from(map.height)
        };
        let (top, bottom) = (edge(j), edge(j + 1));
        let left = (f64::from(i) / f64::from(split) + 0.5) / f64::from(map.width);
        let extent = 1.0 / f64::from(width);
        for a in [0.5 - 0.5 / 3_f64.sqrt(), 0.5 + 0.5 / 3_f64.sqrt()] {
            for b in [0.5 - 0.5 / 3_f64.sqrt(), 0.5 + 0.5 / 3_f64.sqrt()] {
                let (u, v) = ((left + a * extent - turn).rem_euclid(1.0), top + b * (bottom - top));
                let direction = direction_from_lat_long(Vec2::new(u as f32, v as f32));
                let pdf = tables.pdf(map, direction, map.radiance(direction));
                let jacobian = 2.0 * PI * PI * (PI * v).sin();
                *probability += 0.25 * extent * (bottom - top) * f64::from(pdf) * jacobian;
            }
        }
    }
    probabilities
}

#[test]
fn the_density_integrates_to_one() {
    for (name, map) in maps() {
        for tables in tables_of(&map) {
            let integral: f64 = cell_probabilities(&map, &tables, 1).iter().sum();
            assert!((integral - 1.0).abs() < 2e-5, "{name}: {integral}");
        }
    }
}

#[test]
fn the_tables_hold_the_probabilities_of_the_density() {
    for (name, map) in maps() {
        for tables in tables_of(&map) {
            let density = cell_probabilities(&map, &tables, 1);
            let width = map.width as usize;
            for (row, cells) in density.chunks(width).enumerate() {
                let before = if row == 0 { 0.0 } else { tables.rows[row - 1] };
                let row_probability = f64::from(tables.rows[row] - before);
                assert!(
                    (row_probability - cells.iter().sum::<f64>()).abs() < 2e-6,
                    "{name}: row {row}"
                );
                for (column, cell) in cells.iter().enumerate() {
                    let cumulative = tables.cell_cumulative(&map, row);
                    let before = if column == 0 { 0.0 } else { cumulative[column - 1] };
                    let table = row_probability * f64::from(cumulative[column] - before);
                    assert!((table - cell).abs() < 2e-6, "{name}: cell {column}, {row}");
                }
            }
        }
    }
}

/// Tables of a map by luminance, and compensated.
fn tables_of(map: &EnvironmentMap) -> [EnvironmentTables; 2] {
    [EnvironmentTables::new(map), EnvironmentTables::compensated(map)]
}

/// Density that a weight of one has at a direction of `radiance`, from the tables by luminance: rounding
/// errors of a compensated weight are those of the luminance, however little is left.
fn density_per_weight(
    [plain, tables]: [&EnvironmentTables; 2],
    map: &EnvironmentMap,
    direction: Vec3,
    radiance: Vec3,
) -> f32 {
    let bright = plain.pdf(map, direction, radiance) / luminance(radiance).max(1e-30);
    bright * plain.total / tables.total
}

/// Returns the index of a direction's part in [`cell_probabilities`].
fn bin(map: &EnvironmentMap, direction: Vec3, split: u32) -> usize {
    let uv = lat_long_from_direction(direction);
    let u = (uv.x + map.rotation_rad / (2.0 * PI as f32)).rem_euclid(1.0);
    let (width, height) = (map.width * split, (map.height + 1) * split);
    let x = (u * map.width as f32 - 0.5).rem_euclid(map.width as f32) * split as f32;
    let y = (uv.y * map.height as f32 + 0.5) * split as f32;
    ((y as u32).min(height - 1) * width + (x as u32).min(width - 1)) as usize
}

#[test]
fn samples_have_the_density() {
    for (name, map) in maps() {
        for tables in tables_of(&map) {
            let split = 4;
            let expected = cell_probabilities(&map, &tables, split);
            let mut observed = vec![0.0; expected.len()];
            for i in 0..400_000 {
                let sample = tables.sample(&map, random_independent_2d(i, 0, 0, 7));
                assert!(sample.direction.is_normalized() && sample.pdf >= 0.0, "{name}");
                observed[bin(&map, sample.direction, split)] += 1.0;
            }
            // Do not take rounding at the edge of a bin for an impossible count.
            for (observed, expected) in observed.iter_mut().zip(&expected) {
                if *expected < 1e-9 && *observed < 3.0 {
                    *observed = 0.0;
                }
            }
            let p = chi_square_p_value(&observed, &expected);
            assert!(p > FALSE_ALARM, "{name}: p = {p:e}");
        }
    }
}

#[test]
fn a_sample_carries_its_own_radiance_and_density() {
    for (name, map) in maps() {
        let all = tables_of(&map);
        let brightest = map.texels.iter().map(|texel| luminance(*texel)).fold(0.0, f32::max);
        for tables in &all {
            let mut different_rows = 0;
            for i in 0..20_000 {
                let sample = tables.sample(&map, random_2d(0, i, 0, 3));
                let radiance = map.radiance(sample.direction);
                let tolerance = 1e-5 * brightest;
                assert!(radiance.distance(sample.radiance) < 8.0 * tolerance, "{name}: {sample:?}");
                let pdf = tables.pdf(&map, sample.direction, sample.radiance);
                // The density jumps from row to row, and rounding may move a direction into the next one.
                let per_weight =
                    density_per_weight([&all[0], tables], &map, sample.direction, sample.radiance);
                let slack = if tables.compensation > 0.0 { tolerance * per_weight } else { 0.0 };
                if (pdf - sample.pdf).abs() > 2e-5 * sample.pdf + 8.0 * slack + 1e-12 {
                    different_rows += 1;
                }
            }
            assert!(different_rows <= 4, "{name}: {different_rows} densities differ");
        }
    }
}

#[test]
fn only_cells_that_are_not_black_are_drawn_whatever_the_numbers() {
    let map = one_texel(64, 32, 20, 9);
    let tables = EnvironmentTables::new(&map);
    let below_one = 1.0 - f32::EPSILON / 2.0;
    let edges = [0.0, f32::MIN_POSITIVE, 2_f32.powi(-24), 0.25, 0.5, 0.75, below_one];
    for u in edges {
        for v in edges {
            let sample = tables.sample(&map, [u, v]);
            let uv = lat_long_from_direction(sample.direction) * Vec2::new(64.0, 32.0);
            assert!((uv.x - 20.5).abs() < 1.001 && (uv.y - 9.5).abs() < 1.001, "{uv}");
            assert!(sample.pdf.is_finite() && sample.radiance.is_finite());
        }
    }
    // Black rows, and black cells in other rows, repeat the entry before them, so that no number
    // falls between.
    for row in 0..33 {
        let black = !(9..=10).contains(&row);
        let before = if row == 0 { 0.0 } else { tables.rows[row - 1] };
        assert_eq!(tables.rows[row] == before, black, "row {row}");
    }
}

#[test]
fn a_black_map_has_no_samples() {
    let map = map(8, 4, |_, _| Vec3::ZERO);
    let tables = EnvironmentTables::new(&map);
    assert_eq!(tables.total, 0.0);
    let sample = tables.sample(&map, [0.3, 0.6]);
    assert_eq!((sample.pdf, sample.radiance), (0.0, Vec3::ZERO));
    assert_eq!(tables.pdf(&map, Vec3::X, Vec3::ZERO), 0.0);
    assert!(tables.rows.iter().chain(&tables.cells).all(|value| value.is_finite()));
}

#[test]
fn a_constant_map_is_sampled_nearly_uniformly() {
    let map = EnvironmentMap::constant(Vec3::ONE, 2.0).unwrap();
    let tables = EnvironmentTables::new(&map);
    // L / pdf follows the sine in the cells at the poles; elsewhere it varies by half a row of 5.6°.
    for i in 0..1000 {
        let [u, v] = random_independent_2d(i, 0, 0, 5);
        let direction = direction_from_lat_long(Vec2::new(u, 0.1 + 0.8 * v));
        let pdf = f64::from(tables.pdf(&map, direction, map.radiance(direction)));
        assert!((pdf * 4.0 * PI - 1.0).abs() < 0.16, "{direction}: {pdf}");
    }
}

#[test]
fn compensation_leaves_what_the_brdf_does_not_find() {
    let sun = maps().into_iter().find(|(name, _)| *name == "sun").unwrap().1;
    let tables = EnvironmentTables::compensated(&sun);
    // All samples go to the four cells around the sun, since the rest is below the mean.
    for i in 0..1000 {
        let sample = tables.sample(&sun, random_independent_2d(i, 0, 0, 5));
        let uv = lat_long_from_direction(sample.direction) * Vec2::new(32.0, 16.0);
        assert!((uv.x - 20.5).abs() < 1.001 && (uv.y - 3.5).abs() < 1.001, "{uv}");
    }
    assert_eq!(tables.pdf(&sun, Vec3::NEG_Y, sun.radiance(Vec3::NEG_Y)), 0.0);
    // Half of the mean over the sphere, of which a cap above y = 0.9 is a twentieth.
    let cap = scenes::environment(512, |to| Vec3::splat(if to.y > 0.9 { 4.0 } else { 1.0 }));
    let compensation = EnvironmentTables::compensated(&cap).compensation;
    assert!((compensation - 0.575).abs() < 0.005, "{compensation}");
    // Without contrast there is nothing to leave out: the density stays as it is.
    let constant = EnvironmentMap::constant(Vec3::ONE, 2.0).unwrap();
    let [plain, tables] = tables_of(&constant);
    assert!((tables.compensation - 1.0).abs() < 1e-3, "half of the energy is left");
    for direction in [Vec3::X, Vec3::Y, Vec3::new(0.6, -0.8, 0.0)] {
        let radiance = constant.radiance(direction);
        let pdf = plain.pdf(&constant, direction, radiance);
        assert!((tables.pdf(&constant, direction, radiance) / pdf - 1.0).abs() < 1e-4);
    }
}

/// The mean of f·L/pdf over the map's own samples is ∫ f·L dω, whatever the map.
#[test]
fn estimates_of_reflected_light_are_unbiased() {
    // Smooth, and without the symmetries of a cell.
    let reflectance =
        |direction: Vec3| (1.0 + 0.9 * direction.x) * (1.0 + 0.5 * direction.y - 0.4 * direction.z);
    for (name, map) in maps() {
        let tables = EnvironmentTables::new(&map);
        // Integrate f·L dω by the midpoint rule with at least 128 points per cell.
        let mut truth = 0.0;
        let parts = (256 / map.width.min(2 * map.height)).max(8);
        let (width, height) = (map.width * parts, (2 * map.height) * parts);
        for j in 0..height {
            let v = (f64::from(j) + 0.5) / f64::from(height);
            let (top, bottom) = (f64::from(j), f64::from(j + 1));
            let band =
                (PI * top / f64::from(height)).cos() - (PI * bottom / f64::from(height)).cos();
            for i in 0..width {
                let u = (f64::from(i) + 0.5) / f64::from(width);
                let direction = direction_from_lat_long(Vec2::new(u as f32, v as f32));
                let light = luminance(map.radiance(direction)) * reflectance(direction);
                truth += f64::from(light) * band * 2.0 * PI / f64::from(width);
            }
        }
        let replicates: Vec<f64> = (0..64)
            .map(|seed| {
                let sum: f64 = (0..1024)
                    .map(|i| {
                        let sample = tables.sample(&map, random_2d(1, i, 0, seed));
                        let light = luminance(sample.radiance) * reflectance(sample.direction);
                        f64::from(light / sample.pdf.max(1e-30))
                    })
                    .sum();
                sum / 1024.0
            })
            .collect();
        let mean = replicates.iter().sum::<f64>() / 64.0;
        let z = support::statistics::z_of_mean(&replicates, truth);
        assert!(
            z.abs() < 6.0 || (mean / truth - 1.0).abs() < 1e-3,
            "{name}: mean {mean}, truth {truth}, z = {z}"
        );
    }
}

#[test]
fn the_shader_agrees() {
    for (name, map) in maps() {
        let all = tables_of(&map);
        for (compensates, tables) in all.iter().enumerate() {
            let (sin, cos) = map.rotation_rad.sin_cos();
            let parameters = SceneParameters {
                environment_width: map.width,
                environment_height: map.height,
                environment_cos_rotation: cos,
                environment_sin_rotation: sin,
                environment_total: all[0].total,
                compensated_total: all[1].total,
                ..SceneParameters::default()
            };
            let mut inputs: Vec<[f32; 5]> = Vec::new();
            for direction in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z] {
                inputs.push([direction.x, direction.y, direction.z, 0.0, 1.0 - f32::EPSILON / 2.0]);
            }
            for i in 0..10_000 {
                let [u, v] = random_independent_2d(i, 0, 0, 2);
                let direction = direction_from_lat_long(Vec2::new(u, v));
                let [u, v] = random_independent_2d(i, 1, 0, 2);
                inputs.push([direction.x, direction.y, direction.z, u, v]);
            }
            let texel = |texel: &Vec3| texel.extend(all[1].weight(*texel)).to_array();
            let texels: Vec<[f32; 4]> = map.texels.iter().map(texel).collect();
            let output: Vec<[f32; 11]> = support::run_probe(
                "environment",
                &[(CONSTANT_COMPENSATION, compensates as u32)],
                &[
                    (scene::PARAMETERS, bytemuck::bytes_of(&parameters)),
                    (scene::ENVIRONMENT_TEXELS, bytemuck::cast_slice(&texels)),
                    (scene::ENVIRONMENT_ROWS, bytemuck::cast_slice(&all[0].rows)),
                    (scene::ENVIRONMENT_CELLS, bytemuck::cast_slice(&all[0].cells)),
                    (scene::COMPENSATED_ROWS, bytemuck::cast_slice(&all[1].rows)),
                    (scene::COMPENSATED_CELLS, bytemuck::cast_slice(&all[1].cells)),
                ],
                &inputs,
            );
            let brightest = map.texels.iter().map(|texel| texel.max_element()).fold(0.0, f32::max);
            let mut different_rows = 0;
            for (input, shader) in inputs.iter().zip(&output) {
                let direction = Vec3::from_slice(input);
                let radiance = map.radiance(direction);
                assert!(
                    radiance.distance(Vec3::from_slice(shader)) < 1e-4 * brightest,
                    "{name}: radiance at {direction}: {radiance}, shader {shader:?}"
                );
                let seen = Vec3::from_slice(shader);
                let pdf = tables.pdf(&map, direction, seen);
                let slack = |direction, radiance| {
                    let error = if compensates == 1 { 1e-4 * brightest } else { 0.0 };
                    error * density_per_weight([&all[0], tables], &map, direction, radiance)
                };
                if (pdf - shader[3]).abs() > 1e-5 * pdf + slack(direction, seen) {
                    different_rows += 1;
                }
                let sample = tables.sample(&map, [input[3], input[4]]);
                let difference = sample.direction.distance(Vec3::from_slice(&shader[4..]));
                assert!(difference < 2e-6, "{name}: {sample:?}, shader {shader:?}");
                assert!(
                    sample.radiance.distance(Vec3::from_slice(&shader[7..])) < 1e-5 * brightest,
                    "{name}: {sample:?}, shader {shader:?}"
                );
                // On GPUs, as far as directions differ, so do the sines that densities are divided by, and
                // the radiance that they follow.
                let Vec3 { x, z, .. } = sample.direction;
                let of_sine = 2e-6 / x.hypot(z).max(2e-6);
                let seen = Vec3::from_slice(&shader[7..]);
                let of_radiance =
                    2.0 * sample.radiance.distance(seen) / sample.radiance.length().max(1e-30);
                let of_direction = if support::is_software() { 0.0 } else { of_sine + of_radiance };
                assert!(
                    (sample.pdf - shader[10]).abs()
                        <= (1e-4 + of_direction) * sample.pdf
                            + 1e-6
                            + slack(sample.direction, sample.radiance),
                    "{name}: {sample:?}, shader {shader:?}"
                );
            }
            assert!(different_rows <= 4, "{name}: {different_rows} densities differ");
        }
    }
}

/// The texels of this map are not there: no work is done on them.
#[test]
fn a_map_beyond_the_device_is_refused_before_the_work() {
    let mut scene = scenes::mixed_room();
    (scene.environment.width, scene.environment.height) = (1 << 20, 1 << 19);
    assert_error(
        Renderer::new(support::device(), &scene, Settings::default()),
        &["1048576x524288 texels takes"],
    );
}
