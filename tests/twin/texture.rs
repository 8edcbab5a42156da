//! Tangents, normal maps and attributes of triangles: twin of the parts of `glsl/include/texture.glsl` that
//! the library does without, in the same order and with the same names.

pub use fenestra::surface::lookup::{
    image_coordinates, surface_color, surface_opacity, texture_value,
};
use fenestra::{
    accel::attributes::TriangleAttributes,
    math::octahedron,
    shader::constants::{
        ATTRIBUTE_FIRST_UVS, ATTRIBUTE_SECOND_UVS, ATTRIBUTE_TANGENT, FLAT_NORMAL,
    },
    surface::lookup::AttributeWords,
};
use glam::{Vec2, Vec3, Vec4};

/// Tangent that the mesh brings, made a unit vector at right angles to the normal; 0 for none.
pub fn stored_tangent(tangent: Vec4, normal: Vec3) -> Vec4 {
    let stored = tangent.truncate() - tangent.truncate().dot(normal) * normal;
    let squared = stored.length_squared();
    if squared > 1e-8 {
        let sign = if tangent.w < 0.0 { -1.0 } else { 1.0 };
        return (stored / squared.sqrt()).extend(sign);
    }
    Vec4::ZERO
}

/// Unit shading normal after a normal map whose value is `texel`, 0 to 1. `shading_normal` and the
/// result are on the same side: the front for a `side` of 1, the back for −1. `tangent` is that of the
/// front; 0 leaves the normal as it is.
pub fn mapped_normal(
    texel: Vec3,
    normal_scale: f32,
    tangent: Vec4,
    shading_normal: Vec3,
    side: f32,
) -> Vec3 {
    if tangent.w == 0.0 {
        return shading_normal;
    }
    let normal = side * shading_normal;
    let local = 2.0 * texel - 1.0;
    let bitangent = tangent.w * normal.cross(tangent.truncate());
    let mapped = normal_scale * local.x * tangent.truncate()
        + normal_scale * local.y * bitangent
        + local.z * normal;
    let squared = mapped.length_squared();
    if squared > 1e-12 { side * mapped / squared.sqrt() } else { shading_normal }
}

/// Attributes of a point of a triangle, as in the shader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attributes {
    /// First set of texture coordinates; 0 where there is none.
    pub uv0: Vec2,
    /// Second set.
    pub uv1: Vec2,
    /// Tangent of any length along u of the first set, and sign of the bitangent; 0 for none.
    pub tangent: Vec4,
    /// Linear colour and opacity; 1 where there is none.
    pub color: Vec4,
}

/// Attributes of all triangles as look-ups find them.
pub fn words(stored: &TriangleAttributes) -> AttributeWords<'_, [u32]> {
    AttributeWords { bits: stored.bits, words: &stored.words }
}

/// Attributes at the point of a triangle in BVH order with these barycentric coordinates.
pub fn triangle_attributes(
    stored: &TriangleAttributes,
    triangle: u32,
    weights: Vec3,
) -> Attributes {
    let stored = words(stored);
    let uv = |bit| stored.interpolated_uv(triangle, weights, bit);
    let (uv0, uv1) = (uv(ATTRIBUTE_FIRST_UVS), uv(ATTRIBUTE_SECOND_UVS));
    let color = stored.color(triangle, weights);
    let mut attributes = Attributes { uv0, uv1, tangent: Vec4::ZERO, color };
    if stored.bits & ATTRIBUTE_TANGENT != 0 {
        let [a, b, c] =
            [0, 1, 2].map(|corner| stored.corner_attribute(triangle, corner, ATTRIBUTE_TANGENT));
        if ![a[0], b[0], c[0]].contains(&FLAT_NORMAL) {
            let tangent = weights.x * octahedron::unpack(a[0])
                + weights.y * octahedron::unpack(b[0])
                + weights.z * octahedron::unpack(c[0]);
            attributes.tangent = tangent.extend(f32::from_bits(a[1]));
        }
    }
    attributes
}
