// Chooses directions at every hit of the wave and writes one shadow ray for each with its
// unoccluded contribution, BRDF * radiance * cosine / pdf. Densities are in solid angle measure.
#version 460

#include "mis.glsl"
#include "path_list.glsl"
#include "vertex.glsl"

layout(constant_id = CONSTANT_SAMPLER) const uint SAMPLER = SAMPLER_MIS;
// Candidates per shadow ray of `ris`, half from the BRDF and half from the environment; otherwise 1.
layout(constant_id = CONSTANT_CANDIDATES) const uint CANDIDATES = 1u;

// Density of the technique or mixture of SAMPLER, if neither uniform nor the cosine.
float density(DirectionSample sampled) {
    if (SAMPLER == SAMPLER_MIS) {
        return mis_pdf(
            sampled.brdf_pdf, sampled.environment_pdf, wave.total_shadow_rays, wave.bounce_rays);
    }
    if (SAMPLER == SAMPLER_RIS) {
        return 0.5 * (sampled.brdf_pdf + sampled.environment_pdf);
    }
    return SAMPLER == SAMPLER_ENV ? sampled.environment_pdf : sampled.brdf_pdf;
}

DirectionSample draw_environment_candidate(Vertex vertex, uint sequence_index, uint candidate) {
    return draw_from_environment(
        vertex,
        random_2d(
            vertex.index.pixel, sequence_index,
            vertex.dimension + DIMENSION_ENVIRONMENT_DIRECTION + candidate, wave.seed));
}

vec2 surface_numbers(Vertex vertex, uint sequence_index, uint candidate) {
    return random_2d(
        vertex.index.pixel, sequence_index, vertex.dimension + DIMENSION_BRDF_DIRECTION + candidate,
        wave.seed);
}

DirectionSample draw_brdf_candidate(Vertex vertex, uint sequence_index, uint candidate) {
    float lobe = random_1d(
        vertex.index.pixel, sequence_index, vertex.dimension + DIMENSION_BRDF_LOBE + candidate,
        wave.seed);
    return draw_from_brdf(vertex, vec3(surface_numbers(vertex, sequence_index, candidate), lobe));
}

// Candidate chosen in proportion to target / pdf.
struct Reservoir {
    DirectionSample chosen;
    float chosen_target;
    float weight_sum;
    // Random number, rescaled after each choice for the next.
    float u;
};

void add_to(inout Reservoir reservoir, DirectionSample candidate) {
    float target = luminance(candidate.integrand);
    float pdf = density(candidate);
    float weight = pdf > 0.0 ? target / pdf : 0.0;
    reservoir.weight_sum += weight;
    if (weight > 0.0) {
        float probability = weight / reservoir.weight_sum;
        if (reservoir.u < probability) {
            reservoir.u /= probability;
            reservoir.chosen = candidate;
            reservoir.chosen_target = target;
        } else {
            reservoir.u = (reservoir.u - probability) / (1.0 - probability);
        }
    }
}

void sample_path(uint path) {
    uint path_count = wave_path_count();
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        return;
    }
    Vertex vertex = load_vertex(path, hit);
    // Number the rays through all samples: they share one sequence.
    uint first_ray = vertex.index.sample_index * wave.total_shadow_rays + wave.first_shadow_ray;

    if (SAMPLER == SAMPLER_RIS) {
        for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
            Reservoir reservoir;
            reservoir.chosen = DirectionSample(vec3(0.0), vec3(0.0), 0.0, 0.0);
            reservoir.chosen_target = 0.0;
            reservoir.weight_sum = 0.0;
            reservoir.u = random_1d(
                vertex.index.pixel, first_ray + i, vertex.dimension + DIMENSION_RESAMPLING,
                wave.seed);
            for (uint c = 0u; c < CANDIDATES / 2u; ++c) {
                add_to(reservoir, draw_environment_candidate(vertex, first_ray + i, c));
                add_to(reservoir, draw_brdf_candidate(vertex, first_ray + i, c));
            }
            // Talbot et al. 2005, Eq. 6: f / target * mean weight.
            float factor = reservoir.chosen_target > 0.0
                ? reservoir.weight_sum / (float(CANDIDATES) * reservoir.chosen_target)
                : 0.0;
            write_ray(
                i * path_count + path, reservoir.chosen.direction,
                reservoir.chosen.integrand * factor);
        }
    } else if (SAMPLER == SAMPLER_MIS) {
        // A loop for each technique: devices that run both sides of a branch then run one per ray.
        MisTurns turns = mis_turns(
            first_ray, wave.shadow_ray_count, mis_share(wave.total_shadow_rays, wave.bounce_rays),
            block_random_bits(vertex.index, DIMENSION_TECHNIQUE).x);
        uint index = turns.light_index;
        uint left = ~turns.from_brdf & ((1u << wave.shadow_ray_count) - 1u);
        while (left != 0u) {
            uint i = uint(findLSB(left));
            left &= left - 1u;
            DirectionSample sampled = draw_environment_candidate(vertex, index, 0u);
            index++;
            write_sample(i * path_count + path, sampled, density(sampled));
        }
        index = turns.brdf_index;
        left = turns.from_brdf;
        while (left != 0u) {
            uint i = uint(findLSB(left));
            left &= left - 1u;
            DirectionSample sampled = draw_brdf_candidate(vertex, index, 0u);
            index++;
            write_sample(i * path_count + path, sampled, density(sampled));
        }
    } else {
        for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
            DirectionSample sampled;
            float pdf;
            if (SAMPLER == SAMPLER_UNIFORM) {
                vec2 u = surface_numbers(vertex, first_ray + i, 0u);
                vec2 azimuth = sin_cos_pi(2.0 * u.y);
                sampled = evaluate_local(
                    vertex, vec3(sqrt(u.x * (2.0 - u.x)) * azimuth.yx, 1.0 - u.x));
                pdf = 0.5 / PI;
            } else if (SAMPLER == SAMPLER_COSINE) {
                vec3 incident_local =
                    sample_cosine_hemisphere(surface_numbers(vertex, first_ray + i, 0u));
                sampled = evaluate_local(vertex, incident_local);
                pdf = incident_local.z / PI;
            } else if (SAMPLER == SAMPLER_ENV) {
                sampled = draw_environment_candidate(vertex, first_ray + i, 0u);
                pdf = density(sampled);
            } else {
                sampled = draw_brdf_candidate(vertex, first_ray + i, 0u);
                pdf = density(sampled);
            }
            write_sample(i * path_count + path, sampled, pdf);
        }
    }
}

WALK_PATHS(sample_path)
