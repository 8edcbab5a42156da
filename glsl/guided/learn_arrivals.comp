// Counts each bounce ray in the cell it left and the bin of its direction, with the learned light that
// the cell it arrived at reflects; no light if it left the scene. Samples teach as in learn.comp.
#version 460

#include "divide.glsl"
#include "load.glsl"
#include "path_list.glsl"
#include "wave.glsl"

LOADS(PathCell, load_path_cell, path_cell_texels)
TEXELS(guide_reflected)
UPDATES(guide_arrivals)

void learn_arrival(uint path) {
    uint since_rebuild =
        wave.first_sample + divide(path, wave.pixel_count).x - wave.epoch_start;
    if (since_rebuild >= GUIDE_SAMPLES_THAT_ALL_TEACH && since_rebuild % GUIDE_TEACHING_STEP != 0u) {
        return;
    }
    PathCell found = load_path_cell(path);
    // The light that comes from a specular surface is not known.
    if (found.teaches != NOTHING_TO_LEARN && found.cell != SPECULAR_CELL) {
        atomicAdd(guide_arrivals[2u * found.teaches], 1u);
        if (load_hit(path).triangle != NO_TRIANGLE && found.cell != NOTHING_TO_LEARN) {
            uint light = texelFetch(guide_reflected, int(found.cell)).x;
            atomicAdd(guide_arrivals[2u * found.teaches + 1u], light);
        }
    }
}

WALK_PATHS(learn_arrival)
