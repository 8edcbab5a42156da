// Reflectance of smooth interfaces: dielectrics, conductors, Schlick's approximation, thin panes. No
// buffers, so that traversal may include it. Twin: src/brdf/fresnel.rs.

#include "layout.glsl"

// Reflectance of a dielectric of refractive index `ior` seen from outside; exact Fresnel.
float fresnel_dielectric(float cosine, float ior) {
    float g = sqrt(max(0.0, ior * ior - 1.0 + cosine * cosine));
    float difference = (ior * ior - 1.0) / (g + cosine);
    float perpendicular = difference / (g + cosine);
    float ratio = (cosine * (g + cosine) - 1.0) / (cosine * difference + 1.0);
    return min(1.0, 0.5 * perpendicular * perpendicular * (1.0 + ratio * ratio));
}

// Reflectance of a conductor of refractive index eta + i·k; exact Fresnel.
vec3 fresnel_conductor(float cosine, vec3 eta, vec3 k) {
    float cosine_squared = cosine * cosine;
    float sine_squared = max(0.0, 1.0 - cosine_squared);
    vec3 real = eta * eta - k * k - vec3(sine_squared);
    vec3 modulus = sqrt(real * real + 4.0 * eta * eta * k * k);
    vec3 a = sqrt(max(vec3(0.0), 0.5 * (modulus + real)));
    vec3 sum = modulus + vec3(cosine_squared);
    vec3 cross_term = 2.0 * cosine * a;
    vec3 perpendicular = (sum - cross_term) / (sum + cross_term);
    vec3 parallel_sum = cosine_squared * modulus + vec3(sine_squared * sine_squared);
    vec3 parallel_cross = cross_term * sine_squared;
    vec3 parallel = perpendicular * (parallel_sum - parallel_cross)
        / (parallel_sum + parallel_cross);
    // Rounding may leave `perpendicular` below 0 where nothing is reflected, as at eta = 1, k = 0.
    return max(vec3(0.0), 0.5 * (perpendicular + parallel));
}

// Share of the way from normal to grazing reflectance, (1 − cosθ)⁵. [Schlick 1994].
float schlick_rise(float cosine) {
    float complement = 1.0 - cosine;
    float square = complement * complement;
    return square * square * complement;
}

// Reflectance of a conductor from that at normal incidence. [Schlick 1994].
vec3 fresnel_schlick(float cosine, vec3 reflectance) {
    return reflectance + (vec3(1.0) - reflectance) * schlick_rise(cosine);
}

// Cosine of the refracted direction with the inverted normal; `eta` is the refractive index beyond the
// interface over that of this side. 0 for total reflection.
float refracted_cosine(float cosine, float eta) {
    return sqrt(max(0.0, 1.0 - (1.0 - cosine * cosine) / (eta * eta)));
}

// Reflectance of an interface seen from either side, 1 for total reflection; `eta` as above. Exact
// Fresnel.
float fresnel_interface(float cosine, float eta) {
    float refracted = refracted_cosine(cosine, eta);
    float perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
    float parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
    float reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel);
    return refracted > 0.0 ? min(1.0, reflectance) : 1.0;
}

// Share of light that a thin pane reflects, R + T²R + T²R³ + … = 2R/(1 + R) for T = 1 − R at each of its two
// sides. `cosine` may have either sign.
float pane_share(Material material, float cosine) {
    float reflectance = fresnel_interface(abs(cosine), material.ior);
    return 2.0 * reflectance / (1.0 + reflectance);
}

// The same times its factor.
vec3 pane_reflectance(Material material, float cosine) {
    return pane_share(material, cosine) * material.reflectance;
}

// Light that a thin pane lets straight through, (1 − R)/(1 + R), times its factor.
vec3 pane_transmittance(Material material, float cosine) {
    float reflectance = fresnel_interface(abs(cosine), material.ior);
    return (1.0 - reflectance) / (1.0 + reflectance) * material.eta;
}
