// Weights of the lobes at one hit, given its visibility cache. [Wu & Shih 2009], section 4.2: Num(l)
// counts the cached directions close to lobe l, V(l) lowers its weight. Entry points declare the
// cache and close_lobes.
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
const uint SUMS = (KEPT_LOBES + LOBES_PER_SUM - 1u) / LOBES_PER_SUM;

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

// Bit-sliced counts of cached directions close to each of 32 lobes; COUNT_BITS words are in use.
struct Counts {
    uint bits[7];
};

// State of the path at work: counts, and sums of the weights up to the end of every stretch of
// LOBES_PER_SUM lobes.
Counts close_counts[MASK_WORDS];
float weight_sums[SUMS];
// Lobes close to the direction under way, and the sums once it is recorded.
uint masks_under_way[MASK_WORDS];
float sums_under_way[SUMS];

void add_mask(inout Counts counts, uint mask) {
    for (uint p = 0u; p < COUNT_BITS; ++p) {
        uint sum = counts.bits[p] ^ mask;
        mask &= counts.bits[p];
        counts.bits[p] = sum;
    }
}

void subtract_mask(inout Counts counts, uint mask) {
    for (uint p = 0u; p < COUNT_BITS; ++p) {
        uint difference = counts.bits[p] ^ mask;
        mask &= difference;
        counts.bits[p] = difference;
    }
}

// Returns the count of lobe `bit` of 32.
uint count_of(Counts counts, uint bit) {
    uint count = 0u;
    for (uint p = 0u; p < COUNT_BITS; ++p) {
        count |= ((counts.bits[p] >> bit) & 1u) << p;
    }
    return count;
}

// Loads the lobes of a path; `film_index` matters only for caches of pixels.
Lobes load_lobes(uint path, uint path_count, uint film_index) {
    Lobes lobes = Lobes(path, path_count, lobe_counts[path], 0u, 0u);
    if (CACHE_CAPACITY > 0u) {
        lobes.head = cache_head(path, film_index);
        lobes.recorded = visibility_cache[lobes.head] & ~CACHE_GROWN;
    }
    return lobes;
}

// Loads the counts for lobes 32 * word to 32 * word + 31, as earlier passes left them.
Counts load_counts(Lobes lobes, uint word) {
    Counts counts;
    for (uint p = 0u; p < COUNT_BITS; ++p) {
        counts.bits[p] = 0u;
    }
    // The cache of a hit holds no more than its rays so far.
    uint most =
        CACHE_OF_PIXEL != 0u ? CACHE_CAPACITY : min(CACHE_CAPACITY, wave.first_shadow_ray);
    for (uint i = 0u; i < most; ++i) {
        uint entry = lobes.recorded - 1u - min(i, lobes.recorded - 1u);
        uint mask = texelFetch(
            close_lobe_texels,
            int(close_lobes_index(lobes.path, lobes.path_count, entry, word))).x;
        add_mask(counts, i < lobes.recorded ? mask : 0u);
    }
    return counts;
}

// Loads counts and sums, as earlier passes left them.
void load_weights(Lobes lobes) {
    if (CACHE_CAPACITY > 0u) {
        for (uint word = 0u; word < MASK_WORDS; ++word) {
            close_counts[word] = load_counts(lobes, word);
        }
    }
    for (uint s = 0u; s < SUMS; ++s) {
        weight_sums[s] =
            texelFetch(lobe_sum_texels, int(s * lobes.path_count + lobes.path)).x;
    }
}

// V of a lobe with `close` close directions.
float visibility_weight(float close) {
    float ratio = 1.0 / (1.0 + close);
    return VISIBILITY_EXPONENT == 2.0 ? ratio * ratio : pow(ratio, VISIBILITY_EXPONENT);
}

// V of lobe `bit` of 32.
float counted_weight(Counts counts, uint bit) {
    return CACHE_CAPACITY > 0u ? visibility_weight(float(count_of(counts, bit))) : 1.0;
}

// Returns the counts without the direction that a full cache forgets for the next.
Counts counts_kept(Lobes lobes, uint word) {
    Counts counts = close_counts[word];
    for (uint once = lobes.recorded < CACHE_CAPACITY ? 0u : 1u; once > 0u; --once) {
        uint oldest = lobes.recorded - CACHE_CAPACITY;
        subtract_mask(
            counts, close_lobes[close_lobes_index(lobes.path, lobes.path_count, oldest, word)]);
    }
    return counts;
}

uvec2 lobe_words(Lobes lobes, uint l) {
    return texelFetch(lobe_texels, int(l * lobes.path_count + lobes.path)).xy;
}

float weight_of_words(uvec2 words) {
    return unpackHalf2x16(words.y).y;
}

// Returns the sum of all weights.
float weight_total(Lobes lobes) {
    return lobes.count > 0u ? weight_sums[(lobes.count - 1u) / LOBES_PER_SUM] : 0.0;
}

// Finds the first lobe at which the sum of the weights exceeds the target, which is below the total.
uint find_lobe(Lobes lobes, float target) {
    uint last_stretch = (lobes.count - 1u) / LOBES_PER_SUM;
    uint stretch = 0u;
    float sum = 0.0;
    for (uint s = 0u; s + 1u < SUMS; ++s) {
        bool is_before = s < last_stretch && weight_sums[s] <= target;
        stretch = is_before ? s + 1u : stretch;
        sum = is_before ? weight_sums[s] : sum;
    }
    uint first = LOBES_PER_SUM * stretch;
    Counts counts = close_counts[first / 32u];
    uint chosen = first;
    uint end = min(lobes.count - first, LOBES_PER_SUM);
    for (uint i = 0u; i < end && sum <= target; ++i) {
        uint l = first + i;
        float weight = weight_of_words(lobe_words(lobes, l)) * counted_weight(counts, l % 32u);
        sum += weight;
        chosen = weight > 0.0 ? l : chosen;
    }
    return chosen;
}

#endif
