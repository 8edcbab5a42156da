// Continues every path of the wave toward light that its cell has learned: draws candidates from
// the BRDF and keeps one in proportion to that light (resampled importance sampling, Talbot et al.
// 2005). The others cost no ray and no BRDF evaluation. Notes the target of learn_arrivals.comp.
#version 460

#include "guided/arriving.glsl"
#include "bounce.glsl"
#include "path_list.glsl"
#include "reservoir.glsl"

TEXELS(guide_arriving)
LOADS(PathCell, load_path_cell, path_cell_texels)
WRITES(path_cells)

layout(constant_id = CONSTANT_BOUNCE_CANDIDATES) const uint BOUNCE_CANDIDATES = 4u;

void bounce_path(uint path) {
    path_cells[path].teaches = NOTHING_TO_LEARN;
    Hit hit = load_hit(path);
    Material material;
    if (!goes_on_from(path, hit, material)) {
        rays[path].is_active = 0u;
        return;
    }
    PathIndex index = wave_path(path);
    // Start the sequences anew at each rebuild: the cells depend on earlier samples.
    uint number = index.sample_index - wave.epoch_start;
    Frame frame = frame_from_normal(hit.shading_normal);
    vec3 outgoing_local = to_local(frame, -load_ray(path).direction);
    vec3 u = bounce_numbers(index, number, wave.epoch_seed);
    vec3 direction;
    vec3 factor;
    float pdf = 0.0;
    uint learns = NOTHING_TO_LEARN;
    if (hit.material != NO_MATERIAL) {
        Reflector reflector = reflector_from(material, outgoing_local);
        Reservoir reservoir = reservoir_start(random_1d(
            index.pixel, number, vertex_dimension() + DIMENSION_RESAMPLING, wave.epoch_seed));
        // Rotate from candidate to candidate: each stays stratified over samples, all cover the BRDF.
        vec3 rotation = vec3(1.0 / float(BOUNCE_CANDIDATES), 0.618034, 0.754878);
        uint first = load_path_cell(path).cell * GUIDE_ARRIVAL_SIDE * GUIDE_ARRIVAL_SIDE;
        vec3 chosen = vec3(0.0, 0.0, 1.0);
        uint chosen_direction = 0u;
        for (uint c = 0u; c < BOUNCE_CANDIDATES; ++c) {
            vec3 incident_local = brdf_sample(reflector, u);
            uint candidate = arrival_direction(to_world(frame, incident_local));
            float light = texelFetch(guide_arriving, int(first + candidate)).x;
            if (reservoir_takes(reservoir, light, light)) {
                chosen = incident_local;
                chosen_direction = candidate;
            }
            u = fract(u + rotation);
        }
        direction = to_world(frame, chosen);
        factor = bounce_factor(hit, reflector, chosen, direction, pdf)
            * reservoir_factor(reservoir, BOUNCE_CANDIDATES);
        learns = first + chosen_direction;
    } else {
        factor = specular_factor(path, hit, material, frame, outgoing_local, u, direction, pdf);
    }
    // The throughput depends on the tables, and so roulette takes the numbers since their rebuild too.
    if (follow_bounce(path, index, hit, direction, pdf, factor, number, wave.epoch_seed)) {
        path_cells[path].teaches = learns;
    }
}

WALK_PATHS(bounce_path)
