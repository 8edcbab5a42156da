// Chooses directions at every hit of the wave from nodes of the product, BRDF and environment, and writes
// one shadow ray for each by the density of the whole mixture.
#version 460

#include "haar/mixture.glsl"

layout(constant_id = CONSTANT_CACHE_CAPACITY) const uint CACHE_CAPACITY = 0u;

void sample_vertex(uint path, Vertex vertex) {
    uint path_count = wave_path_count();
    HaarMixture mixture = load_haar_mixture(path, path_count);
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        MixtureNumbers numbers =
            draw_numbers(vertex, wave.first_shadow_ray + i, CACHE_CAPACITY > 0u, false);
        NodeSample drawn = haar_sample(vertex, mixture, numbers);
        DirectionSample sampled = evaluate_world(vertex, drawn.direction);
        write_sample(i * path_count + path, sampled, shares_pdf(mixture.shares, sampled, drawn.pdf));
    }
}

RUN_VERTICES(sample_vertex)
