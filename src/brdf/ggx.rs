//! Twin of `glsl/include/ggx.glsl`: same names, same order. GGX microfacets: density of normals,
//! masking, reflection, sampling. Densities are per steradian of incident directions unless stated.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, vec3};

/// Smallest GGX width: single-precision directions cannot resolve a narrower lobe.
pub(crate) const SMALLEST_ALPHA: f32 = 1e-3;

/// Density of GGX normals, per steradian, for a half vector of any length. \[Walter et al. 2007\]
/// Eq. 33, without the cancellation in 1 − cos²θ, which matters for α below 0.01.
pub fn ggx_normal_density(half_vector: Vec3, alpha: f32) -> f32 {
    let tangential = half_vector.truncate().dot(half_vector.truncate());
    let normal = half_vector.z * half_vector.z;
    let ratio = (tangential + normal) / (tangential + alpha * alpha * normal);
    alpha * alpha * ratio * ratio / PI
}

/// Length of the direction after stretching the surface to α = 1: √(cos²θ + α² sin²θ).
pub fn ggx_stretched_length(direction: Vec3, alpha: f32) -> f32 {
    (alpha * direction.truncate()).extend(direction.z).length()
}

/// Lower end of the spherical cap of bounded sampling, as a factor. \[Eto & Tokuyoshi 2023\] Eq. 5.
fn ggx_cap_factor(outgoing_local: Vec3, alpha: f32) -> f32 {
    let bounded_alpha = alpha.min(1.0);
    let alpha_squared = bounded_alpha * bounded_alpha;
    let s = 1.0 + outgoing_local.truncate().length();
    let s_squared = s * s;
    (1.0 - alpha_squared) * s_squared
        / (s_squared + alpha_squared * outgoing_local.z * outgoing_local.z)
}

/// Microfacet reflection at unit reflectance, per steradian: D·G₂/(4 cosθ_o cosθ_i) with the
/// height-correlated masking of \[Heitz 2014\] Eq. 99.
pub(crate) fn ggx_reflection(
    half_vector: Vec3,
    outgoing_local: Vec3,
    incident_local: Vec3,
    alpha: f32,
) -> f32 {
    let masking = incident_local.z * ggx_stretched_length(outgoing_local, alpha)
        + outgoing_local.z * ggx_stretched_length(incident_local, alpha);
    0.5 * ggx_normal_density(half_vector, alpha) / masking
}

/// Density of [`ggx_sample`]. \[Eto & Tokuyoshi 2023\] Eq. 8 with the Jacobian of the reflection.
pub fn ggx_pdf(half_vector: Vec3, outgoing_local: Vec3, alpha: f32) -> f32 {
    let cap = ggx_cap_factor(outgoing_local, alpha) * outgoing_local.z
        + ggx_stretched_length(outgoing_local, alpha);
    0.5 * ggx_normal_density(half_vector, alpha) / cap
}

/// Samples a normal by its projection toward the outgoing direction, on the spherical cap above
/// −`cap_factor`; a factor of 1 gives all visible normals. \[Dupuy & Benyoub 2023\].
pub fn ggx_normal_sample(outgoing_local: Vec3, alpha: f32, cap_factor: f32, u: Vec2) -> Vec3 {
    let stretched = (alpha * outgoing_local.truncate()).extend(outgoing_local.z).normalize();
    let cap = cap_factor * stretched.z;
    // 1 − z rather than z keeps the root below accurate near the pole.
    let below_pole = u.x * (1.0 + cap);
    let sine = (below_pole * (2.0 - below_pole)).max(0.0).sqrt();
    let azimuth = 2.0 * PI * u.y;
    let normal = stretched + vec3(sine * azimuth.cos(), sine * azimuth.sin(), 1.0 - below_pole);
    (alpha * normal.truncate()).extend(normal.z.max(1e-7)).normalize()
}

/// Samples an incident direction by the visible normals of GGX, on the spherical cap that omits
/// most reflections below the surface. Those that remain have z ≤ 0: no sample. \[Dupuy & Benyoub
/// 2023\], \[Eto & Tokuyoshi 2023\].
pub fn ggx_sample(outgoing_local: Vec3, alpha: f32, u: Vec2) -> Vec3 {
    let cap_factor = ggx_cap_factor(outgoing_local, alpha);
    let normal = ggx_normal_sample(outgoing_local, alpha, cap_factor, u);
    2.0 * outgoing_local.dot(normal) * normal - outgoing_local
}
