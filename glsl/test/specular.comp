#version 460

// Probe of specular.glsl for tests/brdf_twin.rs: continuation, value and density of given materials.

#include "specular.glsl"
#include "test/answers.glsl"

READS(materials)

struct SpecularQuery {
    vec3 outgoing_local;
    vec3 u;
    uint material;
    uint is_back;
    float distance;
    vec3 incident_local;
};

struct SpecularAnswer {
    vec3 direction_local;
    uint is_transmitted;
    vec3 weight;
    float pdf;
    vec3 reflectance;
    vec3 transmittance;
    vec3 toward_weight;
    float toward_pdf;
};

SpecularAnswer answer(SpecularQuery query) {
    Material material = materials[query.material];
    bool is_back = query.is_back != 0u;
    Scatter found = scatter(material, query.outgoing_local, is_back, query.u);
    SpecularAnswer result;
    result.direction_local = found.direction_local;
    result.is_transmitted = found.is_transmitted ? 1u : 0u;
    result.weight =
        found.weight * inside_transmittance(material, is_back, query.distance);
    result.pdf = found.pdf;
    Scatter toward =
        dielectric_toward(material, query.outgoing_local, is_back, query.incident_local);
    result.toward_weight = toward.weight;
    result.toward_pdf = toward.pdf;
    result.reflectance = pane_reflectance(material, query.outgoing_local.z);
    result.transmittance = pane_transmittance(material, query.outgoing_local.z);
    return result;
}

ANSWER_QUERIES(SpecularQuery, SpecularAnswer, answer)
