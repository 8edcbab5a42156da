// Probe of random.glsl: (pixel, sample, dimension, seed) in, numbers of each kind out.
#version 460

#include "layout.glsl"
#include "random.glsl"

struct ProbeOutput {
    vec2 stratified;
    float stratified_1d;
    vec2 independent;
    float independent_1d;
};

layout(scalar, set = SET_PROBE, binding = 32) readonly buffer Inputs {
    uvec4 inputs[];
};
layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer Outputs {
    ProbeOutput outputs[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= uint(inputs.length())) {
        return;
    }
    uvec4 key = inputs[index];
    outputs[index] = ProbeOutput(
        random_2d(key.x, key.y, key.z, key.w), random_1d(key.x, key.y, key.z, key.w),
        random_independent_2d(key.x, key.y, key.z, key.w),
        random_independent_1d(key.x, key.y, key.z, key.w));
}
