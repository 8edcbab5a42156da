// Tests the visibility of the light along every shadow ray of the wave: shadow_rays, hits ->
// visibility. Surfaces that are not opaque, and thin panes, dim the ray's contribution. Ray
// direction_index · path_count + path_index starts at hit path_index: neighbouring invocations work
// on neighbouring paths.
#version 460
#extension GL_KHR_shader_subgroup_ballot : require

#include "follow.glsl"
#include "passage.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "wave.glsl"

WRITES(visibility)
UPDATES(shadow_rays)
UPDATES(counters)

// Starts a ray, or finishes one without a contribution. Returns true if it is traced.
bool start_ray(uint place, uint path_count, float offset) {
    ListedRay listed = listed_ray(place, path_count);
    Hit hit = load_hit(listed.path);
    ShadowRay ray = load_shadow_ray(listed.ray);
    bool is_traced = has_shadow_rays(hit) && ray.contribution != vec3(0.0);
    vec3 origin = moved_off_surface(hit.position, hit.geometric_normal, ray.direction, offset);
    float farthest = FAR_AWAY;
    if (wave.to_lamps != 0u) {
        vec3 to_lamp = ray.direction + (hit.position - origin);
        farthest = length(to_lamp);
        ray.direction = to_lamp / max(farthest, 1.0e-20);
    }
    bvh_start(origin, ray.direction, farthest, true);
    bvh_nodes_waiting.y = is_traced ? bvh_nodes_waiting.y : 0u;
    return is_traced;
}

void main() {
    uint path_count = listed_path_count();
    uint ray_count = path_count * wave.shadow_ray_count;
    uint first = gl_WorkGroupID.x * WORKGROUP_SIZE * RAYS_PER_INVOCATION + gl_LocalInvocationID.x;
    float offset = ray_offset();

    uint visible_bits = 0u;
    bool is_traced = false;
    FOLLOW_RAYS(
        first, ray_count, true,
        is_traced = start_ray(first + turn * WORKGROUP_SIZE, path_count, offset),
        {
            bool is_visible = is_traced && !running && bvh_triangle == NO_TRIANGLE;
            visible_bits |= is_visible ? 1u << turn : 0u;
            if (HAS_PASSAGES && is_visible && bvh_transmittance != vec3(1.0)) {
                uint ray = listed_ray(first + turn * WORKGROUP_SIZE, path_count).ray;
                shadow_rays[ray].contribution *= bvh_transmittance;
            }
        },
        listed_ray(first + lost * WORKGROUP_SIZE, path_count).path)
    uint traced = turn;
    for (turn = 0u; turn < traced; turn++) {
        uint ray = listed_ray(first + turn * WORKGROUP_SIZE, path_count).ray;
        visibility[ray] = (visible_bits >> turn) & 1u;
    }
}
