// Finds the lobes of every hit close to the directions cached for its pixel, and sums their weights before
// the first ray: lobes, visibility_cache -> close_lobes, lobe_sums. [Wu & Shih 2009], section 4.2. See
// weights.glsl for the weights.
#version 460

#include "layout.glsl"

WRITES(lobe_sums)
UPDATES(visibility_cache)
UPDATES(close_lobes)
UPDATES(counters)

#include "visibility/weights.glsl"

// Not 0: arrays need an element even in samplers without a cache.
const uint PLACES = CACHE_CAPACITY > 0u ? CACHE_CAPACITY : 1u;

void write_sum(Lobes lobes, uint l, float sum) {
    if (is_sum_kept(l, lobes.count)) {
        lobe_sums[l / LOBES_PER_SUM * lobes.path_count + lobes.path] = sum;
    }
}

// Sums the weights, testing all entries against all lobes, and notes the close ones.
void sum_with_all_entries(Lobes lobes) {
    uint entries = min(lobes.recorded, CACHE_CAPACITY);
    vec3 directions[PLACES];
    uint masks[PLACES];
    for (uint i = 0u; i < CACHE_CAPACITY; ++i) {
        uint entry = lobes.recorded - 1u - min(i, lobes.recorded - 1u);
        directions[i] =
            unpack_normal(visibility_cache[lobes.head + 1u + entry % CACHE_CAPACITY]);
    }
    float sum = 0.0;
    for (uint word = 0u; 32u * word < lobes.count; ++word) {
        for (uint i = 0u; i < CACHE_CAPACITY; ++i) {
            masks[i] = 0u;
        }
        uint end = min(lobes.count - 32u * word, 32u);
        for (uint bit = 0u; bit < end; ++bit) {
            ProductLobe lobe = unpack_lobe(lobe_words(lobes, 32u * word + bit));
            float tail = exp(-2.0 * lobe.bandwidth);
            uint close_count = 0u;
            for (uint i = 0u; i < CACHE_CAPACITY; ++i) {
                bool close = i < entries
                    && is_close(
                        lobe.bandwidth, tail, distance_from_axis(lobe.axis, directions[i]));
                masks[i] |= close ? 1u << bit : 0u;
                close_count += close ? 1u : 0u;
            }
            sum += lobe.weight * visibility_weight(close_count, 0u);
            write_sum(lobes, 32u * word + bit, sum);
        }
        for (uint i = 0u; i < entries; ++i) {
            close_lobes[close_lobes_index(
                lobes.path, lobes.path_count, lobes.recorded - 1u - i, word)] = masks[i];
        }
    }
}

void reweight_path(uint path) {
    uint path_count = wave_path_count();
    PathIndex index = wave_path(path);
    if (!index.inside) {
        return;
    }
    Lobes lobes = load_lobes(path, path_count, index.film_index);
    if (lobes.count == 0u || lobes.recorded == 0u) {
        return;
    }
    sum_with_all_entries(lobes);
    visibility_cache[lobes.head] = lobes.recorded;
    atomicAdd(counters.cdf_rebuilds, 1u);
}

RUN_PATHS(reweight_path)
