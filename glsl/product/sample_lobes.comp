// Chooses directions at every hit of the wave from lobes of the product, BRDF and environment. Writes
// one shadow ray for each, by the density of the whole mixture.
#version 460

#include "layout.glsl"

READS(visibility_cache)
READS(close_lobes)

#include "product/mixture.glsl"

void sample_vertex(uint path, Vertex vertex) {
    uint path_count = wave_path_count();
    Mixture mixture = load_mixture(path, path_count, vertex.index.film_index);
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint ray = wave.first_shadow_ray + i;
        MixtureNumbers numbers = draw_numbers(vertex, ray, false, false);
        shadow_rays[i * path_count + path] = mixture_ray(vertex, mixture, ray, numbers);
    }
}

RUN_VERTICES(sample_vertex)
