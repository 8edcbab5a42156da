// Chooses a shadow ray among candidates at every hit of the wave, once for each ray, writes it with its
// contribution, and adds to the path what the records expect, which no shadow ray carries. Densities are
// in solid angle measure.
//
// The records come from the pilot, whose random numbers are others, and do not change afterwards: the
// samples are independent of them.
#version 460

#include "control_variates/controlled.glsl"
#include "control_variates/records.glsl"
#include "light_groups.glsl"
#include "path_list.glsl"
#include "vertex.glsl"

TEXELS(record_visibilities)
WRITES(paths)

// Candidates per shadow ray, half from the BRDF and half from the environment.
layout(constant_id = CONSTANT_CANDIDATES) const uint CANDIDATES = 4u;
const uint PAIRS = CANDIDATES / 2u;

void add_candidate(inout Controlled chosen, uint record, DirectionSample candidate) {
    float pdf = 0.5 * (candidate.brdf_pdf + candidate.environment_pdf);
    vec3 weight = pdf > 0.0 ? candidate.integrand / pdf : vec3(0.0);
    float expected =
        texelFetch(record_visibilities, int(record_entry(record, candidate.direction))).x;
    controlled_add(chosen, candidate.direction, weight, expected);
}

void sample_vertex(uint path, Vertex vertex) {
    uint path_count = wave_path_count();
    uint record = record_of(vertex.hit.position, vertex.hit.geometric_normal);
    uint first_ray = first_ray_number(vertex);
    vec3 rest = vec3(0.0);
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        Controlled chosen =
            controlled_start(vertex_number(vertex, first_ray + i, DIMENSION_RESAMPLING));
        // The candidates of all rays share two sequences.
        for (uint pair = 0u; pair < PAIRS; ++pair) {
            uint number = (first_ray + i) * PAIRS + pair;
            add_candidate(chosen, record, draw_environment_ray(vertex, number, 0u));
            add_candidate(chosen, record, draw_brdf_ray(vertex, number, 0u));
        }
        vec3 contribution = controlled_contribution(chosen, CANDIDATES);
        write_ray(i * path_count + path, chosen.direction, contribution);
        rest += controlled_rest(chosen, CANDIDATES, contribution);
    }
    PathState state = load_path_state(path);
    precise vec3 light = state.throughput * (rest / float(wave.total_shadow_rays));
    paths[path].radiance = state.radiance + light;
    add_to_group(path, ENVIRONMENT_GROUP, light);
}

WALK_VERTICES(sample_vertex)
