//! Lamps chosen by place: densities of the draws, and pictures of rooms that other rooms' lamps do not reach.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use fenestra::{
    film::Window,
    math::random::hash_4d,
    pass::SceneBuffers,
    sampler::Sampler,
    scene::{
        Scene,
        lamp::{LampKind, Spot, SpotFalloff},
    },
    session::Settings,
    shader::constants::{CONSTANT_SURFACES, LAMP_BIT, SURFACES_LAMP_CELLS},
};
use glam::Vec3;

use crate::support::{
    self,
    command::Folder,
    replicates::{assert_near, replicates},
    scenes,
    statistics::chi_square_p_value,
};

/// Enough to meet each triangle of each lamp.
const DRAWS: u32 = 1 << 17;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Query {
    position: [f32; 3],
    normal: [f32; 3],
    bits: [u32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Answer {
    source: u32,
    probability: f32,
    found_probability: f32,
}

/// A row of closed rooms of 4 m × 3 m × 4 m, each with a lamp below its ceiling; the camera is in the first.
fn rooms(count: i32) -> Scene {
    let mut text = String::from(
        "[camera]\nposition = [0.4, 1.6, 0.4]\nlook_at = [2.6, 1.1, 2.6]\nvertical_fov_deg = 70\n\
         [film]\nwidth = 16\nheight = 16\n\
         [[material]]\nname = \"wall\"\ntype = \"diffuse\"\nreflectance = [0.6, 0.5, 0.4]\n\
         [[material]]\nname = \"lamp\"\ntype = \"diffuse\"\nreflectance = [0.1, 0.1, 0.1]\n\
         emission = [12, 11, 9]\n",
    );
    let mut objects = 0_u32..;
    let mut add = |material: &str, size: [f32; 3], at: [f32; 3]| {
        let name = objects.next().unwrap();
        text += &format!(
            "[[object]]\nname = \"{name}\"\nshape = \"box\"\nmaterial = \"{material}\"\n\
             size = {size:?}\ntranslate = {at:?}\n"
        );
    };
    let length = 4.0 * count as f32;
    for height in [-0.05, 3.05] {
        add("wall", [length + 0.2, 0.1, 4.2], [0.5 * length, height, 2.0]);
    }
    for side in [0.0, 4.0] {
        add("wall", [length, 3.0, 0.1], [0.5 * length, 1.5, side]);
    }
    for room in 0..=count {
        add("wall", [0.1, 3.0, 4.0], [4.0 * room as f32, 1.5, 2.0]);
    }
    for room in 0..count {
        // Sides of unlike power.
        add("lamp", [0.4, 0.1, 0.3], [4.0 * room as f32 + 3.0, 2.8, 2.0]);
    }
    let folder = Folder::new();
    let path = folder.path().join("rooms.toml");
    std::fs::write(&path, text).unwrap();
    Scene::load(&path).unwrap()
}

/// Draws lamps at a place on a floor.
fn draws(scene: &SceneBuffers, position: [f32; 3]) -> Vec<Answer> {
    let query = |draw| {
        let [a, b, ..] = hash_4d([draw, 1, 2, 3]);
        Query { position, normal: [0.0, 1.0, 0.0], bits: [a, b] }
    };
    let queries: Vec<Query> = (0..DRAWS).map(query).collect();
    let constants = [(CONSTANT_SURFACES, scene.surfaces.features)];
    support::run_probe_with("lamps", &constants, &[&scene.set], &[], &queries)
}

#[test]
fn lamps_are_drawn_as_their_probabilities_say() {
    let _alone = support::alone();
    let scene = rooms(40);
    let window = Window { x: 0, y: 0, width: 16, height: 16 };
    let buffers = SceneBuffers::new(support::device(), &scene, window).unwrap();
    assert_ne!(buffers.surfaces.features & SURFACES_LAMP_CELLS, 0);
    let mut likely = Vec::new();
    // The last place is next to a wall: the lamp beyond it is as near as that of the room.
    for (position, least) in
        [([1.0, 0.0, 1.0], 0.5), ([123.0, 0.0, 3.0], 0.5), ([7.8, 0.0, 2.0], 0.75)]
    {
        let mut counts: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
        for answer in draws(&buffers, position) {
            let Answer { source, probability, found_probability } = answer;
            // A bounce that meets the lamp finds the same density.
            assert!((found_probability / probability - 1.0).abs() < 1e-4, "{answer:?}");
            counts.entry(source).or_insert((0.0, probability.into())).0 += 1.0;
        }
        let sum: f64 = counts.values().map(|(_, probability)| probability).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        let (observed, expected): (Vec<f64>, Vec<f64>) = counts
            .values()
            .map(|(count, probability)| (*count, probability * f64::from(DRAWS)))
            .unzip();
        let p = chi_square_p_value(&observed, &expected);
        assert!(p > 1e-4, "p = {p}");
        // Power alone would draw the lamp of the room by a fortieth.
        let mut shares: Vec<(f64, u32)> =
            counts.iter().map(|(source, (_, probability))| (*probability, *source)).collect();
        shares.sort_by(|a, b| b.0.total_cmp(&a.0));
        let own: f64 = shares[..12].iter().map(|(probability, _)| probability).sum();
        eprintln!("{} lamps, {own:.3} for those of the room, p = {p:.3}", counts.len());
        assert!(own > least, "{own}");
        likely.push(shares[0].1);
    }
    assert_ne!(likely[0], likely[1]);
}

/// Every second one of the spots in a row above a floor shines upwards.
#[test]
fn spots_are_drawn_where_they_shine() {
    let _alone = support::alone();
    for falloff in [SpotFalloff::SquaredCosine, SpotFalloff::SmoothCosine, SpotFalloff::LinearAngle]
    {
        let mut scene = scenes::plane(Vec3::splat(0.5), scenes::sky());
        for spot in 0..40 {
            let spot = Spot {
                position: Vec3::new(2.0 * (spot - 20) as f32, 2.0, 0.0),
                direction: if spot % 2 == 0 { Vec3::NEG_Y } else { Vec3::Y },
                intensity: Vec3::ONE,
                inner_angle_rad: 0.0,
                outer_angle_rad: 0.8,
                falloff,
            };
            scenes::add_lamp(&mut scene, LampKind::Spot(spot));
        }
        let window = Window { x: 0, y: 0, width: 16, height: 8 };
        let buffers = SceneBuffers::new(support::device(), &scene, window).unwrap();
        let answers = draws(&buffers, [0.0; 3]);
        let share = |is_wanted: fn(u32) -> bool| -> f64 {
            let count =
                answers.iter().filter(|answer| is_wanted(answer.source & !LAMP_BIT)).count();
            count as f64 / answers.len() as f64
        };
        let [own, upwards] = [share(|spot| spot == 20), share(|spot| spot % 2 == 1)];
        eprintln!("{falloff:?}: {own:.3} for the spot above, {upwards:.3} upwards");
        assert!(own > 0.25 && upwards < 0.2, "{own} for the spot above, {upwards} upwards");
    }
}

/// Alone, its lamp is all there is and drawn by power.
#[test]
fn a_room_looks_the_same_beside_others() {
    let _alone = support::alone();
    let settings = Settings { sampler: Sampler::Mis, depth: 2, ..Settings::default() };
    let alone = replicates(&rooms(1), &settings, 0, 128);
    let beside = replicates(&rooms(40), &settings, 100, 128);
    assert_near("beside others", &beside, &alone, 0.02);
}
