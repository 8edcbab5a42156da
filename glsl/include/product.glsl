// Lobes of the product of environment and BRDF at one hit, as passes hand them on, and the caches of
// directions whose visibility is known. Includes srbf.glsl; [Wu & Shih 2009], section 4.
//
// A lobe is four words: axis in the octahedral map; bandwidth; weight and closeness as halves; one
// over the integral of its kernel. Weights are relative to the strongest bin at their hit. A direction
// d is close to a lobe with axis a where 1 - dot(a, d) is below the closeness (text after Eq. 10).

#ifndef PRODUCT_GLSL
#define PRODUCT_GLSL

#include "frame.glsl"
#include "layout.glsl"
#include "srbf.glsl"

// Bit of the head of a cache: it has grown since the cumulative weights were built. The other bits
// count what was recorded.
const uint CACHE_GROWN = 0x80000000u;

struct ProductLobe {
    vec3 axis;
    float bandwidth;
    float weight;
    float closeness;
    float inverse_integral;
};

uvec4 pack_lobe(ProductLobe lobe) {
    return uvec4(
        pack_normal(lobe.axis), floatBitsToUint(lobe.bandwidth),
        packHalf2x16(vec2(lobe.weight, lobe.closeness)), floatBitsToUint(lobe.inverse_integral));
}

ProductLobe unpack_lobe(uvec4 words) {
    vec2 halves = unpackHalf2x16(words.z);
    return ProductLobe(
        unpack_normal(words.x), uintBitsToFloat(words.y), halves.x, halves.y,
        uintBitsToFloat(words.w));
}

// Whether a direction is close to a lobe.
bool is_close(ProductLobe lobe, vec3 direction) {
    vec3 d = lobe.axis - direction;
    return 0.5 * dot(d, d) < lobe.closeness;
}

// A direction in a cache; its last bit says whether it was visible.
uint pack_outcome(vec3 direction, bool is_visible) {
    return (pack_normal(direction) & ~1u) | (is_visible ? 1u : 0u);
}

#endif
