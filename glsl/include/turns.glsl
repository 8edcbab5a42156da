// Turns of BRDF and light among the shadow rays of a group.

#include "wave.glsl"

struct Turns {
    // Bit of each ray of the group that is from the BRDF.
    uint from_brdf;
    // Index of the first ray of either technique in its own sequence.
    uint brdf_index;
    uint light_index;
};

// Turns of the rays of a group from `first_ray` on. They alternate by the share of the BRDF, in 256ths,
// from `start` below 256: if that is random, a ray is from the BRDF with exactly this probability, and
// neither sequence has gaps.
Turns turns_from(uint first_ray, uint share, uint start) {
    uint before = (first_ray * share + start) >> 8u;
    uint from_brdf = 0u;
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint sum = ((first_ray + i) * share + start) & 255u;
        from_brdf |= sum + share >= 256u ? 1u << i : 0u;
    }
    return Turns(from_brdf, before, first_ray - before);
}

// Runs `body` for `ray` of each bit in turn, with `index` counting up from `first`.
#define TAKE_TURNS(bits, first, body) { \
    uint left = bits; \
    for (uint index = first; left != 0u; ++index) { \
        uint ray = uint(findLSB(left)); \
        left &= left - 1u; \
        body; \
    } \
}

// Runs `light` for each `ray` of the group that is from the light and `brdf` for the others, with its
// `index` in the technique's sequence. A loop for each technique: devices that run both sides of a branch
// then run one per ray.
#define TAKE_ALL_TURNS(turns, light, brdf) \
    TAKE_TURNS(~turns.from_brdf & ((1u << wave.shadow_ray_count) - 1u), turns.light_index, light) \
    TAKE_TURNS(turns.from_brdf, turns.brdf_index, brdf)
