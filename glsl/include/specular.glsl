#ifndef SPECULAR_GLSL
#define SPECULAR_GLSL
#include "brdf.glsl"
struct Scatter { vec3 direction_local; vec3 weight; bool is_transmitted; };
Scatter scatter(Material material, vec3 outgoing_local, bool is_back, vec3 u) {
    vec3 mirrored = vec3(-outgoing_local.xy, outgoing_local.z);
    if (material.kind != MATERIAL_DIELECTRIC) {
        return Scatter(mirrored, material.kind == MATERIAL_MIRROR ? material.reflectance : vec3(1.0), false);
    }
    float ratio = is_back ? 1.0 / material.ior : material.ior;
    float sine2 = (1.0 - outgoing_local.z * outgoing_local.z) / (ratio * ratio);
    float F = sine2 >= 1.0 ? 1.0 : fresnel_dielectric(outgoing_local.z, ratio);
    if (u.x < F) { return Scatter(mirrored, material.reflectance, false); }
    return Scatter(vec3(-outgoing_local.xy / ratio, -sqrt(1.0 - sine2)), material.eta / (ratio * ratio), true);
}
vec3 pane_reflectance(Material material, float cosine) {
    float F = fresnel_dielectric(cosine, material.ior);
    return material.reflectance * (2.0 * F / (1.0 + F));
}
vec3 pane_transmittance(Material material, float cosine) {
    float F = fresnel_dielectric(cosine, material.ior);
    return material.eta * (1.0 - 2.0 * F / (1.0 + F));
}
#endif
