// Candidates of the sampler `guided` for a shadow ray: directions from the BRDF and from the guide by
// stratified numbers, and the density that all of a ray have together.

#ifndef CANDIDATES_GLSL
#define CANDIDATES_GLSL

#include "guided/guide.glsl"

// 1 draws each ray from BRDF or guide (one-sample model); more resample, a fixed number of the
// candidates from the BRDF and the rest from the guide.
layout(constant_id = CONSTANT_CANDIDATES) const uint CANDIDATES = 1u;
layout(constant_id = CONSTANT_BRDF_CANDIDATES) const uint BRDF_CANDIDATES = 1u;

// Offsets of dimensions from the first of a vertex.
const uint DIMENSION_GUIDE_BRDF = 8u;
const uint DIMENSION_GUIDE_LOBE = 9u;
const uint DIMENSION_GUIDE_REGION = 16u;
const uint DIMENSION_GUIDE_PATCH = 24u;

// Numbers that are stratified over the samples since the last rebuild, scrambled anew for each: what
// the cells hold does not depend on them.
uvec2 epoch_bits(Vertex vertex, uint index, uint dimension) {
    return random_bits_2d(
        vertex.index.pixel, index, vertex.dimension + dimension, wave.epoch_seed);
}

uvec4 independent_bits(Vertex vertex, uint index, uint dimension) {
    return hash_4d(uvec4(vertex.index.pixel, index, vertex.dimension + dimension, wave.epoch_seed));
}

Guided draw_candidate(Vertex vertex, uint first, uint index) {
    return draw_guided(
        vertex, first, epoch_bits(vertex, index, DIMENSION_GUIDE_REGION),
        independent_bits(vertex, index, DIMENSION_GUIDE_PATCH));
}

Guided draw_brdf_candidate(Vertex vertex, uint first, uint index) {
    uvec2 bits = epoch_bits(vertex, index, DIMENSION_GUIDE_BRDF);
    float lobe = random_1d(
        vertex.index.pixel, index, vertex.dimension + DIMENSION_GUIDE_LOBE, wave.epoch_seed);
    return draw_brdf_guided(
        vertex, first, vec3(unit_float(bits.x), unit_float(bits.y), lobe));
}

// Density of the candidates of a ray, each drawn by a technique that is fixed.
float candidates_pdf(Guided candidate) {
    const float brdf_part = float(BRDF_CANDIDATES) / float(CANDIDATES);
    return brdf_part * candidate.sampled.brdf_pdf + (1.0 - brdf_part) * guided_pdf(candidate);
}

#endif
