// Finds the closest hit of every ray of the wave: rays -> hits.
//
// One traversal loop takes RAYS_PER_INVOCATION rays: once enough lanes of the subgroup have finished,
// all of those take their next ray. Surfaces are evaluated afterwards, with all lanes in step.
#version 460
#extension GL_KHR_shader_subgroup_ballot : require

#include "bvh.glsl"
#include "load.glsl"
#include "wave.glsl"

WRITES(hits)
UPDATES(counters)

layout(local_size_x = WORKGROUP_SIZE) in;

layout(constant_id = CONSTANT_RAYS_PER_INVOCATION) const uint RAYS_PER_INVOCATION = 1u;
layout(constant_id = CONSTANT_REFILL_LANES) const uint REFILL_LANES = 0xffffffffu;

void main() {
    uint ray_count = wave.pixel_count * wave.sample_count;
    uint first = gl_WorkGroupID.x * WORKGROUP_SIZE * RAYS_PER_INVOCATION + gl_LocalInvocationID.x;
    uint found[RAYS_PER_INVOCATION];

    uint turn = 0u;
    uint steps = 0u;
    bool has_ray = first < ray_count;
    if (has_ray) {
        Ray ray = load_ray(first);
        bvh_start(ray.origin, ray.direction, false);
        bvh_nodes_waiting.y = ray.is_active != 0u ? bvh_nodes_waiting.y : 0u;
    }
    while (has_ray) {
        bool running = true;
        // One ballot per step: software devices loop over the lanes for each.
        uint refill = min(REFILL_LANES, subgroupBallotBitCount(subgroupBallot(true)));
        do {
            if (running) {
                running = bvh_step(false);
            }
            steps++;
        } while (subgroupBallotBitCount(subgroupBallot(!running)) < refill
            && steps < TRAVERSAL_STEP_LIMIT);
        if (!running || steps >= TRAVERSAL_STEP_LIMIT) {
            if (running) {
                atomicAdd(counters.traversal_overruns, 1u);
            }
            found[turn] = bvh_triangle;
            turn++;
            has_ray = turn < RAYS_PER_INVOCATION && first + turn * WORKGROUP_SIZE < ray_count;
            if (has_ray) {
                Ray ray = load_ray(first + turn * WORKGROUP_SIZE);
                bvh_start(ray.origin, ray.direction, false);
                bvh_nodes_waiting.y = ray.is_active != 0u ? bvh_nodes_waiting.y : 0u;
            }
        }
    }

    for (turn = 0u; turn < RAYS_PER_INVOCATION; turn++) {
        uint index = first + turn * WORKGROUP_SIZE;
        if (index < ray_count) {
            Ray ray = load_ray(index);
            uint triangle = found[turn];
            if (triangle == NO_TRIANGLE) {
                hits[index] = no_surface();
            } else {
                hits[index] = surface_at(triangle, ray.origin, ray.direction);
            }
        }
    }
}
