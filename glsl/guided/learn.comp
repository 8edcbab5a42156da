// Counts each teaching shadow ray in the cell and region that sample_guided.comp noted, and of
// visible rays their response and evidence for the BRDF share. Counts are read only between passes.
// Long after a rebuild every fourth sample is enough.
#version 460

#include "divide.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "wave.glsl"

READS(guide)
TEXELS(learn_target_texels)
UPDATES(guide_counts)
UPDATES(guide_shares)

void learn_ray(ListedRay listed) {
    uint ray = listed.ray;
    uint sample_of_wave = divide(listed.path, wave.pixel_count).x;
    uint since_rebuild = wave.first_sample + sample_of_wave - wave.epoch_start;
    if (since_rebuild >= GUIDE_SAMPLES_THAT_ALL_TEACH && since_rebuild % GUIDE_TEACHING_STEP != 0u) {
        return;
    }
    uvec2 target = texelFetch(learn_target_texels, int(ray)).xy;
    if (target.x != NOTHING_TO_LEARN) {
        uint count = GUIDE_COUNT_WORDS * target.x;
        atomicAdd(guide_counts[count], 1u);
        if (reaches_light(ray)) {
            atomicAdd(guide_counts[count + 1u], 1u);
            atomicAdd(guide_counts[count + 2u], target.y >> LEARN_RESPONSE_SHIFT);
            uint from_brdf = (target.y >> LEARN_FROM_BRDF_SHIFT) & NO_SHARE_TO_LEARN;
            if (from_brdf != NO_SHARE_TO_LEARN) {
                uint cell = divide(target.x, guide.region_count).x;
                uint octave = cell * GUIDE_SHARE_OCTAVES
                    + (target.y & ((1u << LEARN_FROM_BRDF_SHIFT) - 1u));
                atomicAdd(guide_shares[2u * octave], 1u);
                atomicAdd(guide_shares[2u * octave + 1u], from_brdf);
            }
        }
    }
}

WALK_RAYS(learn_ray)
