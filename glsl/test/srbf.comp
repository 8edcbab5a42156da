// Probe of srbf.glsl: one row of inputs in, the result of every function out.
#version 460

#include "srbf.glsl"
#include "test/answers.glsl"

struct Input {
    Lobe a;
    Lobe b;
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
    Lobe product;
    float distance;
    vec3 sampled;
    float pdf;
};

Output answer(Input given) {
    Lobe a = given.a;
    Output result;
    result.expm1_x = expm1(given.x);
    result.log1p_x = log1p(max(given.x, -0.9999));
    result.integral = kernel_integral(a.bandwidth);
    result.steepness = kernel_steepness(a.bandwidth);
    result.hemisphere_part = kernel_part_of_ratio(a.bandwidth, dot(a.axis, given.direction));
    result.value = kernel_value(a.axis, a.bandwidth, given.direction);
    result.product = lobe_product(a, given.b);
    result.distance = kernel_sample_distance(a.bandwidth, given.u.x);
    result.sampled = kernel_sample(a.axis, a.bandwidth, given.u);
    result.pdf = kernel_pdf(a.axis, a.bandwidth, given.direction);
    return result;
}

ANSWER_QUERIES(Input, Output, answer)
