//! Light that is sampled at rough glass, against sums over the twin: lamps, the environment and both, from
//! outside and from inside.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use fenestra::{
    brdf::MaterialTables,
    sampler::Sampler,
    scene::{
        Geometry, Scene,
        lamp::LampKind,
        material::{Emission, Material, MaterialKind},
    },
    session::Settings,
    shader::structs,
};
use glam::{DVec3, Vec3, vec3};
use rayon::prelude::*;

use crate::{
    support::{self, materials::uniform, replicates::mean_and_error, scenes},
    twin::specular::{dielectric_evaluate_and_pdf, inside_transmittance, scatter},
};

/// Where the camera is, above the surface or below it, metres; it looks at the origin.
const VIEWER: Vec3 = vec3(0.0, 3.0, 4.0);

/// Boundary of a solid, and a pane.
fn kinds() -> [MaterialKind; 2] {
    let (ior, alpha) = (1.5, 0.3);
    let [reflectance, transmittance] = [vec3(0.5, 1.0, 0.7), vec3(1.0, 0.6, 0.8)];
    let absorption = vec3(0.1, 0.0, 0.05);
    [
        MaterialKind::Dielectric { ior, alpha, reflectance, transmittance, absorption },
        MaterialKind::ThinDielectric { ior, alpha, reflectance, transmittance },
    ]
}

/// Square of glass at y = 0 whose front is above.
fn sheet(glass: MaterialKind, environment: impl Fn(Vec3) -> Vec3) -> Scene {
    let mut scene = scenes::plane(Vec3::ZERO, scenes::environment(64, environment));
    scene.materials = vec![Material::new("glass", glass)];
    scene.geometry = Geometry::default();
    scenes::add_square(&mut scene.geometry, Vec3::ZERO, 5.0, 0);
    scene.camera.vertical_fov_deg = 0.01;
    scene
}

/// Checks the film's mean, seen from above and below, by samplers whose bounces meet the environment alone,
/// beside compensated rays and beside learned ones. `expected` has the material, the outgoing direction, and
/// whether it is at the back.
fn assert_seen(
    name: &str,
    scene: &mut Scene,
    expected: impl Fn(&structs::Material, Vec3, bool) -> DVec3,
) {
    let material = MaterialTables::new(&scene.materials).unwrap().materials[0];
    for is_back in [false, true] {
        scene.camera.position = if is_back { VIEWER * vec3(1.0, -1.0, 1.0) } else { VIEWER };
        let outgoing = local(VIEWER.normalize(), false);
        let inside = inside_transmittance(&material, is_back, VIEWER.length());
        let expected = expected(&material, outgoing, is_back) * inside.as_dvec3();
        for sampler in [Sampler::Cosine, Sampler::Mis, Sampler::Guided] {
            let settings = Settings { sampler, depth: 1, ..Settings::default() };
            let [mean, error] = mean_and_error(scene, &settings, 32, 8);
            let name = format!("{name}, from the back: {is_back}, {}", sampler.name());
            eprintln!("{name}: {mean:.4} ± {error:.4}, expected {expected:.4}");
            let off = (mean - expected).abs() - 6.0 * error - 5e-3 * expected;
            assert!(error.max_element() < 0.02 * expected.max_element(), "{name}: too noisy");
            assert!(off.max_element() < 0.0, "{name}: {mean}, not {expected}");
        }
    }
}

/// Direction in the frame of the side that is seen.
fn local(direction: Vec3, is_back: bool) -> Vec3 {
    vec3(direction.z, direction.x, if is_back { -direction.y } else { direction.y })
}

/// Directional lamps above and below, which no bounce meets.
#[test]
fn rough_glass_shows_lamps_without_size() {
    let _alone = support::alone();
    let towards = [vec3(0.2, 0.8, -0.7).normalize(), vec3(-0.1, -0.9, -0.4).normalize()];
    let irradiance = [vec3(3.0, 1.0, 2.0), vec3(1.0, 2.0, 4.0)];
    for glass in kinds() {
        let mut scene = sheet(glass, |_| Vec3::ZERO);
        for (to_lamp, irradiance) in towards.into_iter().zip(irradiance) {
            scenes::add_lamp(&mut scene, LampKind::Directional { direction: -to_lamp, irradiance });
        }
        assert_seen("lamps", &mut scene, |material, outgoing, is_back| {
            let light = towards.into_iter().zip(irradiance).map(|(to_lamp, irradiance)| {
                let incident = local(to_lamp, is_back);
                let value = dielectric_evaluate_and_pdf(material, outgoing, incident, is_back).0;
                value * incident.z.abs() * irradiance
            });
            light.sum::<Vec3>().as_dvec3()
        });
    }
}

/// An environment with a bright spot, then one without light beside a glowing square, then both.
#[test]
fn rough_glass_shows_light_that_bounces_meet_too() {
    let _alone = support::alone();
    let spot = vec3(0.0, 0.6, -0.8);
    let sky = move |to: Vec3| {
        let bright = if to.dot(spot) > 0.98 { 20.0 } else { 1.0 };
        bright * if to.y > 0.0 { vec3(1.0, 0.5, 0.2) } else { vec3(0.2, 0.5, 1.0) }
    };
    let (height, half, glow) = (-2.0, 1.0, vec3(8.0, 4.0, 6.0));
    let [solid, pane] = kinds();
    for (name, glass, has_sky, has_square) in [
        ("sky", solid.clone(), true, false),
        ("square", solid.clone(), false, true),
        ("both", solid, true, true),
        ("pane", pane, true, true),
    ] {
        let mut scene = sheet(glass, |to| if has_sky { sky(to) } else { Vec3::ZERO });
        let environment = scene.environment.clone();
        if has_square {
            let mut lamp = scenes::diffuse(Vec3::ZERO);
            lamp.surface.emission =
                Some(Emission { radiance: glow, texture: None, two_sided: true });
            scene.materials.push(lamp);
            scenes::add_square(&mut scene.geometry, vec3(0.0, height, 0.0), half, 1);
        }
        assert_seen(name, &mut scene, |material, outgoing, is_back| {
            let light = |incident: Vec3| {
                let to =
                    vec3(incident.y, if is_back { -incident.z } else { incident.z }, incident.x);
                let place = to * (height / to.y);
                let meets = to.y < 0.0 && place.x.abs().max(place.z.abs()) < half;
                if has_square && meets { glow } else { environment.radiance(to) }
            };
            let count = 2_000_000;
            let sum: DVec3 = (0..count)
                .into_par_iter()
                .map(|index| {
                    let found = scatter(material, outgoing, is_back, uniform(index, 31));
                    (found.weight * light(found.direction_local)).as_dvec3()
                })
                .sum();
            sum / f64::from(count)
        });
    }
}
