// Techniques of samplers that draw from a product, environment and BRDF: their shares, random numbers and
// directions. Densities in solid angle measure.

#include "vertex.glsl"

layout(constant_id = CONSTANT_BRDF_SHARE) const float BRDF_SHARE = 0.25;
layout(constant_id = CONSTANT_ENVIRONMENT_SHARE) const float ENVIRONMENT_SHARE = 0.25;

// Probabilities of the three techniques.
struct Shares {
    float product;
    float environment;
    float brdf;
};

// Shares where the weights of the product add up to `total`. The BRDF is the fallback without them or in the
// dark.
Shares shares_at(float total) {
    float product = total > 0.0 ? 1.0 - BRDF_SHARE - ENVIRONMENT_SHARE : 0.0;
    float environment = parameters.environment_total > 0.0 ? ENVIRONMENT_SHARE : 0.0;
    float brdf = product + environment + BRDF_SHARE > 0.0 ? BRDF_SHARE : 1.0;
    float sum = product + environment + brdf;
    return Shares(product / sum, environment / sum, brdf / sum);
}

// Density of all techniques where that of the product is `product_pdf`.
float shares_pdf(Shares shares, DirectionSample sampled, float product_pdf) {
    return shares.product * product_pdf + shares.environment * sampled.environment_pdf
        + shares.brdf * sampled.brdf_pdf;
}

// Random numbers for one direction, each in [0, 1).
struct MixtureNumbers {
    float technique;
    vec2 direction;
    float lobe;
};

// Draws the numbers of one ray; pixels of a block share the technique. Rays that learn from earlier
// rays have dimensions of their own; samples that learn from samples have independent numbers.
MixtureNumbers draw_numbers(
    Vertex vertex, uint ray, bool learns_from_rays, bool learns_from_samples) {
    PathIndex index = vertex.index;
    MixtureNumbers numbers;
    if (learns_from_rays) {
        uint dimension =
            DIMENSION_ADAPTIVE + (wave.vertex * 4096u + ray) * DIMENSIONS_PER_ADAPTIVE_RAY;
        numbers.technique = unit_float(block_random_bits(
            index, dimension + laine_karras_permutation(index.sample_index, ray) * 64u).x);
        if (learns_from_samples) {
            numbers.direction =
                random_independent_2d(index.pixel, index.sample_index, dimension + 1u, wave.seed);
            numbers.lobe =
                random_independent_1d(index.pixel, index.sample_index, dimension + 2u, wave.seed);
        } else {
            numbers.direction =
                random_2d(index.pixel, index.sample_index, dimension + 1u, wave.seed);
            numbers.lobe = random_1d(index.pixel, index.sample_index, dimension + 2u, wave.seed);
        }
    } else {
        // Step through the techniques by the golden ratio from a random start.
        uint number = index.sample_index * wave.total_shadow_rays + ray;
        uint turn = block_random_bits(index, DIMENSION_TECHNIQUE).x + number * 0x9e3779b9u;
        numbers.technique = unit_float(turn);
        numbers.direction = random_2d(
            index.pixel, number, vertex.dimension + DIMENSION_BRDF_DIRECTION, wave.seed);
        numbers.lobe =
            random_1d(index.pixel, number, vertex.dimension + DIMENSION_BRDF_LOBE, wave.seed);
    }
    return numbers;
}

// Tests whether a direction is from the product.
bool is_from_product(Shares shares, MixtureNumbers numbers) {
    return numbers.technique < shares.product;
}

// Samples the world direction of a ray from environment or BRDF; the normal if it is from the product.
vec3 draw_beside_product(Vertex vertex, Shares shares, MixtureNumbers numbers) {
    bool from_product = is_from_product(shares, numbers);
    bool from_environment =
        !from_product && numbers.technique < shares.product + shares.environment;
    vec3 direction = vertex.frame.normal;
    if (from_environment) {
        direction = environment_sample(numbers.direction).direction;
    }
    if (!from_product && !from_environment) {
        direction = to_world(
            vertex.frame, brdf_sample(vertex.reflector, vec3(numbers.direction, numbers.lobe)));
    }
    return direction;
}
