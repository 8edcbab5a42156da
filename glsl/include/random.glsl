// Counter-based random numbers for (pixel, sample, dimension, seed): twins
// crates/scene/src/math/random.rs and tests/twin/random.rs, equal bit for bit. All numbers are multiples of
// 2^-24 in [0, 1).
//
// A dimension names a pair of numbers. random_2d is stratified over the samples of a pixel: use it
// where nothing depends on earlier samples. random_independent_2d is not: use it where past
// outcomes enter.

#include "divide.glsl"

// PCG4D. [Jarzynski & Olano 2020].
uvec4 hash_4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Laine-Karras permutation: flips every bit depending on the key and the bits below it, which is
// Owen scrambling of a bit-reversed number. [Laine & Karras 2011]; constants of [Vegdahl 2021].
uint laine_karras_permutation(uint x, uint key) {
    x ^= x * 0x3d20adeau;
    x += key;
    x *= (key >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// Bit-reversed second coordinate of the Sobol sequence. The direction numbers of x + 1 form
// Pascal's triangle modulo 2, which factors into one step per bit of the bit index.
uint reversed_sobol_1(uint index) {
    index ^= (index >> 1u) & 0x55555555u;
    index ^= (index >> 2u) & 0x33333333u;
    index ^= (index >> 4u) & 0x0f0f0f0fu;
    index ^= (index >> 8u) & 0x00ff00ffu;
    index ^= index >> 16u;
    return index;
}

// Converts an integer to a multiple of 2^-24 in [0, 1).
float unit_float(uint bits) {
    return float(bits >> 8u) * (1.0 / 16777216.0);
}

// bits * count / 2^32: an index below `count`.
uint scaled(uint bits, uint count) {
    uint high;
    uint low;
    umulExtended(bits, count, high, low);
    return high;
}

// Whole part of the width of one of `strata` equal parts of the range of bits; at most 2^16 of them.
uint stratum_width(uint strata) {
    return 0xffffffffu / strata;
}

// Moves uniform bits into one of the parts, which are `width` wide: 2^32 (stratum + u) / strata for
// u = bits / 2^32, to two units. Without divisions, which software devices do lane by lane.
uint stratified(uint bits, uint stratum, uint strata, uint width) {
    float rest = float(0u - width * strata) / float(strata);
    return stratum * width + uint(whole(float(stratum) * rest)) + scaled(bits, width);
}

const uint RANDOM_KEY_TAG = 0x9e3779b9u;

// Keys of a pixel and dimension: of the shuffled index and of the two coordinates.
uvec4 random_keys(uint pixel, uint dimension, uint seed) {
    return hash_4d(uvec4(pixel, RANDOM_KEY_TAG, dimension, seed));
}

// Sample `sample_index` of a shuffled, Owen-scrambled Sobol (0,2)-sequence for this pixel and
// dimension alone, in 2^-32. [Burley 2020].
uvec2 random_bits_2d(uint pixel, uint sample_index, uint dimension, uint seed) {
    uvec4 keys = random_keys(pixel, dimension, seed);
    uint shuffled =
        bitfieldReverse(laine_karras_permutation(bitfieldReverse(sample_index), keys.x));
    return uvec2(
        bitfieldReverse(laine_karras_permutation(shuffled, keys.y)),
        bitfieldReverse(laine_karras_permutation(reversed_sobol_1(shuffled), keys.z)));
}

// random_bits_2d as numbers in [0, 1).
vec2 random_2d(uint pixel, uint sample_index, uint dimension, uint seed) {
    uvec2 bits = random_bits_2d(pixel, sample_index, dimension, seed);
    return vec2(unit_float(bits.x), unit_float(bits.y));
}

// First coordinate of random_2d.
float random_1d(uint pixel, uint sample_index, uint dimension, uint seed) {
    return random_2d(pixel, sample_index, dimension, seed).x;
}

// Numbers unrelated between samples, pixels and dimensions.
vec2 random_independent_2d(uint pixel, uint sample_index, uint dimension, uint seed) {
    uvec4 bits = hash_4d(uvec4(pixel, sample_index, dimension, seed));
    return vec2(unit_float(bits.x), unit_float(bits.y));
}

// First coordinate of random_independent_2d.
float random_independent_1d(uint pixel, uint sample_index, uint dimension, uint seed) {
    return random_independent_2d(pixel, sample_index, dimension, seed).x;
}
