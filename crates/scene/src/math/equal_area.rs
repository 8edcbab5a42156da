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
