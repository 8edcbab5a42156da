// Adds the light of all second vertices of the cohort that its first vertex sees to every path, each by
// its weight. All of a vertex that its own first vertex does not see stays with its own path, and so do
// the peaks of narrow lobes.
#version 460

#include "load.glsl"
#include "sharing/cohort.glsl"
#include "sharing/shared_part.glsl"
#include "wave.glsl"

LOADS(SecondVertex, load_second_vertex, second_vertex_texels)
LOADS(SecondLight, load_second_light, second_light_texels)
TEXELS(seen_texels)
TEXELS(connection_texels)
TEXELS(offer_weight_texels)
WRITES(paths)

void share_path(uint path) {
    uint path_count = wave_path_count();
    Cohort cohort = cohort_of(path);
    vec3 radiance = load_path_state(path).radiance;
    SecondVertex second = load_second_vertex(path);
    if (second.scale > 0.0) {
        float own_weight = texelFetch(offer_weight_texels, int(path)).x;
        SecondLight found = load_second_light(path);
        vec3 light = found.direct + radiance;
        if (own_weight > 0.0) {
            float density =
                texelFetch(connection_texels, int(cohort.member * path_count + path)).w;
            float share = own_weight * density / second.density_ratio;
            vec3 shared_light = found.shared_light + shared_share(found.bounce_value) * radiance;
            light -= (1.0 - share) * shared_light;
        }
        radiance = second.radiance + second.throughput * (light / second.scale);
    }
    uvec2 seen_by_path = texelFetch(seen_texels, int(path)).xy;
    if (seen_by_path != uvec2(0u)) {
        for (uint member = 0u; member < COHORT_PIXELS; ++member) {
            float weight =
                texelFetch(offer_weight_texels, int(cohort_path(cohort, member))).x;
            if (weight > 0.0 && member != cohort.member && is_seen(seen_by_path, member)) {
                radiance += weight
                    * texelFetch(connection_texels, int(member * path_count + path)).xyz;
            }
        }
    }
    paths[path].radiance = radiance;
}

RUN_PATHS(share_path)
