// Counts the directions in each hit's cache after its last ray: visibility_cache -> film_cache_entries.
#version 460

#include "load.glsl"
#include "visibility/cache.glsl"
#include "wave.glsl"

READS(visibility_cache)
UPDATES(film_cache_entries)

void count_pixel(uint pixel, PathIndex index) {
    uint place = film_place(index);
    uvec2 entries_and_hits = film_cache_entries[place];
    for (uint i = 0u; i < wave.sample_count; ++i) {
        uint path = i * wave.pixel_count + pixel;
        if (load_hit(path).material == NO_MATERIAL) {
            continue;
        }
        uint recorded = visibility_cache[cache_head(path, index.film_index)] & ~CACHE_GROWN;
        entries_and_hits += uvec2(min(recorded, CACHE_CAPACITY), 1u);
    }
    film_cache_entries[place] = entries_and_hits;
}

RUN_PIXELS(count_pixel)
