// Lobes of the product of environment and BRDF at one hit, as passes hand them on, and the caches of
// directions whose visibility is known. Includes srbf.glsl; [Wu & Shih 2009], section 4.
//
// A lobe is two words: axis in the octahedral map; bandwidth and weight as halves. Weights are relative
// to the strongest bin at their hit. A direction d is close to a lobe with axis a where 1 - dot(a, d) is
// below a multiple of the lobe's deviation (text after Eq. 10). Which lobes a cached direction is close
// to is kept as a mask of MASK_WORDS words, so that it is worked out once.

#ifndef PRODUCT_GLSL
#define PRODUCT_GLSL

#include "frame.glsl"
#include "layout.glsl"
#include "srbf.glsl"

layout(constant_id = CONSTANT_KEPT_LOBES) const uint KEPT_LOBES = 64u;
layout(constant_id = CONSTANT_THRESHOLD_SCALE) const float THRESHOLD_SCALE = 1.0;
layout(constant_id = CONSTANT_FIXED_THRESHOLD) const uint FIXED_THRESHOLD = 0u;
// Directions of a cache; 0 without one.
layout(constant_id = CONSTANT_CACHE_CAPACITY) const uint CACHE_CAPACITY = 0u;
layout(constant_id = CONSTANT_CACHE_OF_PIXEL) const uint CACHE_OF_PIXEL = 0u;
layout(constant_id = CONSTANT_COUNT_VISIBLE) const uint COUNT_VISIBLE = 0u;

// Bit of the head of a cache: it has grown since the weights were last added up. The other bits count
// what was recorded.
const uint CACHE_GROWN = 0x80000000u;
// Words of a mask over the lobes.
const uint MASK_WORDS = (KEPT_LOBES + 31u) / 32u;
// Deviation of a lobe of bandwidth 20, for the fixed threshold.
const float FIXED_DEVIATION = 0.0707;
// What lobes are drawn with lies between these, where halves can hold it and its forms are exact.
const float SMALLEST_BANDWIDTH = 0.05;
const float LARGEST_BANDWIDTH = 6e4;

struct ProductLobe {
    vec3 axis;
    float bandwidth;
    float weight;
};

uvec2 pack_lobe(ProductLobe lobe) {
    return uvec2(pack_normal(lobe.axis), packHalf2x16(vec2(lobe.bandwidth, lobe.weight)));
}

ProductLobe unpack_lobe(uvec2 words) {
    vec2 halves = unpackHalf2x16(words.y);
    return ProductLobe(unpack_normal(words.x), halves.x, halves.y);
}

// Whether the sum of the weights up to lobe `l` of `count` is kept.
bool is_sum_kept(uint l, uint count) {
    return (l + 1u) % LOBES_PER_SUM == 0u || l + 1u == count;
}

// Half the squared distance of a direction from the axis of a lobe: 1 - cos.
float distance_from_axis(vec3 axis, vec3 direction) {
    vec3 d = axis - direction;
    return 0.5 * dot(d, d);
}

// Whether a direction at a distance from the axis of a lobe is close to it; `tail` is
// exp(-2 bandwidth). The square of kernel_deviation without its quotients.
bool is_close(float bandwidth, float tail, float distance) {
    if (FIXED_THRESHOLD != 0u) {
        return distance < THRESHOLD_SCALE * FIXED_DEVIATION;
    }
    float scaled = distance * bandwidth;
    float moment = 2.0 - tail * (2.0 + bandwidth * (4.0 + 4.0 * bandwidth));
    return scaled * scaled * (1.0 - tail) < THRESHOLD_SCALE * THRESHOLD_SCALE * moment;
}

// Index of the head of a cache, before its directions.
uint cache_head(uint path, uint film_index) {
    return (CACHE_OF_PIXEL != 0u ? film_index : path) * (CACHE_CAPACITY + 1u);
}

// Index of a word of the mask of the recorded direction `entry` of a path. There is room for one more
// than a cache holds: for the direction under way, before it is known whether it is recorded.
uint close_lobes_index(uint path, uint path_count, uint entry, uint word) {
    return (entry % (CACHE_CAPACITY + 1u) * MASK_WORDS + word) * path_count + path;
}

// A direction in a cache; its last bit says whether it was visible.
uint pack_outcome(vec3 direction, bool is_visible) {
    return (pack_normal(direction) & ~1u) | (is_visible ? 1u : 0u);
}

#endif
