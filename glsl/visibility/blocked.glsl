// Recording blocked directions in the visibility cache of a hit. [Wu & Shih 2009], section 4.2. A full
// cache forgets its oldest entry. Entry points declare visibility_cache and close_lobes.

#include "visibility/weights.glsl"

WRITES(lobe_sums)

// Records the direction under way, for which mixture_lobe_density ran last, as blocked. The weights
// that follow from it are in force from now on.
void cache_blocked(inout Lobes lobes, vec3 direction) {
    visibility_cache[lobes.head + 1u + lobes.recorded % CACHE_CAPACITY] = pack_normal(direction);
    for (uint word = 0u; word < MASK_WORDS; ++word) {
        close_lobes[close_lobes_index(lobes.path, lobes.path_count, lobes.recorded, word)] =
            masks_under_way[word];
    }
    lobes.counts = QUADS - lobes.counts;
    for (uint s = 0u; s < SUMS; ++s) {
        weight_sums[s] = sums_under_way[s];
    }
    lobes.recorded += 1u;
}

// Stores the state for later passes; `head_bits` is CACHE_GROWN or 0.
void store_weights(Lobes lobes, uint head_bits) {
    visibility_cache[lobes.head] = lobes.recorded | head_bits;
    for (uint s = 0u; s < SUMS; ++s) {
        lobe_sums[s * lobes.path_count + lobes.path] = weight_sums[s];
    }
}
