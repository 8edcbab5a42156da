// Probe of arriving.glsl: a direction in, its index out.
#version 460

#include "guided/arriving.glsl"
#include "layout.glsl"

layout(scalar, set = SET_PROBE, binding = 32) readonly buffer Inputs {
    vec3 inputs[];
};
layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer Outputs {
    uint outputs[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index < uint(inputs.length())) {
        outputs[index] = arrival_direction(inputs[index]);
    }
}
