// Mixture that `haar` draws from at one vertex: nodes of the product, environment and BRDF. Densities in
// solid angle measure.
//
// Deviation: shares of environment and BRDF, as in `product`. The paper draws from the product alone, which
// needs a BRDF that its samples do not miss.

#include "haar/nodes.glsl"
#include "product/techniques.glsl"

struct HaarMixture {
    uint path;
    uint path_count;
    // Sum of the weights of the nodes.
    float total;
    Shares shares;
};

HaarMixture load_haar_mixture(uint path, uint path_count) {
    float total = nodes_total(path, path_count);
    return HaarMixture(path, path_count, total, shares_at(total));
}

// Samples the world direction of one ray, with the density of the nodes there.
NodeSample haar_sample(Vertex vertex, HaarMixture mixture, MixtureNumbers numbers) {
    NodeSample drawn =
        NodeSample(draw_beside_product(vertex, mixture.shares, numbers), 0.0);
    bool from_nodes = is_from_product(mixture.shares, numbers);
    if (from_nodes) {
        drawn = nodes_sample(
            mixture.path, mixture.path_count, mixture.total, numbers.direction);
    }
    if (!from_nodes) {
        drawn.pdf =
            nodes_pdf(mixture.path, mixture.path_count, mixture.total, drawn.direction);
    }
    return drawn;
}
