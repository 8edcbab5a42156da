//! Lists of lamps with known answers.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::path::Path;

use super::*;
use crate::scene::light_group::LightGroups;

pub(in crate::pass) fn parsed(text: &str) -> (Scene, Accel, LampTables) {
    let scene = Scene::parse(Path::new("a.toml"), text).unwrap();
    let accel = Accel::build(&scene.geometry, 1 << 20).unwrap();
    let tables = LampTables::new(&scene, &accel, &LightGroups::new(&scene));
    (scene, accel, tables)
}

/// A box of 1 m far away, whose far side is seen too if it emits to both sides.
#[test]
fn draws_of_a_lamp_add_up_to_its_irradiance() {
    const DRAWS: u32 = 1 << 14;
    for (keys, sides) in [("", 1.0), ("emission_two_sided = true\n", 2.0)] {
        let text = format!(
            "[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov_deg = 40\n\
             [[material]]\nname = \"lamp\"\ntype = \"diffuse\"\nreflectance = [0, 0, 0]\n\
             emission = [3, 3, 3]\n{keys}[[object]]\nshape = \"box\"\nsize = [1, 1, 1]\n\
             material = \"lamp\"\n"
        );
        let (scene, accel, tables) = parsed(&text);
        let columns = 0..tables.source_count;
        let cluster = Cluster { columns, power: tables.total, centre: None };
        let survey = Survey::new(&scene, &accel, &tables);
        let irradiance = |draw| {
            let numbers = hash_4d([draw, 1, 2, 3]);
            f64::from(survey.light(&cluster, Vec3::new(0.0, 0.0, 100.0), numbers).irradiance)
        };
        let found = (0..DRAWS).map(irradiance).sum::<f64>() / f64::from(DRAWS);
        let ratio = found / (3.0 * sides / 1e4);
        assert!((ratio - 1.0).abs() < 0.06, "{sides} sides: {ratio}");
    }
}

/// Sixty lamps in one place above a floor, of which a list has room for 31.
#[test]
fn lists_and_estimates_have_closed_forms() {
    let lamp = "[[lamp]]\ntype = \"point\"\nposition = [0, 2, 0]\nintensity = [3, 3, 3]\n";
    let text = "[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov_deg = 40\n\
                [[material]]\nname = \"floor\"\ntype = \"diffuse\"\nreflectance = [0, 0, 0]\n\
                [[object]]\nshape = \"box\"\nsize = [1, 1, 1]\nmaterial = \"floor\"\n\
                translate = [0, -0.5, 0]\n"
        .to_owned()
        + &lamp.repeat(60);
    let (scene, accel, tables) = parsed(&text);
    let survey = Survey::new(&scene, &accel, &tables);
    let place = |normal| Place { position: Vec3::ZERO, normal };
    // All are estimated alike: 48 by rays, twelve by their share.
    let list = survey.list(0, &[place(Vec3::Y); 4], 0.5, MOST_ENTRIES);
    assert!((list[0].ratio - (1.0 - 31.0 / 60.0)).abs() < 1e-5, "{:?}", list[0]);
    let cluster = &tables.clusters[0];
    let look = |normal, least| {
        let mut own = Estimate { cluster, score: 1.0, weight: 0.0, visibility: 0.0 };
        survey.look(0, &mut own, [place(normal); 4].iter(), least);
        (own.weight as f32, own.visibility)
    };
    let visible = (4.025_f32 / 4.25).powf(VISIBILITY_EXPONENT);
    let hidden = 0.1_f32.powf(VISIBILITY_EXPONENT);
    // An irradiance of ¾ at each of four places; a quarter where the lamp is nearer than the cell.
    for (normal, least, weight, seen) in [
        (Vec3::Y, 1.0, 3.0 * visible, visible),
        (Vec3::Y, 16.0, 0.75 * visible, visible),
        (Vec3::NEG_Y, 1.0, 0.0, hidden),
    ] {
        let found = look(normal, least);
        let is_near = |a: f32, b: f32| (a - b).abs() < 1e-4 * b.max(1.0);
        assert!(is_near(found.0, weight) && is_near(found.1, seen), "{normal} {least}: {found:?}");
    }
}

/// A pane at a height of 1 m, and a wall above it at 2.5 m.
#[test]
fn a_wall_beyond_a_lamp_behind_a_pane_hides_nothing() {
    let part = |name: &str, kind: &str, height: f32| {
        format!(
            "[[material]]\nname = \"{name}\"\n{kind}\n[[object]]\nshape = \"box\"\nsize = [2, 1e-3, 2]\n\
             material = \"{name}\"\ntranslate = [0, {height}, 0]\n"
        )
    };
    let text = "[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov_deg = 40\n"
        .to_owned()
        + &part("pane", "type = \"thin_dielectric\"", 1.0)
        + &part("wall", "type = \"diffuse\"\nreflectance = [0, 0, 0]", 2.5);
    let (scene, accel, tables) = parsed(&text);
    let survey = Survey::new(&scene, &accel, &tables);
    // The origin moves to the pane.
    for (farthest, is_hidden) in [(2.0, false), (3.0, true)] {
        let mut origin = Vec3::ZERO;
        let met = survey.stops(&mut origin, Vec3::Y, farthest);
        assert_eq!((met.is_some(), origin.y > 1.0), (is_hidden, true), "{farthest} m");
    }
}

#[test]
fn every_cell_and_face_has_its_own_index() {
    let grid = Grid { size: [2, 3, 4], ..Grid::default() };
    let found: Vec<_> = (0..2 * 3 * 4 * FACES).map(|index| grid.cell_of(index)).collect();
    let indices = found.iter().map(|(cell, face)| grid.index_of(*cell, *face));
    assert!(indices.eq(0..found.len()), "{found:?}");
    assert_eq!(found.last(), Some(&(UVec3::new(1, 2, 3), FACES - 1)));
    for (normal, face) in [([0.3, 0.1, 0.2], 0), ([0.1, -0.3, 0.2], 3), ([0.1, 0.2, 0.3], 4)] {
        assert_eq!(cube_face(normal.into()), face, "{normal:?}");
    }
}

/// A floor with a row of lamps above it; the camera looks down on one end.
#[test]
fn cells_are_finer_where_the_camera_looks() {
    let lamps: String = (0..40)
        .map(|x| {
            format!("[[lamp]]\ntype = \"point\"\nposition = [{x}, 2, 0]\nintensity = [3, 3, 3]\n")
        })
        .collect();
    for (at, other) in [(1.0, 39.0), (39.0, 1.0)] {
        let text = format!(
            "[camera]\nposition = [{at}, 2, 0]\nlook_at = [{at}, 0, 0]\nup = [0, 0, 1]\n\
             vertical_fov_deg = 20\n[[material]]\nname = \"floor\"\ntype = \"diffuse\"\n\
             reflectance = [0, 0, 0]\n[[object]]\nshape = \"box\"\nsize = [40, 1, 2]\n\
             material = \"floor\"\ntranslate = [20, -0.5, 0]\n{lamps}"
        );
        let (scene, accel, tables) = parsed(&text);
        let cells = LampCells::new(&scene, &accel, &tables);
        // Lists along a metre of the floor.
        let lists_at = |middle: f32| {
            let list = |step: i32| {
                let position = Vec3::new(middle + 0.01 * step as f32, 0.0, 0.0);
                cells.lists[cells.grid.index(&Place { position, normal: Vec3::Y })]
            };
            (-50..50).map(list).collect::<BTreeSet<_>>().len()
        };
        let (near, far) = (lists_at(at), lists_at(other));
        assert!(near > 2 * far, "{near} lists at {at} m, {far} at {other} m");
    }
}
