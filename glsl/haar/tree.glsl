// Quadtree over the equal-area square: means of the environment's luminance, and hierarchical warping.
// [Clarberg et al. 2005], section 5; [Clarberg & Akenine-Möller 2008]. Twin of tests/twin/haar.rs.
//
// Nodes of a level are numbered in Morton order. A texel of a node holds the means of its four
// children, which is the same information as its mean and its three Haar coefficients.

#include "equal_area.glsl"
#include "layout.glsl"

TEXELS(haar_tree)

// Level of the product's nodes, 2^level along each side.
layout(constant_id = CONSTANT_HAAR_LEVEL) const uint LEVEL = 3u;
// Level of the environment's texels.
layout(constant_id = CONSTANT_HAAR_DEPTH) const uint DEPTH = 8u;

// Number of the first node of a level, all levels in one row.
uint first_of_level(uint level) {
    return ((1u << 2u * level) - 1u) / 3u;
}

// Means of the children of a node.
vec4 tree_children(uint level, uint node) {
    return texelFetch(haar_tree, int(first_of_level(level) + node));
}

float sum_of_four(vec4 values) {
    return values.x + values.y + values.z + values.w;
}

// Moves bit i of a 16-bit number to bit 2 i.
uint spread_bits(uint x) {
    x = (x | x << 8u) & 0x00ff00ffu;
    x = (x | x << 4u) & 0x0f0f0f0fu;
    x = (x | x << 2u) & 0x33333333u;
    return (x | x << 1u) & 0x55555555u;
}

uint gather_bits(uint x) {
    x &= 0x55555555u;
    x = (x | x >> 1u) & 0x33333333u;
    x = (x | x >> 2u) & 0x0f0f0f0fu;
    x = (x | x >> 4u) & 0x00ff00ffu;
    return (x | x >> 8u) & 0x0000ffffu;
}

// Number of the environment's texel in a direction.
uint texel_of(vec3 direction) {
    float side = float(1u << DEPTH);
    uvec2 place = uvec2(min(square_from_direction(direction) * side, vec2(side - 1.0)));
    return spread_bits(place.x) | spread_bits(place.y) << 1u;
}

// Direction to a place within a texel, u in [0, 1)^2.
vec3 direction_in_texel(uint texel, vec2 u) {
    vec2 place = vec2(uvec2(gather_bits(texel), gather_bits(texel >> 1u)));
    return direction_from_square((place + u) / float(1u << DEPTH));
}

// Chooses one of two in proportion to their weights, and rescales u for the next choice.
bool warp_axis(float first, float second, inout float u) {
    float sum = first + second;
    float share = sum > 0.0 ? first / sum : 0.5;
    bool is_second = u >= share;
    u = is_second ? (u - share) / (1.0 - share) : u / share;
    u = min(u, 0.99999994);
    return is_second;
}

// Chooses a child in proportion to its weight: the column, then its row.
uint warp(vec4 weights, inout vec2 u) {
    bool is_right = warp_axis(weights.x + weights.z, weights.y + weights.w, u.x);
    vec2 column = is_right ? weights.yw : weights.xz;
    bool is_below = warp_axis(column.x, column.y, u.y);
    return (is_right ? 1u : 0u) | (is_below ? 2u : 0u);
}

// Chooses a texel within a node of the product in proportion to its light, which it returns.
float warp_below(inout uint node, inout vec2 u) {
    float light = 0.0;
    for (uint level = LEVEL; level < DEPTH; ++level) {
        vec4 children = tree_children(level, node);
        uint child = warp(children, u);
        light = children[child];
        node = 4u * node + child;
    }
    return light;
}
