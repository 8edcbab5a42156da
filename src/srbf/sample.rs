//! Sampling of the kernel: sample, density, inverse.
//!
//! `x = 1 − ω·ξ` has density `λe^{−λx}/(1 − e^{−2λ})` on 0…2; the azimuth is uniform.
//!
//! Deviation: \[Wu & Shih 2009\] draw the elevation by a Metropolis walk, whose samples are
//! correlated and whose density holds only in the limit. The distribution inverts in closed form.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{
    kernel::{kernel_integral, kernel_value},
    special::{expm1, log1p},
};

/// Two unit vectors that complete `axis` to a right-handed frame. \[Duff et al. 2017\].
pub fn lobe_frame(axis: Vec3) -> (Vec3, Vec3) {
    let sign = if axis.z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    (
        Vec3::new(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x),
        Vec3::new(b, sign + axis.y * axis.y * a, -axis.y),
    )
}

/// Maps a uniform number `u` in 0…1 to a distance `x = 1 − ω·ξ` in 0…2.
pub fn kernel_sample_distance(bandwidth: f32, u: f32) -> f32 {
    let x = if bandwidth < 1e-4 {
        2.0 * u
    } else if bandwidth > 10.0 {
        // 1 − e^{−2λ} is 1 in 32 bits; the guard keeps the logarithm finite at u = 1.
        -log1p(-u.min(0.999_999_94)) / bandwidth
    } else {
        -log1p(u * expm1(-2.0 * bandwidth)) / bandwidth
    };
    x.clamp(0.0, 2.0)
}

/// Samples a direction with the density of the kernel; `u` is uniform in the unit square.
pub fn kernel_sample(axis: Vec3, bandwidth: f32, u: Vec2) -> Vec3 {
    let x = kernel_sample_distance(bandwidth, u.x);
    let sine = (x * (2.0 - x)).sqrt();
    let azimuth = 2.0 * PI * u.y;
    let (tangent, bitangent) = lobe_frame(axis);
    (1.0 - x) * axis + sine * azimuth.cos() * tangent + sine * azimuth.sin() * bitangent
}

/// Density of [`kernel_sample`] per steradian.
pub fn kernel_pdf(axis: Vec3, bandwidth: f32, direction: Vec3) -> f32 {
    kernel_value(axis, bandwidth, direction) / kernel_integral(bandwidth)
}

/// Point of the unit square that [`kernel_sample`] maps to `direction`.
pub fn kernel_inverse(axis: Vec3, bandwidth: f32, direction: Vec3) -> Vec2 {
    let d = direction - axis;
    let x = 0.5 * d.dot(d);
    let u =
        if bandwidth < 1e-4 { 0.5 * x } else { expm1(-bandwidth * x) / expm1(-2.0 * bandwidth) };
    let (tangent, bitangent) = lobe_frame(axis);
    let azimuth = direction.dot(bitangent).atan2(direction.dot(tangent)) / (2.0 * PI);
    Vec2::new(u.clamp(0.0, 1.0), if azimuth < 0.0 { azimuth + 1.0 } else { azimuth })
}
