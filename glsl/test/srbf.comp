// Probe of srbf.glsl: one row of inputs in, the result of every function out.
#version 460

#include "srbf.glsl"
#include "test/answers.glsl"

struct Input {
    vec3 axis;
    float bandwidth;
    vec3 direction;
    vec2 u;
    float x;
};

struct Output {
    float expm1_x;
    float log1p_x;
    float integral;
    float steepness;
    float hemisphere_part;
    float value;
    float distance;
    vec3 sampled;
};

Output answer(Input given) {
    Output result;
    result.expm1_x = expm1(given.x);
    result.log1p_x = log1p(max(given.x, -0.9999));
    result.integral = kernel_integral(given.bandwidth);
    result.steepness = kernel_steepness(given.bandwidth);
    result.hemisphere_part = kernel_part_of_ratio(given.bandwidth, dot(given.axis, given.direction));
    result.value = kernel_value(given.axis, given.bandwidth, given.direction);
    result.distance = kernel_sample_distance(given.bandwidth, given.u.x);
    result.sampled = kernel_sample(given.axis, given.bandwidth, given.u);
    return result;
}

ANSWER_QUERIES(Input, Output, answer)
