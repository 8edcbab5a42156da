// Probe of frame.glsl: a normal, a direction and a point of the unit square in, everything out.
#version 460

#include "frame.glsl"
#include "layout.glsl"

struct ProbeInput {
    vec3 normal;
    vec3 direction;
    vec2 uv;
};

struct ProbeOutput {
    vec3 tangent;
    vec3 bitangent;
    vec3 direction_local;
    vec3 direction_again;
    vec2 lat_long;
    vec3 from_lat_long;
    vec2 sin_cos;
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
    Frame frame = frame_from_normal(probe.normal);
    vec3 direction_local = to_local(frame, probe.direction);
    outputs[index] = ProbeOutput(
        frame.tangent, frame.bitangent, direction_local, to_world(frame, direction_local),
        lat_long_from_direction(probe.direction), direction_from_lat_long(probe.uv),
        sin_cos_pi(2.0 * probe.uv.x));
}
