// Probe of control_variates/: a place and a direction in, their entry out; candidates in, the chosen ray out.
#version 460

#include "control_variates/controlled.glsl"
#include "control_variates/records.glsl"
#include "test/answers.glsl"

struct ControlQuery {
    vec3 position;
    vec3 normal;
    vec3 direction;
    float u;
    vec4 weights[4];
};

struct ControlAnswer {
    uint entry;
    // Index of the chosen candidate.
    uint chosen;
    vec3 contribution;
    vec3 rest;
};

ControlAnswer answer(ControlQuery query) {
    Controlled chosen = controlled_start(query.u);
    for (uint c = 0u; c < 4u; ++c) {
        // The direction stands for the index.
        vec4 weight = query.weights[c];
        controlled_add(chosen, vec3(float(c)), weight.xyz, weight.w);
    }
    vec3 contribution = controlled_contribution(chosen, 4u);
    return ControlAnswer(
        record_entry(record_of(query.position, query.normal), query.direction),
        uint(chosen.direction.x), contribution, controlled_rest(chosen, 4u, contribution));
}

ANSWER_QUERIES(ControlQuery, ControlAnswer, answer)
