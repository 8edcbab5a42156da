//! Light beyond the environment against closed forms: lamps, emission, mirrors, glass, thin panes and
//! surfaces that are not opaque.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{f32::consts::PI, sync::Arc};

use fenestra::{
    sampler::Sampler,
    scene::{
        Filter, Geometry, Scene,
        lamp::{LampKind, Spot, SpotFalloff},
        material::{Emission, Material, MaterialKind},
        texture::{Encoding, Interpolation, Texels, Texture, TextureUse},
    },
    session::Settings,
};
use glam::{DVec3, Vec3};

use crate::support::{
    self,
    replicates::{film_mean, mean_and_error},
    scenes,
};

/// Mean of the red channel over the film, where no noise is expected.
fn mean(scene: &Scene, settings: Settings) -> f64 {
    let (sums, totals) = support::render(scene, settings, 4);
    assert_eq!((totals.dropped_samples, totals.traversal_overruns), (0, 0));
    film_mean(&sums).x
}

/// Checks the red of the image's mean within six standard errors and 0.05%, at a relative error below 1%, by
/// renders of eight seeds.
fn assert_mean(scene: &Scene, settings: Settings, samples: u32, expected: f64) {
    let name = format!("{} {} depth {}", scene.name, settings.sampler.name(), settings.depth);
    let [mean, error] = mean_and_error(scene, &settings, samples, 8).map(|value| value.x);
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
    MaterialKind::pane(1.5, transmittance)
}

/// A horizontal plane at y = 0, seen from above, under `environment`, with a sheet at y = 8.
fn sheltered_plane(sheet: Material, environment: fenestra::scene::EnvironmentMap) -> Scene {
    let mut scene = scenes::plane(Vec3::splat(0.5), environment);
    scene.materials.push(sheet);
    scenes::add_square(&mut scene.geometry, Vec3::new(0.0, 8.0, 0.0), 5e3, 1);
    scene
}

/// A square at y = 0 that fills the image, seen along about 70° from its normal, between a sky and a ground
/// that are told apart by their channels.
fn between_sky_and_ground(surface: MaterialKind) -> Scene {
    let environment = scenes::environment(64, |to| if to.y > 0.0 { SKY } else { GROUND });
    let mut scene = scenes::plane(Vec3::ZERO, environment);
    scene.materials = vec![Material::new("surface", surface)];
    scene.geometry = Geometry::default();
    scenes::add_square(&mut scene.geometry, Vec3::ZERO, 5.0, 0);
    scene.camera.position = Vec3::new(0.0, 3.0, 8.0);
    scene.camera.vertical_fov_deg = 4.0;
    scene
}

const SKY: Vec3 = Vec3::new(1.0, 0.0, 1.0);
const GROUND: Vec3 = Vec3::new(0.0, 1.0, 1.0);

/// Checks every channel of the mean of the image against the mean of a function of the cosine at the surface.
fn assert_channels(
    name: &str,
    scene: &Scene,
    samples: u32,
    tolerance: f64,
    expected: impl Fn(f64) -> DVec3,
) {
    assert_channels_at(name, scene, 1, samples, tolerance, expected);
}

/// The same of paths of up to `depth` vertices.
fn assert_channels_at(
    name: &str,
    scene: &Scene,
    depth: u32,
    samples: u32,
    tolerance: f64,
    expected: impl Fn(f64) -> DVec3,
) {
    let (sums, _) = support::render(scene, settings(Sampler::Mis, depth), samples);
    let mean = film_mean(&sums);
    let of = |channel: usize| {
        mean_over_plane(scene, |place| {
            let cosine = (scene.camera.position - place).normalize().y.abs();
            expected(cosine.into())[channel] as f32
        })
    };
    let expected = DVec3::from_array([0, 1, 2].map(of));
    eprintln!("{name}: {mean:.4}, expected {expected:.4}");
    let off = (mean - expected).abs() - tolerance * expected;
    assert!(off.max_element() < 1e-5, "{name}: {mean}, not {expected}");
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
        assert_mean(&scene, settings(sampler, depth), 4, expected);
    }
    // Walls that let half of the light out shine and reflect half as much.
    scene.materials[0].surface.opacity.factor = 0.5;
    assert_mean(&scene, settings(Sampler::Mis, 1), 8, 0.5 * (2.0 + 0.5 * 0.5 * 2.0));
    scene.materials[0].surface.opacity.factor = 1.0;
    // The box emits inward through the back of its triangles.
    scene.materials[0].surface.emission.as_mut().unwrap().two_sided = false;
    let mean = mean(&scene, settings(Sampler::Mis, 3));
    // Rounding lets a point of the same wall shine at a grazing angle.
    assert!(mean < 1e-6, "{mean}");
}

/// A sphere that glows inside, white above and black below: from everywhere a path meets either by the same
/// chance, as long as each bounce draws numbers of its own.
#[test]
fn bounces_in_a_sphere_forget_where_they_come_from() {
    let _alone = support::alone();
    let emission = Emission { radiance: Vec3::ONE, texture: None, two_sided: true };
    let mut scene = scenes::convex_furnace(scenes::diffuse(Vec3::ONE), Vec3::ZERO);
    scene.materials.push(scenes::diffuse(Vec3::ZERO));
    for material in &mut scene.materials {
        material.surface.emission = Some(emission.clone());
    }
    scene.name = "glowing sphere".into();
    scene.geometry = Geometry::default();
    scenes::add_sphere(&mut scene.geometry, Vec3::ZERO, 1.0, 12, 0);
    let half = scene.geometry.materials.len() / 2;
    scene.geometry.materials[half..].fill(1);
    (scene.camera.position, scene.camera.look_at) =
        (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.5, 1.0, 0.4));
    assert_mean(&scene, settings(Sampler::Mis, 3), 8, 2.0 + 0.5 + 0.25);
}

#[test]
fn lamps_without_a_surface_light_a_plane() {
    let _alone = support::alone();
    let position = Vec3::new(1.5, 3.0, 0.0);
    let intensity = Vec3::splat(40.0);
    let down = Vec3::NEG_Y;
    let lit_by = |kind| {
        let mut scene = scenes::plane(Vec3::splat(0.5), black());
        if !matches!(kind, LampKind::Directional { .. }) {
            // Rays end at the lamp. The ceiling behind it is beside the camera's view.
            scenes::add_box(&mut scene.geometry, position + 0.1 * Vec3::Y, Vec3::splat(0.1), 0);
        }
        scenes::add_lamp(&mut scene, kind);
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
    // Five centimetres above the middle of the view.
    let mut near = scenes::plane(Vec3::splat(0.5), black());
    near.camera.vertical_fov_deg = 0.02;
    let above = Vec3::new(0.0, 0.05, 0.0);
    scenes::add_lamp(&mut near, LampKind::Point { position: above, intensity });
    let ratio =
        mean(&near, settings(Sampler::Mis, 1)) / (40.0 / 0.05_f64.powi(2) * 0.5 / f64::from(PI));
    assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
    for falloff in [SpotFalloff::SquaredCosine, SpotFalloff::SmoothCosine, SpotFalloff::LinearAngle]
    {
        let (inner, outer) = (0.1_f32, 0.4_f32);
        let spot = lit_by(LampKind::Spot(Spot {
            position,
            direction: down,
            intensity,
            inner_angle_rad: inner,
            outer_angle_rad: outer,
            falloff,
        }));
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
        scenes::add_lamp(&mut scene, LampKind::Directional { direction: Vec3::NEG_Y, irradiance });
    }
    assert_mean(&scene, settings(Sampler::Mis, 1), 128, 4.0 * 0.5 / f64::from(PI));
    // More lamps than candidates, so that the number that draws one of them tells its colour.
    scene.lamps.clear();
    for irradiance in [Vec3::X, 0.2972 * Vec3::Y].repeat(8) {
        scenes::add_lamp(&mut scene, LampKind::Directional { direction: Vec3::NEG_Y, irradiance });
    }
    assert_mean(&scene, settings(Sampler::Mis, 1), 64, 8.0 * 0.5 / f64::from(PI));
}

#[test]
fn mirrors_and_glass_lose_nothing_in_a_furnace() {
    let _alone = support::alone();
    let mirror = MaterialKind::Mirror { reflectance: Vec3::ONE };
    let solid = MaterialKind::glass(1.5, 0.0);
    for (kind, depth) in [(mirror, 1), (glass(Vec3::ONE), 12), (solid, 24)] {
        let scene = scenes::convex_furnace(Material::new("specular", kind), Vec3::splat(2.0));
        for sampler in [Sampler::Mis, Sampler::Guided] {
            let mean = mean(&scene, settings(sampler, depth));
            eprintln!("{:?}: {mean}", scene.materials[0].kind);
            assert!((mean - 2.0).abs() < 0.01, "{:?}: {mean}", scene.materials[0].kind);
        }
    }
}

/// Reflectance of glass of index 1.5 at a cosine outside.
fn reflectance_of_glass(cosine: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).sqrt() / 1.5;
    let inside = (1.0 - sine * sine).sqrt();
    let parallel = (1.5 * cosine - inside) / (1.5 * cosine + inside);
    let perpendicular = (cosine - 1.5 * inside) / (cosine + 1.5 * inside);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Share of light that a pane of index 1.5 lets through at a cosine: T² Σ R²ⁿ for each polarisation
/// would differ; panes take the mean reflectance of one side, as scene formats do.
fn pane_transmittance(cosine: f64) -> f64 {
    let side = reflectance_of_glass(cosine);
    1.0 - 2.0 * side / (1.0 + side)
}

/// Texture coordinates of a square.
const UVS: [[f32; 2]; 4] = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];

fn white_texel() -> TextureUse {
    let texels = Texels::Bytes(vec![[255; 4]]);
    TextureUse::new(Arc::new(Texture { name: "w".into(), width: 1, height: 1, texels }))
}

/// Glass whose light that goes through is tinted by a texture and by its factor.
fn tinted_by_texture(mut glass: Material, tint: Vec3) -> Material {
    match &mut glass.kind {
        MaterialKind::Dielectric { transmittance, .. }
        | MaterialKind::ThinDielectric { transmittance, .. } => *transmittance = Vec3::splat(0.8),
        kind => unreachable!("{kind:?}"),
    }
    glass.surface.color = Some(TextureUse { scale: (1.25 * tint).to_array(), ..white_texel() });
    glass
}

#[test]
fn panes_reflect_and_pass_their_tints_and_emit_all_of_their_light() {
    let _alone = support::alone();
    let [reflectance, transmittance] = [Vec3::new(0.9, 0.7, 0.5), Vec3::new(0.3, 0.8, 0.6)];
    let pane = MaterialKind::ThinDielectric { ior: 1.5, alpha: 0.0, reflectance, transmittance };
    let mut scene = between_sky_and_ground(pane);
    for (opacity, tint) in [(1.0, "material"), (0.6, "texture"), (0.8, "vertices")] {
        if tint == "texture" {
            scene.materials[0] = tinted_by_texture(scene.materials[0].clone(), transmittance);
            let radiance = Vec3::new(0.5, 1.0, 0.25);
            let emission = Emission { radiance, texture: None, two_sided: true };
            scene.materials[0].surface.emission = Some(emission);
            // The second coordinates lie on the white texel, the first on a black one.
            scene.geometry.uvs = [0.25, 0.75].map(|u| vec![[u, 0.5]; UVS.len()]);
            if let Some(used) = &mut scene.materials[0].surface.color {
                let texels = Texels::Bytes(vec![[0, 0, 0, 255], [255; 4]]);
                let texture = Texture { name: "two".into(), width: 2, height: 1, texels };
                (used.texture, used.uv_set) = (Arc::new(texture), 1);
            }
        } else if tint == "vertices" {
            let surface = &mut scene.materials[0].surface;
            (surface.color, surface.vertex_color) = (None, true);
            scene.geometry.colors = vec![(1.25 * transmittance).extend(1.0).to_array(); UVS.len()];
        }
        scene.materials[0].surface.opacity.factor = opacity;
        let light = scene.materials[0].surface.emission.as_ref();
        let light = light.map_or(Vec3::ZERO, |own| own.radiance).as_dvec3();
        let opacity = f64::from(opacity);
        assert_channels(&format!("opacity {opacity}"), &scene, 512, 0.03, |cosine| {
            let passed = pane_transmittance(cosine) * opacity;
            (opacity - passed) * (reflectance * SKY).as_dvec3()
                + (passed * transmittance.as_dvec3() + (1.0 - opacity)) * GROUND.as_dvec3()
                + opacity * light
        });
    }
}

/// A sheet shows the mean light of either side by a share each, from above and from below, whatever the
/// sampler.
#[test]
fn sheets_scatter_light_through() {
    let _alone = support::alone();
    let [reflectance, transmittance] = [Vec3::new(0.1, 0.6, 0.3), Vec3::new(0.7, 0.2, 0.1)];
    let sheet = MaterialKind::DiffuseTransmission { reflectance, transmittance };
    let mut scene = between_sky_and_ground(sheet);
    // Light of both sides that the samplers tell apart by its luminance as well.
    let [above, below] = [2.0 * SKY, 0.5 * GROUND];
    scene.environment = scenes::environment(64, |to| if to.y > 0.0 { above } else { below });
    let texels = Texels::Bytes(vec![[128, 128, 255, 255]]);
    let flat = Texture { name: "n".into(), width: 1, height: 1, texels };
    let flat = TextureUse { encoding: Encoding::Linear, ..TextureUse::new(Arc::new(flat)) };
    for is_textured in [false, true] {
        if is_textured {
            let half = TextureUse { scale: [0.5; 3], ..white_texel() };
            scene.materials[0].surface.color = Some(half);
            scene.materials[0].surface.normal = Some(flat.clone());
            scene.geometry.uvs[0] = UVS.to_vec();
        }
        let share = if is_textured { 0.5 } else { 1.0 };
        let few = [Sampler::Mis, Sampler::Guided];
        for sampler in if is_textured { &few } else { Sampler::ALL } {
            for (near, far) in [(above, below), (below, above)] {
                let expected = share * (reflectance * near + transmittance * far).as_dvec3();
                let [mean, error] = mean_and_error(&scene, &settings(*sampler, 2), 8, 6);
                eprintln!("{}: {mean:.4} ± {error:.4}, {expected:.4}", sampler.name());
                let off = (mean - expected).abs() - 6.0 * error - 2e-3 * expected;
                assert!(off.max_element() < 0.0, "{}: {mean}, not {expected}", sampler.name());
                scene.camera.position.y *= -1.0;
            }
        }
    }
}

/// No sheet of a box loses light, whichever side paths take at each, and whether pixels share paths or not.
#[test]
fn sheets_lose_nothing_in_a_furnace() {
    let _alone = support::alone();
    let reflectance = Vec3::new(0.2, 0.4, 0.7);
    let transmittance = Vec3::ONE - reflectance;
    let sheet = MaterialKind::DiffuseTransmission { reflectance, transmittance };
    let scene = scenes::convex_furnace(Material::new("sheet", sheet), Vec3::splat(2.0));
    for (sampler, shared) in [(Sampler::Mis, "off"), (Sampler::Guided, "4")] {
        let mut settings = settings(sampler, 40);
        settings.parameters.set(&format!("share-paths={shared}")).unwrap();
        let [mean, error] = mean_and_error(&scene, &settings, 32, 8);
        eprintln!("{}: {mean} ± {error}", sampler.name());
        let off = (mean - 2.0).abs() - 6.0 * error;
        assert!(off.max_element() < 2e-3, "{}: {mean} ± {error}", sampler.name());
        assert!(error.max_element() < 0.01, "{}: too noisy to judge", sampler.name());
    }
}

/// The inside of glass lies behind its triangles: from there all light is reflected at this angle.
#[test]
fn glass_has_its_inside_at_the_back() {
    let _alone = support::alone();
    let mut scene = between_sky_and_ground(MaterialKind::glass(1.5, 0.0));
    let [sky, ground] = [SKY, GROUND].map(|light| light.as_dvec3());
    assert_channels("from outside", &scene, 512, 0.04, |cosine| {
        let reflected = reflectance_of_glass(cosine);
        reflected * sky + (1.0 - reflected) / 2.25 * ground
    });
    scene.camera.position.y *= -1.0;
    assert_channels("from inside", &scene, 1, 1e-4, |_| ground);
    let tint = Vec3::new(0.3, 0.8, 0.6);
    scene.materials[0] = tinted_by_texture(scene.materials[0].clone(), tint);
    scene.geometry.uvs[0] = UVS.to_vec();
    scene.camera.position.y *= -1.0;
    assert_channels("tinted", &scene, 512, 0.04, |cosine| {
        let reflected = reflectance_of_glass(cosine);
        reflected * sky + (1.0 - reflected) / 2.25 * tint.as_dvec3() * ground
    });
}

/// A slab of glass in light that is the same from everywhere: each way through it, at the refracted angle,
/// keeps exp(−absorption · length), and between its sides light is reflected without end.
#[test]
fn slabs_absorb_along_the_way() {
    let _alone = support::alone();
    let absorption = Vec3::new(2.0, 0.0, 0.5);
    let mut glass = MaterialKind::glass(1.5, 0.0);
    if let MaterialKind::Dielectric { absorption: own, .. } = &mut glass {
        *own = absorption;
    }
    let mut scene = between_sky_and_ground(glass);
    scene.environment = scenes::environment(16, |_| Vec3::ONE);
    let thickness = 0.3;
    scenes::add_square(&mut scene.geometry, Vec3::new(0.0, -thickness, 0.0), 5.0, 0);
    scene.geometry.triangles[2..].iter_mut().for_each(|triangle| triangle.swap(1, 2));
    let length = |cosine: f64| f64::from(thickness) / (1.0 - (1.0 - cosine * cosine) / 2.25).sqrt();
    assert_channels_at("slab", &scene, 20, 1024, 0.01, |cosine| {
        let reflected = reflectance_of_glass(cosine);
        let kept = (-length(cosine) * absorption.as_dvec3()).exp();
        let inside = (1.0 - reflected) * kept / (1.0 - reflected * kept);
        reflected + (1.0 - reflected) * inside
    });
}

/// A bent normal would have a mirror reflect what lies below it, and a sheet be lit from there by shadow
/// rays, by bounces and by a lamp.
#[test]
fn bent_normals_let_no_light_through() {
    let _alone = support::alone();
    let mut scene = between_sky_and_ground(MaterialKind::Mirror { reflectance: Vec3::ONE });
    assert_channels("flat", &scene, 1, 1e-4, |_| SKY.as_dvec3());
    // 15° away from the viewer, who looks along 21° above the surface.
    let (sine, cosine) = 15_f32.to_radians().sin_cos();
    scene.geometry.normals.fill([0.0, cosine, -sine]);
    assert_channels("bent", &scene, 1, 1e-4, |_| DVec3::ZERO);
    // A pane reflects what it does not let through, both by its triangles.
    let mut pane = scene.clone();
    pane.materials[0] = Material::new("pane", glass(Vec3::ONE));
    pane.geometry.normals.fill([0.0, cosine, sine]);
    pane.environment = scenes::environment(64, |_| Vec3::ONE);
    assert_channels("pane", &pane, 1, 1e-4, |_| DVec3::ONE);
    scene.materials[0] = scenes::diffuse(Vec3::ONE);
    scene.geometry.normals.fill([0.64, 0.77, 0.0]);
    scene.environment = scenes::environment(64, |to| if to.y > -0.2 { SKY } else { GROUND });
    scenes::add_point(&mut scene, Vec3::new(6.0, -2.0, 0.0), Vec3::Y);
    let mean = film_mean(&support::render(&scene, settings(Sampler::Mis, 2), 16).0);
    assert!(mean.y == 0.0 && mean.x > 0.1, "{mean}");
}

/// Light leaves a lamp by its triangles, whatever normals are interpolated over them.
#[test]
fn the_normals_of_a_lamp_do_not_matter() {
    let _alone = support::alone();
    let mut lamp = scenes::diffuse(Vec3::ZERO);
    let emission = Emission { radiance: Vec3::splat(9.0), texture: None, two_sided: false };
    lamp.surface.emission = Some(emission);
    let mut scene = scenes::plane(Vec3::splat(0.5), black());
    scene.materials.push(lamp);
    scenes::add_sphere(&mut scene.geometry, Vec3::new(1.0, 1.0, 0.0), 0.5, 3, 1);
    let round = support::render(&scene, settings(Sampler::Mis, 2), 16).0;
    scene.geometry.normals.fill([0.0; 3]);
    let flat = support::render(&scene, settings(Sampler::Mis, 2), 16).0;
    assert!(round.sum == flat.sum);
    assert!(round.sum.iter().any(|sum| sum[0] > 0.0));
}

/// A glowing square whose second coordinates lie on the green texel, and the first on the red one. Then one
/// that lights the floor beside it, red on one side and green on the other, and with a hole in half of both.
#[test]
fn emission_takes_the_coordinates_that_its_texture_names() {
    let _alone = support::alone();
    let used = |uv_set, texels: [[u8; 4]; 2]| TextureUse {
        uv_set,
        interpolation: Interpolation::Nearest,
        ..TextureUse::new(Arc::new(Texture {
            name: "lamp".into(),
            width: 2,
            height: 1,
            texels: Texels::Bytes(texels.to_vec()),
        }))
    };
    let texture = Some(used(1, [[255, 0, 0, 255], [0, 255, 0, 255]]));
    let mut scene = between_sky_and_ground(MaterialKind::Diffuse { reflectance: Vec3::ZERO });
    let emission = Emission { radiance: Vec3::ONE, texture, two_sided: false };
    scene.materials[0].surface.emission = Some(emission);
    scene.geometry.uvs = [0.25, 0.75].map(|u| vec![[u, 0.5]; 4]);
    assert_channels("green", &scene, 1, 1e-4, |_| DVec3::Y);

    let mut lamp = scene.materials.remove(0);
    lamp.surface.opacity.texture = Some(used(0, [[0, 0, 0, 255], [255; 4]]));
    let mut scene = scenes::plane(Vec3::splat(0.5), black());
    scene.camera.vertical_fov_deg = 0.1;
    scene.materials.push(lamp);
    scenes::add_square(&mut scene.geometry, Vec3::new(0.9, 0.8, 0.3), 0.6, 1);
    // It shines downward. A corner more: its three triangles are drawn by unlike chances.
    let first = scene.geometry.positions.len() as u32 - 4;
    scene.geometry.positions.push([0.3, 0.8, 0.6]);
    scene.geometry.normals.push([0.0; 3]);
    let fan = [[0, 3, 4], [4, 2, 1], [4, 3, 2]].map(|corners| corners.map(|corner| first + corner));
    scene.geometry.triangles.splice(12.., fan);
    scene.geometry.materials.push(1);
    // The first coordinates go along z, the second ones along x.
    let along = |axis: usize, first: f32| {
        let at = |place: &[f32; 3]| [(place[axis] - first) / 1.2, 0.5];
        scene.geometry.positions.iter().map(at).collect()
    };
    scene.geometry.uvs = [along(2, -0.3), along(0, 0.3)];
    let cells = 200;
    let expected = [0.3, 0.9].map(|first| {
        let cell = |index: i32| {
            let at = |step: i32| 0.6 * (f64::from(step) + 0.5) / f64::from(cells);
            let to_lamp = DVec3::new(first + at(index % cells), 0.8, at(index / cells) + 0.3);
            let cosine = to_lamp.normalize().y;
            cosine * cosine / to_lamp.length_squared()
        };
        let sum: f64 = (0..cells * cells).map(cell).sum();
        sum * (0.6 / f64::from(cells)).powi(2) * 0.5 / f64::from(PI)
    });
    for sampler in [Sampler::Mis, Sampler::Guided] {
        let [mean, error] = mean_and_error(&scene, &settings(sampler, 1), 32, 8);
        eprintln!("{}: {mean:.5} ± {error:.5}, expected {expected:.5?}", sampler.name());
        for (channel, expected) in expected.into_iter().enumerate() {
            assert!(error[channel] < 0.01 * expected, "too noisy to judge");
            let off = (mean[channel] - expected).abs();
            assert!(off < 6.0 * error[channel] + 1e-3 * expected, "{mean}, not {expected}");
        }
    }
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
    // Light passes by its red, although all of its green is stopped.
    let pane = Material::new("pane", glass(Vec3::new(0.7, 0.0, 0.7)));
    let scene = sheltered_plane(pane, sky());
    for sampler in [Sampler::Mis, Sampler::Cosine, Sampler::Guided, Sampler::Visibility] {
        assert_mean(&scene, settings(sampler, 1), 16, 0.5 * 0.7 * through);
    }
    let mut sheet = scenes::diffuse(Vec3::ZERO);
    sheet.surface.opacity.factor = 0.25;
    let mut scene = sheltered_plane(sheet, sky());
    assert_mean(&scene, settings(Sampler::Mis, 1), 16, 0.5 * 0.75);
    // Seen from above, the sheet dims the camera's rays too.
    scene.camera.position.y = 20.0;
    assert_mean(&scene, settings(Sampler::Mis, 1), 64, 0.75 * 0.5 * 0.75);
    scene.materials[1].surface.opacity.cutoff = Some(0.5);
    assert_mean(&scene, settings(Sampler::Mis, 1), 16, 0.5);
    scene.materials[1].surface.opacity.cutoff = Some(0.1);
    let mean = mean(&scene, settings(Sampler::Mis, 1));
    assert!(mean == 0.0, "{mean}");
}

#[test]
fn the_back_of_a_one_sided_surface_is_black() {
    let _alone = support::alone();
    let mut scene = scenes::convex_furnace(scenes::diffuse(Vec3::splat(0.5)), Vec3::ONE);
    scene.camera.position = Vec3::new(0.1, 0.2, 0.3);
    scene.materials[0].surface.two_sided = false;
    scenes::add_point(&mut scene, Vec3::ZERO, Vec3::ONE);
    let dark = mean(&scene, settings(Sampler::Mis, 2));
    assert!(dark == 0.0, "{dark}");
    scene.materials[0].surface.two_sided = true;
    let lit = mean(&scene, settings(Sampler::Mis, 2));
    assert!(lit > 0.1, "{lit}");
    // It keeps both sides beside one that has not, outside.
    let mut other = scenes::diffuse(Vec3::ONE);
    other.surface.two_sided = false;
    scene.materials.push(other);
    scenes::add_box(&mut scene.geometry, Vec3::new(0.8, 0.0, 0.0), Vec3::splat(0.1), 1);
    let beside = mean(&scene, settings(Sampler::Mis, 2));
    assert!((beside - lit).abs() < 1e-3 * lit, "{beside}, not {lit}");
    // So is that of a mirror, whose front reflects all.
    let mirror = Material::new("mirror", MaterialKind::Mirror { reflectance: Vec3::ONE });
    let mut scene = scenes::convex_furnace(mirror, Vec3::ONE);
    scene.materials[0].surface.two_sided = false;
    let front = mean(&scene, settings(Sampler::Mis, 2));
    scene.geometry.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    let back = mean(&scene, settings(Sampler::Mis, 2));
    assert!((front - 1.0).abs() < 1e-3 && back < 0.9, "{front} and {back}");
}

/// Lamps are near the floor's middle or far from it, and light it by way of a green ceiling too: lamps that
/// one vertex of a path draws tell nothing of those that the next one draws.
#[test]
fn every_vertex_draws_lamps_of_its_own() {
    const SAMPLES: usize = 32;
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::splat(0.5), scenes::environment(16, |_| Vec3::ZERO));
    scene.film.filter = Filter::Box;
    scene.materials.push(scenes::diffuse(Vec3::new(0.0, 0.8, 0.0)));
    scenes::add_box(&mut scene.geometry, Vec3::new(0.0, 6.5, 0.0), Vec3::new(100.0, 1.0, 100.0), 1);
    for x in [-0.3, -0.1, 0.1, 0.3] {
        scenes::add_point(&mut scene, Vec3::new(x, 2.5, 0.2), Vec3::splat(9.0));
        scenes::add_point(&mut scene, Vec3::new(100.0 * x, 2.5, 30.0), Vec3::splat(9.0));
    }
    let settings = Settings { depth: 2, shadow_rays: 1, ..Settings::default() };
    let mut renderer = support::renderer(&scene, settings);
    let pixels = 0..(scene.film.width * scene.film.height) as usize;
    let mut before = vec![[0.0; 3]; pixels.len()];
    let mut light: Vec<Vec<[f64; 2]>> = vec![Vec::new(); pixels.len()];
    for _ in 0..SAMPLES {
        renderer.render_pass(1).unwrap();
        let sums = renderer.sums().unwrap();
        for pixel in pixels.clone() {
            let now = sums.total(pixel);
            let [red, green] = [0, 1].map(|channel| now[channel] - before[pixel][channel]);
            light[pixel].push([red, green - red]);
            before[pixel] = now;
        }
    }
    let (mut squares, mut product) = ([0.0; 2], 0.0);
    for of_pixel in &light {
        let mean = |vertex: usize| {
            of_pixel.iter().map(|values| values[vertex]).sum::<f64>() / SAMPLES as f64
        };
        let means = [mean(0), mean(1)];
        for values in of_pixel {
            let [first, second] = [0, 1].map(|vertex| values[vertex] - means[vertex]);
            squares = [squares[0] + first * first, squares[1] + second * second];
            product += first * second;
        }
    }
    let correlation = product / (squares[0] * squares[1]).sqrt();
    assert!(squares.iter().all(|sum| *sum > 0.0) && correlation.abs() < 0.1, "{correlation}");
}
