//! Orthonormal frames and the lat-long mapping; twin of `glsl/include/frame.glsl`.
//!
//! The z axis of a local frame is the normal; names of vectors in it end in `_local`. The lat-long
//! mapping takes unit directions to the unit square. Its Jacobian dω/(du dv) is 2π² sin θ, with θ
//! measured from +Y.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

/// Right-handed orthonormal basis around a unit normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// x axis.
    pub tangent: Vec3,
    /// y axis.
    pub bitangent: Vec3,
    /// z axis.
    pub normal: Vec3,
}

/// Builds a right-handed orthonormal basis around a unit normal, without branches or singularity.
///
/// Duff et al. 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1), listing 3.
pub fn frame_from_normal(normal: Vec3) -> Frame {
    let handedness = if normal.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (handedness + normal.z);
    let b = normal.x * normal.y * a;
    Frame {
        tangent: Vec3::new(
            1.0 + handedness * normal.x * normal.x * a,
            handedness * b,
            -handedness * normal.x,
        ),
        bitangent: Vec3::new(b, handedness + normal.y * normal.y * a, -normal.y),
        normal,
    }
}

impl Frame {
    /// Transforms a world direction into this frame.
    pub fn to_local(&self, direction: Vec3) -> Vec3 {
        Vec3::new(
            self.tangent.dot(direction),
            self.bitangent.dot(direction),
            self.normal.dot(direction),
        )
    }

    /// Transforms a direction in this frame to the world.
    pub fn to_world(&self, direction_local: Vec3) -> Vec3 {
        self.tangent * direction_local.x
            + self.bitangent * direction_local.y
            + self.normal * direction_local.z
    }
}

/// (sin πx, cos πx) for 0 ≤ x ≤ 2 with small *relative* error near the zeros. Shader built-ins do
/// not promise that, and densities over the sphere divide by the sine near the poles.
///
/// Polynomials of Cephes' `sinf` and `cosf` (Moshier 1992) on arguments up to π/4.
#[expect(clippy::excessive_precision, reason = "coefficients as published")]
pub fn sin_cos_pi(x: f32) -> Vec2 {
    let quarter_turns = (2.0 * x + 0.5).floor();
    let angle = PI * (x - 0.5 * quarter_turns);
    let z = angle * angle;
    let s = ((-1.9515295891e-4 * z + 8.3321608736e-3) * z - 1.6666654611e-1) * z * angle + angle;
    let c = ((2.443315711809948e-5 * z - 1.388731625493765e-3) * z + 4.166664568298827e-2) * z * z
        - 0.5 * z
        + 1.0;
    let quadrant = quarter_turns as u32 & 3;
    let turned = if quadrant & 1 == 0 { Vec2::new(s, c) } else { Vec2::new(c, -s) };
    if quadrant & 2 == 0 { turned } else { -turned }
}

/// Lat-long coordinates of a unit direction: u = 0.5 + atan2(x, −z)/2π, v = θ/π.
///
/// u is 0.5 at the poles. The direction need not be exactly unit.
pub fn lat_long_from_direction(direction: Vec3) -> Vec2 {
    let sin_theta = (direction.x * direction.x + direction.z * direction.z).sqrt();
    let azimuth = if sin_theta == 0.0 { 0.0 } else { direction.x.atan2(-direction.z) };
    Vec2::new(0.5 + azimuth / (2.0 * PI), sin_theta.atan2(direction.y) / PI)
}

/// Inverse of [`lat_long_from_direction`]: unit direction at a point of the unit square.
pub fn direction_from_lat_long(uv: Vec2) -> Vec3 {
    let azimuth = sin_cos_pi(2.0 * uv.x);
    let theta = sin_cos_pi(uv.y);
    Vec3::new(-theta.x * azimuth.x, theta.y, theta.x * azimuth.y)
}
