#version 460

// Probe of brdf.glsl for tests/brdf.rs: value, density, sample and albedo of given materials.

#include "brdf.glsl"

READS(materials)

struct BrdfQuery {
    vec3 outgoing_local;
    vec3 incident_local;
    vec3 u;
    uint material;
};

struct BrdfAnswer {
    vec3 value;
    float pdf;
    vec3 sampled_local;
    vec3 albedo;
};

layout(scalar, set = SET_PROBE, binding = 32) readonly buffer QueriesBuffer {
    BrdfQuery queries[];
};
layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer AnswersBuffer {
    BrdfAnswer answers[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= queries.length()) {
        return;
    }
    BrdfQuery query = queries[index];
    Material material = materials[query.material];
    BrdfAnswer answer;
    brdf_evaluate_and_pdf(
        material, query.outgoing_local, query.incident_local, answer.value, answer.pdf);
    answer.sampled_local = brdf_sample(material, query.outgoing_local, query.u);
    answer.albedo = brdf_albedo(material, query.outgoing_local);
    answers[index] = answer;
}
