// Reads the lobes of paths and their cumulative weights back. For tests/product.rs.
#version 460

#define NEEDS_WAVE
#define NEEDS_LOBE_TEXELS
#define NEEDS_LOBE_COUNTS
#define NEEDS_CUMULATIVE_TEXELS
#include "product.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

struct LobeAnswer {
    vec3 axis;
    float bandwidth;
    float weight;
    float closeness;
    float inverse_integral;
    float cumulative;
    uint lobe_count;
};

layout(scalar, set = SET_FILM, binding = 0) readonly buffer Queries {
    // Path and lobe.
    uvec2 queries[];
};
layout(scalar, set = SET_FILM, binding = 1) writeonly buffer Answers {
    LobeAnswer answers[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= queries.length()) {
        return;
    }
    uvec2 query = queries[index];
    int texel = int(query.y * wave.pixel_count * wave.sample_count + query.x);
    ProductLobe lobe = unpack_lobe(texelFetch(lobe_texels, texel));
    answers[index] = LobeAnswer(
        lobe.axis, lobe.bandwidth, lobe.weight, lobe.closeness, lobe.inverse_integral,
        texelFetch(cumulative_texels, texel).x, lobe_counts[query.x]);
}
