// Weights of the lobes at one hit, given its visibility cache. [Wu & Shih 2009], section 4.2: Num(l)
// counts the cached directions close to lobe l, V(l) lowers its weight. Entry points declare the
// cache and close_lobes.
//
// Counts are bytes, one word for a quad of four lobes.
//
// Deviation: V = (1 / (1 + Num))^k, not (1 / Num)^k, infinite for lobes without close directions.

#include "visibility/cache.glsl"
#include "wave.glsl"

TEXELS(lobe_texels)
READS(lobe_counts)
TEXELS(lobe_sum_texels)
TEXELS(close_lobe_texels)

layout(constant_id = CONSTANT_VISIBILITY_EXPONENT) const float VISIBILITY_EXPONENT = 2.0;

const uint SUMS = (KEPT_LOBES + LOBES_PER_SUM - 1u) / LOBES_PER_SUM;
const uint QUADS = (KEPT_LOBES + 3u) / 4u;
const uint QUADS_PER_SUM = LOBES_PER_SUM / 4u;

// Location of the lobes of a path, and the state of their cache.
struct Lobes {
    uint path;
    // Lobe `l` of a path is at `l * path_count + path`.
    uint path_count;
    uint count;
    // Head of the visibility cache, and the number of directions ever recorded in it.
    uint head;
    uint recorded;
    // First of the counts in force in close_counts: 0 or QUADS.
    uint counts;
};

// State of the path at work: numbers of cached directions close to each lobe, those in force and those
// once the direction under way is recorded, in turns.
uint close_counts[CACHE_CAPACITY > 0u ? 2u * QUADS : 1u];
// Sums of the weights in force up to the end of every stretch of LOBES_PER_SUM lobes.
float weight_sums[SUMS];
// The same once the direction under way is recorded, and the lobes close to it.
float sums_under_way[SUMS];
uint masks_under_way[MASK_WORDS];

// Returns the four low bits as bytes.
uint bytes_of_bits(uint bits) {
    return ((bits & 15u) * 0x00204081u) & 0x01010101u;
}

// Loads the lobes of a path; `film_index` matters only for caches of pixels.
Lobes load_lobes(uint path, uint path_count, uint film_index) {
    Lobes lobes = Lobes(path, path_count, lobe_counts[path], 0u, 0u, 0u);
    if (CACHE_CAPACITY > 0u) {
        lobes.head = cache_head(path, film_index);
        lobes.recorded = visibility_cache[lobes.head] & ~CACHE_GROWN;
    }
    return lobes;
}

// Loads the counts as earlier passes left them.
void load_counts(Lobes lobes) {
    // The cache of a hit holds no more than its rays so far.
    uint most =
        CACHE_OF_PIXEL != 0u ? CACHE_CAPACITY : min(CACHE_CAPACITY, wave.first_shadow_ray);
    most = min(most, lobes.recorded);
    for (uint word = 0u; word < MASK_WORDS; ++word) {
        uint counts[8] = uint[](0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
        for (uint i = 0u; i < most; ++i) {
            uint entry = lobes.recorded - 1u - i;
            uint mask = texelFetch(
                close_lobe_texels,
                int(close_lobes_index(lobes.path, lobes.path_count, entry, word))).x;
            for (uint quad = 0u; quad < 8u; ++quad) {
                counts[quad] += bytes_of_bits(mask >> (4u * quad));
            }
        }
        for (uint quad = 0u; quad < min(8u, QUADS - 8u * word); ++quad) {
            close_counts[8u * word + quad] = counts[quad];
        }
    }
}

// Loads counts and sums, as earlier passes left them.
void load_weights(Lobes lobes) {
    if (CACHE_CAPACITY > 0u) {
        load_counts(lobes);
    }
    for (uint s = 0u; s < SUMS; ++s) {
        weight_sums[s] =
            texelFetch(lobe_sum_texels, int(s * lobes.path_count + lobes.path)).x;
    }
}

// V of lobe `i` of the quad with these counts.
float visibility_weight(uint counts, uint i) {
    float ratio = 1.0 / (1.0 + float((counts >> (8u * i)) & 0xffu));
    return VISIBILITY_EXPONENT == 2.0 ? ratio * ratio : pow(ratio, VISIBILITY_EXPONENT);
}

// Returns the counts in force of a quad; 0 without a cache.
uint counts_of(Lobes lobes, uint quad) {
    return CACHE_CAPACITY > 0u ? close_counts[lobes.counts + quad] : 0u;
}

// Returns the bits of 32 lobes for the direction that a full cache forgets for the next.
uint forgotten_mask(Lobes lobes, uint word) {
    uint mask = 0u;
    if (lobes.recorded >= CACHE_CAPACITY) {
        uint oldest = lobes.recorded - CACHE_CAPACITY;
        mask = close_lobes[close_lobes_index(lobes.path, lobes.path_count, oldest, word)];
    }
    return mask;
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
    uint chosen = LOBES_PER_SUM * stretch;
    uint end = min(lobes.count, chosen + LOBES_PER_SUM);
    for (uint first = chosen; first < end && sum <= target; first += 4u) {
        uint counts = counts_of(lobes, first / 4u);
        for (uint l = first; l < min(end, first + 4u) && sum <= target; ++l) {
            float weight =
                weight_of_words(lobe_words(lobes, l)) * visibility_weight(counts, l % 4u);
            sum += weight;
            chosen = weight > 0.0 ? l : chosen;
        }
    }
    return chosen;
}
