// Mixture that `haar` draws from at one vertex: nodes of the product, environment and BRDF. Densities in
// solid angle measure.
//
// Deviation: shares of environment and BRDF, as in `product`. The paper draws from the product alone, which
// needs a BRDF that its samples do not miss.

#include "haar/nodes.glsl"
#include "once.glsl"
#include "product/numbers.glsl"
#include "vertex.glsl"

layout(constant_id = CONSTANT_BRDF_SHARE) const float BRDF_SHARE = 0.25;
layout(constant_id = CONSTANT_ENVIRONMENT_SHARE) const float ENVIRONMENT_SHARE = 0.25;

struct HaarMixture {
    uint path;
    uint path_count;
    // Sum of the weights of the nodes.
    float total;
    // Probabilities of the three techniques.
    float node_share;
    float environment_share;
    float brdf_share;
};

HaarMixture load_haar_mixture(uint path, uint path_count) {
    float total = nodes_total(path, path_count);
    // Fall back on the BRDF where nothing is reflected, and in the dark.
    float node_share = total > 0.0 ? 1.0 - BRDF_SHARE - ENVIRONMENT_SHARE : 0.0;
    float environment_share = parameters.environment_total > 0.0 ? ENVIRONMENT_SHARE : 0.0;
    float shares = node_share + environment_share + BRDF_SHARE;
    return HaarMixture(
        path, path_count, total, node_share / shares, environment_share / shares,
        BRDF_SHARE / shares);
}

// Samples the world direction of one ray, with the density of the nodes there.
NodeSample haar_sample(Vertex vertex, HaarMixture mixture, MixtureNumbers numbers) {
    bool from_nodes = numbers.technique < mixture.node_share;
    bool from_environment =
        !from_nodes && numbers.technique < mixture.node_share + mixture.environment_share;
    NodeSample drawn = NodeSample(vertex.frame.normal, 0.0);
    ONCE_IF(from_nodes) {
        drawn = nodes_sample(
            mixture.path, mixture.path_count, mixture.total, numbers.direction);
    }
    ONCE_IF(from_environment) {
        drawn.direction = environment_sample(numbers.direction).direction;
    }
    ONCE_IF(!from_nodes && !from_environment) {
        drawn.direction = to_world(
            vertex.frame,
            brdf_sample(
                vertex.material, vertex.outgoing_local, vec3(numbers.direction, numbers.lobe)));
    }
    ONCE_IF(!from_nodes) {
        drawn.pdf =
            nodes_pdf(mixture.path, mixture.path_count, mixture.total, drawn.direction);
    }
    return drawn;
}

// Density of the whole mixture where that of the nodes is `node_pdf`.
float haar_pdf(HaarMixture mixture, DirectionSample sampled, float node_pdf) {
    return mixture.node_share * node_pdf + mixture.environment_share * sampled.environment_pdf
        + mixture.brdf_share * sampled.brdf_pdf;
}
