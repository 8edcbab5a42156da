// Adds to the film how many directions the visibility cache of every hit holds after the last of its
// rays, where asked for: visibility_cache -> film_cache_entries.
#version 460

#define NEEDS_PARAMETERS
#define NEEDS_WAVE
#define NEEDS_HIT_TEXELS
#define NEEDS_CACHE
#define NEEDS_FILM_AOVS
#include "product.glsl"
#include "wave.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(constant_id = CONSTANT_CACHE_CAPACITY) const uint CACHE_CAPACITY = 8u;
layout(constant_id = CONSTANT_CACHE_OF_PIXEL) const uint CACHE_OF_PIXEL = 0u;

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    PathIndex index = wave_pixel(wave_film_position(pixel));
    if (pixel >= wave.pixel_count || !index.inside) {
        return;
    }
    uvec2 entries_and_hits = film_cache_entries[index.film_index];
    for (uint i = 0u; i < wave.sample_count; ++i) {
        uint path = i * wave.pixel_count + pixel;
        if (load_hit_origin(path).material == NO_MATERIAL) {
            continue;
        }
        uint cache = CACHE_OF_PIXEL != 0u ? index.film_index : path;
        uint recorded = visibility_cache[cache * (CACHE_CAPACITY + 1u)] & ~CACHE_GROWN;
        entries_and_hits += uvec2(min(recorded, CACHE_CAPACITY), 1u);
    }
    film_cache_entries[index.film_index] = entries_and_hits;
}
