// GGX microfacets: density of normals, masking, reflection, sampling; Beckmann's, drawn as if GGX's. Twins:
// src/brdf/ggx.rs, tests/twin/specular.rs. Densities are per steradian of incident directions unless stated.

#include "frame.glsl"
#include "surfaces.glsl"

// Width of GGX by direction: a circle of radius `alpha`, stretched by the matrix I + M of M = (p, q; q, −p),
// (p, q) = `anisotropy`. The widths are alpha (1 ± |anisotropy|), the larger at half the angle of (p, q) from
// the x axis.
struct GgxWidth {
    float alpha;
    vec2 anisotropy;
    // True if the normals are Beckmann's.
    bool is_beckmann;
};

GgxWidth round_width(float alpha) {
    return GgxWidth(alpha, vec2(0.0), false);
}

GgxWidth material_width(Material material) {
    bool is_covered = material.kind == MATERIAL_COATED || material.kind == MATERIAL_SHEEN;
    bool is_beckmann = HAS_BECKMANN && !is_covered && material.cover_alpha > 0.0;
    return GgxWidth(material.alpha, material.anisotropy, is_beckmann);
}

// M times a vector.
vec2 ggx_turned(vec2 tangential, vec2 anisotropy) {
    return vec2(
        dot(anisotropy, tangential), anisotropy.y * tangential.x - anisotropy.x * tangential.y);
}

// Stretches a direction as the surface of width 1 is.
vec3 ggx_stretched(vec3 direction, GgxWidth width) {
    vec2 tangential = direction.xy;
    if (IS_ANISOTROPIC) {
        tangential += ggx_turned(tangential, width.anisotropy);
    }
    return vec3(width.alpha * tangential, direction.z);
}

// Determinant of I + M, whose inverse is (I − M) over it.
float ggx_area(GgxWidth width) {
    return IS_ANISOTROPIC ? 1.0 - dot(width.anisotropy, width.anisotropy) : 1.0;
}

// Square of a half vector's tangential part before the surface of equal widths α was stretched to this one.
float ggx_narrowed(vec3 half_vector, GgxWidth width) {
    vec2 narrowed = half_vector.xy;
    if (IS_ANISOTROPIC) {
        narrowed = (narrowed - ggx_turned(narrowed, width.anisotropy)) / ggx_area(width);
    }
    return dot(narrowed, narrowed);
}

// Density of GGX normals, per steradian, for a half vector of any length. [Walter et al. 2007] Eq.
// 33, without the cancellation in 1 − cos²θ, which matters for α below 0.01; [Heitz 2014] Eq. 85.
float ggx_normal_density(vec3 half_vector, GgxWidth width) {
    float normal = half_vector.z * half_vector.z;
    float ratio = dot(half_vector, half_vector)
        / (ggx_narrowed(half_vector, width) + width.alpha * width.alpha * normal);
    return width.alpha * width.alpha * ratio * ratio / (PI * ggx_area(width));
}

// Density of Beckmann's normals over that of GGX of the same width, (1 + s)² e^−s ≤ 4/e for the squared slope
// s in units of the width. [Walter et al. 2007] Eq. 25.
float beckmann_ratio(vec3 half_vector, GgxWidth width) {
    float wide = width.alpha * width.alpha * half_vector.z * half_vector.z;
    float slope = min(80.0, ggx_narrowed(half_vector, width) / max(wide, 1e-30));
    return (1.0 + slope) * (1.0 + slope) * exp(-slope);
}

// Length of the direction after stretching the surface to α = 1: √(cos²θ + α² sin²θ).
float ggx_stretched_length(vec3 direction, GgxWidth width) {
    return length(ggx_stretched(direction, width));
}

// Density of the normals of the width's distribution.
float normal_density(vec3 half_vector, GgxWidth width) {
    float density = ggx_normal_density(half_vector, width);
    return width.is_beckmann ? density * beckmann_ratio(half_vector, width) : density;
}

// |cosθ| (1 + 2Λ) of the width's distribution, by which it masks: GGX's is the stretched length. [Walter et
// al. 2007], the fit below Eq. 27.
float masked_length(vec3 direction, GgxWidth width) {
    if (!width.is_beckmann) {
        return ggx_stretched_length(direction, width);
    }
    float cosine = abs(direction.z);
    float tangential = length(ggx_stretched(direction, width).xy);
    float a = cosine / max(tangential, 1e-30);
    float masked = tangential * (1.0 - 1.259 * a + 0.396 * a * a) / (3.535 + 2.181 * a);
    return a < 1.6 ? cosine + 2.0 * masked : cosine;
}

// Lower end of the spherical cap of bounded sampling, as a factor. [Eto & Tokuyoshi 2023] Eq. 5.
float ggx_cap_factor(vec3 outgoing_local, GgxWidth width) {
    float bounded_alpha = min(width.alpha, 1.0);
    if (IS_ANISOTROPIC) {
        bounded_alpha = min(width.alpha * (1.0 - length(width.anisotropy)), 1.0);
    }
    float alpha_squared = bounded_alpha * bounded_alpha;
    float s = 1.0 + length(outgoing_local.xy);
    float s_squared = s * s;
    return (1.0 - alpha_squared) * s_squared
        / (s_squared + alpha_squared * outgoing_local.z * outgoing_local.z);
}

// Microfacet reflection at unit reflectance, per steradian: D·G₂/(4 cosθ_o cosθ_i) with the
// height-correlated masking of [Heitz 2014] Eq. 99. `stretched` is the outgoing direction's length.
float ggx_reflection(
    vec3 half_vector, vec3 outgoing_local, float stretched, vec3 incident_local, GgxWidth width) {
    float masking =
        incident_local.z * (width.is_beckmann ? masked_length(outgoing_local, width) : stretched)
        + outgoing_local.z * masked_length(incident_local, width);
    return 0.5 * normal_density(half_vector, width) / masking;
}

// Density of ggx_sample. [Eto & Tokuyoshi 2023] Eq. 8 with the Jacobian of the reflection.
float ggx_pdf(
    vec3 half_vector, vec3 outgoing_local, float stretched, float cap_factor, GgxWidth width) {
    return 0.5 * ggx_normal_density(half_vector, width) / (cap_factor * outgoing_local.z + stretched);
}

// Samples a normal by its projection toward the outgoing direction, on the spherical cap above
// −`cap_factor`; a factor of 1 gives all visible normals. [Dupuy & Benyoub 2023].
vec3 ggx_normal_sample(vec3 outgoing_local, GgxWidth width, float cap_factor, vec2 u) {
    vec3 stretched = normalize(ggx_stretched(outgoing_local, width));
    float cap = cap_factor * stretched.z;
    // 1 − z rather than z keeps the root below accurate near the pole.
    float below_pole = u.x * (1.0 + cap);
    float sine = sqrt(max(0.0, below_pole * (2.0 - below_pole)));
    float azimuth = 2.0 * PI * u.y;
    vec3 normal = stretched + vec3(sine * cos(azimuth), sine * sin(azimuth), 1.0 - below_pole);
    return normalize(ggx_stretched(vec3(normal.xy, max(1e-7, normal.z)), width));
}

// Density of all visible normals, per steradian, over the cosine of outgoing direction and normal:
// G₁·D/cosθ_o. [Heitz 2014] Eq. 21.
float ggx_visible_density(vec3 normal, vec3 outgoing_local, GgxWidth width) {
    return 2.0 * ggx_normal_density(normal, width)
        / (outgoing_local.z + ggx_stretched_length(outgoing_local, width));
}

// D·G₂ of both directions over GGX's D·G₁ of the outgoing one; height-correlated on one side, and the same
// expression where the other direction is below the surface. 0…1 for GGX.
float visible_normal_ratio(vec3 normal, vec3 outgoing_local, vec3 incident_local, GgxWidth width) {
    float cosine = abs(incident_local.z);
    float visible = (outgoing_local.z + ggx_stretched_length(outgoing_local, width)) * cosine
        / (masked_length(outgoing_local, width) * cosine
            + outgoing_local.z * masked_length(incident_local, width));
    return width.is_beckmann ? visible * beckmann_ratio(normal, width) : visible;
}

// Samples an incident direction by the visible normals of GGX, on the spherical cap that omits most
// reflections below the surface. Those that remain have z ≤ 0: no sample. [Dupuy & Benyoub 2023],
// [Eto & Tokuyoshi 2023].
vec3 ggx_sample(vec3 outgoing_local, GgxWidth width, float cap_factor, vec2 u) {
    vec3 normal = ggx_normal_sample(outgoing_local, width, cap_factor, u);
    return 2.0 * dot(outgoing_local, normal) * normal - outgoing_local;
}
