// Adds one to every word, to test the host itself.
#version 460

#include "layout.glsl"

layout(scalar, set = SET_PROBE, binding = 32) readonly buffer Input {
    uint probe_input[];
};
layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer Output {
    uint probe_output[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index < probe_input.length()) {
        probe_output[index] = probe_input[index] + 1u;
    }
}
