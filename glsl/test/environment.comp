// Probe of environment.glsl: a direction and two random numbers in, lookup and sample out.
#version 460

#include "environment.glsl"
#include "test/answers.glsl"

struct ProbeInput {
    vec3 direction;
    vec2 u;
};

struct ProbeOutput {
    vec3 radiance;
    float pdf;
    vec3 sampled_direction;
    vec3 sampled_radiance;
    float sampled_pdf;
};

ProbeOutput answer(ProbeInput query) {
    vec3 direction = query.direction;
    vec4 light = environment_light(direction);
    EnvironmentSample environment = environment_sample(query.u);
    return ProbeOutput(
        light.xyz, environment_pdf(direction, light), environment.direction,
        environment.radiance, environment.pdf);
}

ANSWER_QUERIES(ProbeInput, ProbeOutput, answer)
