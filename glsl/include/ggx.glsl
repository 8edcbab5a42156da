// GGX microfacets: density of normals, masking, reflection, sampling. Twins: src/brdf/ggx.rs,
// tests/twin/specular.rs. Densities are per steradian of incident directions unless stated.

#include "frame.glsl"

// Density of GGX normals, per steradian, for a half vector of any length. [Walter et al. 2007] Eq.
// 33, without the cancellation in 1 − cos²θ, which matters for α below 0.01.
float ggx_normal_density(vec3 half_vector, float alpha) {
    float tangential = dot(half_vector.xy, half_vector.xy);
    float normal = half_vector.z * half_vector.z;
    float ratio = (tangential + normal) / (tangential + alpha * alpha * normal);
    return alpha * alpha * ratio * ratio / PI;
}

// Length of the direction after stretching the surface to α = 1: √(cos²θ + α² sin²θ).
float ggx_stretched_length(vec3 direction, float alpha) {
    return length(vec3(alpha * direction.xy, direction.z));
}

// Lower end of the spherical cap of bounded sampling, as a factor. [Eto & Tokuyoshi 2023] Eq. 5.
float ggx_cap_factor(vec3 outgoing_local, float alpha) {
    float bounded_alpha = min(alpha, 1.0);
    float alpha_squared = bounded_alpha * bounded_alpha;
    float s = 1.0 + length(outgoing_local.xy);
    float s_squared = s * s;
    return (1.0 - alpha_squared) * s_squared
        / (s_squared + alpha_squared * outgoing_local.z * outgoing_local.z);
}

// Microfacet reflection at unit reflectance, per steradian: D·G₂/(4 cosθ_o cosθ_i) with the
// height-correlated masking of [Heitz 2014] Eq. 99. `stretched` is the outgoing direction's length.
float ggx_reflection(
    vec3 half_vector, vec3 outgoing_local, float stretched, vec3 incident_local, float alpha) {
    float masking = incident_local.z * stretched
        + outgoing_local.z * ggx_stretched_length(incident_local, alpha);
    return 0.5 * ggx_normal_density(half_vector, alpha) / masking;
}

// Density of ggx_sample. [Eto & Tokuyoshi 2023] Eq. 8 with the Jacobian of the reflection.
float ggx_pdf(
    vec3 half_vector, vec3 outgoing_local, float stretched, float cap_factor, float alpha) {
    return 0.5 * ggx_normal_density(half_vector, alpha) / (cap_factor * outgoing_local.z + stretched);
}

// Samples a normal by its projection toward the outgoing direction, on the spherical cap above
// −`cap_factor`; a factor of 1 gives all visible normals. [Dupuy & Benyoub 2023].
vec3 ggx_normal_sample(vec3 outgoing_local, float alpha, float cap_factor, vec2 u) {
    vec3 stretched = normalize(vec3(alpha * outgoing_local.xy, outgoing_local.z));
    float cap = cap_factor * stretched.z;
    // 1 − z rather than z keeps the root below accurate near the pole.
    float below_pole = u.x * (1.0 + cap);
    float sine = sqrt(max(0.0, below_pole * (2.0 - below_pole)));
    float azimuth = 2.0 * PI * u.y;
    vec3 normal = stretched + vec3(sine * cos(azimuth), sine * sin(azimuth), 1.0 - below_pole);
    return normalize(vec3(alpha * normal.xy, max(1e-7, normal.z)));
}

// G₂ of both directions over G₁ of the outgoing one; height-correlated on one side, and the same
// expression where the other direction is below the surface. 0…1.
float ggx_masking_ratio(vec3 outgoing_local, vec3 incident_local, float alpha) {
    float cosine = abs(incident_local.z);
    float stretched = ggx_stretched_length(outgoing_local, alpha);
    return (outgoing_local.z + stretched) * cosine
        / (stretched * cosine + outgoing_local.z * ggx_stretched_length(incident_local, alpha));
}

// Samples an incident direction by the visible normals of GGX, on the spherical cap that omits most
// reflections below the surface. Those that remain have z ≤ 0: no sample. [Dupuy & Benyoub 2023],
// [Eto & Tokuyoshi 2023].
vec3 ggx_sample(vec3 outgoing_local, float alpha, float cap_factor, vec2 u) {
    vec3 normal = ggx_normal_sample(outgoing_local, alpha, cap_factor, u);
    return 2.0 * dot(outgoing_local, normal) * normal - outgoing_local;
}
