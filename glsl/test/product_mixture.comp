// Densities (solid angle) of a draw from the mixture or a given direction. For tests/product.rs.
#version 460

#include "test/answers.glsl"

READS(visibility_cache)
READS(close_lobes)

#include "product/mixture.glsl"
#include "test/mixture_query.glsl"

struct MixtureAnswer {
    vec3 direction;
    float pdf;
    float lobe_density;
    // Density of the lobes weighted by the product alone.
    float unguided_lobe_density;
    float environment_pdf;
    float brdf_pdf;
    float lobe_share;
    float environment_share;
    float brdf_share;
    vec3 integrand;
};

MixtureAnswer answer(MixtureQuery query) {
    Vertex vertex = load_vertex(query.path, load_hit(query.path));
    Mixture mixture = load_mixture(query.path, wave_path_count(), 0u);
    vec3 direction = query.direction;
    if (query.draws != 0u) {
        direction = mixture_sample(vertex, mixture, 0u, numbers_of(query));
    }
    float sum = 0.0;
    float unguided = 0.0;
    for (uint l = 0u; l < mixture.lobes.count; ++l) {
        ProductLobe lobe = unpack_lobe(lobe_words(mixture.lobes, l));
        sum += lobe.weight;
        unguided += lobe.weight / kernel_integral(lobe.bandwidth)
            * kernel_value(lobe.axis, lobe.bandwidth, direction);
    }
    DirectionSample sampled = evaluate_world(vertex, direction);
    MixtureAnswer result;
    result.direction = direction;
    result.lobe_density = mixture_lobe_density(mixture, direction);
    result.pdf = mixture_pdf(mixture, sampled, result.lobe_density);
    result.unguided_lobe_density = sum > 0.0 ? unguided / sum : 0.0;
    result.environment_pdf = sampled.environment_pdf;
    result.brdf_pdf = sampled.brdf_pdf;
    result.lobe_share = mixture.shares.product;
    result.environment_share = mixture.shares.environment;
    result.brdf_share = mixture.shares.brdf;
    result.integrand = sampled.integrand;
    return result;
}

ANSWER_QUERIES(MixtureQuery, MixtureAnswer, answer)
