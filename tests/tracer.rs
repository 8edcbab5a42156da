//! Device and host as tracers: the same hits on the shipped scenes, the same pictures, and their choice.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::path::Path;

use fenestra::{
    accel::Accel,
    film::Attribute,
    gpu::{Device, Tracer},
    pass::Schedule,
    scene::{
        Scene,
        material::{Material, MaterialKind},
    },
    session::{Renderer, Settings},
    shader::structs::{Hit, Ray},
};
use glam::{DVec3, Vec3};

use crate::support::{
    self,
    command::{BALL, Folder, Run, program, yard},
    random::Random,
    rays::{ONE_PAGE, OnDevice, REFILLING, random_shadow_rays, ray},
    scenes,
};

const SCENES: [&str; 5] = ["bathroom", "courtyard", "meeting_room", "reading_room", "restroom"];

fn shipped(name: &str) -> Scene {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    Scene::load(&folder.join(format!("{name}.toml"))).unwrap()
}

/// Smallest barycentric coordinate, by its size, of the point where a ray meets the plane of a triangle.
fn distance_from_edge(accel: &Accel, triangle: u32, ray: &Ray) -> f64 {
    let [a, b, c] = accel
        .triangle(triangle)
        .vertices
        .map(|vertex| Vec3::from(vertex.position).as_dvec3() - Vec3::from(ray.origin).as_dvec3());
    let direction = Vec3::from(ray.direction).as_dvec3();
    let areas: [f64; 3] =
        [(b, c), (c, a), (a, b)].map(|(p, q): (DVec3, DVec3)| p.cross(q).dot(direction));
    let area: f64 = areas.iter().sum();
    areas.iter().map(|share| (share / area).abs()).fold(f64::INFINITY, f64::min)
}

/// Tests whether rounding decides which of two hits of a ray is the closer one, or whether there is any.
fn is_tie(accel: &Accel, ray: &Ray, hits: [&Hit; 2]) -> bool {
    let [one, other] = hits.map(|hit| hit.distance);
    let near_edge = hits
        .iter()
        .filter(|hit| hit.distance >= 0.0)
        .any(|hit| distance_from_edge(accel, hit.triangle, ray) < 1e-5);
    // Coplanar surfaces are as far as rounding of the scene's coordinates tells.
    let rounding = 1e-5 * one.max(other) + accel.ray_offset();
    (one >= 0.0 && other >= 0.0 && (one - other).abs() <= rounding) || near_edge
}

#[test]
fn host_and_device_find_the_same_on_shipped_scenes() {
    for name in SCENES {
        let scene = shipped(name);
        let accel = Accel::build(&scene.geometry, ONE_PAGE).unwrap();
        let tracers = OnDevice::both(&accel);
        let [(_, device), (_, host)] = &tracers[..] else { return };
        let mut random = Random(7);
        let mut rays: Vec<Ray> = (0..20_000)
            .map(|_| ray(scene.camera.position, random.direction_from_point()))
            .collect();
        for generation in ["camera", "bounce"] {
            let (ours, theirs) = (device.trace(&rays, REFILLING), host.trace(&rays, REFILLING));
            assert_eq!(
                theirs,
                host.trace(&rays, Schedule::SINGLE),
                "{name}: answers depend on the schedule"
            );
            let mut ties = 0;
            for (ray, hits) in rays.iter().zip(ours.iter().zip(&theirs)) {
                if hits.0.triangle != hits.1.triangle {
                    ties += 1;
                    assert!(
                        is_tie(&accel, ray, [hits.0, hits.1]),
                        "{name}, {generation}: {ray:?}, {hits:?}"
                    );
                } else {
                    assert_eq!(hits.0, hits.1, "{name}, {generation}: {ray:?}");
                }
            }
            eprintln!("{name}, {generation}: {ties} of {} rays are ties", rays.len());
            // Coplanar surfaces of the scenes make more than edges do.
            assert!(100 * ties < rays.len(), "{name}, {generation}: {ties} ties");
            let hits: Vec<Hit> = ours.into_iter().filter(|hit| hit.distance >= 0.0).collect();
            let directions = random_shadow_rays(2 * hits.len(), &mut random);
            let hits: Vec<Hit> = hits.iter().map(|hit| Hit { material: 0, ..*hit }).collect();
            let visible = [device, host].map(|tracer| tracer.shadow(&hits, &directions, REFILLING));
            let different = visible[0].iter().zip(&visible[1]).filter(|(one, other)| one != other);
            assert!(
                1000 * different.count() < directions.len(),
                "{name}, {generation}: shadow rays"
            );
            rays = hits
                .iter()
                .zip(&directions)
                .map(|(hit, towards)| {
                    let direction = Vec3::from(towards.direction);
                    let [position, normal] = [hit.position, hit.geometric_normal].map(Vec3::from);
                    ray(accel.offset_ray_origin(position, normal, direction), direction)
                })
                .collect();
        }
    }
}

/// Pixels of a picture by a tracer, the same seed for both.
fn picture(scene: &Scene, tracer: Tracer) -> Option<Vec<[f32; 3]>> {
    let device = Device::open_traced(None, true, tracer).ok()?;
    let settings = Settings { depth: 4, shadow_rays: 2, ..Settings::default() };
    let mut renderer = Renderer::new(&device, scene, settings).unwrap();
    renderer.render_pass(16).unwrap();
    assert_eq!(device.validation_messages(), Vec::<String>::new());
    Some(renderer.sums().unwrap().sum.clone())
}

/// Cut-out leaves, panes, solid glass and textures: the same chances at surfaces that let light pass. Before
/// them, a pane with holes, by its vertices too, that fills the picture; after them, rough glass by a lamp
/// and a sphere of panes that stop all of the green.
#[test]
fn host_and_device_draw_the_same_picture() {
    let kind = MaterialKind::pane(1.5, Vec3::ONE);
    let rough = MaterialKind::glass(1.5, 0.3);
    let mut pane = Material::new("pane", kind);
    pane.surface.opacity.factor = 0.8;
    pane.surface.vertex_color = true;
    let mut holes = scenes::plane(Vec3::ONE, scenes::sky());
    holes.materials = vec![pane];
    holes.geometry.colors = vec![[1.0, 1.0, 1.0, 0.75]; holes.geometry.positions.len()];
    assert_same_pictures(&holes);
    let mut scene = shipped("reading_room");
    (scene.film.width, scene.film.height) = (64, 48);
    let color = scene.materials.iter().find_map(|material| material.surface.color.clone());
    let is_pane =
        |material: &&mut Material| matches!(material.kind, MaterialKind::ThinDielectric { .. });
    let panes = scene.materials.iter_mut().filter(is_pane);
    let tinted = panes.map(|material| material.surface.color = color.clone()).count();
    assert!(tinted > 0 && color.is_some());
    assert_same_pictures(&scene);
    let magenta = Material::new("magenta", MaterialKind::pane(1.5, Vec3::new(0.9, 0.0, 0.9)));
    let rough = Material::new("glass", rough);
    let mut glass = scenes::room(vec![scenes::diffuse(Vec3::ONE), rough, magenta]);
    scenes::add_point(&mut glass, Vec3::new(0.5, 1.5, 0.5), Vec3::ONE);
    assert_same_pictures(&glass);
}

fn assert_same_pictures(scene: &Scene) {
    let Some(host) = picture(scene, Tracer::Host) else {
        eprintln!("not tested: there is no library by which the host traces (./setup)");
        return;
    };
    let device = picture(scene, Tracer::Device).unwrap();
    let sum = |pixels: &[[f32; 3]]| pixels.iter().flatten().map(|x| f64::from(*x)).sum::<f64>();
    let ratio = sum(&host) / sum(&device);
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    // The random numbers are the same, so most pixels are.
    let is_same = |(one, other): &(&[f32; 3], &[f32; 3])| {
        one.iter().zip(*other).all(|(x, y)| (x - y).abs() <= 1e-3 * x.abs().max(y.abs()))
    };
    let same = host.iter().zip(&device).filter(is_same).count();
    assert!(same * 10 > host.len() * 9, "{same} of {} pixels are the same", host.len());
    assert_eq!(host, picture(scene, Tracer::Host).unwrap(), "the same seed gives the same bits");
}

fn tracer_of(folder: &Folder) -> String {
    match &folder.image("yard.exr").attributes["fenestra.tracer"] {
        Attribute::Text(text) => text.clone(),
        other => panic!("expected text, found {other:?}"),
    }
}

#[test]
fn the_tracer_is_a_choice() {
    let folder = Folder::new();
    let clay = r#"type = "diffuse"
reflectance = [0.5, 0.5, 0.5]"#;
    folder.write("yard.toml", yard([16, 12], "constant = [1, 1, 1]", clay, BALL));
    let render = |tracer: &str, library: &str| {
        let mut command = program(folder.path());
        command.args(["render", "yard.toml", "--spp", "1", "--tracer", tracer]);
        command.args(["-o", "yard.exr"]).env("FENESTRA_EMBREE", library);
        Run::of(&command.output().unwrap())
    };
    for (tracer, library) in [("auto", "/nonexistent"), ("device", "")] {
        render(tracer, library).assert(0, &[]);
        assert_eq!(tracer_of(&folder), "device");
    }
    let run = render("host", "");
    if !support::is_software() {
        run.assert(75, &["does not share its memory with the host", "take --tracer device"]);
        return;
    }
    folder.write("libnothing.so", "");
    render("host", "/nonexistent").assert(
        75,
        &["tracing on the host needs the library Embree", "/nonexistent", "help: ", "./setup"],
    );
    render("host", "libnothing.so").assert(75, &["libnothing.so", "help: "]);
    if run.status == Some(0) {
        assert!(tracer_of(&folder).starts_with("Embree "), "{}", tracer_of(&folder));
        run.assert(0, &["rays by Embree "]);
    } else {
        run.assert(75, &["tracing on the host needs the library Embree"]);
    }
}
