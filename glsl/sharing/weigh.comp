// Weighs the second vertex of every path by the balance heuristic over the first vertices of its cohort
// that see it. Visibility belongs into this sum: a path cannot come from a first vertex to a place that
// is hidden from it. The weight is 0 if the own first vertex does not see it.
#version 460

#include "sharing/cohort.glsl"
#include "wave.glsl"

LOADS(Offer, load_offer, offer_texels)
TEXELS(connection_texels)
TEXELS(seen_texels)
WRITES(offer_weights)

void weigh_path(uint path) {
    uint path_count = wave_path_count();
    float weight = 0.0;
    if (load_offer(path).material != NO_MATERIAL) {
        Cohort cohort = cohort_of(path);
        bool is_own_seen = false;
        float density = 0.0;
        for (uint member = 0u; member < COHORT_PIXELS; ++member) {
            uint other = cohort_path(cohort, member);
            if (is_seen(texelFetch(seen_texels, int(other)).xy, cohort.member)) {
                is_own_seen = is_own_seen || member == cohort.member;
                density +=
                    texelFetch(connection_texels, int(cohort.member * path_count + other)).w;
            }
        }
        weight = is_own_seen ? load_offer(path).density_ratio / density : 0.0;
    }
    offer_weights[path] = weight;
}

RUN_PATHS(weigh_path)
