//! Instances: the tree of two levels against the same scene placed flat, on the device and on the host;
//! extreme transforms, bad input, memory, and pictures of textured, normal-mapped and clear instances.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use std::{path::Path, sync::Arc};

use fenestra::{
    accel::Accel,
    film::Aov,
    pass::Schedule,
    sampler::Sampler,
    scene::{
        Camera, Geometry, Instance, Scene,
        instance::PLACED_TRIANGLES,
        texture::{Encoding, Texels, Texture, TextureUse},
        transform::Transform,
    },
    session::Settings,
    shader::{
        constants::NO_MATERIAL,
        structs::{Hit, Ray},
    },
};
use glam::{DMat3, DMat4, DVec3, Quat, Vec3, Vec4};

use crate::{
    support::{
        self, assert_error,
        random::Random,
        rays::{
            ONE_PAGE, OnDevice, REFILLING, push, push_box, random_rays, random_shadow_rays, ray,
            soup, sphere,
        },
        replicates::{assert_same, film_mean, replicates},
        scenes,
    },
    twin::surface::{surface_at, triangle_material},
};

/// A random affine map: turned, scaled differently along the axes, sheared, mirrored or not.
fn transform(random: &mut Random, largest_scale: f32, spread: f32, mirrors: bool) -> Transform {
    let scale =
        |random: &mut Random| f64::from(largest_scale.powf(2.0 * random.uniform_f32() - 1.0));
    let axis = random.direction_from_point();
    let turn = Quat::from_axis_angle(axis, 6.0 * random.uniform_f32()).as_dquat();
    let mut scales = DVec3::new(scale(random), scale(random), scale(random));
    if mirrors {
        scales.x = -scales.x;
    }
    let mut shear = DMat3::IDENTITY;
    shear.y_axis.x = f64::from(2.0 * random.uniform_f32() - 1.0);
    let linear = DMat3::from_quat(turn) * shear * DMat3::from_diagonal(scales);
    let shift = (spread * random.point()).as_dvec3();
    Transform::from_matrix(DMat4::from_mat3_translation(linear, shift)).unwrap()
}

/// Placed triangles, and instances of a soup and of a smooth sphere.
fn scene(count: u32, seed: u64, largest_scale: f32, spread: f32, mirrors: bool) -> Geometry {
    let mut random = Random(seed);
    let mut geometry = soup(100, seed + 1);
    geometry.prototypes = vec![soup(200, seed + 2), sphere(12, 0.7)];
    for index in 0..count {
        let mirrors = mirrors && index % 2 == 0;
        let place = transform(&mut random, largest_scale, spread, mirrors);
        let replaces = index % 3 == 0;
        let instance = Instance::new(index % 2, &place, index % 5, replaces);
        geometry.instances.extend(instance);
    }
    geometry
}

/// Rays toward vertices and edges of the scene, where a tree loses triangles first.
fn aimed_rays(flat: &Geometry, count: usize, seed: u64, scale: f32) -> Vec<Ray> {
    let mut random = Random(seed);
    let aim = |random: &mut Random| {
        let pick = (random.uniform_f32() * flat.triangles.len() as f32) as usize;
        let corners = flat.triangles[pick.min(flat.triangles.len() - 1)];
        let [a, b, c] = corners.map(|corner| Vec3::from(flat.positions[corner as usize]));
        let share = random.uniform_f32();
        match (4.0 * share) as u32 {
            0 => a,
            1 => a.lerp(b, share),
            _ => (a + b + c) / 3.0,
        }
    };
    (0..count)
        .map(|_| {
            let origin = scale * random.point();
            let target = aim(&mut random);
            ray(origin, (target - origin).normalize_or(Vec3::X))
        })
        .collect()
}

/// Tests that the host finds what the device finds, but for a few ties.
fn check_host(name: &str, accel: &Accel, rays: &[Ray]) {
    let [(_, device), (_, host)] = &OnDevice::both(accel)[..] else { return };
    let (ours, theirs) = (device.trace(rays, REFILLING), host.trace(rays, REFILLING));
    let other = ours.iter().zip(&theirs).filter(|(one, other)| one != other).count();
    assert!(500 * other <= rays.len(), "{name}: {other} of {} differ", rays.len());
}

/// Compares the two-level tree with the tree over the flattened scene, and the host on the first `free` rays,
/// which aim at no edge. Returns the share of hits whose distance is the same to the bit.
fn check(name: &str, geometry: &Geometry, rays: &[Ray], free: usize, tolerance: f32) -> f64 {
    let flat = geometry.clone().flattened().unwrap();
    let two_levels = Accel::build(geometry, ONE_PAGE).unwrap();
    let one_level = Accel::build(&flat, ONE_PAGE).unwrap();
    assert!(two_levels.is_instanced() && !one_level.is_instanced());
    // Boxes grow with the largest coordinates that instances reach, beside those of the ray.
    let far = flat.positions.as_flattened().iter().fold(0.0, |far: f32, at| far.max(at.abs()));
    let reach = two_levels.instances.iter().fold(1.5, |reach: f32, own| reach.max(own.reach));
    assert!(reach >= far, "{name}: {reach} m of {far} m");
    check_host(name, &two_levels, &rays[..free]);
    let on_device = OnDevice::new(&two_levels);
    let found = on_device.trace(rays, Schedule::SINGLE);
    assert_eq!(found, on_device.trace(rays, REFILLING), "{name}: the schedule changes hits");
    assert_eq!(on_device.overruns(), 0, "{name}");
    let expected = OnDevice::new(&one_level).trace(rays, REFILLING);
    let (mut same, mut met, mut elsewhere, mut turned) = (0, 0, 0, 0);
    // Where GPUs round otherwise than the twin, that decides at edges.
    let rounds_alike = support::is_software();
    let (compared, most_unlike, near) =
        if rounds_alike { (rays.len(), 0, 1e-5) } else { (free, free / 500, tolerance) };
    let mut unlike_twin = 0;
    for (index, ((ray, hit), flat)) in rays.iter().zip(&found).zip(&expected).enumerate() {
        let (origin, direction) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
        let twin = two_levels.closest(origin, direction).filter(|_| index < compared);
        let is_alike = index >= compared
            || match &twin {
                Some(twin) => (twin.distance - hit.distance).abs() <= near * hit.distance,
                None => hit.distance < 0.0,
            };
        if !is_alike {
            eprintln!("{name}, ray {index}: {hit:?} {twin:?}");
            unlike_twin += 1;
        } else if let Some(twin) = twin {
            let material = triangle_material(&two_levels, twin.triangle, twin.instance);
            let surface = surface_at(&two_levels, twin.triangle, twin.instance, origin, direction);
            if twin.triangle == hit.triangle {
                assert_eq!(material, hit.material, "{name}, ray {index}");
                let normal = Vec3::from(hit.shading_normal);
                assert!(surface.shading_normal.distance(normal) < 2e-3, "{name}, ray {index}");
            }
        }
        assert_eq!(
            hit.material == NO_MATERIAL,
            flat.material == NO_MATERIAL,
            "{name}, ray {index} {ray:?}: {hit:?}, flat {flat:?}"
        );
        if hit.material == NO_MATERIAL {
            continue;
        }
        met += 1;
        same += usize::from(hit.distance == flat.distance);
        let off = (hit.distance - flat.distance).abs();
        if off > tolerance * flat.distance {
            eprintln!("{name}, ray {index}: {hit:?}, flat {flat:?}");
            elsewhere += 1;
            continue;
        }
        let is_same = hit.material == flat.material
            && Vec3::from(hit.shading_normal).distance(flat.shading_normal.into()) < 5e-3
            && Vec3::from(hit.geometric_normal).distance(flat.geometric_normal.into()) < 5e-3;
        turned += usize::from(!is_same);
    }
    eprintln!(
        "{name}: {met} hits, {same} the same to the bit, {elsewhere} elsewhere, {turned} turned"
    );
    assert!(unlike_twin <= most_unlike, "{name}: {unlike_twin} rays find what the twin does not");
    assert_eq!(elsewhere, 0, "{name}: {elsewhere} of {met} hits are elsewhere");
    // At an edge that two triangles share, rounding and order decide which one is met.
    assert!(turned * 50 <= met, "{name}: {turned} of {met} hits are of another triangle");
    same as f64 / f64::from(u32::try_from(met.max(1)).unwrap())
}

#[test]
fn two_levels_find_what_one_level_finds() {
    for (count, seed) in [(1, 1), (2, 2), (40, 3), (400, 4)] {
        let geometry = scene(count, 10 * seed, 2.0, 4.0, false);
        let flat = geometry.clone().flattened().unwrap();
        let mut rays = random_rays(1500, seed, 6.0);
        rays.extend(aimed_rays(&flat, 1500, seed, 6.0));
        let same = check(&format!("{count} instances"), &geometry, &rays, 1500, 1e-5);
        assert!(same > 0.999, "{count} instances: {same} of the distances are the same to the bit");
    }
}

#[test]
fn mirrors_and_extreme_transforms_lose_no_triangle() {
    // Scales from 1/s to s along each axis, shears, far from the origin.
    for (scale, spread, tolerance) in [(4.0, 4.0, 2e-5), (100.0, 50.0, 1e-3), (10.0, 1000.0, 1e-3)]
    {
        let geometry = scene(60, 77, scale, spread, true);
        let flat = geometry.clone().flattened().unwrap();
        let mut rays = random_rays(1500, 5, 1.5 * spread);
        rays.extend(aimed_rays(&flat, 3000, 6, 1.5 * spread));
        check(&format!("scale {scale} at {spread} m"), &geometry, &rays, 1500, tolerance);
    }
}

#[test]
fn shadow_rays_are_blocked_by_instances() {
    let geometry = scene(60, 31, 2.0, 3.0, true);
    let flat = geometry.clone().flattened().unwrap();
    let mut random = Random(8);
    // Hits in space without a surface: their rays start where they are, but for the offset.
    let hits: Vec<Hit> = (0..500)
        .map(|_| Hit { position: (5.0 * random.point()).into(), ..Hit::default() })
        .collect();
    let directions = random_shadow_rays(2000, &mut random);
    let flat = OnDevice::new(&Accel::build(&flat, ONE_PAGE).unwrap());
    let one = flat.shadow(&hits, &directions, REFILLING);
    for (tracer, on_device) in OnDevice::both(&Accel::build(&geometry, ONE_PAGE).unwrap()) {
        let two = on_device.shadow(&hits, &directions, REFILLING);
        let other = two.iter().zip(&one).filter(|(two, one)| two != one).count();
        assert!(other <= usize::from(tracer == "host"), "{tracer}: {other} differ");
    }
    let blocked = one.iter().filter(|visible| **visible == 0).count();
    assert!((200..1800).contains(&blocked), "{blocked}");
}

/// Closed instances side by side, which share the vertices of their common edges, let no ray out.
#[test]
fn instances_that_share_edges_do_not_leak() {
    let mut tile = Geometry::default();
    push(&mut tile, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0)]);
    push(&mut tile, [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    let mut geometry = Geometry { prototypes: vec![tile], ..Geometry::default() };
    for x in -8..8 {
        for y in -8..8 {
            let shift = [0.75 * x as f32, 0.75 * y as f32, 1.0];
            let place = Transform::new([0.75, 0.75, 1.0], [0.0; 3], shift);
            geometry.instances.extend(Instance::new(0, &place, 0, false));
        }
    }
    let mut random = Random(9);
    let rays: Vec<Ray> = (0..20_000)
        .map(|index| {
            let grid = |random: &mut Random| 0.75 * (10.0 * random.uniform_f32() - 5.0).round();
            let free = 8.0 * random.uniform_f32() - 4.0;
            let target = match index % 3 {
                0 => Vec3::new(grid(&mut random), free, 1.0),
                1 => Vec3::new(free, grid(&mut random), 1.0),
                _ => Vec3::new(grid(&mut random), grid(&mut random), 1.0),
            };
            let origin = 0.5 * random.point();
            ray(origin, (target - origin).normalize())
        })
        .collect();
    for (tracer, on_device) in OnDevice::both(&Accel::build(&geometry, ONE_PAGE).unwrap()) {
        let hits = on_device.trace(&rays, REFILLING);
        let leaks = hits.iter().filter(|hit| hit.material == NO_MATERIAL).count();
        // Few slip through a vertex on the host, as in docs/traversal.md.
        let most = if tracer == "host" { rays.len() / 1000 } else { 0 };
        assert!(leaks <= most, "{tracer}: {leaks} of {} rays leak", rays.len());
    }
}

/// More triangles than the host places unasked are the device's.
#[test]
fn the_host_leaves_too_many_copies_to_the_device() {
    let place = Transform::new([1.0; 3], [0.0; 3], [0.0; 3]);
    let instance = Instance::new(0, &place, 0, false).unwrap();
    let tracers = |count: usize| {
        let (prototypes, instances) = (vec![sphere(64, 1.0)], vec![instance; count]);
        let geometry = Geometry { prototypes, instances, ..Geometry::default() };
        OnDevice::both(&Accel::build(&geometry, ONE_PAGE).unwrap()).len()
    };
    assert_eq!(tracers(1 + (1 << 23) / (4 * 64 * 63)), 1);
}

#[test]
fn memory_does_not_grow_with_the_triangles_of_instances() {
    let bytes = |count: usize| {
        let mut geometry = Geometry { prototypes: vec![sphere(64, 1.0)], ..Geometry::default() };
        let mut random = Random(11);
        for _ in 0..count {
            let place = transform(&mut random, 2.0, 50.0, false);
            geometry.instances.extend(Instance::new(0, &place, 0, false));
        }
        assert_eq!(
            geometry.triangle_count(),
            (count * geometry.prototypes[0].triangles.len()) as u64
        );
        let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
        assert!(accel.triangle_count() <= geometry.prototypes[0].triangles.len());
        80 * accel.nodes.len() + 48 * accel.triangle_count() + 128 * accel.instances.len()
    };
    let (few, many) = (bytes(10), bytes(10_010));
    // A record of 128 bytes, and a share of a node of 80 bytes with up to eight children.
    let each = (many - few) as f64 / 1e4;
    assert!((128.0..180.0).contains(&each), "{each} bytes for each instance");
}

#[test]
fn impossible_instances_are_refused() {
    let place = Transform::new([1.0; 3], [0.0; 3], [0.0; 3]);
    let instance = Instance::new(0, &place, 0, false).unwrap();
    let refused = |geometry: &Geometry, part: &str| {
        assert_error(Accel::build(geometry, ONE_PAGE), &["instance 0", part]);
    };
    let with = |instance: Instance| Geometry {
        prototypes: vec![sphere(4, 1.0)],
        instances: vec![instance],
        ..Geometry::default()
    };
    refused(&with(Instance { prototype: 1, ..instance }), "mesh 1");
    let mut singular = instance;
    singular.world_from_object[2] = singular.world_from_object[1];
    refused(&with(singular), "inverse");
    let mut nan = instance;
    nan.world_from_object[0].x = f32::NAN;
    refused(&with(nan), "inverse");
    let far = Transform::new([1.0; 3], [0.0; 3], [1e12, 0.0, 0.0]);
    refused(&with(Instance { prototype: 0, ..instance.moved(&far).unwrap_or(instance) }), "m");
    assert!(Instance::new(0, &Transform::new([1e-9; 3], [0.0; 3], [0.0; 3]), 0, false).is_none());
    // Nothing is left of a mesh without area, and of a scene of such.
    let mut empty = with(instance);
    empty.prototypes = vec![Geometry::default()];
    let accel = Accel::build(&empty, ONE_PAGE).unwrap();
    assert!(!accel.is_instanced());
    assert_eq!(accel.closest(Vec3::ZERO, Vec3::X), None);
    // More triangles than 32 bits count.
    let mut many = with(instance);
    many.instances = vec![instance; 1 << 20];
    many.prototypes = vec![sphere(64, 1.0)];
    assert!(many.triangle_count() > u64::from(u32::MAX) && many.flattened().is_none());
}

#[test]
fn coincident_instances_do_not_deepen_the_tree() {
    let mut geometry = Geometry::default();
    push_box(&mut geometry, Vec3::ZERO, Vec3::ONE, Quat::IDENTITY);
    let mesh = std::mem::take(&mut geometry);
    geometry.prototypes = vec![mesh];
    let place = Transform::new([1.0; 3], [0.0; 3], [0.0; 3]);
    geometry.instances = vec![Instance::new(0, &place, 0, false).unwrap(); 3000];
    let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
    let hit = accel.closest(Vec3::new(0.0, 0.1, 5.0), Vec3::NEG_Z).unwrap();
    assert_eq!(hit.distance, 4.0);
}

/// Objects on a floor: a mesh of 200,000 triangles used six times over.
fn objects(only: Option<usize>) -> String {
    let mut text = String::from(
        r#"
[camera]
position = [0, 1.6, 4]
look_at = [0, 0.5, 0]
vertical_fov_deg = 50
[film]
width = 32
height = 24
[environment.sky]
[[material]]
name = "floor"
type = "diffuse"
reflectance = [0.5, 0.5, 0.5]
[[material]]
name = "woven"
type = "diffuse"
reflectance = { texture = "textures/rug.png", scale = [3, 2] }
normal = { texture = "textures/weave_normal.png", scale = 6, strength = 0.9 }
[[material]]
name = "glass"
type = "dielectric"
ior = 1.5
[[material]]
name = "leaf"
type = "principled"
base_color = { texture = "textures/leaf.png", scale = [5, 2.5], wrap = "clamp" }
roughness = 0.4
opacity = { texture = "textures/leaf.png", scale = [5, 2.5], channel = "a" }
[[material]]
name = "shiny"
type = "principled"
base_color = { texture = "textures/picture.png", scale = [2, 1] }
metallic = 0.7
roughness = 0.3
[[object]]
shape = "box"
size = [8, 0.2, 8]
translate = [0, -0.1, 0]
material = "floor"
"#,
    );
    let placed = [
        ("woven", "scale = [1, 1, 1]\ntranslate = [-1.4, 0.5, 0]"),
        ("woven", "scale = [-1, 0.6, 0.8]\nrotate_deg = [0, 50, 20]\ntranslate = [0, 0.6, -0.8]"),
        ("glass", "scale = [0.8, 1, 0.8]\nrotate_deg = [0, 0, 40]\ntranslate = [1.2, 0.6, 0.4]"),
        ("leaf", "scale = [1, 1.2, 0.5]\nrotate_deg = [10, 0, 0]\ntranslate = [0.2, 0.6, 0.9]"),
        ("shiny", "scale = [0.5, -0.5, 0.5]\ntranslate = [-0.7, 0.3, 1.2]"),
        ("shiny", "scale = [0.4, 0.9, 0.4]\nrotate_deg = [0, 0, 20]\ntranslate = [1.6, 0.5, -1]"),
    ];
    for (index, (material, place)) in placed.into_iter().enumerate() {
        if only.is_none_or(|only| only == index) {
            let shape = "shape = \"sphere\"\nradius = 0.5\nsegments = 448";
            text += &format!("[[object]]\n{shape}\nmaterial = \"{material}\"\n{place}\n");
        }
    }
    text
}

fn load(only: Option<usize>) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/instances.toml");
    Scene::parse(&path, &objects(only)).unwrap()
}

#[test]
fn repeated_meshes_become_instances_that_look_like_copies() {
    let _alone = support::alone();
    let instanced = load(None);
    let geometry = &instanced.geometry;
    assert_eq!((geometry.prototypes.len(), geometry.instances.len()), (1, 6));
    assert!(geometry.triangle_count() > PLACED_TRIANGLES as u64);
    assert!(geometry.prototypes[0].triangles.len() * 4 < PLACED_TRIANGLES);

    let mut flat = load(None);
    flat.geometry = geometry.clone().flattened().unwrap();
    // A mesh that is used once is placed by other code.
    let alone = load(Some(1)).geometry;
    let own = geometry.prototypes[0].positions.len();
    let first = geometry.positions.len();
    assert!(alone.instances.is_empty());
    for vertex in 0..own {
        let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-6);
        let copy = first + own + vertex;
        assert!(near(&flat.geometry.positions[copy], &alone.positions[first + vertex]));
        assert!(near(&flat.geometry.normals[copy], &alone.normals[first + vertex]));
        assert_eq!(flat.geometry.uvs[0][copy], alone.uvs[0][first + vertex]);
    }

    let settings = Settings { sampler: Sampler::Mis, depth: 3, ..Settings::default() };
    let reference = replicates(&flat, &settings, 100, 4);
    let values = replicates(&instanced, &settings, 200, 4);
    assert_same("instances", &values, &reference, 0.0);
}

#[test]
fn instances_enter_the_hash() {
    let text = |shift: f32| {
        let object = |x: f32| {
            format!(
                "[[object]]\nshape = \"sphere\"\nradius = 1\nsegments = 1024\nmaterial = \"clay\"\n\
                 translate = [{x}, 0, 0]\n"
            )
        };
        format!(
            "[camera]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\nvertical_fov_deg = 40\n\
             [environment]\nconstant = [1, 1, 1]\n[[material]]\nname = \"clay\"\n\
             type = \"diffuse\"\nreflectance = [0.5, 0.5, 0.5]\n{}{}",
            object(0.0),
            object(shift)
        )
    };
    let [a, b] = [3.0, 4.0].map(|shift| Scene::parse(Path::new("x.toml"), &text(shift)).unwrap());
    assert_eq!(a.geometry.instances.len(), 2);
    assert!(a.geometry.positions.is_empty());
    assert_ne!(a.hash, b.hash);
}

/// Adds a flat quad around `centre` with half edges `right` and `up`, seen from where `right` × `up` points.
/// The image of its textures stands upright on it.
fn add_quad(geometry: &mut Geometry, centre: Vec3, [right, up]: [Vec3; 2], has_tangents: bool) {
    let first = geometry.positions.len() as u32;
    for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
        geometry.positions.push((centre + x * right + y * up).into());
        geometry.normals.push([0.0; 3]);
        geometry.uvs[0].push([x, -y]);
        let tangent = if has_tangents { right.normalize().extend(1.0) } else { Vec4::ZERO };
        geometry.tangents.push(tangent.into());
    }
    geometry.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|corner| first + corner)));
    geometry.materials.extend([0; 2]);
}

/// Quads with one bump of a normal map, each in a pixel of its own: placed and as instances, mirrored and
/// not, from in front and from behind, with tangents of the mesh and without.
#[test]
fn bumps_keep_their_side_in_mirrors_and_from_behind() {
    let _alone = support::alone();
    let texels = Texels::Bytes(vec![[217, 166, 230, 255]]);
    let bump = (Vec3::new(217.0, 166.0, 230.0) / 127.5 - 1.0).normalize();
    let texture = Texture { name: "bump".into(), width: 1, height: 1, texels };
    let mut material = scenes::diffuse(Vec3::splat(0.5));
    material.surface.normal =
        Some(TextureUse { encoding: Encoding::Linear, ..TextureUse::new(Arc::new(texture)) });
    let mut scene = scenes::plane(Vec3::ONE, scenes::environment(16, |_| Vec3::ONE));
    scene.materials = vec![material];
    // An image that stands aslant in its mesh leans another way once that is stretched.
    let along = Vec3::new(2.0, 0.48, 0.0).normalize();
    let stretched = bump.x * along + bump.y * Vec3::Z.cross(along) + bump.z * Vec3::Z;
    // Seen from behind, the bump is turned round.
    let signed = |x: f32, y: f32| Vec3::new(x, y, 1.0) * bump;
    let cases = [
        ("placed", None, bump),
        ("placed, from behind", None, signed(1.0, -1.0)),
        ("instance", Some(([1.0; 3], 0.0)), bump),
        ("instance, from behind", Some(([1.0; 3], 180.0)), signed(1.0, -1.0)),
        ("mirrored", Some(([-1.0, 1.0, 1.0], 0.0)), signed(-1.0, 1.0)),
        ("mirrored, from behind", Some(([1.0, 1.0, -1.0], 0.0)), signed(-1.0, -1.0)),
        ("stretched", Some(([2.0, 1.2, 1.0], 0.0)), stretched),
    ];
    let mut geometry = Geometry::default();
    for (row, has_tangents) in [(0_u32, true), (1, false)] {
        for slant in [0.0, 0.4] {
            let mut quad = Geometry::default();
            let edges = [Vec3::new(0.5, 0.5 * slant, 0.0), Vec3::new(-0.5 * slant, 0.5, 0.0)];
            add_quad(&mut quad, Vec3::ZERO, edges, has_tangents);
            geometry.prototypes.push(quad);
        }
        for (column, (name, transform, _)) in cases.iter().enumerate() {
            let mut centre = Vec3::new(column as f32, -(row as f32), 0.0);
            let Some((scale, turn)) = transform else {
                let right = if name.contains("behind") { -0.5 } else { 0.5 } * Vec3::X;
                add_quad(&mut geometry, centre, [right, 0.5 * Vec3::Y], has_tangents);
                continue;
            };
            let is_stretched = *name == "stretched";
            if is_stretched {
                // Larger than its pixel, behind and far from the others.
                centre += Vec3::new(if has_tangents { 0.0 } else { 2.0 }, 0.0, -0.5);
            }
            let place = Transform::new(*scale, [0.0, *turn, 0.0], centre.into());
            let mesh = 2 * row + u32::from(is_stretched);
            geometry.instances.extend(Instance::new(mesh, &place, 0, false));
        }
    }
    (scene.film.width, scene.film.height) = (9, 2);
    let look_at = Vec3::new(4.0, -0.5, 0.0);
    scene.camera = Camera {
        position: look_at + 100.0 * Vec3::Z,
        look_at,
        vertical_fov_deg: 2.0 * 0.01_f32.atan().to_degrees(),
        ..scene.camera
    };
    let settings = Settings { shadow_rays: 0, aovs: vec![Aov::Normal], ..Settings::default() };
    // The same scene placed flat has the same bumps.
    for geometry in [geometry.clone(), geometry.clone().flattened().unwrap()] {
        scene.geometry = geometry;
        let (sums, _) = support::render(&scene, settings.clone(), 1);
        for row in [0, 1] {
            for (column, (name, _, expected)) in cases.iter().enumerate() {
                let beside = if row == 1 && *name == "stretched" { 2 } else { 0 };
                let found = Vec3::from(sums.normal[9 * row + column + beside]);
                let distance = found.distance(*expected);
                assert!(distance < 1e-3, "{name}, row {row}: {found}, not {expected}");
            }
        }
    }
}

/// Shadow rays are dimmed by every sheet, and camera rays go through each by a chance of its own, with the
/// material that the instance gives it: that of the mesh would stop them.
#[test]
fn rays_go_through_each_of_several_sheets() {
    let _alone = support::alone();
    let mut scene = scenes::plane(Vec3::splat(0.5), scenes::environment(16, |_| Vec3::ONE));
    let mut sheet = scenes::diffuse(Vec3::ZERO);
    sheet.surface.opacity.factor = 0.5;
    scene.materials.push(sheet);
    let mut quad = Geometry::default();
    add_quad(&mut quad, Vec3::ZERO, [5e3 * Vec3::X, 5e3 * Vec3::NEG_Z], false);
    let closed = quad.clone();
    quad.materials.fill(1);
    scene.geometry.prototypes = vec![quad, closed];
    for (height, mesh, first_material, replaces) in
        [(8.0, 0, 0, false), (9.0, 0, 1, true), (10.0, 1, 1, true)]
    {
        let place = Transform::new([1.0; 3], [0.0; 3], [0.0, height, 0.0]);
        scene.geometry.instances.extend(Instance::new(mesh, &place, first_material, replaces));
    }
    let settings = Settings { sampler: Sampler::Cosine, ..Settings::default() };
    // A ray that leaves the scene between two sheets is one in 10⁵.
    for (height, samples, expected, tolerance) in
        [(5.0, 1, 0.5 * 0.125, 1e-3), (20.0, 256, 0.125 * 0.5 * 0.125, 0.08)]
    {
        scene.camera.position.y = height;
        let (sums, _) = support::render(&scene, settings.clone(), samples);
        let mean = film_mean(&sums).x;
        eprintln!("from {height} m: {mean:.5}, expected {expected:.5}");
        assert!((mean / expected - 1.0).abs() < tolerance, "from {height} m: {mean}");
    }
}
