// Adds the samples of a sweep to the film, each weighted by the reconstruction filter in the pixels around
// its own, pixel by pixel and in sample order: grouping never changes a sum.
#version 460

#include "wave.glsl"
#include "reconstruction.glsl"

READS(film_radiance)
UPDATES(film_sum)
UPDATES(film_compensation)
UPDATES(film_squares)
UPDATES(film_squares_compensation)
UPDATES(film_groups)

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

// Returns one sample of the filtered picture, layer 0, or of a light group: those of 3×3 pixels by their
// weights, which add up to one.
vec3 filtered(PathIndex index, uint place, uint i, uint layer) {
    if (parameters.film_filter != FILTER_GAUSSIAN) {
        return film_radiance[radiance_place(place, i) + layer];
    }
    uvec2 end = uvec2(parameters.crop_width, parameters.crop_height) - 1u;
    uvec2 first = uvec2(equal(index.crop_pixel, uvec2(0u)));
    uvec2 last = 1u + uvec2(lessThan(index.crop_pixel, end));
    vec2 offset = sample_offset(index.pixel, wave.first_sample + i, wave.seed);
    vec3 columns = filter_weights(offset.x, vec3(1u - first.x, 1u, last.x - 1u));
    vec3 rows = filter_weights(offset.y, vec3(1u - first.y, 1u, last.y - 1u));
    vec3 value = vec3(0.0);
    for (uint y = first.y; y <= last.y; ++y) {
        for (uint x = first.x; x <= last.x; ++x) {
            uint beside = place + y * parameters.crop_width + x - parameters.crop_width - 1u;
            value += rows[y] * columns[x] * film_radiance[radiance_place(beside, i) + layer];
        }
    }
    return value;
}

void accumulate_pixel(uint pixel, PathIndex index) {
    uint place = film_place(index);
    vec3 sum = film_sum[place];
    vec3 compensation = film_compensation[place];
    vec3 squares = film_squares[place];
    vec3 squares_compensation = film_squares_compensation[place];
    for (uint i = 0u; i < wave.sample_count; ++i) {
        vec3 radiance = filtered(index, place, i, 0u);
        add(radiance, sum, compensation);
        add(radiance * radiance, squares, squares_compensation);
    }
    film_sum[place] = sum;
    film_compensation[place] = compensation;
    film_squares[place] = squares;
    film_squares_compensation[place] = squares_compensation;
    for (uint group = 0u; group < LIGHT_GROUPS; ++group) {
        uint at = 2u * (place * LIGHT_GROUPS + group);
        sum = film_groups[at];
        compensation = film_groups[at + 1u];
        for (uint i = 0u; i < wave.sample_count; ++i) {
            add(filtered(index, place, i, 1u + group), sum, compensation);
        }
        film_groups[at] = sum;
        film_groups[at + 1u] = compensation;
    }
}

RUN_PIXELS(accumulate_pixel)
