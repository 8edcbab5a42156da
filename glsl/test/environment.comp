// Probe of environment.glsl: a direction and two random numbers in, lookup and sample out.
#version 460

#include "environment.glsl"

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
    vec3 direction = inputs[index].direction;
    vec4 light = environment_light(direction);
    EnvironmentSample environment = environment_sample(inputs[index].u);
    outputs[index] = ProbeOutput(
        light.xyz, environment_pdf(direction, light), environment.direction,
        environment.radiance, environment.pdf);
}
