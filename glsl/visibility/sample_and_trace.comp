// Draws shadow rays one after another at every hit of the wave, traces each, and records blocked ones in
// the visibility cache before the next is drawn: algorithm 5.1 of [Wu & Shih 2009]. Reads and writes
// rays as sample_lobes.comp and shadow.comp do.
//
// The weights after a blocked ray are summed in the loop over all lobes that the density of the ray
// takes anyway.
#version 460

#include "given_up.glsl"
#include "passage.glsl"

UPDATES(visibility_cache)
UPDATES(close_lobes)
WRITES(visibility)
UPDATES(counters)

#include "product/mixture.glsl"
#include "visibility/blocked.glsl"

void sample_vertex(uint path, Vertex vertex) {
    uint path_count = wave_path_count();
    Mixture mixture = load_mixture(path, path_count, vertex.index.film_index);
    float offset = ray_offset();
    uint recorded_before = mixture.lobes.recorded;
    uint grown = 0u;
    // Steps of all rays together: software devices bound the loops of an invocation.
    uint steps = 0u;
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint index = wave.first_shadow_ray + i;
        MixtureNumbers numbers = draw_numbers(vertex, index, true, CACHE_OF_PIXEL != 0u);
        ShadowRay ray = mixture_ray(vertex, mixture, index, numbers);

        bool is_traced = ray.contribution != vec3(0.0);
        bool running = is_traced;
        bvh_start(
            moved_off_surface(
                vertex.hit.position, vertex.hit.geometric_normal, ray.direction, offset),
            ray.direction, FAR_AWAY, true);
        while (running && steps < TRAVERSAL_STEP_LIMIT) {
            running = bvh_step(true);
            steps++;
        }
        bool is_visible = is_traced && !running && bvh_triangle == NO_TRIANGLE;
        if (HAS_PASSAGES && is_visible) {
            ray.contribution *= bvh_transmittance;
        }
        shadow_rays[i * path_count + path] = ray;
        visibility[i * path_count + path] = is_visible ? 1u : 0u;

        if (running) {
            COUNT_GIVEN_UP(path);
        }
        // Only the pixel's next sample can use the last ray of a hit.
        bool is_last = index + 1u == wave.total_shadow_rays;
        bool is_learned = is_traced && !is_visible && (CACHE_OF_PIXEL != 0u || !is_last);
        if (is_learned) {
            cache_blocked(mixture.lobes, ray.direction);
            set_shares(mixture);
            grown = is_last ? CACHE_GROWN : 0u;
        }
    }
    uint recorded = mixture.lobes.recorded - recorded_before;
    if (recorded > 0u) {
        store_weights(mixture.lobes, grown);
        atomicAdd(counters.cache_entries, recorded);
        atomicAdd(counters.cdf_rebuilds, grown != 0u ? recorded - 1u : recorded);
    }
}

RUN_VERTICES(sample_vertex)
