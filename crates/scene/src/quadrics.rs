//! Sphere, disk, cylinder, rectangle and cube as scene formats define them: meshes with the exact
//! normals and texture coordinates at their vertices.
//!
//! Axes and texture coordinates are those of Mitsuba 3, with +Z as the axis of the round ones. Flat
//! and open shapes face +Z or away from their axis.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec3};

use super::mesh::Mesh;

/// Segments of a full turn; the chords of a circle are within 0.03% of its radius.
const SEGMENTS: usize = 128;
/// Rows of a sphere from pole to pole.
const SPHERE_ROWS: usize = 64;

/// Sphere about the origin, normals outward: u from 0 at +X towards +Y to 1 after the share `turns` of a
/// turn, v from 0 to 1 between two angles from +Z.
pub(crate) fn sphere(radius: f32, [first, last]: [f64; 2], turns: f64) -> Mesh {
    let radius = f64::from(radius);
    grid(SPHERE_ROWS, |u, v| {
        let angle = first + (last - first) * v;
        let (turn, (sine, cosine)) = (turn(turns * u), angle.sin_cos());
        // Single out the pole, where a sine is not exactly 0.
        let sine = if angle == PI { 0.0 } else { sine };
        let normal = (turn * sine).extend(cosine);
        Vertex { position: normal * radius, normal, uv: [u, v] }
    })
}

/// Ring about the origin in the plane z = 0, with the normal +Z: u = r/`radius`, v from 0 at +X towards +Y
/// to 1 after the share `turns` of a turn. An `inner_radius` of 0 makes a disk.
pub(crate) fn disk(radius: f32, inner_radius: f32, turns: f64) -> Mesh {
    let (radius, inner) = (f64::from(radius), f64::from(inner_radius));
    grid(1, |u, v| {
        let distance = inner + (radius - inner) * v;
        let position = (turn(turns * u) * distance).extend(0.0);
        Vertex { position, normal: DVec3::Z, uv: [distance / radius, u] }
    })
}

/// Open cylinder about the z axis, normals outward: u from 0 at +X towards +Y to 1 after the share `turns` of
/// a turn, v from 0 at `z_min` to 1 at `z_max`.
pub(crate) fn cylinder(radius: f32, [z_min, z_max]: [f32; 2], turns: f64) -> Mesh {
    let (radius, z_min, z_max) = (f64::from(radius), f64::from(z_min), f64::from(z_max));
    grid(1, |u, v| {
        // Rows run from the top, so that columns × rows points outward.
        let normal = turn(turns * u).extend(0.0);
        let position = (normal * radius).with_z(z_max + (z_min - z_max) * v);
        Vertex { position, normal, uv: [u, 1.0 - v] }
    })
}

/// Square from (−1, −1, 0) to (1, 1, 0) with the normal +Z: u along +X, v along +Y.
pub(crate) fn rectangle() -> Mesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let uvs = corners.map(|corner: [f32; 2]| corner.map(|coordinate| 0.5 * (coordinate + 1.0)));
    Mesh {
        positions: corners.map(|[x, y]| [x, y, 0.0]).to_vec(),
        normals: vec![[0.0, 0.0, 1.0]; 4],
        uvs: [uvs.to_vec(), Vec::new()],
        triangles: vec![[0, 1, 2], [2, 3, 0]],
        ..Mesh::default()
    }
}

/// Corners of a cube's faces, counter-clockwise from outside, with the texture coordinates
/// (0, 1), (1, 1), (1, 0) and (0, 0).
const CUBE_FACES: [[[f32; 3]; 4]; 6] = [
    [[1.0, -1.0, -1.0], [1.0, -1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, -1.0, -1.0]],
    [[1.0, 1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
    [[1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]],
    [[1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]],
    [[-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, -1.0]],
    [[1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, -1.0], [-1.0, 1.0, -1.0]],
];

/// Cube from (−1, −1, −1) to (1, 1, 1), normals outward, every face with the whole unit square of
/// texture coordinates.
pub(crate) fn cube() -> Mesh {
    let mut mesh = Mesh::default();
    for face in CUBE_FACES {
        let first = mesh.positions.len() as u32;
        let [a, b, c] = [face[0], face[1], face[2]].map(Vec3::from_array);
        let normal = (b - a).cross(c - a).normalize().to_array();
        mesh.positions.extend(face);
        mesh.normals.extend([normal; 4]);
        mesh.uvs[0].extend([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        mesh.triangles.extend([[0, 1, 2], [3, 0, 2]].map(|corners| corners.map(|at| first + at)));
    }
    mesh
}

struct Vertex {
    position: DVec3,
    normal: DVec3,
    uv: [f64; 2],
}

/// Unit vector at the share `u` of a turn from +X towards +Y; 1 is 0 bit for bit.
fn turn(u: f64) -> DVec2 {
    DVec2::from_angle(TAU * (u % 1.0))
}

/// Surface over a grid of a turn, or part of one, by `rows`; rows × columns (cross product) points outward.
///
/// Where a row has no extent, as at a pole, each of its triangles has a vertex of its own in the
/// middle of the column: all directions meet there, and no one coordinate would do.
fn grid(rows: usize, vertex: impl Fn(f64, f64) -> Vertex) -> Mesh {
    let mut mesh = Mesh::default();
    let share = |row: usize| row as f64 / rows as f64;
    let is_point =
        |row: usize| vertex(0.0, share(row)).position == vertex(0.5, share(row)).position;
    for row in 0..=rows {
        let shift = if is_point(row) { 0.5 } else { 0.0 };
        for column in 0..=SEGMENTS {
            let u = ((column as f64 + shift) / SEGMENTS as f64).min(1.0);
            let Vertex { position, normal, uv } = vertex(u, share(row));
            mesh.positions.push(position.as_vec3().to_array());
            mesh.normals.push(normal.as_vec3().to_array());
            mesh.uvs[0].push(uv.map(|coordinate| coordinate as f32));
        }
    }
    let at = |row: usize, column: usize| (row * (SEGMENTS + 1) + column) as u32;
    for row in 0..rows {
        let (starts_in_point, ends_in_point) = (is_point(row), is_point(row + 1));
        for column in 0..SEGMENTS {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column + 1), at(row + 1, column));
            if !ends_in_point {
                mesh.triangles.push([a, d, c]);
            }
            if !starts_in_point {
                mesh.triangles.push(if ends_in_point { [a, d, b] } else { [a, c, b] });
            }
        }
    }
    mesh
}
