// The mixture that `product` and `visibility` draw directions from at one vertex: the lobes of the
// product by their cumulative weights, the environment's own sampling and the BRDF's. Algorithm 5.1 of
// [Wu & Shih 2009]. All densities per steradian. Needs what vertex.glsl needs, NEEDS_LOBE_TEXELS and
// NEEDS_CUMULATIVE_TEXELS.
//
// Deviation: elevations by inversion of the closed form; the Metropolis walk of the thesis is an
// option, and biased.

#ifndef MIXTURE_GLSL
#define MIXTURE_GLSL

#include "vertex.glsl"
#include "product.glsl"

layout(constant_id = CONSTANT_BRDF_SHARE) const float BRDF_SHARE = 0.25;
layout(constant_id = CONSTANT_ENVIRONMENT_SHARE) const float ENVIRONMENT_SHARE = 0.25;
layout(constant_id = CONSTANT_METROPOLIS) const uint METROPOLIS = 0u;

const uint WALK_STEPS = 16u;

// The weights in force at one vertex.
struct Mixture {
    uint path;
    // Lobe `l` of a path is at `l * path_count + path`.
    uint path_count;
    uint lobe_count;
    // Sum of the weights of the lobes.
    float total;
    // Probabilities of the three techniques.
    float lobe_share;
    float environment_share;
    float brdf_share;
};

// What one direction is drawn with, each in [0, 1).
struct MixtureNumbers {
    float technique;
    vec2 direction;
    float lobe;
};

float cumulative_weight(Mixture mixture, uint l) {
    return texelFetch(cumulative_texels, int(l * mixture.path_count + mixture.path)).x;
}

ProductLobe mixture_lobe(Mixture mixture, uint l) {
    return unpack_lobe(texelFetch(lobe_texels, int(l * mixture.path_count + mixture.path)));
}

// The mixture at a path with `lobe_count` lobes.
Mixture load_mixture(uint path, uint path_count, uint lobe_count) {
    Mixture mixture = Mixture(path, path_count, lobe_count, 0.0, 0.0, 0.0, 0.0);
    mixture.total = lobe_count > 0u ? cumulative_weight(mixture, lobe_count - 1u) : 0.0;
    // Without lobes or in the dark the BRDF's own sampling is left.
    float lobe_share = mixture.total > 0.0 ? 1.0 - BRDF_SHARE - ENVIRONMENT_SHARE : 0.0;
    float environment_share = parameters.environment_total > 0.0 ? ENVIRONMENT_SHARE : 0.0;
    float brdf_share = lobe_share + environment_share + BRDF_SHARE > 0.0 ? BRDF_SHARE : 1.0;
    float shares = lobe_share + environment_share + brdf_share;
    mixture.lobe_share = lobe_share / shares;
    mixture.environment_share = environment_share / shares;
    mixture.brdf_share = brdf_share / shares;
    return mixture;
}

// First lobe whose cumulative weight exceeds the target.
uint find_lobe(Mixture mixture, float target) {
    uint first = 0u;
    uint last = mixture.lobe_count - 1u;
    while (first < last) {
        uint middle = (first + last) >> 1u;
        if (cumulative_weight(mixture, middle) > target) {
            last = middle;
        } else {
            first = middle + 1u;
        }
    }
    return first;
}

// 1 - cos of the elevation by a random walk, as in the thesis; biased, since the walk is short.
float walk(Vertex vertex, uint ray, float bandwidth) {
    float x = min(1.0 / max(bandwidth, 1e-3), 1.0);
    float stride = min(3.0 / max(bandwidth, 1e-3), 2.0);
    uint dimension = DIMENSION_WALK + (wave.vertex * 4096u + ray) * WALK_STEPS;
    for (uint step = 0u; step < WALK_STEPS; ++step) {
        vec2 u = random_independent_2d(
            vertex.index.pixel, vertex.index.sample_index, dimension + step, wave.seed);
        float proposed = abs(x + stride * (2.0 * u.x - 1.0));
        proposed = proposed > 2.0 ? 4.0 - proposed : proposed;
        x = u.y < exp(bandwidth * (x - proposed)) ? proposed : x;
    }
    return clamp(x, 0.0, 2.0);
}

vec3 draw_from_lobe(Vertex vertex, uint ray, ProductLobe lobe, vec2 u) {
    if (METROPOLIS == 0u) {
        return kernel_sample(lobe.axis, lobe.bandwidth, u);
    }
    float x = walk(vertex, ray, lobe.bandwidth);
    vec2 azimuth = sin_cos_pi(2.0 * u.y) * sqrt(x * (2.0 - x));
    vec3 tangent;
    vec3 bitangent;
    lobe_frame(lobe.axis, tangent, bitangent);
    return (1.0 - x) * lobe.axis + azimuth.y * tangent + azimuth.x * bitangent;
}

// Direction of one ray of the vertex, in the world. Directions below the horizon bring nothing.
vec3 mixture_sample(Vertex vertex, Mixture mixture, uint ray, MixtureNumbers numbers) {
    bool from_lobe = numbers.technique < mixture.lobe_share;
    bool from_environment =
        !from_lobe && numbers.technique < mixture.lobe_share + mixture.environment_share;
    vec3 direction = vertex.frame.normal;
    // Loops of one round instead of branches: devices that run both sides of a branch skip them.
    for (uint once = from_lobe ? 1u : 0u; once > 0u; --once) {
        uint l = find_lobe(mixture, numbers.lobe * mixture.total);
        direction = draw_from_lobe(vertex, ray, mixture_lobe(mixture, l), numbers.direction);
    }
    for (uint once = from_environment ? 1u : 0u; once > 0u; --once) {
        direction = environment_sample(numbers.direction).direction;
    }
    for (uint once = from_lobe || from_environment ? 0u : 1u; once > 0u; --once) {
        direction = to_world(
            vertex.frame,
            brdf_sample(
                vertex.material, vertex.outgoing_local, vec3(numbers.direction, numbers.lobe)));
    }
    return direction;
}

// Density of the lobes alone, with the cumulative weights in force; 0 without lobes.
float mixture_lobe_density(Mixture mixture, vec3 direction) {
    float density = 0.0;
    float before = 0.0;
    for (uint l = 0u; l < mixture.lobe_count; ++l) {
        ProductLobe lobe = mixture_lobe(mixture, l);
        float up_to = cumulative_weight(mixture, l);
        density += (up_to - before) * lobe.inverse_integral
            * kernel_value(lobe.axis, lobe.bandwidth, direction);
        before = up_to;
    }
    return mixture.total > 0.0 ? density / mixture.total : 0.0;
}

// Density of the whole mixture at a direction for which the lobes alone have `lobe_density`.
float mixture_pdf(Mixture mixture, Considered considered, float lobe_density) {
    return mixture.lobe_share * lobe_density
        + mixture.environment_share * considered.environment_pdf
        + mixture.brdf_share * considered.brdf_pdf;
}

#endif
