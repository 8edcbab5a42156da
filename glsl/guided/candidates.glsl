// Candidates for the shadow rays of `guided`, from BRDF and guide. Densities in solid angle measure.

#include "guided/guide.glsl"

// 1 draws each ray from BRDF or guide (one-sample model). More are resampled, BRDF_CANDIDATES of
// them from the BRDF and the rest from the guide.
layout(constant_id = CONSTANT_CANDIDATES) const uint CANDIDATES = 1u;
layout(constant_id = CONSTANT_BRDF_CANDIDATES) const uint BRDF_CANDIDATES = 1u;

// Offsets from the first dimension of a vertex.
const uint DIMENSION_GUIDE_BRDF = 8u;
const uint DIMENSION_GUIDE_LOBE = 9u;
const uint DIMENSION_GUIDE_REGION = 16u;
const uint DIMENSION_GUIDE_PATCH = 24u;

// Returns bits stratified over the samples of an epoch: its cells do not depend on them.
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

// Returns the density of all candidates of a ray together; each has a fixed technique.
float candidates_pdf(Guided candidate) {
    const float brdf_part = float(BRDF_CANDIDATES) / float(CANDIDATES);
    return brdf_part * candidate.sampled.brdf_pdf + (1.0 - brdf_part) * guided_pdf(candidate);
}
