// GGX microfacets: density of normals, masking, reflection, sampling. Twins: src/brdf/ggx.rs,
// tests/twin/specular.rs. Densities are per steradian of incident directions unless stated.

#include "frame.glsl"
#include "surfaces.glsl"

// Width of GGX by direction: a circle of radius `alpha`, stretched by the matrix I + M of M = (p, q; q, −p),
// (p, q) = `anisotropy`. The widths are alpha (1 ± |anisotropy|), the larger at half the angle of (p, q) from
// the x axis.
struct GgxWidth {
    float alpha;
    vec2 anisotropy;
};

GgxWidth round_width(float alpha) {
    return GgxWidth(alpha, vec2(0.0));
}

GgxWidth material_width(Material material) {
    return GgxWidth(material.alpha, material.anisotropy);
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

// Density of GGX normals, per steradian, for a half vector of any length. [Walter et al. 2007] Eq.
// 33, without the cancellation in 1 − cos²θ, which matters for α below 0.01; [Heitz 2014] Eq. 85.
float ggx_normal_density(vec3 half_vector, GgxWidth width) {
    float tangential = dot(half_vector.xy, half_vector.xy);
    float normal = half_vector.z * half_vector.z;
    float squared = tangential + normal;
    // Determinant of I + M, whose inverse is (I − M) over it.
    float area = 1.0;
    if (IS_ANISOTROPIC) {
        area -= dot(width.anisotropy, width.anisotropy);
        vec2 narrowed = (half_vector.xy - ggx_turned(half_vector.xy, width.anisotropy)) / area;
        tangential = dot(narrowed, narrowed);
    }
    float ratio = squared / (tangential + width.alpha * width.alpha * normal);
    return width.alpha * width.alpha * ratio * ratio / (PI * area);
}

// Length of the direction after stretching the surface to α = 1: √(cos²θ + α² sin²θ).
float ggx_stretched_length(vec3 direction, GgxWidth width) {
    return length(ggx_stretched(direction, width));
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
    float masking = incident_local.z * stretched
        + outgoing_local.z * ggx_stretched_length(incident_local, width);
    return 0.5 * ggx_normal_density(half_vector, width) / masking;
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

// G₂ of both directions over G₁ of the outgoing one; height-correlated on one side, and the same
// expression where the other direction is below the surface. 0…1.
float ggx_masking_ratio(vec3 outgoing_local, vec3 incident_local, GgxWidth width) {
    float cosine = abs(incident_local.z);
    float stretched = ggx_stretched_length(outgoing_local, width);
    return (outgoing_local.z + stretched) * cosine
        / (stretched * cosine + outgoing_local.z * ggx_stretched_length(incident_local, width));
}

// Samples an incident direction by the visible normals of GGX, on the spherical cap that omits most
// reflections below the surface. Those that remain have z ≤ 0: no sample. [Dupuy & Benyoub 2023],
// [Eto & Tokuyoshi 2023].
vec3 ggx_sample(vec3 outgoing_local, GgxWidth width, float cap_factor, vec2 u) {
    vec3 normal = ggx_normal_sample(outgoing_local, width, cap_factor, u);
    return 2.0 * dot(outgoing_local, normal) * normal - outgoing_local;
}
