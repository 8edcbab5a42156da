// Chooses directions at every hit of the wave from lobes of the product, BRDF and environment. Writes
// one shadow ray for each, by the density of the whole mixture: algorithm 5.1 of [Wu & Shih 2009].
#version 460

#include "layout.glsl"

READS(visibility_cache)

#include "product/mixture.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(constant_id = CONSTANT_SAMPLER) const uint SAMPLER = SAMPLER_PRODUCT;

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
        MixtureNumbers numbers =
            draw_numbers(vertex, ray, SAMPLER == SAMPLER_VISIBILITY, CACHE_OF_PIXEL != 0u);
        vec3 direction = mixture_sample(vertex, mixture, ray, numbers);
        float lobe_density = mixture_lobe_density(mixture, direction, is_noted);
        DirectionSample sampled = evaluate_world(vertex, direction);
        write_sample(
            i * path_count + path, sampled, mixture_pdf(mixture, sampled, lobe_density));
    }
}
