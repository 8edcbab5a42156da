//! Twin of `glsl/include/fresnel.glsl`: same names, same order. Reflectance of smooth interfaces:
//! conductors, Schlick's approximation, thin panes.

use glam::{Vec3, vec3};

pub use crate::scene::coat::fresnel_dielectric;
use crate::shader::structs::Material;

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

/// Cosine of the refracted direction with the inverted normal; `eta` is the refractive index beyond
/// the interface over that of this side. 0 for total reflection.
pub fn refracted_cosine(cosine: f32, eta: f32) -> f32 {
    (1.0 - (1.0 - cosine * cosine) / (eta * eta)).max(0.0).sqrt()
}

/// Reflectance of an interface seen from either side, 1 for total reflection; `eta` as above. Exact
/// Fresnel.
pub fn fresnel_interface(cosine: f32, eta: f32) -> f32 {
    let refracted = refracted_cosine(cosine, eta);
    let perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
    let parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
    let reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel);
    if refracted > 0.0 { reflectance.min(1.0) } else { 1.0 }
}

/// Share of light that a thin pane reflects, R + T²R + T²R³ + … = 2R/(1 + R) for T = 1 − R at each of its two
/// sides. `cosine` may have either sign.
pub fn pane_share(material: &Material, cosine: f32) -> f32 {
    let reflectance = fresnel_interface(cosine.abs(), material.ior);
    2.0 * reflectance / (1.0 + reflectance)
}

/// The same times its factor.
pub fn pane_reflectance(material: &Material, cosine: f32) -> Vec3 {
    pane_share(material, cosine) * Vec3::from(material.reflectance)
}

/// Light that a thin pane lets straight through, (1 − R)/(1 + R), times its factor.
pub fn pane_transmittance(material: &Material, cosine: f32) -> Vec3 {
    let reflectance = fresnel_interface(cosine.abs(), material.ior);
    (1.0 - reflectance) / (1.0 + reflectance) * Vec3::from(material.eta)
}
