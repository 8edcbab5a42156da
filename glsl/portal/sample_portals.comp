// Chooses directions at every hit of the wave from the BRDF, from the portals of the scene and from the
// environment, and writes one shadow ray for each by the density of all three: the balance heuristic of
// `mis`. Densities are in solid angle measure.
#version 460

#include "mis.glsl"
#include "path_list.glsl"
#include "portal/portals.glsl"

// Density of all techniques at a direction; `light_share` is that of portals among light.
float density(Vertex vertex, DirectionSample sampled, float light_share, float total) {
    float light = (1.0 - light_share) * sampled.environment_pdf;
    if (light_share > 0.0) {
        light += light_share * portal_pdf(vertex, total, sampled.direction);
    }
    return mis_pdf(sampled.brdf_pdf, light, wave.total_shadow_rays, wave.bounce_rays);
}

void sample_path(uint path) {
    uint path_count = wave_path_count();
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        return;
    }
    Vertex vertex = load_vertex(path, hit);
    uint pixel = vertex.index.pixel;
    // Number the rays through all samples: they share one sequence.
    uint first_ray = vertex.index.sample_index * wave.total_shadow_rays + wave.first_shadow_ray;
    float total = portal_total(vertex);
    // Where no portal is seen, the environment takes their share.
    float light_share = total > 0.0 ? PORTAL_SHARE : 0.0;

    MisTurns turns = mis_turns(
        first_ray, wave.shadow_ray_count, mis_share(wave.total_shadow_rays, wave.bounce_rays),
        block_random_bits(vertex.index, DIMENSION_TECHNIQUE).x);
    uint index = turns.light_index;
    uint left = ~turns.from_brdf & ((1u << wave.shadow_ray_count) - 1u);
    while (left != 0u) {
        uint i = uint(findLSB(left));
        left &= left - 1u;
        vec2 u = random_2d(
            pixel, index, vertex.dimension + DIMENSION_ENVIRONMENT_DIRECTION, wave.seed);
        float choice =
            random_1d(pixel, index, vertex.dimension + DIMENSION_RESAMPLING, wave.seed);
        index++;
        DirectionSample sampled;
        if (choice < light_share) {
            sampled =
                evaluate_world(vertex, portal_sample(vertex, total, choice / light_share, u));
        } else {
            sampled = draw_from_environment(vertex, u);
        }
        write_sample(
            i * path_count + path, sampled, density(vertex, sampled, light_share, total));
    }
    index = turns.brdf_index;
    left = turns.from_brdf;
    while (left != 0u) {
        uint i = uint(findLSB(left));
        left &= left - 1u;
        vec2 u =
            random_2d(pixel, index, vertex.dimension + DIMENSION_BRDF_DIRECTION, wave.seed);
        float lobe = random_1d(pixel, index, vertex.dimension + DIMENSION_BRDF_LOBE, wave.seed);
        index++;
        DirectionSample sampled = draw_from_brdf(vertex, vec3(u, lobe));
        write_sample(
            i * path_count + path, sampled, density(vertex, sampled, light_share, total));
    }
}

WALK_PATHS(sample_path)
