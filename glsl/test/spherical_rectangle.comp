// Probe of spherical_rectangle.glsl: rectangle, two random numbers, a direction and a
// normal in, everything out.
#version 460

#include "spherical_rectangle.glsl"
#include "test/answers.glsl"

struct ProbeInput {
    vec3 corner;
    vec2 size;
    vec2 u;
    vec3 direction;
    vec3 normal;
};

struct ProbeOutput {
    float solid_angle;
    float pdf;
    vec3 sampled_direction;
    float is_below;
};

ProbeOutput answer(ProbeInput probe) {
    SphericalRectangle seen = spherical_rectangle(
        probe.corner, vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), probe.size);
    return ProbeOutput(
        seen.solid_angle, spherical_rectangle_pdf(seen, probe.direction),
        spherical_rectangle_sample(seen, probe.u), float(is_below(seen, probe.normal)));
}

ANSWER_QUERIES(ProbeInput, ProbeOutput, answer)
