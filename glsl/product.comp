// The product of environment and BRDF at every hit: hits, SRBF tables -> the strongest lobes and their
// cumulative weights. [Tsai et al. 2008]; [Wu & Shih 2009], Eq. 8.
//
// Lobes are counted by strength first, which gives the strength above which as many as are wanted are
// left; those are noted, and worked out in full at last. Environment lobes below the horizon are
// skipped: a loop whose bound is zero, since devices that run both sides of a branch end loops early.
//
// Deviation: the weight of a lobe is the part of its integral above the horizon [Tokuyoshi], not the
// whole integral, since what is drawn below the horizon is lost.
#version 460

#define NEEDS_WAVE
#define NEEDS_RAY_TEXELS
#define NEEDS_HIT_TEXELS
#define NEEDS_FITS
#define NEEDS_LOBES
#define WRITES_LOBES
#define NEEDS_LOBE_COUNTS
#define WRITES_LOBE_COUNTS
#define NEEDS_CUMULATIVE
#define WRITES_CUMULATIVE
#define NEEDS_CACHE
#define WRITES_CACHE
#define NEEDS_COUNTERS
#include "product.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(constant_id = CONSTANT_ENVIRONMENT_LOBES) const uint ENVIRONMENT_LOBES = 100u;
layout(constant_id = CONSTANT_BRDF_LOBES) const uint BRDF_LOBES = 20u;
layout(constant_id = CONSTANT_VIEWS) const uint VIEWS = 32u;
layout(constant_id = CONSTANT_KEPT_LOBES) const uint KEPT_LOBES = 64u;
layout(constant_id = CONSTANT_ORDER_BY_COEFFICIENT) const uint ORDER_BY_COEFFICIENT = 0u;
layout(constant_id = CONSTANT_THRESHOLD_SCALE) const float THRESHOLD_SCALE = 1.0;
layout(constant_id = CONSTANT_FIXED_THRESHOLD) const uint FIXED_THRESHOLD = 0u;
layout(constant_id = CONSTANT_CACHE_CAPACITY) const uint CACHE_CAPACITY = 0u;
layout(constant_id = CONSTANT_CACHE_OF_PIXEL) const uint CACHE_OF_PIXEL = 0u;

// Bins of strength, each a factor of the square root of two wide.
const uint BINS = 64u;
// An environment lobe whose value is everywhere above the horizon below exp(-7) of its top is skipped.
const float BELOW_HORIZON = 7.0;
// Deviation of a lobe of bandwidth 20, for the fixed threshold.
const float FIXED_DEVIATION = 0.0707;

// BRDF lobes of the hit in the world: axis and bandwidth, amplitude.
vec4 brdf_shape[BRDF_LOBES];
float brdf_amplitude[BRDF_LOBES];
uint histogram[BINS];
// BRDF lobe and environment lobe, 16 bits each.
uint selected[KEPT_LOBES];

// Strength of a product: its integral over 2 pi, or its coefficient.
float strength(vec4 environment, float environment_amplitude, uint index) {
    vec4 shape = brdf_shape[index];
    vec3 d = environment.xyz - shape.xyz;
    float distance_squared = dot(d, d);
    float sum = environment.w + shape.w;
    float product = environment.w * shape.w;
    float bandwidth = sqrt(max(sum * sum - product * distance_squared, 0.0));
    float exponent = -product * distance_squared / (sum + bandwidth);
    float coefficient = environment_amplitude * brdf_amplitude[index] * exp(exponent);
    if (ORDER_BY_COEFFICIENT != 0u) {
        return coefficient;
    }
    return coefficient * (1.0 - exp(-2.0 * bandwidth)) / max(bandwidth, 1e-3);
}

// Bin of a strength relative to a bound: 0 next to the bound.
uint bin_of(float relative) {
    uint bits = floatBitsToUint(min(relative, 1.0));
    return min((0x3f800000u - bits) >> 22u, BINS - 1u);
}

// Brdf lobes to look at for an environment lobe: none where it lies below the horizon.
uint partners(vec4 environment, vec3 normal, uint brdf_count) {
    float cosine = dot(environment.xyz, normal);
    float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    return cosine < 0.0 && environment.w * (1.0 - sine) > BELOW_HORIZON ? 0u : brdf_count;
}

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave.pixel_count * wave.sample_count;
    if (path >= path_count) {
        return;
    }
    if (CACHE_CAPACITY > 0u && CACHE_OF_PIXEL == 0u) {
        visibility_cache[path * (CACHE_CAPACITY + 1u)] = 0u;
    }
    lobe_counts[path] = 0u;
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL || ENVIRONMENT_LOBES == 0u) {
        return;
    }

    // BRDF lobes are fitted for views in the plane of +x.
    vec3 normal = hit.shading_normal;
    vec3 outgoing = -load_ray(path).direction;
    float cosine = dot(outgoing, normal);
    vec3 in_plane = outgoing - cosine * normal;
    float sine = length(in_plane);
    vec3 tangent = sine > 1e-4 ? in_plane / sine : frame_from_normal(normal).tangent;
    vec3 bitangent = cross(normal, tangent);
    float theta = atan(sine, max(cosine, 0.0));
    uint view = min(uint(theta * (2.0 / PI) * float(VIEWS)), VIEWS - 1u);
    uvec2 material = texelFetch(material_lobes, int(hit.material)).xy;
    uint brdf_count = min(material.y, BRDF_LOBES);
    uint first_lobe = material.x + view * material.y;
    float strongest = 0.0;
    for (uint i = 0u; i < brdf_count; ++i) {
        vec4 shape = texelFetch(brdf_lobes, int(2u * (first_lobe + i)));
        float amplitude = texelFetch(brdf_lobes, int(2u * (first_lobe + i) + 1u)).x;
        brdf_shape[i] =
            vec4(tangent * shape.x + bitangent * shape.y + normal * shape.z, shape.w);
        brdf_amplitude[i] = amplitude;
        strongest = max(strongest, amplitude);
    }
    // No product is stronger than the strongest amplitude times the largest integral, or, for
    // coefficients, than the product of the amplitudes.
    float largest = 0.0;
    for (uint e = 0u; e < ENVIRONMENT_LOBES; ++e) {
        float amplitude = texelFetch(environment_lobes, int(2u * e + 1u)).w;
        float bandwidth = texelFetch(environment_lobes, int(2u * e)).w;
        largest = max(
            largest, ORDER_BY_COEFFICIENT != 0u
                ? amplitude
                : amplitude * (1.0 - exp(-2.0 * bandwidth)) / max(bandwidth, 1e-3));
    }
    float bound = strongest * largest;
    float to_relative = bound > 0.0 ? 1.0 / bound : 0.0;

    for (uint i = 0u; i < BINS; ++i) {
        histogram[i] = 0u;
    }
    float energy = 0.0;
    for (uint e = 0u; e < ENVIRONMENT_LOBES; ++e) {
        vec4 environment = texelFetch(environment_lobes, int(2u * e));
        float amplitude = texelFetch(environment_lobes, int(2u * e + 1u)).w;
        uint count = partners(environment, normal, brdf_count);
        for (uint i = 0u; i < count; ++i) {
            float value = strength(environment, amplitude, i) * to_relative;
            energy += value;
            histogram[bin_of(value)] += 1u;
        }
    }

    // The bin in which the wanted number is reached, and how many of it are wanted.
    uint last_bin = 0u;
    uint left = KEPT_LOBES;
    for (uint i = 0u; i < BINS - 1u && histogram[i] <= left; ++i) {
        left -= histogram[i];
        last_bin = i + 1u;
    }
    // Weights are relative to the strongest bin that is not empty, so that halves can hold them.
    uint first_bin = 0u;
    while (first_bin < BINS - 1u && histogram[first_bin] == 0u) {
        first_bin += 1u;
    }
    float to_weight = to_relative * exp2(0.5 * float(first_bin)) * (0.5 / SRBF_PI);
    // The last bin holds what is too weak to tell apart, products of zero among it.
    left = last_bin == BINS - 1u ? 0u : left;

    uint count = 0u;
    for (uint e = 0u; e < ENVIRONMENT_LOBES && count < KEPT_LOBES; ++e) {
        vec4 environment = texelFetch(environment_lobes, int(2u * e));
        float amplitude = texelFetch(environment_lobes, int(2u * e + 1u)).w;
        uint partner_count = partners(environment, normal, brdf_count);
        for (uint i = 0u; i < partner_count; ++i) {
            uint bin = bin_of(strength(environment, amplitude, i) * to_relative);
            bool is_last = bin == last_bin && left > 0u;
            if ((bin < last_bin || is_last) && count < KEPT_LOBES) {
                selected[count] = i << 16u | e;
                count += 1u;
                left -= is_last ? 1u : 0u;
            }
        }
    }

    float sum = 0.0;
    float kept = 0.0;
    for (uint l = 0u; l < count; ++l) {
        uint index = selected[l] >> 16u;
        uint e = selected[l] & 0xffffu;
        vec4 environment = texelFetch(environment_lobes, int(2u * e));
        float amplitude = texelFetch(environment_lobes, int(2u * e + 1u)).w;
        kept += strength(environment, amplitude, index) * to_relative;
        Lobe product = lobe_product(
            Lobe(environment.xyz, environment.w, amplitude),
            Lobe(brdf_shape[index].xyz, brdf_shape[index].w, brdf_amplitude[index]));
        float integral = kernel_integral(product.bandwidth);
        float above = ORDER_BY_COEFFICIENT != 0u
            ? 1.0
            : kernel_hemisphere_part(product.bandwidth, dot(product.axis, normal));
        float weight = product.amplitude * integral * above * to_weight;
        float deviation =
            FIXED_THRESHOLD != 0u ? FIXED_DEVIATION : kernel_deviation(product.bandwidth);
        ProductLobe lobe = ProductLobe(
            product.axis, product.bandwidth, weight, THRESHOLD_SCALE * deviation, 1.0 / integral);
        uvec4 words = pack_lobe(lobe);
        sum += unpackHalf2x16(words.z).x;
        lobes[l * path_count + path] = words;
        cumulative[l * path_count + path] = sum;
    }
    lobe_counts[path] = count;
    if (count > 0u) {
        atomicAdd(counters.product_hits, 1u);
        atomicAdd(counters.lobes_kept, count);
        atomicAdd(counters.energy_kept, uint(256.0 * min(kept / max(energy, 1e-30), 1.0)));
    }
}
