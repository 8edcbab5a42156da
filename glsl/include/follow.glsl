// Rays of an invocation in one traversal loop: once enough lanes of the subgroup have finished, all of those
// take their next ray.

#include "given_up.glsl"

// At most 32: what becomes of rays is kept as bits until the end.
layout(constant_id = CONSTANT_RAYS_PER_INVOCATION) const uint RAYS_PER_INVOCATION = 1u;
layout(constant_id = CONSTANT_REFILL_LANES) const uint REFILL_LANES = 0xffffffffu;

// Follows the rays of an invocation: the one at place `first`, if that is below `ray_count`, and each
// WORKGROUP_SIZE further on, numbered by `turn`. `start` begins a ray. `finish` takes what it has met, or
// goes on with `continue`; a ray that is still `running` is given up. `lost_path` is the path of ray `lost`.
//
// One ballot per step, since software devices loop over the lanes for each. A loop at the end, since they
// run the body of every branch.
#define FOLLOW_RAYS(first, ray_count, is_any_hit, start, finish, lost_path) \
    uint turn = 0u; \
    uint steps = 0u; \
    uint given_up = 0u; \
    bool has_ray = first < ray_count; \
    if (has_ray) { \
        start; \
    } \
    while (has_ray) { \
        bool running = true; \
        uint refill = min(REFILL_LANES, subgroupBallotBitCount(subgroupBallot(true))); \
        do { \
            if (running) { \
                running = bvh_step(is_any_hit); \
            } \
            steps++; \
        } while (subgroupBallotBitCount(subgroupBallot(!running)) < refill \
            && steps < TRAVERSAL_STEP_LIMIT); \
        if (!running || steps >= TRAVERSAL_STEP_LIMIT) { \
            given_up |= running ? 1u << turn : 0u; \
            finish \
            turn++; \
            has_ray = turn < RAYS_PER_INVOCATION && first + turn * WORKGROUP_SIZE < ray_count; \
            if (has_ray) { \
                start; \
            } \
        } \
    } \
    for (; given_up != 0u; given_up &= given_up - 1u) { \
        uint lost = uint(findLSB(given_up)); \
        COUNT_GIVEN_UP(lost_path); \
    }
