// Shadow rays of samplers of the `mis` kind, from BRDF and light. A sampler supplies how it draws a
// direction to the light, and with which density. Solid angle measure.

#include "mis.glsl"
#include "turns.glsl"
#include "vertex.glsl"

// Turns of the rays of a group, of which `share` are from the BRDF, in 256ths.
Turns mis_turns(Vertex vertex, uint share) {
    // Pixels of a block start alike.
    uint bits = block_random_bits(vertex.index, DIMENSION_TECHNIQUE).x;
    Turns turns =
        turns_from(first_ray_number(vertex), share, (bits & 1u) << 7u | ((bits >> 1u) & 127u));
    turns.light_index += bits & 1u;
    return turns;
}

void write_mis_ray(uint place, DirectionSample sampled) {
    float pdf = mis_pdf(
        sampled.brdf_pdf, sampled.environment_pdf, wave.total_shadow_rays, wave.bounce_rays);
    write_sample(place, sampled, pdf);
}

// Writes the rays of a group at the vertex of a path. `light` and `brdf` draw direction `index` of the
// technique's sequence, as a DirectionSample whose environment_pdf is the density of `light`.
#define WRITE_MIS_RAYS(path, vertex, share, light, brdf) { \
    Turns turns = mis_turns(vertex, share); \
    uint path_count = wave_path_count(); \
    TAKE_ALL_TURNS( \
        turns, write_mis_ray(ray * path_count + path, light), \
        write_mis_ray(ray * path_count + path, brdf)) \
}
