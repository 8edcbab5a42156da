#version 460

// Probe of brdf.glsl for tests/brdf.rs: value, density, sample and albedo of given materials.

#include "brdf.glsl"
#include "test/answers.glsl"

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

BrdfAnswer answer(BrdfQuery query) {
    Material material = materials[query.material];
    BrdfAnswer result;
    Reflector reflector = reflector_from(material, query.outgoing_local);
    brdf_evaluate_and_pdf(reflector, query.incident_local, result.value, result.pdf);
    result.sampled_local = brdf_sample(reflector, query.u);
    result.albedo = brdf_albedo(material, query.outgoing_local);
    return result;
}

ANSWER_QUERIES(BrdfQuery, BrdfAnswer, answer)
