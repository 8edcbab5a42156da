// Chooses directions at every hit of the wave from lobes of the product, BRDF and environment. Writes
// one shadow ray for each, by the density of the whole mixture: algorithm 5.1 of [Wu & Shih 2009].
#version 460

#include "layout.glsl"

READS(visibility_cache)

#include "product/mixture.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(constant_id = CONSTANT_SAMPLER) const uint SAMPLER = SAMPLER_PRODUCT;

// Draws the numbers of one ray; pixels of a block share the technique. Rays that learn from earlier
// rays have dimensions of their own; samples that learn from samples have independent numbers.
MixtureNumbers draw_numbers(Vertex vertex, uint ray) {
    PathIndex index = vertex.index;
    MixtureNumbers numbers;
    if (SAMPLER == SAMPLER_VISIBILITY) {
        uint dimension =
            DIMENSION_ADAPTIVE + (wave.vertex * 4096u + ray) * DIMENSIONS_PER_ADAPTIVE_RAY;
        numbers.technique = unit_float(block_random_bits(
            index, dimension + laine_karras_permutation(index.sample_index, ray) * 64u).x);
        if (CACHE_OF_PIXEL != 0u) {
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

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count) {
        return;
    }
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        return;
    }
    Vertex vertex = load_vertex(path, hit);
    Mixture mixture = load_mixture(path, path_count, vertex.index.film_index);
    // Skip the last ray of a hit: the next sample has other lobes.
    bool is_noted = wave.first_shadow_ray + wave.shadow_ray_count < wave.total_shadow_rays;
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint ray = wave.first_shadow_ray + i;
        vec3 direction = mixture_sample(vertex, mixture, ray, draw_numbers(vertex, ray));
        float lobe_density = mixture_lobe_density(mixture, direction, is_noted);
        DirectionSample sampled = evaluate_world(vertex, direction);
        write_sample(
            i * path_count + path, sampled, mixture_pdf(mixture, sampled, lobe_density));
    }
}
