// Adds one to every word, to test the host itself.
#version 460

#include "test/answers.glsl"

uint answer(uint query) {
    return query + 1u;
}

ANSWER_QUERIES(uint, uint, answer)
