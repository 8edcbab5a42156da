// Product lobes at one hit. [Wu & Shih 2009], section 4. Integrals over solid angle.
//
// A lobe is two words: axis in the octahedral map; bandwidth and weight as halves. Weights are
// relative to the strongest lobe of the guess at the hit.

#include "frame.glsl"
#include "layout.glsl"
#include "srbf.glsl"

layout(constant_id = CONSTANT_KEPT_LOBES) const uint KEPT_LOBES = 64u;

// Range of bandwidths for drawing, where halves can hold them and the closed forms are exact.
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

// Returns true if the sum of the weights up to lobe `l` of `count` is stored.
bool is_sum_kept(uint l, uint count) {
    return (l + 1u) % LOBES_PER_SUM == 0u || l + 1u == count;
}
