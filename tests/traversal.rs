//! Traversal: the device against its Rust twin, brute force and obvhs; degenerate input, watertight
//! edges, self-intersection at every scale, pages, bounds.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::{
    accel::Accel,
    pass::geometry::Schedule,
    scene::Geometry,
    shader::{
        constants::{NO_INSTANCE, NO_MATERIAL},
        structs::{Hit, Ray, ShadowRay},
    },
};
use glam::{DVec3, Quat, Vec3};
use obvhs::{
    cwbvh::{CwBvh, node::CwBvhNode},
    ray::RayHit,
    rt_triangle::RtTriangle,
};

use crate::{
    support::{
        assert_error, device, is_software,
        random::Random,
        rays::{
            ONE_PAGE, OnDevice, REFILLING, push, push_box, random_rays, random_shadow_rays, ray,
            scaled, soup, sphere,
        },
    },
    twin::surface::surface_at,
};

/// Finds the distance of the nearest triangle by testing all of them in double precision. The second
/// result is true if an edge is touched so closely that rounding may decide.
fn brute_force(geometry: &Geometry, ray: &Ray) -> (Option<f64>, bool) {
    let origin = Vec3::from(ray.origin).as_dvec3();
    let direction = Vec3::from(ray.direction).as_dvec3();
    let mut nearest: Option<f64> = None;
    let mut doubtful = false;
    for triangle in &geometry.triangles {
        let [a, b, c] = triangle.map(|v| Vec3::from(geometry.positions[v as usize]).as_dvec3());
        let normal = (b - a).cross(c - a);
        let along = normal.dot(direction);
        if normal == DVec3::ZERO {
            continue;
        }
        if along.abs() < 1e-5 * normal.length() {
            // Seen edge on: rounding decides if it is hit.
            let closest = (a - origin).dot(normal).abs() < 1e-5 * normal.length();
            doubtful |= closest;
            continue;
        }
        let distance = normal.dot(a - origin) / along;
        let point = origin + distance * direction;
        let area = normal.length_squared();
        let smallest = [(b, c), (c, a), (a, b)]
            .map(|(p, q)| (q - p).cross(point - p).dot(normal) / area)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let size = (a - origin).abs().max_element().max((b - a).abs().max_element());
        if smallest.abs() < 1e-4 || distance.abs() < 1e-5 * size {
            doubtful |= smallest > -1e-4;
        }
        if smallest >= 0.0 && distance > 0.0 && nearest.is_none_or(|nearest| distance < nearest) {
            nearest = Some(distance);
        }
    }
    (nearest, doubtful)
}

/// Checks device and host against brute force; returns the larger share of rays that brute force cannot
/// decide.
fn check(name: &str, geometry: &Geometry, rays: &[Ray]) -> f64 {
    let accel = Accel::build(geometry, ONE_PAGE).unwrap();
    let check_one = |(tracer, on_device): &(&str, OnDevice)| {
        check_tracer([name, tracer], geometry, &accel, on_device, rays)
    };
    OnDevice::both(&accel).iter().map(check_one).fold(0.0, f64::max)
}

/// Checks a tracer, under both schedules, and the twin against brute force. Returns the share of rays that
/// brute force cannot decide.
fn check_tracer(
    [name, tracer]: [&str; 2],
    geometry: &Geometry,
    accel: &Accel,
    on_device: &OnDevice,
    rays: &[Ray],
) -> f64 {
    let name = format!("{name} by the {tracer}");
    let single = on_device.trace(rays, Schedule::SINGLE);
    let refilled = on_device.trace(rays, REFILLING);
    assert_eq!(single, refilled, "{name}: the schedule changes hits");
    assert_eq!(on_device.overruns(), 0, "{name}");
    let size =
        geometry.positions.iter().flatten().fold(0.0, |size: f64, x| size.max(x.abs().into()));
    // GPUs fuse multiplications and additions, and divide by approximations.
    let is_software = is_software();
    let slack = |distance: f64| {
        1e-5 * distance + if is_software { 0.0 } else { 2e-5 * distance + 2e-6 * size }
    };
    let mut doubtful = 0;
    for (index, (ray, hit)) in rays.iter().zip(&single).enumerate() {
        let twin = accel.closest(ray.origin.into(), ray.direction.into());
        let distance = f64::from(hit.distance);
        let found = (hit.material != NO_MATERIAL).then_some(distance);
        let (expected, is_doubtful) = brute_force(geometry, ray);
        let agrees = match (found, &twin) {
            (Some(distance), Some(twin)) => {
                (distance - f64::from(twin.distance)).abs() <= slack(distance)
            }
            (found, twin) => found.is_none() == twin.is_none(),
        };
        // The twin decides as the device where rounding decides.
        assert!(
            agrees || is_doubtful && (tracer == "host" || !is_software),
            "{name}, ray {index} {ray:?}: {hit:?}, twin {twin:?}"
        );
        if is_doubtful {
            doubtful += 1;
            continue;
        }
        match (found, expected) {
            (None, None) => {}
            (Some(found), Some(expected)) => assert!(
                (found - expected).abs() <= 2e-5 * expected + 2e-6 * size,
                "{name}, ray {index} {ray:?}: {found}, brute force {expected}"
            ),
            _ => panic!("{name}, ray {index} {ray:?}: {found:?}, brute force {expected:?}"),
        }
    }
    doubtful as f64 / rays.len() as f64
}

#[test]
fn random_soups_match_brute_force() {
    for (count, seed) in [(1, 1), (2, 2), (9, 3), (100, 4), (3000, 5)] {
        let geometry = soup(count, seed);
        let doubtful = check("soup", &geometry, &random_rays(2000, 100 + seed, 1.5));
        assert!(doubtful < 0.05, "{count} triangles: {doubtful} of the rays undecided");
    }
}

#[test]
fn an_empty_scene_is_left_by_every_ray() {
    let mut zero_area = Geometry::default();
    push(&mut zero_area, [Vec3::ZERO, Vec3::X, Vec3::X]);
    push(&mut zero_area, [Vec3::ONE; 3]);
    for geometry in [Geometry::default(), zero_area] {
        let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
        assert_eq!(accel.triangle_count(), 0);
        let rays = random_rays(100, 7, 1.5);
        for (tracer, on_device) in OnDevice::both(&accel) {
            for hit in on_device.trace(&rays, REFILLING) {
                assert_eq!((hit.material, hit.distance), (NO_MATERIAL, -1.0), "{tracer}");
            }
            let hits = vec![Hit::default(); 100];
            let towards = ShadowRay { direction: [0.0, 1.0, 0.0], contribution: [1.0; 3] };
            let visible = on_device.shadow(&hits, &[towards; 300], REFILLING);
            assert!(visible.iter().all(|visible| *visible == 1), "{tracer}");
        }
        assert_eq!(accel.closest(Vec3::ONE, Vec3::X), None);
    }
}

#[test]
fn degenerate_triangles_do_no_harm() {
    let mut geometry = soup(300, 11);
    let mut random = Random(12);
    for _ in 0..300 {
        let (p, q) = (random.point(), random.point());
        // Points, segments, needles.
        push(&mut geometry, [p, p, p]);
        push(&mut geometry, [p, q, q]);
        push(&mut geometry, [p, q, p.lerp(q, 0.5) + 1e-7 * random.point()]);
        push(&mut geometry, [p, q, p + 1e-4 * random.point()]);
    }
    let doubtful = check("degenerate", &geometry, &random_rays(2000, 13, 1.5));
    assert!(doubtful < 0.1, "{doubtful}");
}

#[test]
fn coincident_triangles_are_one() {
    let mut geometry = Geometry::default();
    for _ in 0..2000 {
        push(&mut geometry, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    }
    check("coincident", &geometry, &random_rays(500, 17, 1.5));
}

#[test]
fn small_and_large_coordinates_match_brute_force() {
    for scale in [1e-9, 1e-3, 1e3, 1e8] {
        let geometry = scaled(&soup(500, 21), scale);
        let doubtful =
            check(&format!("scale {scale}"), &geometry, &random_rays(1000, 22, 1.5 * scale));
        assert!(doubtful < 0.1, "scale {scale}: {doubtful}");
    }
}

/// Rays along the axes and in the planes of the faces of a grid of boxes.
#[test]
fn axis_aligned_boxes_and_rays() {
    let mut geometry = Geometry::default();
    for index in 0..27_u32 {
        let cell = Vec3::new((index % 3) as f32, (index / 3 % 3) as f32, (index / 9) as f32);
        push_box(&mut geometry, 2.0 * cell, Vec3::splat(0.75), Quat::IDENTITY);
    }
    let mut rays = Vec::new();
    let mut random = Random(31);
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for sign in [-1.0, 1.0] {
            for _ in 0..500 {
                let origin = 4.0 * random.point() + 2.0;
                rays.push(ray(origin, sign * axis));
                // In the planes of faces, along edges and through corners.
                let on_plane = (origin * 4.0).round() / 4.0;
                rays.push(ray(on_plane, sign * axis));
                let slanted = (random.direction_from_point() * (Vec3::ONE - axis)).normalize();
                rays.push(ray(on_plane, slanted));
                rays.push(ray(origin, slanted));
            }
        }
    }
    let doubtful = check("boxes", &geometry, &rays);
    assert!(doubtful < 0.6, "{doubtful}");
}

#[test]
fn obvhs_finds_the_same() {
    let geometry = soup(2000, 41);
    let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
    let triangles: Vec<RtTriangle> = (0..accel.triangle_count() as u32)
        .map(|index| {
            let [a, b, c] = accel.triangle(index).vertices.map(|v| v.position.into());
            RtTriangle::new(a, b, c)
        })
        .collect();
    let bvh = CwBvh {
        nodes: bytemuck::cast_slice::<_, CwBvhNode>(&accel.nodes).to_vec(),
        ..CwBvh::default()
    };
    let rays = random_rays(20_000, 42, 1.5);
    for (tracer, on_device) in OnDevice::both(&accel) {
        let hits = on_device.trace(&rays, REFILLING);
        let mut different = 0;
        for (ray, hit) in rays.iter().zip(&hits) {
            let theirs = obvhs::ray::Ray::new_inf(ray.origin.into(), ray.direction.into());
            let mut nearest = RayHit::none();
            bvh.ray_traverse(theirs, &mut nearest, |ray, index| triangles[index].intersect(ray));
            let ours = if hit.distance < 0.0 { f32::INFINITY } else { hit.distance };
            different +=
                usize::from(ours != nearest.t && (ours - nearest.t).abs() > 1e-6 + 1e-5 * ours);
        }
        // Rounding decides on rays through edges.
        assert!(different <= 2, "{tracer}: {different} of 20,000 rays differ");
    }
}

/// No ray from inside at the vertices and edges of closed meshes gets out.
#[test]
fn closed_meshes_do_not_leak() {
    let mut turned = Geometry::default();
    push_box(&mut turned, Vec3::ZERO, Vec3::new(3.0, 1.5, 4.0), Quat::from_rotation_y(0.7));
    let mut straight = Geometry::default();
    push_box(&mut straight, Vec3::ZERO, Vec3::new(3.0, 1.5, 4.0), Quat::IDENTITY);
    let far_away = {
        let mut geometry = sphere(24, 1.0);
        for position in &mut geometry.positions {
            position[0] += 100.0;
        }
        geometry
    };
    for (name, geometry, centre) in [
        ("sphere", sphere(24, 1.0), Vec3::ZERO),
        ("sphere at 100 m", far_away, 100.0 * Vec3::X),
        ("turned box", turned, Vec3::ZERO),
        ("box", straight, Vec3::ZERO),
    ] {
        let mut random = Random(51);
        let mut rays = Vec::new();
        while rays.len() < 40_000 {
            let pick = (random.uniform_f32() * geometry.triangles.len() as f32) as usize;
            let corners = geometry.triangles[pick.min(geometry.triangles.len() - 1)];
            let [a, b, _] = corners.map(|v| Vec3::from(geometry.positions[v as usize]));
            let origin = centre + 0.3 * random.point();
            let target = match rays.len() % 3 {
                0 => a,
                1 => a.lerp(b, 0.5),
                _ => a.lerp(b, random.uniform_f32()),
            };
            rays.push(ray(origin, (target - origin).normalize()));
        }
        let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
        for (tracer, on_device) in OnDevice::both(&accel) {
            let hits = on_device.trace(&rays, REFILLING);
            let leaks = hits.iter().filter(|hit| hit.material == NO_MATERIAL).count();
            // The host's test is watertight along edges, but not for rays right at vertices, a third here.
            let at_vertices = if tracer == "host" { rays.len() / 1000 } else { 0 };
            assert!(leaks <= at_vertices, "{name}, {tracer}: {leaks} of {} rays leak", rays.len());
        }
    }
}

/// Draws hits on closed meshes of slivers, and rays that leave them to the outside.
fn leaving_rays(geometry: &Geometry, scale: f32, count: usize) -> (Vec<Hit>, Vec<ShadowRay>) {
    let mut random = Random(61);
    let mut hits = Vec::new();
    let mut shadow_rays = Vec::new();
    for _ in 0..count {
        let pick = (random.uniform_f32() * geometry.triangles.len() as f32) as usize;
        let corners = geometry.triangles[pick.min(geometry.triangles.len() - 1)];
        let [a, b, c] = corners.map(|v| Vec3::from(geometry.positions[v as usize]));
        let (u, v) = (random.uniform_f32(), random.uniform_f32());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        // Keep off the edges, where a ray would have to leave the surface beyond as well.
        let (u, v) = (0.002 + 0.994 * u, 0.002 + 0.994 * v);
        let normal = ((b - a) / scale).cross((c - a) / scale).normalize();
        hits.push(Hit {
            position: ((1.0 - u - v) * a + u * b + v * c).into(),
            geometric_normal: normal.into(),
            ..Hit::default()
        });
        // Make half of them graze, but not so much that rounding decides on their side.
        let along = random.direction_from_point();
        let cosine =
            random.uniform_f32().max(1e-3) * if random.uniform_f32() < 0.5 { 1.0 } else { 1e-2 };
        let outward = (along - along.dot(normal) * normal).normalize()
            * (1.0 - cosine * cosine).sqrt()
            + cosine * normal;
        shadow_rays.push(ShadowRay { direction: outward.into(), contribution: [1.0; 3] });
    }
    (hits, shadow_rays)
}

#[test]
fn rays_leave_their_surface_at_every_scale() {
    // A ray that leaves a convex body must not meet it again.
    for rotation in [Quat::IDENTITY, Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1)] {
        for half in
            [Vec3::new(3.0, 1.5, 4.0), Vec3::new(3.0, 0.01, 4.0), Vec3::new(4.0, 0.02, 0.02)]
        {
            let mut geometry = Geometry::default();
            push_box(&mut geometry, Vec3::new(0.5, 1.0, -0.5), half, rotation);
            for scale in [1.0, 1e-3, 1e3, 1.0 / 1024.0, 1024.0] {
                let geometry = scaled(&geometry, scale);
                let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
                let (hits, outward) = leaving_rays(&geometry, scale, 20_000);
                let inward: Vec<ShadowRay> = outward
                    .iter()
                    .map(|ray| ShadowRay { direction: ray.direction.map(|x| -x), ..*ray })
                    .collect();
                for (tracer, on_device) in OnDevice::both(&accel) {
                    let visible = on_device.shadow(&hits, &outward, REFILLING);
                    let blocked = visible.iter().filter(|visible| **visible == 0).count();
                    assert_eq!(blocked, 0, "{tracer}, outside, half size {half}, scale {scale}");
                    let visible = on_device.shadow(&hits, &inward, REFILLING);
                    let leaks = visible.iter().filter(|visible| **visible == 1).count();
                    assert_eq!(leaks, 0, "{tracer}, inside, half size {half}, scale {scale}");
                }
            }
        }
    }
}

#[test]
fn a_power_of_two_of_scale_changes_nothing() {
    let geometry = soup(1000, 71);
    let rays = random_rays(3000, 72, 1.5);
    let unscaled = Accel::build(&geometry, ONE_PAGE).unwrap();
    let references = OnDevice::both(&unscaled);
    let trace = |(_, on_device): &(_, OnDevice), rays: &[Ray]| on_device.trace(rays, REFILLING);
    for scale in [1024.0, 1.0 / 1024.0] {
        let accel = Accel::build(&scaled(&geometry, scale), ONE_PAGE).unwrap();
        assert_eq!(accel.ray_offset(), scale * unscaled.ray_offset());
        let moved: Vec<Ray> =
            rays.iter().map(|ray| Ray { origin: ray.origin.map(|x| x * scale), ..*ray }).collect();
        for (scaled, unscaled) in OnDevice::both(&accel).iter().zip(&references) {
            for (hit, reference) in trace(scaled, &moved).iter().zip(&trace(unscaled, &rays)) {
                assert_eq!(hit.material, reference.material, "{}", scaled.0);
                assert_eq!(hit.shading_normal, reference.shading_normal, "{}", scaled.0);
                if hit.material != NO_MATERIAL {
                    assert_eq!(hit.distance, scale * reference.distance, "{}", scaled.0);
                }
            }
        }
    }
}

#[test]
fn pages_of_triangles_make_no_difference() {
    let geometry = soup(1000, 81);
    let rays = random_rays(2000, 82, 1.5);
    let whole = Accel::build(&geometry, ONE_PAGE).unwrap();
    let references = OnDevice::both(&whole);
    // 256, 512 and 1,024 triangles per page make four, two and one page.
    for (page_bytes, pages) in [(48 * 256 + 47, 4), (48 * 512, 2), (48 * 1024, 1)] {
        let accel = Accel::build(&geometry, page_bytes).unwrap();
        assert_eq!(accel.triangle_pages.len(), pages);
        for ((tracer, paged), (_, whole)) in OnDevice::both(&accel).iter().zip(&references) {
            let expected = whole.trace(&rays, REFILLING);
            assert_eq!(paged.trace(&rays, REFILLING), expected, "{tracer}, {pages} pages");
        }
    }
    assert_error(Accel::build(&geometry, 48 * 128), &["1000 triangles", "512"]);
}

#[test]
fn rays_without_need_are_not_traced() {
    let accel = Accel::build(&soup(200, 91), ONE_PAGE).unwrap();
    for (_, on_device) in OnDevice::both(&accel) {
        check_needless(&on_device);
    }
}

fn check_needless(on_device: &OnDevice) {
    let mut rays = random_rays(1000, 92, 1.5);
    let all = on_device.trace(&rays, Schedule::SINGLE);
    for ray in rays.iter_mut().skip(1).step_by(3) {
        ray.is_active = 0;
    }
    for schedule in [Schedule::SINGLE, REFILLING] {
        for (index, (hit, full)) in on_device.trace(&rays, schedule).iter().zip(&all).enumerate() {
            if index % 3 == 1 {
                assert_eq!((hit.material, hit.distance), (NO_MATERIAL, -1.0));
            } else {
                assert_eq!(hit, full);
            }
        }
    }
    // Visibility is 0 for a path that has ended and for a direction that brings nothing.
    let mut hits = vec![Hit { position: [50.0, 0.0, 0.0], ..Hit::default() }; 77];
    for hit in hits.iter_mut().step_by(5) {
        hit.material = NO_MATERIAL;
    }
    let mut shadow_rays =
        vec![ShadowRay { direction: [1.0, 0.0, 0.0], contribution: [0.0, 0.0, 1e-30] }; 5 * 77];
    for ray in shadow_rays.iter_mut().step_by(3) {
        ray.contribution = [0.0; 3];
    }
    for schedule in [Schedule::SINGLE, REFILLING] {
        for (index, visible) in on_device.shadow(&hits, &shadow_rays, schedule).iter().enumerate() {
            let expected = index % 77 % 5 != 0 && index % 3 != 0;
            assert_eq!(*visible, u32::from(expected), "ray {index}");
        }
    }
}

#[test]
fn shadow_rays_agree_with_closest_hits() {
    let geometry = soup(2000, 101);
    let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
    for (tracer, on_device) in OnDevice::both(&accel) {
        // Rounding decides on rays through edges, alike on the device and in its twin.
        check_shadows(&accel, &on_device, if tracer == "host" { 3 } else { 0 });
    }
}

/// Compares shadow rays with those of the twin, but for `undecided` of them.
fn check_shadows(accel: &Accel, on_device: &OnDevice, undecided: u32) {
    let hits: Vec<Hit> = on_device
        .trace(&random_rays(3001, 102, 1.5), Schedule::SINGLE)
        .into_iter()
        .filter(|hit| hit.material != NO_MATERIAL)
        .collect();
    let shadow_rays = random_shadow_rays(4 * hits.len(), &mut Random(103));
    let single = on_device.shadow(&hits, &shadow_rays, Schedule::SINGLE);
    let refilled = on_device.shadow(&hits, &shadow_rays, REFILLING);
    assert_eq!(single, refilled);
    let (mut visible_count, mut different) = (0, 0);
    for (index, (ray, visible)) in shadow_rays.iter().zip(&single).enumerate() {
        let hit = &hits[index % hits.len()];
        let direction = Vec3::from(ray.direction);
        let origin =
            accel.offset_ray_origin(hit.position.into(), hit.geometric_normal.into(), direction);
        let is_occluded = accel.is_occluded(origin, direction);
        different += u32::from((*visible == 0) != is_occluded);
        assert_eq!(is_occluded, accel.closest(origin, direction).is_some(), "ray {index}");
        visible_count += visible;
    }
    assert!(different <= undecided, "{different} of {} rays differ", single.len());
    // Both outcomes occur.
    assert!((100..single.len() as u32 - 100).contains(&visible_count), "{visible_count}");
}

#[test]
fn surfaces_are_consistent() {
    let geometry = sphere(4, 1.0);
    let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
    // Rays come from inside and outside, many at grazing angles to the coarse sphere.
    for (_, on_device) in OnDevice::both(&accel) {
        check_surfaces(&accel, &on_device);
    }
}

fn check_surfaces(accel: &Accel, on_device: &OnDevice) {
    let rays = random_rays(20_000, 111, 1.5);
    let mut turned = 0;
    for (ray, hit) in rays.iter().zip(on_device.trace(&rays, REFILLING)) {
        if hit.material == NO_MATERIAL {
            continue;
        }
        assert_eq!(hit.material, 3);
        let (origin, direction) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
        let position = Vec3::from(hit.position);
        let geometric = Vec3::from(hit.geometric_normal);
        let shading = Vec3::from(hit.shading_normal);
        assert!((geometric.length() - 1.0).abs() < 1e-5 && (shading.length() - 1.0).abs() < 1e-5);
        assert!(geometric.dot(direction) <= 0.0, "{hit:?}");
        assert!(shading.dot(direction) < 0.0, "{hit:?}");
        assert!(position.distance(origin + hit.distance * direction) < 1e-5, "{hit:?}");
        let twin = surface_at(accel, hit.triangle, NO_INSTANCE, origin, direction);
        assert!(twin.position.distance(position) < 1e-6, "{hit:?} {twin:?}");
        assert!(twin.geometric_normal.distance(geometric) < 1e-5, "{hit:?} {twin:?}");
        assert!(twin.shading_normal.distance(shading) < 1e-4, "{hit:?} {twin:?}");
        // The interpolated normal of a sphere points along its radius.
        let side = if geometric.dot(position) > 0.0 { 1.0 } else { -1.0 };
        if side * position.normalize().dot(direction) < -0.02 {
            assert!(shading.distance(side * position.normalize()) < 0.1, "{hit:?}");
        } else {
            turned += 1;
        }
    }
    assert!(turned > 20, "only {turned} grazing hits");
}

/// Rays that meet more triangles in one place than an invocation has steps are counted and still hit.
#[test]
fn rays_that_take_too_long_are_counted() {
    let mut geometry = Geometry::default();
    for _ in 0..40_000 {
        push(&mut geometry, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    }
    let accel = Accel::build(&geometry, ONE_PAGE).unwrap();
    let on_device = OnDevice::new(&accel);
    let through = ray(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z);
    let hits = on_device.trace(&[through; 8], Schedule::SINGLE);
    assert!(hits.iter().all(|hit| hit.distance == 1.0));
    assert_eq!(on_device.overruns(), 8);
}

#[test]
fn impossible_geometry_is_refused() {
    let mut geometry = soup(2, 121);
    geometry.positions[4][1] = f32::NAN;
    assert_error(Accel::build(&geometry, ONE_PAGE), &["vertex 4", "NaN"]);
    geometry.positions[4][1] = 1e30;
    assert_error(Accel::build(&geometry, ONE_PAGE), &["vertex 4", "1e9"]);
    geometry.positions[4][1] = 0.0;
    geometry.triangles[1][2] = 6;
    assert_error(Accel::build(&geometry, ONE_PAGE), &["triangle 1", "vertex 6"]);
    // Four pages of a triangle each; the tree, which would find the vertex, is not begun.
    let mut geometry = soup(5, 121);
    geometry.triangles[1][2] = 99;
    assert_error(Accel::build(&geometry, 48), &["5 triangles", "hold 4"]);
    assert!(Accel::build(&soup(1, 1), 47).is_err());
    assert!(device().capabilities().missing().is_empty());
}
