// Visibility caches: blocked directions, and the lobes close to them. [Wu & Shih 2009], section 4.2.
//
// A direction d is close to a lobe with axis a if 1 - dot(a, d) is below a multiple of the lobe's
// deviation (text after Eq. 10). Masks of MASK_WORDS words store the lobes close to each direction.

#include "product/lobes.glsl"

layout(constant_id = CONSTANT_THRESHOLD_SCALE) const float THRESHOLD_SCALE = 1.0;
layout(constant_id = CONSTANT_FIXED_THRESHOLD) const uint FIXED_THRESHOLD = 0u;
// Directions of a cache; 0 without one.
layout(constant_id = CONSTANT_CACHE_CAPACITY) const uint CACHE_CAPACITY = 0u;
layout(constant_id = CONSTANT_CACHE_OF_PIXEL) const uint CACHE_OF_PIXEL = 0u;

// Head bit of a cache that holds the last ray of its hit, which no weights know. The other bits count
// directions.
const uint CACHE_GROWN = 0x80000000u;
const uint MASK_WORDS = (KEPT_LOBES + 31u) / 32u;
// Deviation of a lobe of bandwidth 20, for the fixed threshold.
const float FIXED_DEVIATION = 0.0707;

// Returns 1 - cos of the angle to the axis: half the squared distance.
float distance_from_axis(vec3 axis, vec3 direction) {
    vec3 d = axis - direction;
    return 0.5 * dot(d, d);
}

// Tests whether a direction is close to a lobe, by squares; `tail` is exp(-2 bandwidth).
bool is_close(float bandwidth, float tail, float distance) {
    if (FIXED_THRESHOLD != 0u) {
        return distance < THRESHOLD_SCALE * FIXED_DEVIATION;
    }
    float scaled = distance * bandwidth;
    float moment = 2.0 - tail * (2.0 + bandwidth * (4.0 + 4.0 * bandwidth));
    return scaled * scaled * (1.0 - tail) < THRESHOLD_SCALE * THRESHOLD_SCALE * moment;
}

// Returns the index of the head of a cache; its directions follow.
uint cache_head(uint path, uint film_index) {
    return (CACHE_OF_PIXEL != 0u ? film_index : path) * (CACHE_CAPACITY + 1u);
}

// Returns the index of a mask word of the direction `entry` of a path. There is room for one more
// than a cache holds: the last ray of a hit, and those that the weights know.
uint close_lobes_index(uint path, uint path_count, uint entry, uint word) {
    return (entry % (CACHE_CAPACITY + 1u) * MASK_WORDS + word) * path_count + path;
}
