// Adds the finished paths to the film, pixel by pixel and in sample order: grouping never changes a sum.
#version 460

#include "wave.glsl"

READS(paths)
UPDATES(film_sum)
UPDATES(film_compensation)
UPDATES(film_squares)
UPDATES(film_squares_compensation)
UPDATES(film_visible)
UPDATES(counters)

// Adds a value to a sum of two floats. Two-sum (Knuth): `rest` is exactly what rounding `total` lost.
void add(vec3 value, inout vec3 sum, inout vec3 compensation) {
    precise vec3 total = sum + value;
    precise vec3 added = total - sum;
    precise vec3 rest = (sum - (total - added)) + (value - added);
    // Keep the compensation below half a unit of the sum: left to grow, it would round too.
    precise vec3 low = compensation + rest;
    precise vec3 next_sum = total + low;
    precise vec3 next_compensation = low - (next_sum - total);
    sum = next_sum;
    compensation = next_compensation;
}

void accumulate_pixel(uint pixel, PathIndex index) {
    // Training rays are counted, but their light stays out of the picture.
    bool adds = wave.is_training == 0u;
    uint place = adds ? film_place(index) : 0u;
    vec3 sum = film_sum[place];
    vec3 compensation = film_compensation[place];
    vec3 squares = film_squares[place];
    vec3 squares_compensation = film_squares_compensation[place];
    uint bounce_rays = 0u;
    uint dropped = 0u;
    uvec2 shadow_rays = uvec2(0u);
    for (uint i = 0u; i < wave.sample_count; ++i) {
        PathState state = paths[i * wave.pixel_count + pixel];
        bounce_rays += state.rays_traced - 1u;
        shadow_rays += uvec2(state.shadow_rays_visible, state.shadow_rays_traced);
        vec3 radiance = state.radiance;
        // One value that is not finite would spoil the pixel for good.
        if (any(isnan(radiance)) || any(isinf(radiance))) {
            dropped += 1u;
            continue;
        }
        add(radiance, sum, compensation);
        add(radiance * radiance, squares, squares_compensation);
    }
    if (adds) {
        film_sum[place] = sum;
        film_compensation[place] = compensation;
        film_squares[place] = squares;
        film_squares_compensation[place] = squares_compensation;
        if ((wave.aovs & AOV_VISIBLE) != 0u) {
            film_visible[place] += shadow_rays;
        }
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

RUN_PIXELS(accumulate_pixel)
