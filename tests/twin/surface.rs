//! Material and surface where a ray meets a triangle: twin of `triangle_material` and `surface_at` in
//! `glsl/include/bvh.glsl`, with the same names and order of operations.

use fenestra::{
    accel::{
        Accel, TriangleRecord, VertexRecord,
        instances::Record,
        traverse::{depth, edge_functions, placed},
    },
    math::{frame::frame_from_normal, octahedron},
    shader::constants::FLAT_NORMAL,
};
use glam::Vec3;

/// Cosine with the outgoing direction below which shading normals are turned.
const LEAST_SHADING_COSINE: f32 = 0.01;

/// Surface where a ray meets a triangle; twin of the shader's `Hit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Point on the triangle, metres.
    pub position: Vec3,
    /// Distance along the ray, metres.
    pub distance: f32,
    /// Unit normal of the triangle, turned toward the ray's origin.
    pub geometric_normal: Vec3,
    /// Unit interpolated normal, turned toward the ray's origin, with a positive cosine to it.
    pub shading_normal: Vec3,
}

/// Material of a triangle in an instance, or in a tree of one level with `NO_INSTANCE`.
///
/// # Panics
/// Either is out of range.
pub fn triangle_material(accel: &Accel, triangle: u32, instance: u32) -> u32 {
    let own = accel.triangle_materials[triangle as usize];
    accel
        .instances
        .get(instance as usize)
        .map_or(own, |instance| instance.first_material + (own & instance.material_mask))
}

/// Computes the surface that a ray meets on `triangle` in `instance`, which is `NO_INSTANCE` in a
/// tree of one level.
///
/// # Panics
/// `triangle` is out of range.
pub fn surface_at(
    accel: &Accel,
    triangle: u32,
    instance: u32,
    origin: Vec3,
    direction: Vec3,
) -> Surface {
    let TriangleRecord { vertices } = accel.triangle(triangle);
    let instance = accel.instances.get(instance as usize);
    let [a, b, c] = vertices.map(|vertex| placed(instance, vertex.position));
    let frame = frame_from_normal(direction);
    let local = [a, b, c].map(|vertex| frame.to_local(vertex - origin));
    let areas = edge_functions(local);
    let area = areas.x + areas.y + areas.z;
    let weights = areas / area;
    let normal = (b - a).cross(c - a);
    let normal = (normal / normal.abs().max_element()).normalize();
    let geometric_normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
    let mut shading_normal = geometric_normal;
    if vertices[0].normal != FLAT_NORMAL {
        let [a, b, c] = vertices.map(|vertex: VertexRecord| {
            let normal = octahedron::unpack(vertex.normal);
            instance.map_or(normal, |instance| normal_to_world(instance, normal))
        });
        let interpolated = weights.x * a + weights.y * b + weights.z * c;
        if interpolated.length_squared() > 1e-12 {
            let unit = interpolated.normalize();
            shading_normal = if unit.dot(geometric_normal) < 0.0 { -unit } else { unit };
        }
    }
    let cosine = -geometric_normal.dot(direction);
    Surface {
        position: weights.x * a + weights.y * b + weights.z * c,
        distance: depth(areas, local) / area,
        geometric_normal,
        shading_normal: consistent_normal(
            shading_normal,
            -direction,
            LEAST_SHADING_COSINE.min(cosine).max(1e-6),
        ),
    }
}

/// Takes a normal of the mesh to the world, a unit vector unless it has no direction.
fn normal_to_world(instance: &Record, normal: Vec3) -> Vec3 {
    let [x, y, z] = instance.object_from_world.map(|[x, y, z, _]| Vec3::new(x, y, z));
    let world = normal.x * x + normal.y * y + normal.z * z;
    let largest = world.abs().max_element();
    if largest > 0.0 { (world / largest).normalize() } else { Vec3::ZERO }
}

/// Turns a shading normal toward `outgoing_direction` until their cosine is at least `least`.
fn consistent_normal(shading_normal: Vec3, outgoing_direction: Vec3, least: f32) -> Vec3 {
    let cosine = shading_normal.dot(outgoing_direction);
    let tangential = shading_normal - cosine * outgoing_direction;
    let size = tangential.length();
    if cosine >= least || size == 0.0 {
        return shading_normal;
    }
    tangential * ((1.0 - least * least).sqrt() / size) + least * outgoing_direction
}
