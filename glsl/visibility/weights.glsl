// Weights of the lobes at one hit, given its visibility cache. [Wu & Shih 2009], section 4.2: Num(l)
// counts the cached directions close to lobe l, V(l) lowers its weight. Entry points declare the cache.
//
// Counts are bit-sliced over 32 lobes: word p of a count holds bit p of each lobe's count, so that
// a few operations add a mask for all 32.
//
// Deviation: V = (1 / (1 + Num))^k, not (1 / Num)^k, infinite for lobes without close directions.

#ifndef WEIGHTS_GLSL
#define WEIGHTS_GLSL

#include "visibility/cache.glsl"
#include "wave.glsl"

TEXELS(lobe_texels)
READS(lobe_counts)
TEXELS(lobe_sum_texels)
TEXELS(close_lobe_texels)

layout(constant_id = CONSTANT_VISIBILITY_EXPONENT) const float VISIBILITY_EXPONENT = 2.0;

const uint COUNT_BITS = CACHE_CAPACITY < 2u ? 1u
    : CACHE_CAPACITY < 4u ? 2u
    : CACHE_CAPACITY < 8u ? 3u
    : CACHE_CAPACITY < 16u ? 4u
    : CACHE_CAPACITY < 32u ? 5u
    : CACHE_CAPACITY < 64u ? 6u
    : 7u;

// Location of the lobes of a path, and the state of their cache.
struct Lobes {
    uint path;
    // Lobe `l` of a path is at `l * path_count + path`.
    uint path_count;
    uint count;
    // Head of the visibility cache, and the number of directions ever recorded in it.
    uint head;
    uint recorded;
};

// Bit-sliced counts of cached directions close to each of 32 lobes.
uint close_bits[COUNT_BITS];

// Loads the lobes of a path; `film_index` matters only for caches of pixels.
Lobes load_lobes(uint path, uint path_count, uint film_index) {
    Lobes lobes = Lobes(path, path_count, lobe_counts[path], 0u, 0u);
    if (CACHE_CAPACITY > 0u) {
        lobes.head = cache_head(path, film_index);
        lobes.recorded = visibility_cache[lobes.head] & ~CACHE_GROWN;
    }
    return lobes;
}

// Loads the counts for lobes 32 * word to 32 * word + 31.
void load_counts(Lobes lobes, uint word) {
    for (uint p = 0u; p < COUNT_BITS; ++p) {
        close_bits[p] = 0u;
    }
    // The cache of a hit holds no more than its rays so far.
    uint rays = wave.first_shadow_ray + wave.shadow_ray_count;
    uint most = CACHE_OF_PIXEL != 0u ? CACHE_CAPACITY : min(CACHE_CAPACITY, rays);
    for (uint i = 0u; i < most; ++i) {
        uint entry = lobes.recorded - 1u - min(i, lobes.recorded - 1u);
        uint mask = texelFetch(
            close_lobe_texels,
            int(close_lobes_index(lobes.path, lobes.path_count, entry, word))).x;
        uint carry = i < lobes.recorded ? mask : 0u;
        for (uint p = 0u; p < COUNT_BITS; ++p) {
            uint sum = close_bits[p] ^ carry;
            carry &= close_bits[p];
            close_bits[p] = sum;
        }
    }
}

// V of a lobe with `close` close directions.
float visibility_weight(float close) {
    float ratio = 1.0 / (1.0 + close);
    return VISIBILITY_EXPONENT == 2.0 ? ratio * ratio : pow(ratio, VISIBILITY_EXPONENT);
}

// V of lobe `bit` of the 32 whose counts are loaded.
float counted_weight(uint bit) {
    if (CACHE_CAPACITY == 0u) {
        return 1.0;
    }
    uint close = 0u;
    for (uint p = 0u; p < COUNT_BITS; ++p) {
        close |= ((close_bits[p] >> bit) & 1u) << p;
    }
    return visibility_weight(float(close));
}

uvec2 lobe_words(Lobes lobes, uint l) {
    return texelFetch(lobe_texels, int(l * lobes.path_count + lobes.path)).xy;
}

float weight_of_words(uvec2 words) {
    return unpackHalf2x16(words.y).y;
}

// Returns the sum of the current weights up to the end of a stretch of LOBES_PER_SUM lobes.
float sum_of_stretch(Lobes lobes, uint stretch) {
    return texelFetch(lobe_sum_texels, int(stretch * lobes.path_count + lobes.path)).x;
}

// Finds the first lobe at which the sum of the weights exceeds the target, which is below the total.
uint find_lobe(Lobes lobes, float target) {
    uint last_stretch = (lobes.count - 1u) / LOBES_PER_SUM;
    uint stretch = 0u;
    float sum = 0.0;
    for (uint s = 0u; s < last_stretch; ++s) {
        float up_to = sum_of_stretch(lobes, s);
        stretch = up_to <= target ? s + 1u : stretch;
        sum = up_to <= target ? up_to : sum;
    }
    uint first = LOBES_PER_SUM * stretch;
    load_counts(lobes, first / 32u);
    uint chosen = first;
    uint end = min(lobes.count - first, LOBES_PER_SUM);
    for (uint i = 0u; i < end && sum <= target; ++i) {
        uint l = first + i;
        float weight = weight_of_words(lobe_words(lobes, l)) * counted_weight(l % 32u);
        sum += weight;
        chosen = weight > 0.0 ? l : chosen;
    }
    return chosen;
}

#endif
