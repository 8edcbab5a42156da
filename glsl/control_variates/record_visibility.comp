// Counts every shadow ray of the pilot, and every visible one, in the record of its hit and the bin of its
// direction. Sums of integers: the order of rays makes no difference.
#version 460

#include "control_variates/records.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "wave.glsl"

UPDATES(record_counts)

void record_ray(ListedRay listed) {
    Hit hit = load_hit(listed.path);
    ShadowRay ray = load_shadow_ray(listed.ray);
    // Same test as in shadow.comp: rays without a contribution are not traced.
    if (hit.material == NO_MATERIAL || ray.contribution == vec3(0.0)) {
        return;
    }
    uint entry = record_entry(record_of(hit.position, hit.geometric_normal), ray.direction);
    atomicAdd(record_counts[2u * entry], 1u);
    if (reaches_light(listed.ray)) {
        atomicAdd(record_counts[2u * entry + 1u], 1u);
    }
}

WALK_RAYS(record_ray)
