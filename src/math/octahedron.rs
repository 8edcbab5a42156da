//! Unit vectors in 32 bits: octahedral map, 16 bits per coordinate. Twin: `unpack_normal` in `bvh.glsl`.
//!
//! Z. H. Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT
//! 3(2), 2014.

use glam::{Vec2, Vec3};

/// Largest magnitude of a quantised coordinate.
const SCALE: f32 = 32767.0;

/// Folds the lower half of the octahedron over the upper, and back.
fn fold(p: Vec2) -> Vec2 {
    let sign = Vec2::new(1.0_f32.copysign(p.x), 1.0_f32.copysign(p.y));
    (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * sign
}

/// Packs a unit vector, x in the low half.
pub fn pack(normal: Vec3) -> u32 {
    let n = normal / (normal.x.abs() + normal.y.abs() + normal.z.abs());
    let p = if n.z < 0.0 { fold(n.truncate()) } else { n.truncate() };
    let quantise = |x: f32| (x.clamp(-1.0, 1.0) * SCALE).round() as i16 as u16 as u32;
    quantise(p.x) | (quantise(p.y) << 16)
}

/// Unpacks a unit vector, within 1e-4 rad of the packed one.
pub fn unpack(packed: u32) -> Vec3 {
    let p = Vec2::new((packed & 0xffff) as u16 as i16 as f32, (packed >> 16) as u16 as i16 as f32)
        / SCALE;
    let z = 1.0 - p.x.abs() - p.y.abs();
    let p = if z < 0.0 { fold(p) } else { p };
    p.extend(z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unpacked_normals_are_close() {
        for i in 0..10_000 {
            let z = 1.0 - (i as f32 + 0.5) / 5_000.0;
            let phi = i as f32 * 2.399_963;
            let r = (1.0 - z * z).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z);
            assert_ne!(pack(n), crate::shader::constants::FLAT_NORMAL);
            assert!(unpack(pack(n)).distance(n) < 1e-4, "{n}");
        }
        for n in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            assert!(unpack(pack(n)).distance(n) < 1e-6, "{n}");
        }
    }
}
