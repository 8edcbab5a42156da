// Chooses directions at every hit of the wave from lobes of the product, BRDF and environment. Writes
// one shadow ray for each, by the density of the whole mixture.
#version 460

#include "layout.glsl"

READS(visibility_cache)
READS(close_lobes)

#include "product/mixture.glsl"

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
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint ray = wave.first_shadow_ray + i;
        MixtureNumbers numbers = draw_numbers(vertex, ray, false, false);
        shadow_rays[i * path_count + path] = mixture_ray(vertex, mixture, ray, numbers);
    }
}
