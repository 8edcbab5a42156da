// Random numbers of samplers that draw from a product, BRDF and environment.

#include "vertex.glsl"

// Random numbers for one direction, each in [0, 1).
struct MixtureNumbers {
    float technique;
    vec2 direction;
    float lobe;
};

// Draws the numbers of one ray; pixels of a block share the technique. Rays that learn from earlier
// rays have dimensions of their own; samples that learn from samples have independent numbers.
MixtureNumbers draw_numbers(
    Vertex vertex, uint ray, bool learns_from_rays, bool learns_from_samples) {
    PathIndex index = vertex.index;
    MixtureNumbers numbers;
    if (learns_from_rays) {
        uint dimension =
            DIMENSION_ADAPTIVE + (wave.vertex * 4096u + ray) * DIMENSIONS_PER_ADAPTIVE_RAY;
        numbers.technique = unit_float(block_random_bits(
            index, dimension + laine_karras_permutation(index.sample_index, ray) * 64u).x);
        if (learns_from_samples) {
            numbers.direction =
                random_independent_2d(index.pixel, index.sample_index, dimension + 1u, wave.seed);
            numbers.lobe =
                random_independent_1d(index.pixel, index.sample_index, dimension + 2u, wave.seed);
        } else {
            numbers.direction =
                random_2d(index.pixel, index.sample_index, dimension + 1u, wave.seed);
            numbers.lobe = random_1d(index.pixel, index.sample_index, dimension + 2u, wave.seed);
        }
    } else {
        // Step through the techniques by the golden ratio from a random start.
        uint number = index.sample_index * wave.total_shadow_rays + ray;
        uint turn = block_random_bits(index, DIMENSION_TECHNIQUE).x + number * 0x9e3779b9u;
        numbers.technique = unit_float(turn);
        numbers.direction = random_2d(
            index.pixel, number, vertex.dimension + DIMENSION_BRDF_DIRECTION, wave.seed);
        numbers.lobe =
            random_1d(index.pixel, number, vertex.dimension + DIMENSION_BRDF_LOBE, wave.seed);
    }
    return numbers;
}
