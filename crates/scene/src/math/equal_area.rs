//! Equal-area octahedral map between the sphere and the unit square: twin of `glsl/include/equal_area.glsl`.
//!
//! A part of the square stands for 4π times its area in steradians \[Clarberg 2008\].

use std::f32::consts::PI;

use glam::{Vec2, Vec3, vec2, vec3};

use super::frame::sin_cos_pi;

/// Unit direction at a point of the square.
pub fn direction_from_square(at: Vec2) -> Vec3 {
    let p = 2.0 * at - 1.0;
    // Inside the diamond of the upper hemisphere this is positive.
    let inside = 1.0 - (p.x.abs() + p.y.abs());
    let radius = 1.0 - inside.abs();
    let quarter = if radius > 0.0 { 0.5 * ((p.y.abs() - p.x.abs()) / radius + 1.0) } else { 0.0 };
    let azimuth = sin_cos_pi(0.5 * quarter.clamp(0.0, 1.0));
    let sine = radius * (2.0 - radius * radius).sqrt();
    let z = 1.0 - radius * radius;
    vec3(
        if p.x < 0.0 { -sine * azimuth.y } else { sine * azimuth.y },
        if p.y < 0.0 { -sine * azimuth.x } else { sine * azimuth.x },
        if inside < 0.0 { -z } else { z },
    )
}

/// Point of the square, in \[0, 1\], for a unit direction.
pub fn square_from_direction(direction: Vec3) -> Vec2 {
    let a = direction.abs();
    // The root of 1 − |z|, without cancellation near the poles.
    let radius = ((a.x * a.x + a.y * a.y) / (1.0 + a.z)).sqrt();
    let quarter = if a.x + a.y > 0.0 { a.y.atan2(a.x) * (2.0 / PI) } else { 0.0 };
    let mut p = vec2(radius - radius * quarter, radius * quarter);
    if direction.z < 0.0 {
        p = vec2(1.0 - p.y, 1.0 - p.x);
    }
    let signed = vec2(
        if direction.x < 0.0 { -p.x } else { p.x },
        if direction.y < 0.0 { -p.y } else { p.y },
    );
    (0.5 * signed + 0.5).clamp(Vec2::ZERO, Vec2::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let [a, b, c, d] =
                [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
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
}
