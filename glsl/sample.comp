// Chooses directions at every hit of the wave and writes one shadow ray for each with its
// unoccluded contribution, BRDF * radiance * cosine / pdf. Densities are in solid angle measure.
#version 460

#include "mis_rays.glsl"
#include "path_list.glsl"
#include "reservoir.glsl"

layout(constant_id = CONSTANT_SAMPLER) const uint SAMPLER = SAMPLER_MIS;
// Candidates per shadow ray of `ris`, half from the BRDF and half from the environment; otherwise 1.
layout(constant_id = CONSTANT_CANDIDATES) const uint CANDIDATES = 1u;

void add_candidate(
    inout DirectionSample chosen, inout Reservoir reservoir, DirectionSample candidate) {
    float target = luminance(candidate.integrand);
    float pdf = 0.5 * (candidate.brdf_pdf + candidate.environment_pdf);
    if (reservoir_takes(reservoir, pdf > 0.0 ? target / pdf : 0.0, target)) {
        chosen = candidate;
    }
}

// Writes a ray chosen among candidates in proportion to target / pdf.
void write_resampled_ray(uint place, Vertex vertex, uint number) {
    DirectionSample chosen = DirectionSample(vec3(0.0), vec3(0.0), 0.0, 0.0);
    Reservoir reservoir = reservoir_start(vertex_number(vertex, number, DIMENSION_RESAMPLING));
    for (uint c = 0u; c < CANDIDATES / 2u; ++c) {
        add_candidate(chosen, reservoir, draw_environment_ray(vertex, number, c));
        add_candidate(chosen, reservoir, draw_brdf_ray(vertex, number, c));
    }
    float factor = reservoir_factor(reservoir, CANDIDATES);
    write_ray(place, chosen.direction, chosen.integrand * factor);
}

// Writes a ray of one technique.
void write_plain_ray(uint place, Vertex vertex, uint number) {
    DirectionSample sampled;
    float pdf;
    if (SAMPLER == SAMPLER_UNIFORM) {
        vec3 incident_local =
            sample_uniform_hemisphere(vertex_numbers(vertex, number, DIMENSION_BRDF_DIRECTION));
        sampled = evaluate_local(vertex, incident_local);
        pdf = 0.5 / PI;
    } else if (SAMPLER == SAMPLER_COSINE) {
        vec3 incident_local =
            sample_cosine_hemisphere(vertex_numbers(vertex, number, DIMENSION_BRDF_DIRECTION));
        sampled = evaluate_local(vertex, incident_local);
        pdf = incident_local.z / PI;
    } else if (SAMPLER == SAMPLER_ENV) {
        sampled = draw_environment_ray(vertex, number, 0u);
        pdf = sampled.environment_pdf;
    } else {
        sampled = draw_brdf_ray(vertex, number, 0u);
        pdf = sampled.brdf_pdf;
    }
    write_sample(place, sampled, pdf);
}

void sample_vertex(uint path, Vertex vertex) {
    if (SAMPLER == SAMPLER_MIS) {
        WRITE_MIS_RAYS(
            path, vertex, mis_share(wave.total_shadow_rays, wave.bounce_rays),
            draw_environment_ray(vertex, index, 0u), draw_brdf_ray(vertex, index, 0u))
        return;
    }
    uint path_count = wave_path_count();
    uint first_ray = first_ray_number(vertex);
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        if (SAMPLER == SAMPLER_RIS) {
            write_resampled_ray(i * path_count + path, vertex, first_ray + i);
        } else {
            write_plain_ray(i * path_count + path, vertex, first_ray + i);
        }
    }
}

WALK_VERTICES(sample_vertex)
