//! Portals: the rectangle seen from a point against its exact solid angle, by χ² and by its shader twin;
//! the picture against other samplers; the keys of `[[portal]]`.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::{fs, path::Path};

use fenestra::{
    math::random::random_independent_1d,
    sampler::Sampler,
    scene::{Portal, Scene},
    session::Settings,
};
use glam::{DVec2, DVec3, Vec2, Vec3};

use crate::{
    support::{
        self, assert_error, command::Folder, replicates, scenes, statistics::chi_square_p_value,
    },
    twin::{
        random::random_2d,
        spherical_rectangle::{LEAST_UNIFORM_SOLID_ANGLE, SphericalRectangle},
    },
};

/// Chance of a false alarm of one χ² test.
const FALSE_ALARM: f64 = 1e-6;

/// Corner, size: far, near, wide, off the axis, around the axis, nearly edge on, tiny, a slit.
const RECTANGLES: [(Vec3, Vec2); 10] = [
    (Vec3::new(-0.5, -0.5, 1.0), Vec2::new(1.0, 1.0)),
    (Vec3::new(-0.3, -0.4, 0.05), Vec2::new(1.0, 1.0)),
    (Vec3::new(-10.0, -10.0, 0.5), Vec2::new(20.0, 20.0)),
    (Vec3::new(1.0, 0.5, 2.0), Vec2::new(2.0, 1.3)),
    (Vec3::new(-3.0, -2.5, 2.0), Vec2::new(2.0, 1.3)),
    (Vec3::new(0.2, 1.0, 0.1), Vec2::new(1.5, 1.0)),
    (Vec3::new(3.0, 1.0, 5.0), Vec2::new(0.01, 0.01)),
    (Vec3::new(0.5, -0.5, 0.01), Vec2::new(1.0, 1.0)),
    (Vec3::new(-1.0, 0.3, 1.0), Vec2::new(2.0, 0.001)),
    (Vec3::new(0.4, -2.0, -3.0), Vec2::new(1.2, 1.0)),
];

fn seen(corner: Vec3, size: Vec2) -> SphericalRectangle {
    SphericalRectangle::new(corner, [Vec3::X, Vec3::Y], size)
}

/// Solid angle from the axis to a corner, in double precision.
fn corner(at: DVec2, h: f64) -> f64 {
    (at.x * at.y / (h * (at.length_squared() + h * h).sqrt())).atan()
}

/// Exact solid angle between two corners.
fn exact(low: DVec2, high: DVec2, h: f64) -> f64 {
    corner(high, h) - corner(DVec2::new(low.x, high.y), h) - corner(DVec2::new(high.x, low.y), h)
        + corner(low, h)
}

#[test]
fn solid_angles_are_exact() {
    for (from, size) in RECTANGLES {
        let rectangle = seen(from, size);
        let low = from.as_dvec3().truncate();
        let expected = exact(low, low + size.as_dvec2(), f64::from(from.z.abs()));
        let found = f64::from(rectangle.solid_angle);
        // The exact one cancels too: relative to 1e-16 over it.
        let tolerance = 1e-4 * expected + 1e-15;
        assert!((found - expected).abs() < tolerance, "{from} {size}: {found}, not {expected}");
    }
    // In the plane of the rectangle and next to it there is none, nor a number that is not finite.
    for z in [0.0, 1e-6, -1e-4] {
        assert_eq!(seen(Vec3::new(-0.5, -0.5, z), Vec2::ONE).solid_angle, 0.0);
    }
}

#[test]
fn samples_follow_the_density_which_integrates_to_one() {
    const BINS: u32 = 12;
    for (from, size) in RECTANGLES {
        let rectangle = seen(from, size);
        let h = rectangle.distance;
        let mut expected = vec![0.0; (BINS * BINS) as usize];
        for (bin, expected) in expected.iter_mut().enumerate() {
            let step = size.as_dvec2() / f64::from(BINS);
            let place = DVec2::new((bin as u32 % BINS).into(), (bin as u32 / BINS).into());
            let low = from.as_dvec3().truncate() + place * step;
            // A density uniform in solid angle or over the area: one value stands for its kind.
            let middle = (low + 0.5 * step).extend(f64::from(from.z));
            let density = f64::from(rectangle.pdf(middle.normalize().as_vec3()));
            let cosine = f64::from(h) / middle.length();
            *expected = if rectangle.solid_angle >= LEAST_UNIFORM_SOLID_ANGLE {
                density * exact(low, low + step, f64::from(h))
            } else {
                density * cosine / middle.length_squared() * step.x * step.y
            };
        }
        let total: f64 = expected.iter().sum();
        assert!((total - 1.0).abs() < 1e-3, "{from} {size}: the density integrates to {total}");
        let mut observed = vec![0.0; expected.len()];
        for index in 0..40_000 {
            let direction = rectangle.sample(Vec2::from_array(random_2d(3, index, 0, 1)));
            let direction: DVec3 = direction.as_dvec3();
            let at = direction.truncate() * f64::from(from.z) / direction.z;
            let bin = ((at - from.as_dvec3().truncate()) / size.as_dvec2() * f64::from(BINS))
                .clamp(DVec2::ZERO, DVec2::splat(f64::from(BINS) - 0.5));
            observed[(bin.y as u32 * BINS + bin.x as u32) as usize] += 1.0;
        }
        let p = chi_square_p_value(&observed, &expected);
        assert!(p > FALSE_ALARM, "{from} {size}: p {p:e}");
    }
    // Another density is found.
    let rectangle = seen(RECTANGLES[1].0, RECTANGLES[1].1);
    let (mut observed, expected) = (vec![0.0; 4], vec![1.0; 4]);
    for index in 0..1000 {
        let direction = rectangle.sample(Vec2::from_array(random_2d(3, index, 0, 1)));
        observed[usize::from(direction.x > 0.2) + 2 * usize::from(direction.y > 0.1)] += 1.0;
    }
    assert!(chi_square_p_value(&observed, &expected) < FALSE_ALARM);
}

#[test]
fn the_shader_agrees() {
    let _alone = support::alone();
    let number = |index, dimension| random_independent_1d(index, 5, dimension, 2);
    let mut inputs: Vec<[f32; 13]> = Vec::new();
    for index in 0..2000 {
        let (from, size) = RECTANGLES[index as usize % RECTANGLES.len()];
        let mut input = [0.0; 13];
        input[..3].copy_from_slice(&from.to_array());
        input[3..5].copy_from_slice(&size.to_array());
        input[5..7].copy_from_slice(&[number(index, 0), number(index, 1)]);
        // Half of the directions meet the rectangle.
        let along = Vec2::new(number(index, 2), number(index, 3)) * 2.0 - 0.5;
        let at = (from + (along * size).extend(0.0)).normalize();
        input[7..10].copy_from_slice(&at.to_array());
        let normal = [4, 5, 6].map(|dimension| number(index, dimension) - 0.5);
        input[10..].copy_from_slice(&normal);
        inputs.push(input);
    }
    let output: Vec<[f32; 6]> = support::run_probe("spherical_rectangle", &[], &[], &inputs);
    for (input, shader) in inputs.iter().zip(&output) {
        let rectangle = seen(Vec3::from_slice(input), Vec2::from_slice(&input[3..]));
        let direction = rectangle.sample(Vec2::from_slice(&input[5..]));
        let pdf = rectangle.pdf(Vec3::from_slice(&input[7..]));
        let close = |a: f32, b: f32| (a - b).abs() <= 1e-3 * a.abs().max(b.abs());
        assert!(close(shader[0], rectangle.solid_angle), "{input:?}: {shader:?}, {rectangle:?}");
        assert!(close(shader[1], pdf), "{input:?}: density {}, not {pdf}", shader[1]);
        let distance = direction.distance(Vec3::from_slice(&shader[2..]));
        assert!(distance < 1e-3, "{input:?}: {shader:?}, not {direction}");
        // A portal that reaches above a horizon anywhere lights what lies there.
        let corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]].map(|along| {
            let corner = (Vec2::from(along) * Vec2::from_slice(&input[3..])).extend(0.0);
            (Vec3::from_slice(input) + corner).dot(Vec3::from_slice(&input[10..]))
        });
        let above = corners.iter().filter(|height| **height > 0.0).count();
        if corners.iter().all(|height| height.abs() > 1e-5) {
            assert_eq!(shader[5] == 1.0, above == 0, "{input:?}: {corners:?}");
        }
    }
}

fn portal(corner: [f32; 3], first: [f32; 3], second: [f32; 3]) -> Portal {
    let [first, second] = [first, second].map(Vec3::from_array);
    Portal {
        name: String::new(),
        corner: corner.into(),
        axes: [first.normalize(), second.normalize()],
        size: [first.length(), second.length()],
    }
}

/// The window of `scenes::room`, half of it again, one in the open, one in the floor, which is behind
/// most surfaces, and one that a wall closes.
fn portals() -> Vec<Portal> {
    vec![
        portal([-2.0, 0.8, -0.6], [0.0, 1.2, 0.0], [0.0, 0.0, 1.2]),
        portal([-2.1, 0.8, -0.6], [0.0, 0.6, 0.0], [0.0, 0.0, 1.2]),
        portal([-9.0, 0.0, -3.0], [0.0, 4.0, 0.0], [0.0, 0.0, 6.0]),
        portal([-1.0, -0.01, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0]),
        portal([-1.0, 1.0, 2.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
    ]
}

#[test]
fn pictures_agree_with_other_samplers() {
    let _alone = support::alone();
    let materials =
        || vec![scenes::diffuse(Vec3::splat(0.6)), scenes::copper(0.3), scenes::plastic(0.3)];
    let mut room = scenes::room(materials());
    let reference_of = |scene: &Scene, depth| {
        let settings = Settings { sampler: Sampler::Mis, depth, ..Settings::default() };
        replicates::replicates(scene, &settings, 4000, 128)
    };
    let agrees = |scene: &Scene, depth, share: &str, reference: &[_]| {
        let parameters = support::parameters(&[share]);
        let settings =
            Settings { sampler: Sampler::Portal, depth, parameters, ..Settings::default() };
        let values = replicates::replicates(scene, &settings, 9000, 32);
        let label = format!("{} {share} {}", scene.name, scene.portals.len());
        replicates::assert_same(&label, &values, reference, 0.0);
    };
    let direct = reference_of(&room, 1);
    for (count, share) in [
        (0, "portal-share=1"),
        (1, "portal-share=1"),
        (5, "portal-share=1"),
        (5, "portal-share=0.5"),
    ] {
        room.portals = portals()[..count].to_vec();
        agrees(&room, 1, share, &direct);
    }
    let bounced = reference_of(&room, 3);
    agrees(&room, 3, "portal-share=0.5", &bounced);
    // Light comes past the portals too.
    let mut open = scenes::open(materials());
    let reference = reference_of(&open, 1);
    open.portals = portals();
    agrees(&open, 1, "portal-share=1", &reference);
}

const SCENE: &str = "
[camera]
position = [0, 1, 5]
look_at = [0, 0, 0]
vertical_fov_deg = 40
[environment]
constant = [1, 1, 1]
[[portal]]
name = \"window\"
corner = [0, 1, 0]
first_edge = [0, 2, 0]
second_edge = [0, 0, 3]
";

#[test]
fn bad_portals_are_refused_and_ignored_ones_named() {
    let load = |text: &str| Scene::parse(Path::new("room.toml"), text);
    let scene = load(SCENE).unwrap();
    assert_eq!(scene.portals[0].size, [2.0, 3.0]);
    assert_eq!(scene.portals[0].axes, [Vec3::Y, Vec3::Z]);
    let warning = Sampler::Mis.portal_warning(&scene).unwrap();
    assert!(warning.contains("--sampler mis ignores") && warning.contains("`window`"), "{warning}");
    assert_eq!(Sampler::Portal.portal_warning(&scene), None);
    let without = load(SCENE.split_once("[[portal]]").unwrap().0).unwrap();
    assert_eq!(Sampler::Mis.portal_warning(&without), None);
    assert!(Sampler::Portal.portal_warning(&without).unwrap().contains("no [[portal]]"));
    assert_ne!(scene.hash, without.hash);
    for (from, to, expected) in [
        ("[0, 2, 0]", "[0, 0, 0]", "portal `window` (line 8): first_edge: expected an edge of"),
        ("[0, 2, 0]", "[0, nan, 0]", "first_edge: expected a finite number, found NaN"),
        ("[0, 2, 0]", "[0, inf, 0]", "first_edge: expected a finite number, found inf"),
        ("[0, 2, 0]", "[0, 3e38, 3e38]", "first_edge: expected an edge of"),
        ("[0, 0, 3]", "[0, 1, 3]", "at right angles, found 71.57 degrees"),
        ("[0, 0, 3]", "[0, 2, 0]", "at right angles, found 0.00 degrees"),
        ("[0, 1, 0]", "[1e9, 1, 0]", "corner: expected a number from -1000000 to 1000000"),
        ("second_edge", "edge", "unknown field `edge`, expected one of `name`, `corner`"),
        ("second_edge = [0, 0, 3]", "", "missing field `second_edge`"),
    ] {
        assert_error(load(&SCENE.replace(from, to)), &[expected]);
    }
    let folder = Folder::new();
    let clay = "[[material]]\nname = \"clay\"\ntype = \"diffuse\"\nreflectance = [0.6, 0.4, 0.3]\n";
    let ball = "[[object]]\nshape = \"sphere\"\nradius = 1\nmaterial = \"clay\"\n";
    folder.write("room.toml", format!("{SCENE}{clay}{ball}"));
    let options = ["render", "room.toml", "--quick", "--spp=1", "--sampler=mis", "--stats=s.json"];
    folder.run(&options).assert(0, &[&warning]);
    let statistics = fs::read_to_string(folder.path().join("s.json")).unwrap();
    assert!(statistics.contains("--sampler mis ignores"), "{statistics}");
    let table = SCENE.split_once("[[portal]]").unwrap().1;
    let many = format!("{SCENE}{}", format!("[[portal]]{table}").repeat(256));
    assert_error(load(&many), &["at most 256"]);
}
