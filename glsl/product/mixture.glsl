// Mixture that `product` and `visibility` draw from at one vertex: lobes by their current weights,
// environment and BRDF. [Wu & Shih 2009], algorithm 5.1. Densities in solid angle measure. Entry
// points declare visibility_cache and close_lobes.
//
// Deviation: elevations by inversion; the thesis's Metropolis walk is optional, and biased.

#include "product/techniques.glsl"
#include "vertex.glsl"
#include "visibility/weights.glsl"

layout(constant_id = CONSTANT_METROPOLIS) const uint METROPOLIS = 0u;

const uint WALK_STEPS = 16u;

struct Mixture {
    Lobes lobes;
    float total;
    Shares shares;
};

// Sets the probabilities of the techniques by the weights in force.
void set_shares(inout Mixture mixture) {
    mixture.total = weight_total(mixture.lobes);
    mixture.shares = shares_at(mixture.total);
}

// Loads the mixture at a path; `film_index` matters only for caches of pixels.
Mixture load_mixture(uint path, uint path_count, uint film_index) {
    Mixture mixture;
    mixture.lobes = load_lobes(path, path_count, film_index);
    load_weights(mixture.lobes);
    set_shares(mixture);
    return mixture;
}

// Samples 1 - cos of the elevation by a random walk, as in the thesis; biased because it is short.
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
    Frame frame = frame_from_normal(lobe.axis);
    return (1.0 - x) * lobe.axis + azimuth.y * frame.tangent + azimuth.x * frame.bitangent;
}

// Samples the world direction of one ray. Directions below the horizon contribute nothing.
vec3 mixture_sample(Vertex vertex, Mixture mixture, uint ray, MixtureNumbers numbers) {
    vec3 direction = draw_beside_product(vertex, mixture.shares, numbers);
    if (is_from_product(mixture.shares, numbers)) {
        uint l = find_lobe(mixture.lobes, numbers.lobe * mixture.total);
        ProductLobe lobe = unpack_lobe(lobe_words(mixture.lobes, l));
        direction = draw_from_lobe(vertex, ray, lobe, numbers.direction);
    }
    return direction;
}

// Returns the density of the lobes with their current weights; 0 without lobes. With a cache, finds
// the lobes close to the direction, and sums the weights that they have if it is recorded.
float mixture_lobe_density(Mixture mixture, vec3 direction) {
    Lobes lobes = mixture.lobes;
    float density = 0.0;
    float sum = 0.0;
    for (uint word = 0u; 32u * word < lobes.count; ++word) {
        uint forgotten = CACHE_CAPACITY > 0u ? forgotten_mask(lobes, word) : 0u;
        uint mask = 0u;
        uint quads_end = min((lobes.count + 3u) / 4u, 8u * word + 8u);
        for (uint quad = 8u * word; quad < quads_end; ++quad) {
            uint counts = counts_of(lobes, quad);
            uint next = counts - bytes_of_bits(forgotten >> (4u * (quad % 8u)));
            // Always four, so that compilers unroll the loop.
            for (uint i = 0u; i < 4u; ++i) {
                uint l = 4u * quad + i;
                ProductLobe lobe = unpack_lobe(lobe_words(lobes, min(l, lobes.count - 1u)));
                float distance = distance_from_axis(lobe.axis, direction);
                float tail = exp(-2.0 * lobe.bandwidth);
                lobe.weight = l < lobes.count ? lobe.weight : 0.0;
                density += lobe.weight * visibility_weight(counts, i) * lobe.bandwidth
                    / (1.0 - tail) * exp(-lobe.bandwidth * distance);
                if (CACHE_CAPACITY > 0u) {
                    uint close = is_close(lobe.bandwidth, tail, distance) ? 1u : 0u;
                    mask |= close << (4u * (quad % 8u) + i);
                    next += close << (8u * i);
                    sum += lobe.weight * visibility_weight(next, i);
                }
            }
            if (CACHE_CAPACITY > 0u) {
                close_counts[QUADS - lobes.counts + quad] = next;
                sums_under_way[quad / QUADS_PER_SUM] = sum;
            }
        }
        if (CACHE_CAPACITY > 0u) {
            masks_under_way[word] = mask;
        }
    }
    return mixture.total > 0.0 ? density / (2.0 * PI * mixture.total) : 0.0;
}

// Returns the density of the whole mixture where that of the lobes is `lobe_density`.
float mixture_pdf(Mixture mixture, DirectionSample sampled, float lobe_density) {
    return shares_pdf(mixture.shares, sampled, lobe_density);
}

// Draws one ray; its contribution is integrand / pdf, without occlusion.
ShadowRay mixture_ray(Vertex vertex, Mixture mixture, uint ray, MixtureNumbers numbers) {
    vec3 direction = mixture_sample(vertex, mixture, ray, numbers);
    float lobe_density = mixture_lobe_density(mixture, direction);
    DirectionSample sampled = evaluate_world(vertex, direction);
    float pdf = mixture_pdf(mixture, sampled, lobe_density);
    return ShadowRay(direction, pdf > 0.0 ? sampled.integrand / pdf : vec3(0.0));
}
