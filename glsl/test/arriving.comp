// Probe of arriving.glsl: a direction in, its index out.
#version 460

#include "guided/arriving.glsl"
#include "test/answers.glsl"

uint answer(vec3 query) {
    return arrival_direction(query);
}

ANSWER_QUERIES(vec3, uint, answer)
