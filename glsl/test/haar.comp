// Densities (solid angle) of a draw from the mixture of haar or of a given direction. For tests/haar.rs.
#version 460

#include "haar/mixture.glsl"
#include "test/answers.glsl"

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

HaarAnswer answer(HaarQuery query) {
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
    return HaarAnswer(
        drawn.direction, shares_pdf(mixture.shares, sampled, drawn.pdf), drawn.pdf,
        mixture.shares.product, mixture.shares.environment, sampled.environment_pdf,
        sampled.brdf_pdf, mixture.total, sampled.integrand);
}

ANSWER_QUERIES(HaarQuery, HaarAnswer, answer)
