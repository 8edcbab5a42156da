// The product of environment and BRDF at every hit: hits, SRBF tables -> the strongest lobes and their
// cumulative weights. [Tsai et al. 2008]; [Wu & Shih 2009], Eq. 8.
//
// Pairs are counted by strength first, which gives the strength above which as many as are wanted are
// left; those are noted, and worked out in full at last. Strengths are logarithms, so that a pair
// costs a square root and a logarithm. Environment lobes below the horizon are skipped: a loop of no
// rounds, since devices that run both sides of a branch end loops early.
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

layout(constant_id = CONSTANT_STRONGEST_ENVIRONMENT_LOBE)
    const float STRONGEST_ENVIRONMENT_LOBE = 0.0;

// Bins of strength, each a factor of the square root of two wide.
const uint BINS = 64u;
const float BINS_PER_E_FOLD = 2.0 / 0.69314718;
// BRDF lobes that are held in registers at a time.
const uint GROUP = 4u;
// An environment lobe whose value is everywhere above the horizon below exp(-7) of its top is skipped.
const float BELOW_HORIZON = 7.0;
// Deviation of a lobe of bandwidth 20, for the fixed threshold.
const float FIXED_DEVIATION = 0.0707;
// Strength of what is nothing.
const float NO_STRENGTH = -1e30;

uint histogram[BINS];
// BRDF lobe and environment lobe, 16 bits each.
uint selected[KEPT_LOBES];

// The surface at a hit as the fits see it: their views lie in the plane of +x.
struct View {
    vec3 tangent;
    vec3 bitangent;
    vec3 normal;
    // First lobe of the view, and how many it has.
    uint first_lobe;
    uint lobe_count;
};

Lobe environment_lobe(uint index) {
    vec4 first = texelFetch(environment_lobes, int(2u * index));
    vec4 second = texelFetch(environment_lobes, int(2u * index + 1u));
    return Lobe(first.xyz, length(second.xyz), first.w);
}

Lobe brdf_lobe(View view, uint index) {
    vec4 shape = texelFetch(brdf_lobes, int(2u * (view.first_lobe + index)));
    float amplitude = texelFetch(brdf_lobes, int(2u * (view.first_lobe + index) + 1u)).x;
    vec3 axis = view.tangent * shape.x + view.bitangent * shape.y + view.normal * shape.z;
    return Lobe(axis, shape.w, amplitude);
}

// bandwidth * axis and ln(amplitude) - bandwidth: what a product's strength is made of.
vec4 exponents(View view, uint index) {
    vec4 result = vec4(0.0, 0.0, 0.0, NO_STRENGTH);
    if (index < view.lobe_count) {
        Lobe lobe = brdf_lobe(view, index);
        result = vec4(
            lobe.bandwidth * lobe.axis,
            lobe.amplitude > 0.0 ? log(lobe.amplitude) - lobe.bandwidth : NO_STRENGTH);
    }
    return result;
}

// Bin of a product: of its coefficient, or of its integral over 2 pi, which is the coefficient times
// (1 - exp(-2 bandwidth)) / bandwidth, here 1 / (bandwidth + 1/2). 0 is next to the bound.
uint bin_of(vec4 environment, vec4 brdf, float bound) {
    float bandwidth = length(environment.xyz + brdf.xyz);
    float strength = environment.w + brdf.w + bandwidth;
    if (ORDER_BY_COEFFICIENT == 0u) {
        strength -= log(bandwidth + 0.5);
    }
    return uint(clamp((bound - strength) * BINS_PER_E_FOLD, 0.0, float(BINS - 1u)));
}

// 1 for an environment lobe with a part above the horizon, else 0.
uint is_above_horizon(vec4 environment, vec3 normal) {
    float bandwidth = length(environment.xyz);
    float cosine = dot(environment.xyz, normal);
    float sine = sqrt(max(bandwidth * bandwidth - cosine * cosine, 0.0));
    return cosine < 0.0 && bandwidth - sine > BELOW_HORIZON ? 0u : 1u;
}

void count_bin(uint bin) {
    histogram[bin] += 1u;
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

    View view;
    view.normal = hit.shading_normal;
    vec3 outgoing = -load_ray(path).direction;
    float cosine = dot(outgoing, view.normal);
    vec3 in_plane = outgoing - cosine * view.normal;
    float sine = length(in_plane);
    view.tangent = sine > 1e-4 ? in_plane / sine : frame_from_normal(view.normal).tangent;
    view.bitangent = cross(view.normal, view.tangent);
    float theta = atan(sine, max(cosine, 0.0));
    uint nearest = min(uint(theta * (2.0 / PI) * float(VIEWS)), VIEWS - 1u);
    uvec2 material = texelFetch(material_lobes, int(hit.material)).xy;
    view.lobe_count = min(material.y, BRDF_LOBES);
    view.first_lobe = material.x + nearest * material.y;

    // No product is stronger than the strongest amplitude times the largest integral, or, for
    // coefficients, than the product of the amplitudes.
    float strongest = 0.0;
    for (uint i = 0u; i < view.lobe_count; ++i) {
        strongest = max(
            strongest, texelFetch(brdf_lobes, int(2u * (view.first_lobe + i) + 1u)).x);
    }
    float bound = log(max(strongest, 1e-30)) + STRONGEST_ENVIRONMENT_LOBE;

    for (uint i = 0u; i < BINS; ++i) {
        histogram[i] = 0u;
    }
    for (uint first = 0u; first < view.lobe_count; first += GROUP) {
        vec4 brdf_0 = exponents(view, first);
        vec4 brdf_1 = exponents(view, first + 1u);
        vec4 brdf_2 = exponents(view, first + 2u);
        vec4 brdf_3 = exponents(view, first + 3u);
        for (uint e = 0u; e < ENVIRONMENT_LOBES; ++e) {
            vec4 environment = texelFetch(environment_lobes, int(2u * e + 1u));
            for (uint once = is_above_horizon(environment, view.normal); once > 0u; --once) {
                count_bin(bin_of(environment, brdf_0, bound));
                count_bin(bin_of(environment, brdf_1, bound));
                count_bin(bin_of(environment, brdf_2, bound));
                count_bin(bin_of(environment, brdf_3, bound));
            }
        }
    }

    // The bin in which the wanted number is reached, and how many of it are wanted. The last bin holds
    // what is too weak to tell apart, products of zero among it.
    uint last_bin = 0u;
    uint left = KEPT_LOBES;
    uint first_bin = BINS - 1u;
    float energy = 0.0;
    float kept = 0.0;
    bool is_full = false;
    for (uint i = 0u; i < BINS - 1u; ++i) {
        uint here = histogram[i];
        float strength = exp2(-0.5 * float(i));
        first_bin = here > 0u ? min(first_bin, i) : first_bin;
        energy += float(here) * strength;
        if (!is_full) {
            last_bin = i;
            is_full = here > left;
            kept += float(min(here, left)) * strength;
            left -= is_full ? 0u : here;
        }
    }

    uint count = 0u;
    for (uint first = 0u; first < view.lobe_count; first += GROUP) {
        vec4 brdf_0 = exponents(view, first);
        vec4 brdf_1 = exponents(view, first + 1u);
        vec4 brdf_2 = exponents(view, first + 2u);
        vec4 brdf_3 = exponents(view, first + 3u);
        for (uint e = 0u; e < ENVIRONMENT_LOBES; ++e) {
            vec4 environment = texelFetch(environment_lobes, int(2u * e + 1u));
            uvec4 bins = uvec4(BINS);
            for (uint once = is_above_horizon(environment, view.normal); once > 0u; --once) {
                bins = uvec4(
                    bin_of(environment, brdf_0, bound), bin_of(environment, brdf_1, bound),
                    bin_of(environment, brdf_2, bound), bin_of(environment, brdf_3, bound));
            }
            bool any_kept = any(lessThanEqual(bins, uvec4(last_bin)));
            for (uint i = 0u; i < (any_kept ? GROUP : 0u); ++i) {
                uint bin = bins[i];
                bool is_last = is_full && bin == last_bin;
                if (bin <= last_bin && (!is_last || left > 0u) && count < KEPT_LOBES) {
                    selected[count] = (first + i) << 16u | e;
                    count += 1u;
                    left -= is_last ? 1u : 0u;
                }
            }
        }
    }

    // Weights are relative to the strongest bin that is not empty, so that halves can hold them.
    float to_weight =
        exp(-bound + 0.34657359 * float(first_bin)) * (0.5 / SRBF_PI);
    float sum = 0.0;
    for (uint l = 0u; l < count; ++l) {
        Lobe product = lobe_product(
            environment_lobe(selected[l] & 0xffffu), brdf_lobe(view, selected[l] >> 16u));
        float integral = kernel_integral(product.bandwidth);
        float above = ORDER_BY_COEFFICIENT != 0u
            ? 1.0
            : kernel_hemisphere_part(product.bandwidth, dot(product.axis, view.normal));
        float deviation =
            FIXED_THRESHOLD != 0u ? FIXED_DEVIATION : kernel_deviation(product.bandwidth);
        ProductLobe lobe = ProductLobe(
            product.axis, product.bandwidth,
            min(product.amplitude * integral * above * to_weight, 6e4),
            THRESHOLD_SCALE * deviation, 1.0 / integral);
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
