// Probe of spherical_rectangle.glsl: rectangle, two random numbers and a direction in, everything out.
#version 460

#include "layout.glsl"
#include "spherical_rectangle.glsl"

struct ProbeInput {
    vec3 corner;
    vec2 size;
    vec2 u;
    vec3 direction;
};

struct ProbeOutput {
    float solid_angle;
    float pdf;
    vec3 sampled_direction;
};

layout(scalar, set = SET_PROBE, binding = 32) readonly buffer Inputs {
    ProbeInput inputs[];
};
layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer Outputs {
    ProbeOutput outputs[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= uint(inputs.length())) {
        return;
    }
    ProbeInput probe = inputs[index];
    SphericalRectangle seen = spherical_rectangle(
        probe.corner, vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), probe.size);
    outputs[index] = ProbeOutput(
        seen.solid_angle, spherical_rectangle_pdf(seen, probe.direction),
        spherical_rectangle_sample(seen, probe.u));
}
