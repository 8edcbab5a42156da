//! Image layers: surfaces behind mirrors and glass, and what samplers learned: the fill of visibility
//! caches, and the cells of learned visibility that were found.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{collections::BTreeMap, sync::Arc};

use fenestra::{
    film::{Aov, Window, cryptomatte::identifier},
    sampler::{
        Parameters, Sampler,
        guided::CellKey,
        regions::{FACE_COUNT, face_normal},
    },
    scene::{
        Geometry, Instance, Scene,
        material::{Material, MaterialKind},
        texture::{Texels, Texture, TextureUse},
        transform::Transform,
    },
    session::{Renderer, Settings},
};
use glam::Vec3;

use crate::support::{self, assert_error, guide::Guide as _, render, renderer, scenes};

/// Returns settings of `visibility` with few lobes, `assignments` and the layer of its caches.
fn visibility(assignments: &[&str]) -> Settings {
    let few = ["environment-lobes=24", "brdf-lobes=4", "views=8", "lobes=24"];
    Settings {
        sampler: Sampler::Visibility,
        parameters: support::parameters(&[&few, assignments].concat()),
        aovs: vec![Aov::CacheEntries],
        ..Settings::default()
    }
}

fn guided() -> Settings {
    Settings {
        sampler: Sampler::Guided,
        // `auto` is measured and may differ from run to run.
        parameters: Parameters { candidates: Some(1), ..Parameters::default() },
        aovs: vec![Aov::GuideCell, Aov::Normal, Aov::Unfiltered],
        ..Settings::default()
    }
}

fn room() -> Scene {
    scenes::room(vec![scenes::diffuse(Vec3::splat(0.6)), scenes::copper(0.3)])
}

/// Sums both counts over all pixels.
fn total(counts: &[[u32; 2]]) -> [u64; 2] {
    counts.iter().fold([0; 2], |sum, pair| [0, 1].map(|i| sum[i] + u64::from(pair[i])))
}

/// A textured floor of albedo (0.6, 0, 0.3) below the camera, with a ceiling of the same above it.
fn hall() -> Scene {
    let mut scene = scenes::plane(Vec3::new(0.6, 0.4, 0.3), scenes::sky());
    let texels = Texels::Bytes(vec![[255, 0, 255, 255]]);
    let texture = Texture { name: "magenta".into(), width: 1, height: 1, texels };
    scene.materials[0].surface.color = Some(TextureUse::new(Arc::new(texture)));
    scenes::add_box(&mut scene.geometry, Vec3::new(0.0, 8.5, 0.0), Vec3::new(99.0, 1.0, 99.0), 0);
    scene
}

/// Whatever way paths take through white glass, they end at one albedo.
#[test]
fn surfaces_are_shown_in_mirrors_and_through_glass() {
    let _alone = support::alone();
    let mirror = MaterialKind::Mirror { reflectance: Vec3::splat(0.5) };
    let pane = MaterialKind::pane(1.5, Vec3::ONE);
    let frosted = MaterialKind::ThinDielectric {
        ior: 1.5,
        alpha: 0.3,
        reflectance: Vec3::ONE,
        transmittance: Vec3::ONE,
    };
    let (smooth, rough) = (MaterialKind::glass(1.5, 0.0), MaterialKind::glass(1.5, 0.3));
    let sheet = MaterialKind::DiffuseTransmission {
        reflectance: Vec3::new(0.4, 0.1, 0.3),
        transmittance: Vec3::new(0.1, 0.6, 0.7),
    };
    let seen = Vec3::new(0.6, 0.0, 0.3);
    let black = MaterialKind::Mirror { reflectance: Vec3::ZERO };
    for (kind, depth, albedo, normal) in [
        (black, 2, Vec3::ZERO, 0.999..=1.0),
        (mirror, 1, 0.5 * seen, -1.0..=-0.999),
        (pane, 4, seen, 0.6..=0.95),
        (smooth, 6, seen, 0.6..=0.95),
        (rough, 2, Vec3::ONE, 0.999..=1.0),
        (frosted, 2, Vec3::ONE, 0.999..=1.0),
        (sheet, 2, Vec3::new(0.5, 0.7, 1.0), 0.999..=1.0),
    ] {
        let mut scene = hall();
        scene.materials.push(Material::new("specular", kind.clone()));
        scenes::add_box(
            &mut scene.geometry,
            Vec3::new(0.0, 1.0, 0.0),
            Vec3::new(99.0, 1.0, 99.0),
            1,
        );
        scene.geometry.uvs[0] = vec![[0.5; 2]; scene.geometry.positions.len()];
        let aovs = vec![Aov::Albedo, Aov::Normal, Aov::Position];
        let settings = Settings { depth, aovs: aovs.clone(), ..Settings::default() };
        let (sums, _) = render(&scene, settings.clone(), 8);
        let pixels = sums.pixel_count() as f32;
        let mean = |layer: &[[f32; 3]]| {
            layer.iter().map(|value| Vec3::from(*value)).sum::<Vec3>() / (8.0 * pixels)
        };
        let found = [&sums.albedo, &sums.normal, &sums.position].map(|layer| mean(layer));
        assert!((found[0] - albedo).abs().max_element() < 1e-3, "{kind:?}: {found:?}");
        assert!(normal.contains(&found[1].y), "{kind:?}: {found:?}");
        let is_pane = matches!(kind, MaterialKind::ThinDielectric { alpha: 0.0, .. });
        assert!(is_pane || (found[2].y - 1.5).abs() < 1e-3, "{kind:?}: {found:?}");
        assert!(support::render_passes(&scene, settings, &[1; 8]) == sums, "{kind:?}");
    }
}

/// A floor under the camera, and a plate on it whose edge crosses a column of pixels: placed, or as an
/// instance.
fn half_covered(is_instanced: bool) -> Scene {
    let mut scene = scenes::plane(Vec3::splat(0.5), scenes::sky());
    scene.materials.push(Material { name: "paint".into(), ..scenes::copper(0.3) });
    let mut geometry = Geometry::default();
    geometry.start_object("floor");
    scenes::add_box(&mut geometry, Vec3::new(0.0, -0.5, 0.0), Vec3::new(100.0, 1.0, 100.0), 0);
    geometry.start_object("plate");
    let (centre, size) = (Vec3::new(EDGE + 20.0, 0.0, 0.0), Vec3::new(40.0, 0.02, 40.0));
    if is_instanced {
        let mut mesh = Geometry::default();
        scenes::add_box(&mut mesh, Vec3::ZERO, size, 0);
        geometry.prototypes.push(mesh);
        let place = Transform::new([1.0; 3], [0.0; 3], centre.into());
        geometry.instances.push(Instance::new(0, &place, 1, true).unwrap());
    } else {
        scenes::add_box(&mut geometry, centre, size, 1);
    }
    scene.geometry = geometry;
    scene
}

/// Place of the edge of the plate, metres.
const EDGE: f32 = 0.1;

#[test]
fn mattes_are_the_shares_of_objects_and_materials() {
    let _alone = support::alone();
    let aovs = vec![Aov::CryptoObject, Aov::CryptoMaterial];
    let settings = Settings { depth: 1, shadow_rays: 1, aovs: aovs.clone(), ..Settings::default() };
    for is_instanced in [false, true] {
        let scene = half_covered(is_instanced);
        let (sums, _) = render(&scene, settings.clone(), 128);
        let image = sums.to_image(&aovs);
        for (layer, under, over) in
            [("CryptoObject", "floor", "plate"), ("CryptoMaterial", "diffuse", "paint")]
        {
            let names = ["R", "G", "B", "A"].map(|channel| format!("{layer}00.{channel}"));
            let [first, first_share, second, second_share] =
                names.each_ref().map(|name| &image.channels[name]);
            let [under, over] = [under, over].map(|name| f32::from_bits(identifier(name)));
            // The camera is 4.99 m above the plate: a column is 33 cm wide, and the ninth begins at 0.
            let covered = 1.0 - EDGE / (2.0 * 4.99 * 15_f32.to_radians().tan() / 8.0);
            for pixel in 0..sums.pixel_count() {
                let ids = (first[pixel], second[pixel]);
                let sum = first_share[pixel] + second_share[pixel];
                assert!((sum - 1.0).abs() < 1e-6, "{layer}, pixel {pixel}: {sum}");
                match pixel % 16 {
                    8 => {
                        assert_eq!(ids, (over, under), "{layer}, pixel {pixel}");
                        let share = first_share[pixel];
                        assert!((share - covered).abs() < 0.04, "{layer}: {share} of {covered}");
                    }
                    column => assert_eq!(ids, (if column < 8 { under } else { over }, 0.0)),
                }
            }
            assert!(image.channels[&format!("{layer}02.A")].iter().all(|share| *share == 0.0));
        }
        // Neither the grouping of samples nor a window nor a break changes a count.
        assert!(support::render_passes(&scene, settings.clone(), &[1, 100, 27]) == sums);
        let window = Some(Window { x: 7, y: 2, width: 3, height: 4 });
        let (part, _) = render(&scene, Settings { window, ..settings.clone() }, 128);
        assert_eq!(part.objects[4], sums.objects[3 * 16 + 8]);
        let (mut first, _) = render(&scene, settings.clone(), 28);
        assert!(support::resume(&scene, settings.clone(), &first, 100) == sums);
        first.add(&render(&scene, Settings { first_sample: 28, ..settings.clone() }, 100).0);
        let added = first.to_image(&aovs);
        for (name, values) in image.channels.iter().filter(|(name, _)| name.starts_with("Crypto")) {
            assert_eq!(added.channels[name], *values, "{name}");
        }
    }
}

/// Eight stripes in one pixel, of which six find room: none is counted as another.
#[test]
fn mattes_without_room_are_not_counted() {
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::splat(0.5), scenes::sky());
    (scene.film.width, scene.film.height) = (1, 1);
    scene.camera.position = Vec3::new(0.0, 9.0, 1e-3);
    scene.camera.vertical_fov_deg = 2.0 * (4.0_f32 / 9.0).atan().to_degrees();
    scene.geometry = Geometry::default();
    for stripe in 0..8 {
        scene.geometry.start_object(&format!("stripe {stripe}"));
        let centre = Vec3::new(stripe as f32 - 3.5, -0.5, 0.0);
        scenes::add_box(&mut scene.geometry, centre, Vec3::new(1.0, 1.0, 99.0), 0);
    }
    let aovs = vec![Aov::CryptoObject];
    let settings = Settings { depth: 1, shadow_rays: 1, aovs, ..Settings::default() };
    let counts = render(&scene, settings, 256).0.objects[0].map(|[_, count]| count);
    assert!(counts.iter().all(|count| (24..=40).contains(count)), "{counts:?} of 256");
}

#[test]
fn cache_entries_are_those_of_the_statistics() {
    let _alone = support::alone();
    for depth in [1, 3] {
        let settings = Settings { depth, ..visibility(&[]) };
        let (sums, totals) = render(&room(), settings, 5);
        assert!(totals.cache_entries > totals.product_hits, "mostly walls are seen");
        assert_eq!(total(&sums.cache_entries), [totals.cache_entries, totals.product_hits]);
        let image = sums.to_image(&[Aov::CacheEntries]);
        let (entries, hits) = (&image.channels["CacheEntries.Y"], &image.channels["Hits.Y"]);
        let most = sums.cache_entries.iter().map(|pair| pair[0]).max().unwrap();
        let found = entries.iter().zip(hits).map(|(entries, hits)| entries * hits);
        let found = found.fold(0.0, f32::max);
        assert!((found - most as f32).abs() < 1e-3, "{found} {most}");
    }
}

#[test]
fn visible_rays_are_those_of_the_statistics() {
    let _alone = support::alone();
    let settings = Settings { depth: 2, aovs: vec![Aov::Visible], ..Settings::default() };
    let (sums, totals) = render(&room(), settings.clone(), 3);
    let [visible, traced] = total(&sums.visible);
    assert_eq!([visible, traced], [totals.shadow_rays_visible, totals.shadow_rays_traced]);
    assert!(0 < visible && visible < traced, "{visible} of {traced}");
    // Rays of training are in the statistics alone: two vertices of a pixel have eight rays each, at most.
    let settings = Settings { sampler: Sampler::Guided, ..settings };
    let (sums, totals) = render(&room(), settings, 3);
    assert!(sums.visible.iter().all(|pair| pair[1] <= 3 * 2 * 8), "{:?}", sums.visible[0]);
    assert!(total(&sums.visible)[1] < totals.shadow_rays_traced);
}

#[test]
fn where_nothing_is_blocked_caches_are_empty() {
    let _alone = support::alone();
    let scene = scenes::plane(Vec3::splat(0.5), scenes::sky());
    let (sums, _) = render(&scene, visibility(&[]), 3);
    assert!(sums.cache_entries.iter().all(|pair| *pair == [0, 3]), "the plane fills the image");
    // Where the camera sees the sky there is no hit.
    let scene = scenes::convex_furnace(scenes::diffuse(Vec3::splat(0.5)), Vec3::ONE);
    let (sums, totals) = render(&scene, visibility(&[]), 3);
    assert_eq!(total(&sums.cache_entries), [0, totals.product_hits]);
    assert!(sums.cache_entries.contains(&[0; 2]) && sums.cache_entries.contains(&[0, 3]));
}

#[test]
fn a_cache_holds_no_more_than_it_has_room_for() {
    let _alone = support::alone();
    // A box around the camera: every direction from every hit is blocked.
    let mut scene = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5))]);
    scenes::add_box(&mut scene.geometry, Vec3::new(0.0, 1.0, 0.0), Vec3::splat(9.0), 0);
    let (sums, totals) = render(&scene, visibility(&["cache=pixel", "cache-capacity=7"]), 6);
    let [entries, hits] = total(&sums.cache_entries);
    assert_eq!(hits, totals.product_hits);
    assert!(sums.cache_entries.iter().all(|pair| pair[0] <= 7 * 6));
    // About 4 of 5 rays bring light and are recorded, so a cache is full after two samples.
    let mean = entries as f64 / hits as f64;
    assert!((6.0..6.9).contains(&mean), "{mean} directions");
    assert!(totals.cache_entries > 2 * entries / 3, "the oldest were forgotten");
}

#[test]
fn entries_are_kept_by_checkpoints_and_add_up() {
    let _alone = support::alone();
    let scene = room();
    let (whole, _) = render(&scene, visibility(&[]), 7);
    let (first, _) = render(&scene, visibility(&[]), 3);
    assert!(support::resume(&scene, visibility(&[]), &first, 4) == whole);
    let (rest, _) = render(&scene, Settings { first_sample: 3, ..visibility(&[]) }, 4);
    let mut added = first;
    added.add(&rest);
    assert_eq!(added.cache_entries, whole.cache_entries);
}

#[test]
fn layers_of_other_samplers_are_refused() {
    let scene = room();
    for (aov, sampler, expected) in [
        (Aov::CacheEntries, Sampler::Product, "--aov cache-entries: the sampler product"),
        (Aov::CacheEntries, Sampler::Guided, "expected --sampler visibility"),
        (Aov::GuideCell, Sampler::Mis, "--aov guide-cell: the sampler mis"),
    ] {
        let settings = Settings { sampler, aovs: vec![aov], ..Settings::default() };
        assert_error(Renderer::new(support::device(), &scene, settings), &[expected]);
    }
}

/// Returns three bytes of the key's hash. Twin of `show_cells.comp`.
fn colour_of(key: CellKey) -> [u32; 3] {
    let hash = key.slot(u32::MAX);
    [hash & 255, hash >> 8 & 255, hash >> 16 & 255]
}

/// Returns the key that stands for the cell of a face.
fn face_key(face: u32) -> CellKey {
    CellKey(0xf000_0000 | face)
}

/// Groups keys by their colour.
fn keys_by_colour(keys: &[u32]) -> BTreeMap<[u32; 3], Vec<CellKey>> {
    let faces = (0..FACE_COUNT as u32).map(face_key);
    let mut by_colour: BTreeMap<[u32; 3], Vec<CellKey>> = BTreeMap::new();
    for key in keys[FACE_COUNT..].iter().map(|key| CellKey(*key)).chain(faces) {
        by_colour.entry(colour_of(key)).or_default().push(key);
    }
    by_colour
}

#[test]
fn a_sample_shows_the_cell_it_found() {
    let _alone = support::alone();
    // Leave room for 9 cells besides the faces, for all coarse and some fine ones, and for all.
    for memory in [15 * 16 * 256, 150 * 16 * 256, 1 << 27] {
        let mut settings = guided();
        settings.parameters.guided.guide_memory = memory;
        let mut renderer = renderer(&room(), settings);
        renderer.render_pass(1).unwrap();
        support::assert_silent();
        let keys = renderer.guide_state().unwrap().unwrap().keys;
        let (sums, by_colour) = (renderer.sums().unwrap(), keys_by_colour(&keys));
        let mut found = [0; 3];
        assert!(sums.unfiltered == sums.sum, "no light of training");
        for pixel in 0..sums.pixel_count() {
            if sums.normal[pixel] == [0.0; 3] {
                assert_eq!(sums.guide_level[pixel], [0.0; 3], "the sky has no cell");
                continue;
            }
            let level = sums.guide_level[pixel].iter().position(|count| *count == 1.0);
            let level = level.expect("every hit has a cell, be it that of its face");
            found[level] += 1;
            assert_eq!(sums.guide_level[pixel].iter().sum::<f32>(), 1.0);
            let colour = sums.guide_cell[pixel].map(|value| (256.0 * value) as u32);
            let keys = by_colour.get(&colour).expect("a colour of a cell");
            let normal = Vec3::from(sums.normal[pixel]);
            let fits = |key: &CellKey| match level {
                0 => normal.dot(face_normal(key.0 as usize & 7)) > 0.4 && key.face() == 7,
                1 => normal.dot(face_normal(key.face())) > 0.4 && key.is_coarse(),
                _ => normal.dot(face_normal(key.face())) > 0.4 && !key.is_coarse(),
            };
            assert!(keys.iter().any(fits), "pixel {pixel}: level {level}, keys {keys:?}");
        }
        eprintln!("{memory} bytes: {found:?} samples in cells of faces, coarse, fine");
        match memory {
            61_440 => assert!(found[0] > 400 && found[1] > 0 && found[2] == 0, "{found:?}"),
            614_400 => assert!(found[1] > 50 && found[2] > 50, "{found:?}"),
            _ => assert!(found[0] < 40 && found[2] > 350, "{found:?}"),
        }
    }
}

#[test]
fn where_nothing_is_learned_no_cell_is_shown() {
    let _alone = support::alone();
    let scene = scenes::open(vec![scenes::diffuse(Vec3::splat(0.5)), scenes::plastic(0.2)]);
    let (sums, _) = render(&scene, guided(), 2);
    assert!(sums.guide_level.iter().chain(&sums.guide_cell).all(|sum| *sum == [0.0; 3]));
    assert!(sums.normal.iter().any(|sum| *sum != [0.0; 3]));
}

#[test]
fn cells_are_kept_by_checkpoints() {
    let _alone = support::alone();
    let scene = room();
    let (whole, _) = render(&scene, guided(), 6);
    let mut first = renderer(&scene, guided());
    first.render_pass(2).unwrap();
    let mut second = renderer(&scene, guided());
    second.restore(&first.sums().unwrap()).unwrap();
    second.restore_guide(&first.guide_state().unwrap().unwrap()).unwrap();
    second.render_pass(4).unwrap();
    assert!(second.sums().unwrap() == whole);
}
