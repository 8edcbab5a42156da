// Reads back the lobes of paths and their current weights. For tests/product.rs.
#version 460

#include "test/answers.glsl"

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

LobeAnswer answer(uvec2 query) {
    Lobes lobes = load_lobes(query.x, wave_path_count(), 0u);
    ProductLobe lobe = unpack_lobe(lobe_words(lobes, query.y));
    load_weights(lobes);
    float visibility = visibility_weight(counts_of(lobes, query.y / 4u), query.y % 4u);
    return LobeAnswer(
        lobe.axis, lobe.bandwidth, lobe.weight, lobe.weight * visibility, lobes.count,
        weight_total(lobes));
}

ANSWER_QUERIES(uvec2, LobeAnswer, answer)
