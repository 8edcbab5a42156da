#version 460

// Probe of specular.glsl for tests/brdf_twin.rs: continuation, value and density of given materials.

#include "specular.glsl"

READS(materials)

struct SpecularQuery {
    vec3 outgoing_local;
    vec3 incident_local;
    vec3 u;
    uint material;
    uint is_back;
};

struct SpecularAnswer {
    vec3 direction_local;
    uint is_transmitted;
    vec3 weight;
    vec3 value;
    float pdf;
    vec3 reflectance;
    vec3 transmittance;
};

layout(scalar, set = SET_PROBE, binding = 32) readonly buffer QueriesBuffer {
    SpecularQuery queries[];
};
layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer AnswersBuffer {
    SpecularAnswer answers[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= queries.length()) {
        return;
    }
    SpecularQuery query = queries[index];
    Material material = materials[query.material];
    bool is_back = query.is_back != 0u;
    Scatter found = scatter(material, query.outgoing_local, is_back, query.u);
    SpecularAnswer answer;
    answer.direction_local = found.direction_local;
    answer.is_transmitted = found.is_transmitted ? 1u : 0u;
    answer.weight = found.weight;
    dielectric_evaluate_and_pdf(
        material, query.outgoing_local, query.incident_local, is_back, answer.value, answer.pdf);
    answer.reflectance = pane_reflectance(material, query.outgoing_local.z);
    answer.transmittance = pane_transmittance(material, query.outgoing_local.z);
    answers[index] = answer;
}
