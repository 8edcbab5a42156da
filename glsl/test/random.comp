// Probe of random.glsl: (pixel, sample, dimension, seed) in, numbers of each kind out.
#version 460

#include "random.glsl"
#include "test/answers.glsl"

struct ProbeOutput {
    vec2 stratified;
    float stratified_1d;
    vec2 independent;
    float independent_1d;
};

ProbeOutput answer(uvec4 key) {
    return ProbeOutput(
        random_2d(key.x, key.y, key.z, key.w), random_1d(key.x, key.y, key.z, key.w),
        random_independent_2d(key.x, key.y, key.z, key.w),
        random_independent_1d(key.x, key.y, key.z, key.w));
}

ANSWER_QUERIES(uvec4, ProbeOutput, answer)
