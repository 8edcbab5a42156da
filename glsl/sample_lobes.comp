// Chooses directions at every hit of the wave from the lobes of the product, with shares of the BRDF's
// and the environment's own sampling, and writes one shadow ray for each: Algorithm 5.1 of
// [Wu & Shih 2009]. The density is that of the whole mixture with the cumulative weights in force.
//
// Deviation: elevations by inversion of the closed form; the Metropolis walk of the thesis is an
// option, and biased.
#version 460

#define NEEDS_PARAMETERS
#define NEEDS_WAVE
#define NEEDS_RAY_TEXELS
#define NEEDS_HIT_TEXELS
#define NEEDS_SHADOW_RAYS
#define WRITES_SHADOW_RAYS
#define NEEDS_MATERIALS
#define NEEDS_ENVIRONMENT
#define NEEDS_LOBE_TEXELS
#define NEEDS_LOBE_COUNTS
#define NEEDS_CUMULATIVE_TEXELS
#include "vertex.glsl"
#include "product.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(constant_id = CONSTANT_SAMPLER) const uint SAMPLER = SAMPLER_PRODUCT;
layout(constant_id = CONSTANT_BRDF_SHARE) const float BRDF_SHARE = 0.25;
layout(constant_id = CONSTANT_ENVIRONMENT_SHARE) const float ENVIRONMENT_SHARE = 0.25;
layout(constant_id = CONSTANT_METROPOLIS) const uint METROPOLIS = 0u;
layout(constant_id = CONSTANT_CACHE_OF_PIXEL) const uint CACHE_OF_PIXEL = 0u;

const uint WALK_STEPS = 16u;

struct Numbers {
    // Shared by a block of pixels.
    float technique;
    vec2 direction;
    float lobe;
};

// Numbers of one ray. Where rays learn from the rays before them, each has dimensions of its own; where
// samples learn from samples, numbers without any relation.
Numbers draw_numbers(Vertex vertex, uint ray) {
    PathIndex index = vertex.index;
    Numbers numbers;
    if (SAMPLER == SAMPLER_VISIBILITY) {
        uint dimension =
            DIMENSION_ADAPTIVE + (wave.vertex * 4096u + ray) * DIMENSIONS_PER_ADAPTIVE_RAY;
        numbers.technique = unit_float(block_random_bits(
            index, dimension + laine_karras_permutation(index.sample_index, ray) * 64u).x);
        if (CACHE_OF_PIXEL != 0u) {
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
        // Techniques follow each other by the golden ratio from a random start.
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

// First lobe whose cumulative weight exceeds the target.
uint find_lobe(uint path, uint path_count, uint lobe_count, float target) {
    uint first = 0u;
    uint last = lobe_count - 1u;
    while (first < last) {
        uint middle = (first + last) >> 1u;
        if (texelFetch(cumulative_texels, int(middle * path_count + path)).x > target) {
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

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count) {
        return;
    }
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        return;
    }
    Vertex vertex = load_vertex(path, hit);
    uint lobe_count = lobe_counts[path];
    float total = lobe_count > 0u
        ? texelFetch(cumulative_texels, int((lobe_count - 1u) * path_count + path)).x
        : 0.0;
    // Without lobes or in the dark the BRDF's own sampling is left.
    float lobe_share = total > 0.0 ? 1.0 - BRDF_SHARE - ENVIRONMENT_SHARE : 0.0;
    float environment_share = parameters.environment_total > 0.0 ? ENVIRONMENT_SHARE : 0.0;
    float brdf_share =
        lobe_share + environment_share + BRDF_SHARE > 0.0 ? BRDF_SHARE : 1.0;
    float shares = lobe_share + environment_share + brdf_share;
    lobe_share /= shares;
    environment_share /= shares;
    brdf_share /= shares;

    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint ray = wave.first_shadow_ray + i;
        Numbers numbers = draw_numbers(vertex, ray);
        bool from_lobe = numbers.technique < lobe_share;
        bool from_environment = !from_lobe && numbers.technique < lobe_share + environment_share;
        vec3 direction = vertex.frame.normal;
        // Loops of one round instead of branches: devices that run both sides of a branch skip them.
        for (uint once = from_lobe ? 1u : 0u; once > 0u; --once) {
            uint l = find_lobe(path, path_count, lobe_count, numbers.lobe * total);
            ProductLobe lobe =
                unpack_lobe(texelFetch(lobe_texels, int(l * path_count + path)));
            direction = draw_from_lobe(vertex, ray, lobe, numbers.direction);
        }
        for (uint once = from_environment ? 1u : 0u; once > 0u; --once) {
            direction = environment_sample(numbers.direction).direction;
        }
        for (uint once = from_lobe || from_environment ? 0u : 1u; once > 0u; --once) {
            direction = to_world(
                vertex.frame,
                brdf_sample(
                    vertex.material, vertex.outgoing_local,
                    vec3(numbers.direction, numbers.lobe)));
        }
        float lobe_density = 0.0;
        float before = 0.0;
        for (uint l = 0u; l < lobe_count; ++l) {
            ProductLobe lobe =
                unpack_lobe(texelFetch(lobe_texels, int(l * path_count + path)));
            float up_to = texelFetch(cumulative_texels, int(l * path_count + path)).x;
            lobe_density += (up_to - before) * lobe.inverse_integral
                * kernel_value(lobe.axis, lobe.bandwidth, direction);
            before = up_to;
        }
        lobe_density = total > 0.0 ? lobe_density / total : 0.0;
        Considered considered = consider_world(vertex, direction);
        write_considered(
            i * path_count + path, considered,
            lobe_share * lobe_density + environment_share * considered.environment_pdf
                + brdf_share * considered.brdf_pdf);
    }
}
