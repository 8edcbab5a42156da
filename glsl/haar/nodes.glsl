// Product of environment and BRDF at one hit, constant over each of 4^LEVEL nodes of the sphere but for
// the environment's own detail below. [Clarberg & Akenine-Möller 2008]. Densities in solid angle
// measure. Twin of tests/twin/haar.rs.
//
// A direction in node m has the density r(m) L / Z: L is the luminance of the environment's texel there,
// r(m) the mean of BRDF * cosine over the node, lowered by what the cache knows, and Z the sum of the
// nodes' weights r(m) L(m) times their solid angle, L(m) the mean of L. Nodes hold r as halves, and these
// halves are both drawn with and divided by.

#include "haar/tree.glsl"

TEXELS(haar_node_texels)
TEXELS(haar_sum_texels)

const uint QUADS = 1u << 2u * (LEVEL - 1u);

struct NodeSample {
    vec3 direction;
    // Density of the nodes alone.
    float pdf;
};

// r of the four nodes of a quad.
vec4 load_quad(uint path, uint path_count, uint quad) {
    return texelFetch(haar_node_texels, int(quad * path_count + path));
}

// Sums of the weights of the nodes below each child.
vec4 load_sums(uint path, uint path_count, uint level, uint node) {
    return texelFetch(haar_sum_texels, int((first_of_level(level) + node) * path_count + path));
}

// Sum of the weights of all nodes.
float nodes_total(uint path, uint path_count) {
    return sum_of_four(load_sums(path, path_count, 0u, 0u));
}

// Density where the texel's light is `light` and its node has `reflectance`.
float density_of(float reflectance, float light, float total) {
    return total > 0.0 ? reflectance * light / total * (float(4u * QUADS) / (4.0 * PI)) : 0.0;
}

// Density of a direction.
float nodes_pdf(uint path, uint path_count, float total, vec3 direction) {
    uint texel = texel_of(direction);
    float light = tree_children(DEPTH - 1u, texel >> 2u)[texel & 3u];
    uint node = texel >> 2u * (DEPTH - LEVEL);
    return density_of(load_quad(path, path_count, node >> 2u)[node & 3u], light, total);
}

// Samples a direction by the sums of the coarse nodes, the weights of the fine ones, and the light below;
// u in [0, 1)^2, and a total above 0.
NodeSample nodes_sample(uint path, uint path_count, float total, vec2 u) {
    uint node = 0u;
    for (uint level = 0u; level < LEVEL - 2u; ++level) {
        node = 4u * node + warp(load_sums(path, path_count, level, node), u);
    }
    vec4 sums;
    for (uint i = 0u; i < 4u; ++i) {
        uint quad = 4u * node + i;
        sums[i] = sum_of_four(
            load_quad(path, path_count, quad) * tree_children(LEVEL - 1u, quad));
    }
    uint quad = 4u * node + warp(sums, u);
    vec4 reflectances = load_quad(path, path_count, quad);
    uint child = warp(reflectances * tree_children(LEVEL - 1u, quad), u);
    node = 4u * quad + child;
    float light = warp_below(node, u);
    return NodeSample(
        direction_in_texel(node, u), density_of(reflectances[child], light, total));
}
