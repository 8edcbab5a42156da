//! Twin of `glsl/include/fresnel.glsl`: same names, same order. Reflectance of smooth interfaces:
//! conductors, Schlick's approximation.

use glam::{Vec3, vec3};

pub use crate::scene::coat::fresnel_dielectric;

/// Reflectance of a conductor of refractive index eta + i·k; exact Fresnel.
pub fn fresnel_conductor(cosine: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let cosine_squared = cosine * cosine;
    let sine_squared = (1.0 - cosine_squared).max(0.0);
    let real = eta * eta - k * k - Vec3::splat(sine_squared);
    let modulus = square_root(real * real + 4.0 * eta * eta * k * k);
    let a = square_root((0.5 * (modulus + real)).max(Vec3::ZERO));
    let sum = modulus + Vec3::splat(cosine_squared);
    let cross_term = 2.0 * cosine * a;
    let perpendicular = (sum - cross_term) / (sum + cross_term);
    let parallel_sum = cosine_squared * modulus + Vec3::splat(sine_squared * sine_squared);
    let parallel_cross = cross_term * sine_squared;
    let parallel =
        perpendicular * (parallel_sum - parallel_cross) / (parallel_sum + parallel_cross);
    // Rounding may leave `perpendicular` below 0 where nothing is reflected, as at eta = 1, k = 0.
    (0.5 * (perpendicular + parallel)).max(Vec3::ZERO)
}

/// GLSL's `sqrt` of a vector.
fn square_root(v: Vec3) -> Vec3 {
    vec3(v.x.sqrt(), v.y.sqrt(), v.z.sqrt())
}

/// Share of the way from normal to grazing reflectance, (1 − cosθ)⁵. \[Schlick 1994\].
pub(crate) fn schlick_rise(cosine: f32) -> f32 {
    let complement = 1.0 - cosine;
    let square = complement * complement;
    square * square * complement
}

/// Reflectance of a conductor from that at normal incidence. \[Schlick 1994\].
pub(crate) fn fresnel_schlick(cosine: f32, reflectance: Vec3) -> Vec3 {
    reflectance + (Vec3::ONE - reflectance) * schlick_rise(cosine)
}
