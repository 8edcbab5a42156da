//! Light beyond the environment against closed forms: lamps, emission, mirrors, glass, thin panes and
//! surfaces that are not opaque.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::f32::consts::PI;

use fenestra::{
    sampler::Sampler,
    scene::{
        Lamp, Scene,
        lamp::{LampKind, SpotFalloff},
        material::{Emission, Material, MaterialKind},
    },
    session::Settings,
};
use glam::Vec3;

use crate::support::{self, scenes};

/// Mean of the red channel over the film and its standard error, from renders of eight seeds.
fn mean_and_error(scene: &Scene, settings: Settings, samples: u32) -> (f64, f64) {
    const SEEDS: u32 = 8;
    let mut renderer = support::renderer(scene, settings);
    let means: Vec<f64> = (0..SEEDS)
        .map(|seed| {
            renderer.restart(seed).unwrap();
            renderer.render_pass(samples).unwrap();
            let totals = renderer.totals();
            assert_eq!((totals.dropped_samples, totals.traversal_overruns), (0, 0));
            let sums = renderer.sums().unwrap();
            let pixels = sums.pixel_count();
            (0..pixels).map(|pixel| sums.mean(pixel)[0]).sum::<f64>() / pixels as f64
        })
        .collect();
    support::assert_silent();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    let squares: f64 = means.iter().map(|value| (value - mean).powi(2)).sum();
    let count = means.len() as f64;
    (mean, (squares / (count * (count - 1.0))).sqrt())
}

/// Checks the mean of the image within six standard errors and 0.05%, at a relative error below 1%.
fn assert_mean(scene: &Scene, settings: Settings, samples: u32, expected: f64) {
    let name = format!("{} {} depth {}", scene.name, settings.sampler.name(), settings.depth);
    let (mean, error) = mean_and_error(scene, settings, samples);
    eprintln!("{name}: {mean:.5} ± {error:.5}, expected {expected:.5}");
    assert!(error < 0.01 * expected, "{name}: too noisy to judge");
    assert!((mean - expected).abs() < 6.0 * error + 5e-4 * expected, "{name}");
}

fn settings(sampler: Sampler, depth: u32) -> Settings {
    Settings { sampler, depth, ..Settings::default() }
}

fn black() -> fenestra::scene::EnvironmentMap {
    scenes::environment(16, |_| Vec3::ZERO)
}

fn glass(transmittance: Vec3) -> MaterialKind {
    MaterialKind::ThinDielectric { ior: 1.5, reflectance: Vec3::ONE, transmittance }
}

/// A horizontal plane at y = 0, seen from above, under `environment`, with a sheet at y = 8.
fn sheltered_plane(sheet: Material, environment: fenestra::scene::EnvironmentMap) -> Scene {
    let mut scene = scenes::plane(Vec3::splat(0.5), environment);
    scene.materials.push(sheet);
    let first = scene.geometry.positions.len() as u32;
    for [x, z] in [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]] {
        scene.geometry.positions.push([x * 5e3, 8.0, z * 5e3]);
        scene.geometry.normals.push([0.0; 3]);
    }
    scene.geometry.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    scene.geometry.materials.extend([1, 1]);
    scene
}

#[test]
fn a_glowing_box_fills_itself_with_light() {
    let _alone = support::alone();
    // Everywhere inside, radiance is that of the walls times 1 + ρ + ρ² + …, up to the depth.
    let mut wall = scenes::diffuse(Vec3::splat(0.5));
    let emission = Emission { radiance: Vec3::splat(2.0), texture: None, two_sided: true };
    wall.surface.emission = Some(emission);
    let mut scene = scenes::convex_furnace(wall, Vec3::ZERO);
    scene.name = "glowing box".into();
    scene.camera.position = Vec3::new(0.1, 0.2, 0.3);
    for (sampler, depth, expected) in [
        (Sampler::Mis, 1, 3.0),
        (Sampler::Mis, 3, 3.75),
        (Sampler::Brdf, 2, 3.5),
        (Sampler::Guided, 3, 3.75),
        (Sampler::Product, 2, 3.5),
    ] {
        assert_mean(&scene, settings(sampler, depth), 16, expected);
    }
    // Walls that let half of the light out shine and reflect half as much.
    scene.materials[0].surface.opacity.factor = 0.5;
    assert_mean(&scene, settings(Sampler::Mis, 1), 32, 0.5 * (2.0 + 0.5 * 0.5 * 2.0));
    scene.materials[0].surface.opacity.factor = 1.0;
    // The box emits inward through the back of its triangles.
    scene.materials[0].surface.emission.as_mut().unwrap().two_sided = false;
    let (mean, _) = mean_and_error(&scene, settings(Sampler::Mis, 3), 4);
    // Rounding lets a point of the same wall shine at a grazing angle.
    assert!(mean < 1e-6, "{mean}");
}

#[test]
fn lamps_without_a_surface_light_a_plane() {
    let _alone = support::alone();
    let position = Vec3::new(0.0, 3.0, 0.0);
    let intensity = Vec3::splat(40.0);
    let down = Vec3::NEG_Y;
    let lit_by = |kind| {
        let mut scene = scenes::plane(Vec3::splat(0.5), black());
        scene.lamps.push(Lamp { name: "lamp".into(), kind });
        scene
    };
    // Integrate I cosθ/d² · ρ/π over the part of the plane that the camera sees: its rays, by pixel.
    let sun = lit_by(LampKind::Directional { direction: down, irradiance: Vec3::splat(7.0) });
    assert_mean(&sun, settings(Sampler::Mis, 1), 4, 7.0 * 0.5 / f64::from(PI));
    let slanted = Vec3::new(0.6, -0.8, 0.0);
    let sun = lit_by(LampKind::Directional { direction: slanted, irradiance: Vec3::splat(7.0) });
    assert_mean(&sun, settings(Sampler::Guided, 1), 4, 0.8 * 7.0 * 0.5 / f64::from(PI));
    let point = lit_by(LampKind::Point { position, intensity });
    let expected = mean_over_plane(&point, |place| {
        let to_lamp = position - place;
        40.0 * to_lamp.normalize().y / to_lamp.length_squared() * 0.5 / PI
    });
    assert_mean(&point, settings(Sampler::Mis, 1), 64, expected);
    for falloff in [SpotFalloff::SquaredCosine, SpotFalloff::SmoothCosine, SpotFalloff::LinearAngle]
    {
        let (inner, outer) = (0.1_f32, 0.4_f32);
        let spot = lit_by(LampKind::Spot {
            position,
            direction: down,
            intensity,
            inner_angle_rad: inner,
            outer_angle_rad: outer,
            falloff,
        });
        let expected = mean_over_plane(&spot, |place| {
            let to_lamp = position - place;
            let cosine = to_lamp.normalize().y;
            let t = match falloff {
                SpotFalloff::LinearAngle => (outer - cosine.acos()) / (outer - inner),
                _ => (cosine - outer.cos()) / (inner.cos() - outer.cos()),
            };
            let t = t.clamp(0.0, 1.0);
            let share = match falloff {
                SpotFalloff::LinearAngle => t,
                SpotFalloff::SquaredCosine => t * t,
                SpotFalloff::SmoothCosine => t * t * (3.0 - 2.0 * t),
            };
            share * 40.0 * cosine / to_lamp.length_squared() * 0.5 / PI
        });
        assert_mean(&spot, settings(Sampler::Mis, 1), 64, expected);
    }
}

/// Mean over the film of a function of the places on the plane y = 0 that the camera sees.
fn mean_over_plane(scene: &Scene, radiance: impl Fn(Vec3) -> f32) -> f64 {
    const SIDE: u32 = 400;
    let camera = &scene.camera;
    let forward = (camera.look_at - camera.position).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let half = (0.5 * camera.vertical_fov_deg).to_radians().tan();
    let aspect = scene.film.width as f32 / scene.film.height as f32;
    let mut sum = 0.0;
    for index in 0..SIDE * SIDE {
        let place = |step: u32| 2.0 * (step as f32 + 0.5) / SIDE as f32 - 1.0;
        let (x, y) = (place(index % SIDE) * half * aspect, place(index / SIDE) * half);
        let direction = forward + x * right + y * up;
        let place = camera.position - direction * (camera.position.y / direction.y);
        sum += f64::from(radiance(place));
    }
    sum / f64::from(SIDE * SIDE)
}

/// Each lamp is drawn as often as its power asks for, and weighs as much as all others together leave it.
#[test]
fn lamps_of_unlike_power_add_up() {
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::splat(0.5), black());
    for irradiance in [Vec3::new(1.0, 0.0, 0.0), Vec3::new(3.0, 0.0, 1.0), Vec3::new(0.0, 9.0, 0.0)]
    {
        let kind = LampKind::Directional { direction: Vec3::NEG_Y, irradiance };
        scene.lamps.push(Lamp { name: "lamp".into(), kind });
    }
    assert_mean(&scene, settings(Sampler::Mis, 1), 128, 4.0 * 0.5 / f64::from(PI));
}

#[test]
fn an_area_lamp_agrees_with_a_point_far_away() {
    let _alone = support::alone();
    // A square of 0.2 m, 4 m above: I = L·A along its axis, to 0.2%.
    let mut scene = scenes::plane(Vec3::splat(0.5), black());
    scene.camera.vertical_fov_deg = 2.0;
    let emission = Emission { radiance: Vec3::splat(900.0), texture: None, two_sided: false };
    let mut lamp = scenes::diffuse(Vec3::ZERO);
    lamp.surface.emission = Some(emission);
    scene.materials.push(lamp);
    let first = scene.geometry.positions.len() as u32;
    // The camera stands at x = 0 below the lamp's height; the lamp is beside its view.
    for [x, z] in [[0.4, -0.1], [0.6, -0.1], [0.6, 0.1], [0.4, 0.1]] {
        scene.geometry.positions.push([x, 4.0, z]);
        scene.geometry.normals.push([0.0; 3]);
    }
    scene.geometry.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    scene.geometry.materials.extend([1, 1]);
    let expected = mean_over_plane(&scene, |place| {
        let cells = 20;
        (0..cells * cells)
            .map(|cell| {
                let at = |index: i32| 0.2 * ((index as f32 + 0.5) / cells as f32 - 0.5);
                let point = Vec3::new(0.5 + at(cell % cells), 4.0, at(cell / cells));
                let to_lamp = point - place;
                let cosine = to_lamp.normalize().y;
                900.0 * 0.04 * cosine * cosine / to_lamp.length_squared() * 0.5 / PI
            })
            .sum::<f32>()
            / (cells * cells) as f32
    });
    assert_mean(&scene, settings(Sampler::Mis, 1), 64, expected);
    assert_mean(&scene, settings(Sampler::Guided, 1), 64, expected);
}

#[test]
fn mirrors_and_glass_lose_nothing_in_a_furnace() {
    let _alone = support::alone();
    let mirror = MaterialKind::Mirror { reflectance: Vec3::ONE };
    let solid = MaterialKind::Dielectric {
        ior: 1.5,
        alpha: 0.0,
        reflectance: Vec3::ONE,
        transmittance: Vec3::ONE,
    };
    for (kind, depth) in [(mirror, 1), (glass(Vec3::ONE), 12), (solid, 24)] {
        let scene = scenes::convex_furnace(Material::new("specular", kind), Vec3::splat(2.0));
        for sampler in [Sampler::Mis, Sampler::Guided] {
            let (mean, _) = mean_and_error(&scene, settings(sampler, depth), 4);
            eprintln!("{:?}: {mean}", scene.materials[0].kind);
            assert!((mean - 2.0).abs() < 0.01, "{:?}: {mean}", scene.materials[0].kind);
        }
    }
}

/// Share of light that a pane of index 1.5 lets through at a cosine: T² Σ R²ⁿ for each polarisation
/// would differ; panes take the mean reflectance of one side, as scene formats do.
fn pane_transmittance(cosine: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).sqrt() / 1.5;
    let inside = (1.0 - sine * sine).sqrt();
    let parallel = (1.5 * cosine - inside) / (1.5 * cosine + inside);
    let perpendicular = (cosine - 1.5 * inside) / (cosine + 1.5 * inside);
    let side = 0.5 * (parallel * parallel + perpendicular * perpendicular);
    1.0 - 2.0 * side / (1.0 + side)
}

#[test]
fn shadow_rays_go_through_panes_and_sheets() {
    let _alone = support::alone();
    let sky = || scenes::environment(16, |_| Vec3::ONE);
    // ∫ T(θ) cosθ/π dω = ∫ T 2μ dμ.
    let steps = 20_000;
    let through: f64 = (0..steps)
        .map(|step| {
            let cosine = (f64::from(step) + 0.5) / f64::from(steps);
            2.0 * cosine * pane_transmittance(cosine) / f64::from(steps)
        })
        .sum();
    let pane = Material::new("pane", glass(Vec3::splat(0.7)));
    let scene = sheltered_plane(pane, sky());
    for sampler in [Sampler::Mis, Sampler::Cosine, Sampler::Guided, Sampler::Visibility] {
        assert_mean(&scene, settings(sampler, 1), 128, 0.5 * 0.7 * through);
    }
    let mut sheet = scenes::diffuse(Vec3::ZERO);
    sheet.surface.opacity.factor = 0.25;
    let mut scene = sheltered_plane(sheet, sky());
    assert_mean(&scene, settings(Sampler::Mis, 1), 128, 0.5 * 0.75);
    // Seen from above, the sheet dims the camera's rays too.
    scene.camera.position.y = 20.0;
    assert_mean(&scene, settings(Sampler::Mis, 1), 512, 0.75 * 0.5 * 0.75);
    scene.materials[1].surface.opacity.cutoff = Some(0.5);
    assert_mean(&scene, settings(Sampler::Mis, 1), 128, 0.5);
    scene.materials[1].surface.opacity.cutoff = Some(0.1);
    let (mean, _) = mean_and_error(&scene, settings(Sampler::Mis, 1), 4);
    assert!(mean == 0.0, "{mean}");
}

#[test]
fn the_back_of_a_one_sided_surface_is_black() {
    let _alone = support::alone();
    let mut scene = scenes::convex_furnace(scenes::diffuse(Vec3::splat(0.5)), Vec3::ONE);
    scene.camera.position = Vec3::new(0.1, 0.2, 0.3);
    scene.materials[0].surface.two_sided = false;
    scene.lamps.push(Lamp {
        name: "lamp".into(),
        kind: LampKind::Point { position: Vec3::ZERO, intensity: Vec3::ONE },
    });
    let (mean, _) = mean_and_error(&scene, settings(Sampler::Mis, 2), 4);
    assert!(mean == 0.0, "{mean}");
    scene.materials[0].surface.two_sided = true;
    let (mean, _) = mean_and_error(&scene, settings(Sampler::Mis, 2), 4);
    assert!(mean > 0.1, "{mean}");
}
