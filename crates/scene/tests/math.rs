//! Placements of objects, the square map of the sphere, and colours below coats.
#![expect(clippy::unwrap_used, reason = "tests may panic")]

use fenestra_scene::{
    Geometry,
    coat::{albedo_below_coat, base_below_coat},
    geometry::Dropped,
    instance::Instance,
    math::equal_area::{direction_from_square, square_from_direction},
    mesh::Mesh,
    transform::Transform,
};
use glam::{DMat4, Vec3, vec2};

fn close(found: [f32; 3], expected: [f32; 3]) -> bool {
    Vec3::from_array(found).abs_diff_eq(Vec3::from_array(expected), 1e-6)
}

#[test]
fn turns_go_about_x_then_y_then_z() {
    // X takes +Y to +Z, Y takes +Z to +X, Z takes +X to +Y.
    let transform = Transform::new([1.0; 3], [90.0, 90.0, 90.0], [0.0; 3]);
    assert!(close(transform.position([0.0, 1.0, 0.0]), [0.0, 1.0, 0.0]));
    let transform = Transform::new([1.0; 3], [90.0, 90.0, 0.0], [0.0; 3]);
    assert!(close(transform.position([0.0, 1.0, 0.0]), [1.0, 0.0, 0.0]));
}

#[test]
fn normals_stay_at_right_angles_to_the_surface() {
    let transform = Transform::new([4.0, 1.0, -0.5], [20.0, 40.0, 60.0], [0.0; 3]);
    let tangent = Vec3::new(1.0, -1.0, 0.5);
    let normal = Vec3::new(1.0, 1.0, 0.0).normalize();
    let world_tangent = transform.linear * tangent;
    let world_normal = Vec3::from_array(transform.normal(normal.to_array()));
    assert!(world_tangent.normalize().dot(world_normal).abs() < 1e-6);
    assert!((world_normal.length() - 1.0).abs() < 1e-6);
    assert!(transform.mirrors);
}

#[test]
fn a_matrix_gives_the_same_transform() {
    let expected = Transform::new([4.0, 1.0, -0.5], [0.0, 90.0, 180.0], [1.0, 2.0, 3.0]);
    let columns = expected.linear.as_dmat3();
    let matrix = DMat4::from_mat3_translation(columns, expected.translate.as_dvec3());
    let found = Transform::from_matrix(matrix).unwrap();
    assert_eq!(found.position([1.0, 2.0, 3.0]), expected.position([1.0, 2.0, 3.0]));
    let normal = [0.2, 0.3, 0.4];
    assert!(close(found.normal(normal), expected.normal(normal)));
    assert!(found.mirrors);
    assert!(Transform::from_matrix(DMat4::ZERO).is_none());
}

#[test]
fn tiny_and_huge_scales_keep_their_normals() {
    for factor in [1e-30, 1e30] {
        let transform = Transform::new([factor; 3], [0.0, 0.0, 30.0], [0.0; 3]);
        let normal = Vec3::from_array(transform.normal([0.0, 1.0, 0.0]));
        assert!((normal.length() - 1.0).abs() < 1e-6, "{factor}: {normal}");
    }
}

fn corner_mesh() -> Mesh {
    Mesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    }
}

#[test]
fn boxes_of_instances_have_eight_corners() {
    let place = Transform::new([2.0, 1.0, 1.0], [0.0; 3], [0.0, 0.0, 5.0]);
    let instance = Instance::new(0, &place, 0, true).unwrap();
    let mut corners = instance.corners([Vec3::ZERO, Vec3::ONE]).map(|corner| corner.to_array());
    corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let expected = [0.0, 2.0].map(|x| [0.0, 1.0].map(|y| [5.0, 6.0].map(|z| [x, y, z])));
    assert_eq!(corners, expected.as_flattened().as_flattened());
}

#[test]
fn bad_triangles_are_dropped_and_counted() {
    let mut mesh = corner_mesh();
    mesh.positions.push([f32::NAN, 0.0, 0.0]);
    mesh.positions.push([1e-20, 1e-20, 0.0]);
    mesh.triangles = vec![[0, 1, 3], [0, 1, 2], [1, 1, 2], [0, 1, 4], [0, 1, 5]];
    let mut geometry = Geometry::default();
    let place = Transform::new([1.0; 3], [0.0; 3], [5.0, 0.0, 0.0]);
    let dropped = geometry.append(&mesh, &place, |index| index as u32);
    // In world space the sixth vertex falls onto the first.
    assert_eq!(dropped, Dropped { degenerate: 3, non_finite: 1, normals: 0 });
    assert_eq!(geometry.triangles, [[0, 1, 2]]);
    assert_eq!(geometry.materials, [1]);
    assert_eq!(geometry.normals.len(), geometry.positions.len());
    assert!(geometry.positions.iter().flatten().all(|coordinate| coordinate.is_finite()));
}

#[test]
fn normals_that_are_not_finite_mark_flat_shading() {
    let mut mesh = corner_mesh();
    mesh.normals = vec![[0.0, 0.0, 2.0], [f32::INFINITY, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]];
    let mut geometry = Geometry::default();
    let place = Transform::new([1.0; 3], [0.0; 3], [0.0; 3]);
    assert_eq!(geometry.append(&mesh, &place, |_| 0).normals, 1);
    let expected = [[0.0, 0.0, 1.0], [0.0; 3], [0.0; 3], [0.0, 0.0, 1.0]];
    assert_eq!(geometry.normals, expected);
}

#[test]
fn colours_of_vertices_lie_from_black_to_white() {
    let mut mesh = corner_mesh();
    mesh.colors = vec![[2.0, -1.0, 0.5, 3.0], [f32::NAN; 4], [0.25; 4], [0.0; 4]];
    let mut geometry = Geometry::default();
    geometry.append(&mesh, &Transform::new([1.0; 3], [0.0; 3], [0.0; 3]), |_| 0);
    assert_eq!(geometry.colors, [[1.0, 0.0, 0.5, 1.0], [1.0; 4], [0.25; 4], [0.0; 4]]);
}

/// Every cell of the square has the solid angle of its area. Its edges are curved near the poles, so
/// that parts of it are added up, each nearly flat: half the cross product of its diagonals.
#[test]
fn cells_have_equal_solid_angles() {
    const SIDE: u32 = 512;
    const PARTS: u32 = 8;
    let corner = |x: u32, y: u32| {
        direction_from_square(vec2(x as f32, y as f32) / (SIDE * PARTS) as f32).as_dvec3()
    };
    let area = |x: u32, y: u32| {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        0.5 * (c - a).cross(d - b).length()
    };
    let expected = 4.0 * std::f64::consts::PI / f64::from(SIDE * SIDE);
    for (x, y) in (0..SIDE).step_by(5).flat_map(|x| (0..SIDE).step_by(7).map(move |y| (x, y))) {
        let parts = (0..PARTS * PARTS).map(|part| (part % PARTS, part / PARTS));
        let area: f64 = parts.map(|(i, j)| area(x * PARTS + i, y * PARTS + j)).sum();
        assert!((area / expected - 1.0).abs() < 0.01, "{x} {y}: {area}, expected {expected}");
    }
}

#[test]
fn the_map_is_its_own_inverse() {
    for i in 0..20_000_u32 {
        let at = vec2((i % 151) as f32 / 151.0, (i % 137) as f32 / 137.0);
        let direction = direction_from_square(at);
        assert!((direction.length() - 1.0).abs() < 1e-6, "{at}");
        let back = direction_from_square(square_from_direction(direction));
        assert!(back.distance(direction) < 2e-6, "{at}: {direction}, then {back}");
    }
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
        let back = direction_from_square(square_from_direction(axis));
        assert!(back.distance(axis) < 2e-6, "{axis}, then {back}");
    }
}

#[test]
fn colours_deepen_below_a_coat_and_white_stays() {
    let below = albedo_below_coat(1.5);
    assert_eq!((below(0.0), below(1.0)), (0.0, 1.0));
    // The inside of glass throws back three fifths [Egan & Hilgeman 1973]; light bounces in a series:
    // ρ T Σ (ρ Fi)ⁿ, with T = 1 − Fi.
    assert!((below(1e-4) / 1e-4 - 0.4037).abs() < 1e-3, "{}", below(1e-4));
    let series: f32 = (0..200).map(|n| 0.5 * 0.4037 * (0.5 * 0.5963_f32).powi(n)).sum();
    assert!((below(0.5) - series).abs() < 1e-3, "{} and {series}", below(0.5));
    let base = base_below_coat(1.5);
    assert!([0.0, 0.3, 1.0].iter().all(|&albedo| (base(below(albedo)) - albedo).abs() < 1e-6));
    assert!((albedo_below_coat(1.0)(0.5) - 0.5).abs() < 1e-3, "no coat");
}
