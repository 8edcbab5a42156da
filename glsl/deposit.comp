// Leaves the radiance of finished paths for the pass `accumulate`, and adds what needs no filter to the film.
#version 460

#include "light_groups.glsl"
#include "load.glsl"
#include "wave.glsl"

READS(features)
WRITES(film_radiance)
UPDATES(film_unfiltered)
UPDATES(film_visible)
UPDATES(film_albedo)
UPDATES(film_normal)
UPDATES(film_position)
UPDATES(counters)

// Adds a feature of the samples to its layer. Sample by sample, as below.
#define ADD_FEATURE(layer, film, feature) \
    if ((AOVS & layer) != 0u) { \
        vec3 sum = film[place]; \
        for (uint i = 0u; i < wave.sample_count; ++i) { \
            sum += features[i * wave.pixel_count + pixel].feature; \
        } \
        film[place] = sum; \
    }

void deposit_pixel(uint pixel, PathIndex index) {
    // Training rays are counted, but their light stays out of the picture.
    bool adds = wave.is_training == 0u;
    uint place = adds ? film_place(index) : 0u;
    bool wants_unfiltered = adds && (AOVS & AOV_UNFILTERED) != 0u;
    vec3 unfiltered = wants_unfiltered ? film_unfiltered[place] : vec3(0.0);
    uint bounce_rays = 0u;
    uint dropped = 0u;
    uvec2 shadow_rays = uvec2(0u);
    for (uint i = 0u; i < wave.sample_count; ++i) {
        PathState state = load_path_state(i * wave.pixel_count + pixel);
        bounce_rays += state.rays_traced - 1u;
        shadow_rays += uvec2(state.shadow_rays_visible, state.shadow_rays_traced);
        vec3 radiance = state.radiance;
        // One value that is not finite would spoil the pixel for good.
        bool is_dropped = any(isnan(radiance)) || any(isinf(radiance));
        if (is_dropped) {
            dropped += 1u;
            radiance = vec3(0.0);
        }
        if (adds) {
            film_radiance[radiance_place(place, i)] = radiance;
            for (uint group = 0u; group < LIGHT_GROUPS; ++group) {
                vec3 own = group_radiance[group_place(i * wave.pixel_count + pixel, group)];
                film_radiance[radiance_place(place, i) + 1u + group] = is_dropped ? vec3(0.0) : own;
            }
        }
        // Add sample by sample: the sum must not depend on how samples are grouped into waves.
        unfiltered += radiance;
    }
    if (wants_unfiltered) {
        film_unfiltered[place] = unfiltered;
    }
    if (adds) {
        ADD_FEATURE(AOV_ALBEDO, film_albedo, albedo)
        ADD_FEATURE(AOV_NORMAL, film_normal, normal)
        ADD_FEATURE(AOV_POSITION, film_position, position)
    }
    if (adds && (AOVS & AOV_VISIBLE) != 0u) {
        film_visible[place] += shadow_rays;
    }
    atomicAdd(counters.camera_rays, wave.sample_count);
    if (bounce_rays > 0u) {
        atomicAdd(counters.bounce_rays, bounce_rays);
    }
    if (shadow_rays.y > 0u) {
        atomicAdd(counters.shadow_rays_visible, shadow_rays.x);
        atomicAdd(counters.shadow_rays_traced, shadow_rays.y);
    }
    if (dropped > 0u) {
        atomicAdd(counters.dropped_samples, dropped);
    }
}

RUN_PIXELS(deposit_pixel)
