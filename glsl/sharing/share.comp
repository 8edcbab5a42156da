// Adds the light of all second vertices of the cohort that its first vertex sees to every path, each by
// its weight. What the rest of the BRDF reflects stays with its own path, and so does a second vertex
// that its own first vertex does not see.
#version 460

#include "load.glsl"
#include "sharing/cohort.glsl"
#include "wave.glsl"

READS(second_vertices)
READS(seen)
TEXELS(connection_texels)
TEXELS(offer_weight_texels)
UPDATES(paths)

void share_path(uint path) {
    uint path_count = wave_path_count();
    vec3 radiance = paths[path].radiance;
    SecondVertex second = second_vertices[path];
    if (second.scale > 0.0) {
        vec3 shared_light = texelFetch(offer_weight_texels, int(path)).x > 0.0
            ? second.base + second.bounce_share * radiance
            : vec3(0.0);
        vec3 rest = second.direct + radiance - shared_light;
        radiance = second.radiance + second.throughput * (rest / second.scale);
    }
    uvec2 seen_by_path = seen[path];
    if (seen_by_path != uvec2(0u)) {
        Cohort cohort = cohort_of(path);
        for (uint member = 0u; member < COHORT_PIXELS; ++member) {
            float weight =
                texelFetch(offer_weight_texels, int(cohort_path(cohort, member))).x;
            if (weight > 0.0 && is_seen(seen_by_path, member)) {
                radiance += weight
                    * texelFetch(connection_texels, int(member * path_count + path)).xyz;
            }
        }
    }
    paths[path].radiance = radiance;
}

RUN_PATHS(share_path)
