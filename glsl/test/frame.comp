// Probe of frame.glsl: a normal, a direction and a number in, everything out.
#version 460

#include "frame.glsl"
#include "test/answers.glsl"

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
    vec2 sin_cos;
};

ProbeOutput answer(ProbeInput probe) {
    Frame frame = frame_from_normal(probe.normal);
    vec3 direction_local = to_local(frame, probe.direction);
    return ProbeOutput(
        frame.tangent, frame.bitangent, direction_local, to_world(frame, direction_local),
        lat_long_from_direction(probe.direction), sin_cos_pi(2.0 * probe.uv.x));
}

ANSWER_QUERIES(ProbeInput, ProbeOutput, answer)
