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
    float erf_x;
    float integral;
    float deviation;
    float hemisphere_part;
    float value;
    Lobe product;
    float convolution;
    float distance;
    vec3 sampled;
    float pdf;
    vec2 inverse;
};

Output answer(Input given) {
    Lobe a = given.a;
    Output result;
    result.expm1_x = expm1(given.x);
    result.log1p_x = log1p(max(given.x, -0.9999));
    result.erf_x = erf(given.x);
    result.integral = lobe_integral(a);
    result.deviation = kernel_deviation(a.bandwidth);
    result.hemisphere_part = kernel_hemisphere_part(a.bandwidth, dot(a.axis, given.direction));
    result.value = lobe_value(a, given.direction);
    result.product = lobe_product(a, given.b);
    result.convolution = lobe_convolution(a, given.b);
    result.distance = kernel_sample_distance(a.bandwidth, given.u.x);
    result.sampled = kernel_sample(a.axis, a.bandwidth, given.u);
    result.pdf = kernel_pdf(a.axis, a.bandwidth, given.direction);
    result.inverse = kernel_inverse(a.axis, a.bandwidth, result.sampled);
    return result;
}

ANSWER_QUERIES(Input, Output, answer)
