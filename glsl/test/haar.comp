// Densities (solid angle) of a draw from the mixture of haar or of a given direction. For tests/haar.rs.
#version 460

#include "haar/mixture.glsl"
#include "test/answers.glsl"
#include "test/mixture_query.glsl"

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

HaarAnswer answer(MixtureQuery query) {
    Vertex vertex = load_vertex(query.path, load_hit(query.path));
    HaarMixture mixture = load_haar_mixture(query.path, wave_path_count());
    NodeSample drawn = NodeSample(
        query.direction,
        nodes_pdf(mixture.path, mixture.path_count, mixture.total, query.direction));
    if (query.draws != 0u) {
        drawn = haar_sample(vertex, mixture, numbers_of(query));
    }
    DirectionSample sampled = evaluate_world(vertex, drawn.direction);
    return HaarAnswer(
        drawn.direction, shares_pdf(mixture.shares, sampled, drawn.pdf), drawn.pdf,
        mixture.shares.product, mixture.shares.environment, sampled.environment_pdf,
        sampled.brdf_pdf, mixture.total, sampled.integrand);
}

ANSWER_QUERIES(MixtureQuery, HaarAnswer, answer)
