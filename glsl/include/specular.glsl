// Mirrors, dielectrics and thin panes: materials at which paths go on in a sampled direction, and no
// sampler draws light; sample_lamps.comp does at rough dielectrics. Twin of tests/twin/specular.rs, same
// names, same order.
//
// Directions are unit vectors in the shading frame, whose z points to the side of the viewer, and point
// away from the surface: transmitted ones have z < 0. Values are per steradian without the cosine.
//
// Values are for radiance on its way to the viewer, as in pbrt and Mitsuba: light that comes through an
// interface is scaled by (index of the viewer's side / index of the light's side)^2, so that light that
// goes in and out again has its former radiance. Values of importance would lack this factor.

#include "brdf.glsl"

// Continuation of a path; a weight of 0 ends it.
struct Scatter {
    vec3 direction_local;
    // Value * |cosine| / density.
    vec3 weight;
    bool is_transmitted;
    // Density per steradian at a rough dielectric; 0 of a single direction.
    float pdf;
};

// Tests for materials that `sample_lamps` samples light at where they are rough.
bool is_interface(Material material) {
    return is_kind(material, MATERIAL_DIELECTRIC) || is_kind(material, MATERIAL_ROUGH_PANE);
}

// Refractive index of the side that the viewer does not see over that of the viewer's; 1 beyond a pane.
float relative_index(Material material, bool is_back) {
    float eta = is_back ? 1.0 / material.ior : material.ior;
    return is_kind(material, MATERIAL_ROUGH_PANE) ? 1.0 : eta;
}

// Light that an interface or a pane reflects at a cosine with the normal of a microfacet.
float facet_reflectance(Material material, float cosine, float eta) {
    return is_kind(material, MATERIAL_ROUGH_PANE) ? pane_share(material, cosine)
                                                  : fresnel_interface(cosine, eta);
}

// Mirrors a direction at the surface: a pane lets through what it reflects, mirrored.
vec3 mirrored(vec3 direction) {
    return vec3(direction.xy, -direction.z);
}

// Probability of reflection: its part of all light by luminance.
float reflection_probability(Material material, float fresnel) {
    float reflected = fresnel * dot(material.reflectance, LUMINANCE_WEIGHTS);
    float sum = reflected + (1.0 - fresnel) * dot(material.eta, LUMINANCE_WEIGHTS);
    return sum > 0.0 ? reflected / sum : 1.0;
}

// Refracts at a normal.
vec3 refracted(vec3 outgoing_local, vec3 normal, float eta) {
    float cosine = dot(outgoing_local, normal);
    return (cosine / eta - refracted_cosine(cosine, eta)) * normal - outgoing_local / eta;
}

// Sends light along a direction by the normal between it and the viewer's, at an interface of relative index
// `eta`; `probability` is that of reflection. [Walter et al. 2007].
Scatter interface_scatter(
    Material material, vec3 outgoing_local, vec3 normal, float eta, vec3 incident_local,
    bool is_transmitted, float fresnel, float probability) {
    Scatter result = Scatter(incident_local, vec3(0.0), is_transmitted, 0.0);
    float cosine = dot(outgoing_local, normal);
    // A normal may send light to the wrong side of the surface: no sample.
    if (cosine <= 0.0 || (incident_local.z < 0.0) != is_transmitted) {
        return result;
    }
    float chosen = max(is_transmitted ? 1.0 - probability : probability, 1.0e-20);
    result.weight = is_transmitted ? (1.0 - fresnel) / (chosen * eta * eta) * material.eta
                                   : fresnel / chosen * material.reflectance;
    if (material.alpha > 0.0) {
        GgxWidth width = material_width(material);
        result.weight *= visible_normal_ratio(normal, outgoing_local, incident_local, width);
        float incident_cosine = dot(incident_local, normal);
        float sum = cosine + eta * incident_cosine;
        float turned = is_transmitted && !is_kind(material, MATERIAL_ROUGH_PANE)
            ? eta * eta * cosine * abs(incident_cosine) / (sum * sum)
            : 0.25;
        result.pdf = chosen * turned * ggx_visible_density(normal, outgoing_local, width);
    }
    return result;
}

// Interface of a dielectric, or a rough pane: smooth at alpha = 0, else by GGX's visible normals. The light
// that the pane lets through is that of `KHR_materials_transmission`.
Scatter dielectric_scatter(Material material, vec3 outgoing_local, bool is_back, vec3 u) {
    float eta = relative_index(material, is_back);
    vec3 normal = vec3(0.0, 0.0, 1.0);
    if (material.alpha > 0.0) {
        normal = ggx_normal_sample(outgoing_local, material_width(material), 1.0, u.yz);
    }
    float cosine = dot(outgoing_local, normal);
    float fresnel = facet_reflectance(material, cosine, eta);
    float probability = reflection_probability(material, fresnel);
    bool is_transmitted = u.x >= probability;
    vec3 incident_local = 2.0 * cosine * normal - outgoing_local;
    if (is_transmitted) {
        incident_local = is_kind(material, MATERIAL_ROUGH_PANE)
            ? mirrored(incident_local)
            : refracted(outgoing_local, normal, eta);
    }
    return interface_scatter(
        material, outgoing_local, normal, eta, incident_local, is_transmitted, fresnel, probability);
}

// Weight and density of that for a given direction; 0 at a smooth dielectric.
Scatter dielectric_toward(Material material, vec3 outgoing_local, bool is_back, vec3 incident_local) {
    float eta = relative_index(material, is_back);
    bool is_transmitted = incident_local.z < 0.0;
    bool is_refracted = is_transmitted && !is_kind(material, MATERIAL_ROUGH_PANE);
    vec3 facing =
        is_transmitted && !is_refracted ? mirrored(incident_local) : incident_local;
    vec3 half_vector = outgoing_local + (is_refracted ? eta : 1.0) * facing;
    vec3 normal = normalize(half_vector.z < 0.0 ? -half_vector : half_vector);
    bool is_beyond = dot(facing, normal) < 0.0;
    if (material.alpha == 0.0 || outgoing_local.z <= 0.0 || is_beyond != is_refracted) {
        return Scatter(incident_local, vec3(0.0), is_transmitted, 0.0);
    }
    float fresnel = facet_reflectance(material, dot(outgoing_local, normal), eta);
    return interface_scatter(
        material, outgoing_local, normal, eta, incident_local, is_transmitted, fresnel,
        reflection_probability(material, fresnel));
}

// Share that is left of light which reaches a surface over `distance`: a viewer at the back of a dielectric
// is inside. Beer and Lambert's law.
vec3 inside_transmittance(Material material, bool is_back, float distance) {
    bool is_inside = is_back && is_kind(material, MATERIAL_DIELECTRIC);
    return is_inside ? exp(-distance * material.k) : vec3(1.0);
}

// Pane: reflects as a mirror or lets light straight through.
Scatter pane_scatter(Material material, vec3 outgoing_local, vec3 u) {
    vec3 reflectance = pane_reflectance(material, outgoing_local.z);
    vec3 transmittance = pane_transmittance(material, outgoing_local.z);
    float reflected = dot(reflectance, LUMINANCE_WEIGHTS);
    float sum = reflected + dot(transmittance, LUMINANCE_WEIGHTS);
    float probability = sum > 0.0 ? reflected / sum : 1.0;
    if (u.x < probability) {
        return Scatter(
            vec3(-outgoing_local.xy, outgoing_local.z), reflectance / probability, false, 0.0);
    }
    return Scatter(-outgoing_local, transmittance / (1.0 - probability), true, 0.0);
}

// Samples the next direction of a path with three numbers in [0, 1). `is_back` tells that the viewer
// sees the back of the triangles, where the inside of a dielectric is.
Scatter scatter(Material material, vec3 outgoing_local, bool is_back, vec3 u) {
    if (outgoing_local.z > 0.0 && is_kind(material, MATERIAL_MIRROR)) {
        return Scatter(
            vec3(-outgoing_local.xy, outgoing_local.z),
            (is_back ? material.ior : 1.0) * material.reflectance, false, 0.0);
    }
    if (outgoing_local.z > 0.0 && is_interface(material)) {
        return dielectric_scatter(material, outgoing_local, is_back, u);
    }
    if (outgoing_local.z > 0.0 && is_kind(material, MATERIAL_THIN_DIELECTRIC)) {
        return pane_scatter(material, outgoing_local, u);
    }
    return Scatter(vec3(0.0, 0.0, 1.0), vec3(0.0), false, 0.0);
}
