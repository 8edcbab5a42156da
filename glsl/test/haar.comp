// Densities (solid angle) of a draw from the mixture of haar or of a given direction. For tests/haar.rs.
#version 460

#include "haar/mixture.glsl"

struct HaarQuery {
    uint path;
    // 1 draws a direction from the numbers, 0 takes the given one.
    uint draws;
    vec3 direction;
    float technique;
    vec2 direction_numbers;
    float lobe;
};

struct HaarAnswer {
    vec3 direction;
    float pdf;
    float node_pdf;
    float node_share;
    float environment_share;
    float environment_pdf;
    float brdf_pdf;
    float total;
    vec3 integrand;
};

layout(scalar, set = SET_PROBE, binding = 32) readonly buffer Queries {
    HaarQuery queries[];
};
layout(scalar, set = SET_PROBE, binding = 33) writeonly buffer Answers {
    HaarAnswer answers[];
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= queries.length()) {
        return;
    }
    HaarQuery query = queries[index];
    Vertex vertex = load_vertex(query.path, load_hit(query.path));
    HaarMixture mixture = load_haar_mixture(query.path, wave_path_count());
    NodeSample drawn = NodeSample(
        query.direction,
        nodes_pdf(mixture.path, mixture.path_count, mixture.total, query.direction));
    if (query.draws != 0u) {
        MixtureNumbers numbers =
            MixtureNumbers(query.technique, query.direction_numbers, query.lobe);
        drawn = haar_sample(vertex, mixture, numbers);
    }
    DirectionSample sampled = evaluate_world(vertex, drawn.direction);
    answers[index] = HaarAnswer(
        drawn.direction, shares_pdf(mixture.shares, sampled, drawn.pdf), drawn.pdf, mixture.shares.product,
        mixture.shares.environment, sampled.environment_pdf, sampled.brdf_pdf, mixture.total,
        sampled.integrand);
}
