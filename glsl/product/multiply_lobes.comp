// Multiplies environment and BRDF at every hit: hits, SRBF tables -> strongest lobes and sums of
// their weights. [Tsai et al. 2008]; [Wu & Shih 2009], Eq. 8.
//
// Selects pairs stronger than about the n-th strongest. Guesses that threshold from every eighth
// pair and corrects it in rounds over all pairs, noting the stronger ones as bits. Strengths are
// logarithms; ordering by integral costs another one per pair.
//
// Deviation: by integral, a lobe's weight is its integral above the horizon [Tokuyoshi 2022], not over
// the sphere, since directions drawn below are lost. By coefficient it is that over the sphere.
#version 460

#include "load.glsl"
#include "product/lobes.glsl"
#include "visibility/cache.glsl"
#include "wave.glsl"

TEXELS(environment_lobes)
TEXELS(brdf_lobes)
TEXELS(material_lobes)
WRITES(lobes)
WRITES(lobe_counts)
WRITES(lobe_sums)
WRITES(visibility_cache)
UPDATES(counters)

layout(constant_id = CONSTANT_ENVIRONMENT_LOBES) const uint ENVIRONMENT_LOBES = 100u;
layout(constant_id = CONSTANT_BRDF_LOBES) const uint BRDF_LOBES = 20u;
layout(constant_id = CONSTANT_VIEWS) const uint VIEWS = 32u;
layout(constant_id = CONSTANT_ORDER_BY_COEFFICIENT) const uint ORDER_BY_COEFFICIENT = 0u;

layout(constant_id = CONSTANT_STRONGEST_ENVIRONMENT_LOBE)
    const float STRONGEST_ENVIRONMENT_LOBE = 0.0;

// Bins of strength in the guess, each a factor of two wide.
const uint BINS = 24u;
const float BINS_PER_E_FOLD = 1.0 / 0.69314718;
// One pair in this many enters the guess.
const uint GUESS_STRIDE = 8u;
// Surplus of pairs at which a round is near enough; pairs of the strongest environment lobes are kept.
const uint SLACK = (KEPT_LOBES + 1u) / 2u;
const uint ROUNDS = 8u;
// BRDF lobes held in registers at a time, and the number of such groups.
const uint GROUP = BRDF_LOBES < 20u ? BRDF_LOBES : 20u;
const uint GROUPS = (BRDF_LOBES + GROUP - 1u) / GROUP;
// An environment lobe is skipped if it stays below exp(-7) of its peak above the horizon.
const float BELOW_HORIZON = 7.0;
// Strength of a product of zero.
const float NO_STRENGTH = -1e30;

uint histogram[BINS];
vec4 brdf[GROUP];
// Bits of the BRDF lobes in a group whose product with an environment lobe is kept.
uint stronger[GROUPS * (ENVIRONMENT_LOBES > 0u ? ENVIRONMENT_LOBES : 1u)];
// BRDF lobe and environment lobe of each kept product, 16 bits each.
uint selected[KEPT_LOBES];

// Surface at a hit as the fits see it: views lie in the plane of +x.
struct View {
    vec3 tangent;
    vec3 bitangent;
    vec3 normal;
    uint first_lobe;
    uint lobe_count;
};

// Returns bandwidth * axis and ln(amplitude) - bandwidth of a BRDF lobe. To multiply lobes, add these.
vec4 brdf_exponents(View view, uint index) {
    vec4 local = texelFetch(brdf_lobes, int(view.first_lobe + index));
    vec3 axis = view.tangent * local.x + view.bitangent * local.y + view.normal * local.z;
    return vec4(axis, index < view.lobe_count ? local.w : NO_STRENGTH);
}

vec4 environment_exponents(uint index) {
    return texelFetch(environment_lobes, int(index));
}

// ln(x) to within 0.06: the bits of a float are a piecewise linear logarithm.
float coarse_logarithm(float x) {
    return 0.69314718 * (float(floatBitsToInt(x)) * 1.1920929e-7 - 126.957);
}

// Logarithm of sqrt(bandwidth^2 + 1/4).
float half_logarithm(float square) {
    return 0.5 * coarse_logarithm(square + 0.25);
}

// Strength of a product: logarithm of its coefficient, or of its integral over 2 pi. The integral
// is the coefficient times (1 - exp(-2 bandwidth)) / bandwidth, here 1 / sqrt(bandwidth^2 + 1/4).
float strength_of(vec4 environment, vec4 brdf) {
    vec3 sum = environment.xyz + brdf.xyz;
    float square = dot(sum, sum);
    float strength = environment.w + brdf.w + sqrt(square);
    if (ORDER_BY_COEFFICIENT == 0u) {
        strength -= half_logarithm(square);
    }
    return strength;
}

// erf to 2e-4. [Winitzki 2008, A handy approximation for the error function and its inverse].
float coarse_erf(float x) {
    float square = x * x;
    float exponent = -square * (1.2732395 + 0.147 * square) / (1.0 + 0.147 * square);
    return sign(x) * sqrt(1.0 - exp(exponent));
}

// Share of a kernel's integral above the horizon, with a coarse erf.
float part_above_horizon(float bandwidth, float cosine) {
    float steepness = kernel_steepness(bandwidth);
    float ratio = steepness < 1e-2
        ? cosine
        : coarse_erf(steepness * cosine) / coarse_erf(steepness);
    return kernel_part_of_ratio(bandwidth, ratio);
}

// Tests whether an environment lobe has a part above the horizon.
bool is_above_horizon(vec4 environment, vec3 normal) {
    float bandwidth = length(environment.xyz);
    float cosine = dot(environment.xyz, normal);
    float sine = sqrt(max(bandwidth * bandwidth - cosine * cosine, 0.0));
    return !(cosine < 0.0 && bandwidth - sine > BELOW_HORIZON);
}

void load_group(View view, uint group) {
    for (uint i = 0u; i < GROUP; ++i) {
        brdf[i] = brdf_exponents(view, group * GROUP + i);
    }
}

struct Guess {
    // Strength that about KEPT_LOBES pairs exceed.
    float threshold;
    // Largest strength among the pairs tested.
    float strongest;
    // Sum of the exponentials of all strengths, relative to the bound.
    float energy;
};

Guess guess(View view, float bound) {
    float strongest = NO_STRENGTH;
    for (uint i = 0u; i < BINS; ++i) {
        histogram[i] = 0u;
    }
    for (uint group = 0u; group < GROUPS; ++group) {
        if (GROUPS > 1u) {
            load_group(view, group);
        }
        for (uint stretch = 0u; stretch < ENVIRONMENT_LOBES; stretch += GUESS_STRIDE) {
            for (uint i = 0u; i < GROUP; ++i) {
                uint e = stretch + (5u * i + 3u * (stretch / GUESS_STRIDE)) % GUESS_STRIDE;
                vec4 environment = environment_exponents(min(e, ENVIRONMENT_LOBES - 1u));
                bool counts =
                    e < ENVIRONMENT_LOBES && is_above_horizon(environment, view.normal);
                float strength = counts ? strength_of(environment, brdf[i]) : NO_STRENGTH;
                strongest = max(strongest, strength);
                histogram[uint(clamp((bound - strength) * BINS_PER_E_FOLD, 0.0, float(BINS - 1u)))] += 1u;
            }
        }
    }
    // The last bin holds pairs too weak to tell apart, among them products of zero.
    float energy = 0.0;
    float wanted = float(KEPT_LOBES + SLACK / 2u) / float(GUESS_STRIDE);
    float bins = 0.0;
    for (uint i = 0u; i < BINS - 1u; ++i) {
        float here = float(histogram[i]);
        energy += here * exp2(-float(i) - 0.5);
        bins += here > wanted ? wanted / here : wanted > 0.0 ? 1.0 : 0.0;
        wanted = here > wanted ? 0.0 : wanted - here;
    }
    float threshold = bound - bins / BINS_PER_E_FOLD;
    return Guess(threshold, max(strongest, threshold), float(GUESS_STRIDE) * energy);
}

// Tests strength_of against a threshold, less the environment's part, without the root.
bool is_stronger(vec3 environment, vec4 brdf, float threshold) {
    vec3 sum = environment + brdf.xyz;
    float square = dot(sum, sum);
    float root = threshold - brdf.w;
    if (ORDER_BY_COEFFICIENT == 0u) {
        root += half_logarithm(square);
    }
    return square > root * abs(root);
}

uint note_stronger(View view, float threshold) {
    uint count = 0u;
    for (uint group = 0u; group < GROUPS; ++group) {
        if (GROUPS > 1u) {
            load_group(view, group);
        }
        for (uint e = 0u; e < ENVIRONMENT_LOBES; ++e) {
            vec4 environment = environment_exponents(e);
            uint bits = 0u;
            if (is_above_horizon(environment, view.normal)) {
                float left = threshold - environment.w;
                for (uint i = 0u; i < GROUP; ++i) {
                    bits |= is_stronger(environment.xyz, brdf[i], left) ? 1u << i : 0u;
                }
            }
            stronger[group * ENVIRONMENT_LOBES + e] = bits;
            count += bitCount(bits);
        }
    }
    return count;
}

void multiply_path(uint path) {
    uint path_count = wave_path_count();
    if (CACHE_CAPACITY > 0u && CACHE_OF_PIXEL == 0u) {
        visibility_cache[cache_head(path, 0u)] = 0u;
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
    if (material.y == 0u) {
        return;
    }
    view.lobe_count = min(material.y, BRDF_LOBES);
    view.first_lobe = material.x + nearest * material.y;

    // Bound the strength: strongest amplitude times largest integral or, by coefficient, amplitude.
    float strongest_brdf_lobe = NO_STRENGTH;
    for (uint i = 0u; i < view.lobe_count; ++i) {
        vec4 lobe = brdf_exponents(view, i);
        strongest_brdf_lobe = max(strongest_brdf_lobe, lobe.w + length(lobe.xyz));
    }
    float bound = strongest_brdf_lobe + STRONGEST_ENVIRONMENT_LOBE;
    if (GROUPS == 1u) {
        load_group(view, 0u);
    }

    // Correct the guess, assuming that the number of stronger pairs falls as fast as strength grows,
    // within the bounds that earlier rounds found. Pairs below the last bin count as nothing.
    Guess guessed = guess(view, bound);
    float threshold = guessed.threshold;
    float too_weak = bound - float(BINS) / BINS_PER_E_FOLD;
    float too_strong = bound + 1.0;
    uint pair_count = note_stronger(view, threshold);
    for (uint round = 1u; round < ROUNDS; ++round) {
        bool is_near = pair_count >= KEPT_LOBES && pair_count <= KEPT_LOBES + SLACK;
        bool is_all = pair_count < KEPT_LOBES && threshold <= too_weak;
        if (is_near || is_all) {
            break;
        }
        if (pair_count < KEPT_LOBES) {
            too_strong = threshold;
        } else {
            too_weak = threshold;
        }
        threshold += log(float(pair_count + 1u) / float(KEPT_LOBES + SLACK / 2u + 1u));
        bool is_between = threshold > too_weak && threshold < too_strong;
        threshold = is_between ? threshold : 0.5 * (too_weak + too_strong);
        // The last round takes a threshold known to be low enough.
        threshold = round + 1u < ROUNDS && too_strong - too_weak > 0.01 ? threshold : too_weak;
        pair_count = note_stronger(view, threshold);
    }

    uint count = 0u;
    for (uint group = 0u; group < GROUPS; ++group) {
        for (uint e = 0u; e < ENVIRONMENT_LOBES; ++e) {
            uint bits = stronger[group * ENVIRONMENT_LOBES + e];
            while (bits != 0u && count < KEPT_LOBES) {
                selected[count] = (group * GROUP + uint(findLSB(bits))) << 16u | e;
                bits &= bits - 1u;
                count += 1u;
            }
        }
    }

    // Scale weights by the strongest lobe, so that halves can hold them: that of the guess or, where that
    // is not the one of the largest integral, that of the kept ones.
    float strongest = guessed.strongest;
    if (ORDER_BY_COEFFICIENT != 0u) {
        strongest = NO_STRENGTH;
        for (uint l = 0u; l < count; ++l) {
            vec4 product = environment_exponents(selected[l] & 0xffffu)
                + brdf_exponents(view, selected[l] >> 16u);
            float square = dot(product.xyz, product.xyz);
            strongest = max(strongest, product.w + sqrt(square) - half_logarithm(square));
        }
    }
    float sum = 0.0;
    float kept = 0.0;
    for (uint l = 0u; l < count; ++l) {
        vec4 product = environment_exponents(selected[l] & 0xffffu)
            + brdf_exponents(view, selected[l] >> 16u);
        float bandwidth = length(product.xyz);
        vec3 axis = bandwidth > 1e-20 ? product.xyz / bandwidth : view.normal;
        float drawn_bandwidth = clamp(bandwidth, SMALLEST_BANDWIDTH, LARGEST_BANDWIDTH);
        float coefficient = exp(product.w + bandwidth - strongest);
        float weight = coefficient * ((1.0 - exp(-2.0 * drawn_bandwidth)) / drawn_bandwidth);
        kept += ORDER_BY_COEFFICIENT == 0u ? weight : coefficient;
        if (ORDER_BY_COEFFICIENT == 0u) {
            weight *= part_above_horizon(drawn_bandwidth, dot(axis, view.normal));
        }
        uvec2 words = pack_lobe(ProductLobe(axis, drawn_bandwidth, min(weight, 6e4)));
        sum += unpackHalf2x16(words.y).y;
        lobes[l * path_count + path] = words;
        if (is_sum_kept(l, count)) {
            lobe_sums[l / LOBES_PER_SUM * path_count + path] = sum;
        }
    }
    kept *= exp(strongest - bound);
    lobe_counts[path] = count;
    if (count > 0u) {
        atomicAdd(counters.product_hits, 1u);
        atomicAdd(counters.lobes_kept, count);
        atomicAdd(counters.energy_kept, uint(256.0 * min(kept / max(guessed.energy, 1e-30), 1.0)));
    }
}

RUN_PATHS(multiply_path)
