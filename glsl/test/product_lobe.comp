// Reads back the lobes of paths and their current weights. For tests/product.rs.
#version 460

#include "layout.glsl"

READS(visibility_cache)
READS(close_lobes)

#include "visibility/weights.glsl"

struct LobeAnswer {
    vec3 axis;
    float bandwidth;
    float weight;
    // Weight lowered by what the cache knows.
    float weight_in_force;
    uint lobe_count;
    // Sum over all lobes of the path.
    float total;
};

layout(scalar, set = SET_PROBE, binding = 32) readonly buffer Queries {
    uvec2 queries[];
};
layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer Answers {
    LobeAnswer answers[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= queries.length()) {
        return;
    }
    uvec2 query = queries[index];
    Lobes lobes = load_lobes(query.x, wave.pixel_count * wave.sample_count, 0u);
    ProductLobe lobe = unpack_lobe(lobe_words(lobes, query.y));
    load_weights(lobes);
    float visibility = visibility_weight(counts_of(lobes, query.y / 4u), query.y % 4u);
    answers[index] = LobeAnswer(
        lobe.axis, lobe.bandwidth, lobe.weight, lobe.weight * visibility, lobes.count,
        weight_total(lobes));
}
