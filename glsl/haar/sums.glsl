// Nodes as halves, and sums of their weights, level by level, as nodes are gone through in Morton order.

#include "haar/tree.glsl"

WRITES(haar_sums)

// Smallest half that all devices hold alike.
const float SMALLEST_HALF = 6.2e-5;

// Four nodes as halves.
uvec2 pack_quad(vec4 quad) {
    vec4 held = mix(quad, vec4(0.0), lessThan(quad, vec4(SMALLEST_HALF)));
    return uvec2(packHalf2x16(held.xy), packHalf2x16(held.zw));
}

vec4 unpack_quad(uvec2 halves) {
    return vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
}

// Unfinished sums of each level.
vec4 pending[LEVEL - 2u];

// Adds the sum of the weights of the sixteen nodes of a group; groups come in their order.
void add_group(uint path, uint path_count, uint group, float sum) {
    uint node = group;
    for (uint up = 3u; up <= LEVEL; ++up) {
        uint level = LEVEL - up;
        pending[level][node & 3u] = sum;
        if ((node & 3u) != 3u) {
            break;
        }
        node >>= 2u;
        haar_sums[(first_of_level(level) + node) * path_count + path] = pending[level];
        sum = sum_of_four(pending[level]);
    }
}
