// Visibility caches: directions that turned out blocked, and which lobes they are close to.
// [Wu & Shih 2009], section 4.2.
//
// A direction d is close to a lobe with axis a where 1 - dot(a, d) is below a multiple of the lobe's
// deviation (text after Eq. 10). A mask of MASK_WORDS words keeps the lobes that a cached direction is
// close to, so that they are found once.

#ifndef CACHE_GLSL
#define CACHE_GLSL

#include "product/lobes.glsl"

layout(constant_id = CONSTANT_THRESHOLD_SCALE) const float THRESHOLD_SCALE = 1.0;
layout(constant_id = CONSTANT_FIXED_THRESHOLD) const uint FIXED_THRESHOLD = 0u;
// Directions of a cache; 0 without one.
layout(constant_id = CONSTANT_CACHE_CAPACITY) const uint CACHE_CAPACITY = 0u;
layout(constant_id = CONSTANT_CACHE_OF_PIXEL) const uint CACHE_OF_PIXEL = 0u;

// Bit of the head of a cache: it has grown since the weights were last added up. The other bits count
// the recorded directions.
const uint CACHE_GROWN = 0x80000000u;
// Words of a mask over the lobes.
const uint MASK_WORDS = (KEPT_LOBES + 31u) / 32u;
// Deviation of a lobe of bandwidth 20, for the fixed threshold.
const float FIXED_DEVIATION = 0.0707;

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

#endif
