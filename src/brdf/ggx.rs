//! Twin of `glsl/include/ggx.glsl`: same names, same order. GGX microfacets: density of normals, masking,
//! reflection, sampling; Beckmann's, drawn as if GGX's. Densities are per steradian of incident directions
//! unless stated.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, vec2, vec3};

use crate::{
    scene::coat::beckmann_length,
    shader::{
        constants::{MATERIAL_COATED, MATERIAL_SHEEN},
        structs::Material,
    },
};

/// Smallest GGX width: single-precision directions cannot resolve a narrower lobe.
pub(crate) const SMALLEST_ALPHA: f32 = 1e-3;

/// Width of GGX by direction: a circle of radius `alpha`, stretched by the matrix I + M of M = (p, q; q, −p),
/// (p, q) = `anisotropy`. The widths are alpha (1 ± |anisotropy|), the larger at half the angle of (p, q)
/// from the x axis.
#[derive(Clone, Copy, Debug)]
pub struct GgxWidth {
    /// Mean of the two widths α.
    pub alpha: f32,
    /// Entries (p, q), of a length below 1.
    pub anisotropy: Vec2,
    /// True if the normals are Beckmann's.
    pub is_beckmann: bool,
}

impl GgxWidth {
    /// The same in all directions.
    pub fn round(alpha: f32) -> Self {
        Self { alpha, anisotropy: Vec2::ZERO, is_beckmann: false }
    }

    /// That of a material's main lobe.
    pub fn of(material: &Material) -> Self {
        let is_covered = matches!(material.kind, MATERIAL_COATED | MATERIAL_SHEEN);
        Self {
            alpha: material.alpha,
            anisotropy: material.anisotropy.into(),
            is_beckmann: !is_covered && material.cover_alpha > 0.0,
        }
    }

    /// M times a vector.
    fn turned(self, tangential: Vec2) -> Vec2 {
        let Vec2 { x: p, y: q } = self.anisotropy;
        vec2(self.anisotropy.dot(tangential), q * tangential.x - p * tangential.y)
    }

    /// Determinant of I + M, whose inverse is (I − M) over it.
    fn area(self) -> f32 {
        1.0 - self.anisotropy.dot(self.anisotropy)
    }

    /// Square of a half vector's tangential part before the surface of equal widths α was stretched to this.
    fn narrowed(self, half_vector: Vec3) -> f32 {
        let tangential = half_vector.truncate();
        ((tangential - self.turned(tangential)) / self.area()).length_squared()
    }

    /// Stretches a direction as the surface of width 1 is.
    fn stretched(self, direction: Vec3) -> Vec3 {
        let tangential = direction.truncate();
        (self.alpha * (tangential + self.turned(tangential))).extend(direction.z)
    }
}

/// Density of GGX normals, per steradian, for a half vector of any length. \[Walter et al. 2007\]
/// Eq. 33, without the cancellation in 1 − cos²θ, which matters for α below 0.01; \[Heitz 2014\] Eq. 85.
pub fn ggx_normal_density(half_vector: Vec3, width: GgxWidth) -> f32 {
    let normal = half_vector.z * half_vector.z;
    let ratio = half_vector.length_squared()
        / (width.narrowed(half_vector) + width.alpha * width.alpha * normal);
    width.alpha * width.alpha * ratio * ratio / (PI * width.area())
}

/// Density of Beckmann's normals over that of GGX of the same width, (1 + s)² e^−s ≤ 4/e for the squared
/// slope s in units of the width. \[Walter et al. 2007\] Eq. 25.
pub fn beckmann_ratio(half_vector: Vec3, width: GgxWidth) -> f32 {
    let wide = width.alpha * width.alpha * half_vector.z * half_vector.z;
    let slope = (width.narrowed(half_vector) / wide.max(1e-30)).min(80.0);
    (1.0 + slope) * (1.0 + slope) * (-slope).exp()
}

/// Density of the normals of the width's distribution.
pub fn normal_density(half_vector: Vec3, width: GgxWidth) -> f32 {
    let density = ggx_normal_density(half_vector, width);
    if width.is_beckmann { density * beckmann_ratio(half_vector, width) } else { density }
}

/// Length of the direction after stretching the surface to α = 1: √(cos²θ + α² sin²θ).
pub fn ggx_stretched_length(direction: Vec3, width: GgxWidth) -> f32 {
    width.stretched(direction).length()
}

/// |cosθ| (1 + 2Λ) of the width's distribution, by which it masks: GGX's is the stretched length.
pub fn masked_length(direction: Vec3, width: GgxWidth) -> f32 {
    let stretched = width.stretched(direction);
    if width.is_beckmann {
        beckmann_length(direction.z.abs(), stretched.truncate().length())
    } else {
        stretched.length()
    }
}

/// Lower end of the spherical cap of bounded sampling, as a factor. \[Eto & Tokuyoshi 2023\] Eq. 5.
fn ggx_cap_factor(outgoing_local: Vec3, width: GgxWidth) -> f32 {
    let bounded_alpha = (width.alpha * (1.0 - width.anisotropy.length())).min(1.0);
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
    width: GgxWidth,
) -> f32 {
    let masking = incident_local.z * masked_length(outgoing_local, width)
        + outgoing_local.z * masked_length(incident_local, width);
    0.5 * normal_density(half_vector, width) / masking
}

/// Density of [`ggx_sample`]. \[Eto & Tokuyoshi 2023\] Eq. 8 with the Jacobian of the reflection.
pub fn ggx_pdf(half_vector: Vec3, outgoing_local: Vec3, width: GgxWidth) -> f32 {
    let cap = ggx_cap_factor(outgoing_local, width) * outgoing_local.z
        + ggx_stretched_length(outgoing_local, width);
    0.5 * ggx_normal_density(half_vector, width) / cap
}

/// Samples a normal by its projection toward the outgoing direction, on the spherical cap above
/// −`cap_factor`; a factor of 1 gives all visible normals. \[Dupuy & Benyoub 2023\].
pub fn ggx_normal_sample(outgoing_local: Vec3, width: GgxWidth, cap_factor: f32, u: Vec2) -> Vec3 {
    let stretched = width.stretched(outgoing_local).normalize();
    let cap = cap_factor * stretched.z;
    // 1 − z rather than z keeps the root below accurate near the pole.
    let below_pole = u.x * (1.0 + cap);
    let sine = (below_pole * (2.0 - below_pole)).max(0.0).sqrt();
    let azimuth = 2.0 * PI * u.y;
    let normal = stretched + vec3(sine * azimuth.cos(), sine * azimuth.sin(), 1.0 - below_pole);
    width.stretched(normal.truncate().extend(normal.z.max(1e-7))).normalize()
}

/// Samples an incident direction by the visible normals of GGX, on the spherical cap that omits
/// most reflections below the surface. Those that remain have z ≤ 0: no sample. \[Dupuy & Benyoub
/// 2023\], \[Eto & Tokuyoshi 2023\].
pub fn ggx_sample(outgoing_local: Vec3, width: GgxWidth, u: Vec2) -> Vec3 {
    let cap_factor = ggx_cap_factor(outgoing_local, width);
    let normal = ggx_normal_sample(outgoing_local, width, cap_factor, u);
    2.0 * outgoing_local.dot(normal) * normal - outgoing_local
}
