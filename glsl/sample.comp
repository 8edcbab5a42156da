// Chooses directions at every hit of the wave and writes one shadow ray for each, with what it
// brings if nothing is in the way: BRDF * radiance * cosine / pdf. Densities per steradian.
#version 460

#define NEEDS_PARAMETERS
#define NEEDS_WAVE
#define NEEDS_RAYS
#define NEEDS_HITS
#define NEEDS_SHADOW_RAYS
#define WRITES_SHADOW_RAYS
#define NEEDS_MATERIALS
#define NEEDS_ENVIRONMENT
#include "layout.glsl"
#include "frame.glsl"
#include "random.glsl"
#include "wave.glsl"
#include "brdf.glsl"
#include "environment.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(constant_id = CONSTANT_SAMPLER) const uint SAMPLER = SAMPLER_MIS;
// Candidates per shadow ray of `ris`, half from the BRDF and half from the environment; 1 otherwise.
layout(constant_id = CONSTANT_CANDIDATES) const uint CANDIDATES = 1u;

// A direction considered at a hit.
struct Candidate {
    vec3 direction;
    // BRDF * radiance * cosine, radiance as if unoccluded.
    vec3 integrand;
    // Density of the whole technique or mixture it was drawn from.
    float pdf;
};

// Whether `candidate` of shadow ray `ray` is drawn from the environment rather than the BRDF, for
// the samplers that use both. Resampling has fixed counts. Otherwise the techniques take turns from
// a random start, so that each ray's choice is a fair coin; the coin is shared by a block of 8x8
// pixels, since a workgroup that takes one branch is faster.
bool draws_from_environment(uint ray, uint candidate, uint coin) {
    if (SAMPLER == SAMPLER_RIS) {
        return (candidate & 1u) == 1u;
    }
    return SAMPLER == SAMPLER_ENV || (SAMPLER == SAMPLER_MIS && ((ray + coin) & 1u) == 1u);
}

Candidate draw_candidate(
    PathIndex index, uint ray, uint candidate, uint coin, Hit hit, Frame frame, Material material,
    vec3 outgoing_local) {
    uint first_dimension = vertex_dimension();
    bool both = SAMPLER == SAMPLER_MIS || SAMPLER == SAMPLER_RIS;
    // Techniques that take turns each walk through their own sequence.
    uint sequence_index = SAMPLER == SAMPLER_MIS ? (ray + coin) >> 1u : ray;

    Candidate result = Candidate(vec3(0.0), vec3(0.0), 0.0);
    vec3 incident_local;
    vec3 radiance;
    float environment_density = 0.0;
    if (draws_from_environment(ray, candidate, coin)) {
        vec2 u = random_2d(
            index.pixel, sequence_index,
            first_dimension + DIMENSION_ENVIRONMENT_DIRECTION + (candidate >> 1u), wave.seed);
        EnvironmentSample light = environment_sample(u);
        result.direction = light.direction;
        incident_local = to_local(frame, light.direction);
        radiance = light.radiance;
        environment_density = light.pdf;
    } else {
        vec2 u = random_2d(
            index.pixel, sequence_index,
            first_dimension + DIMENSION_BRDF_DIRECTION + (candidate >> 1u), wave.seed);
        if (SAMPLER == SAMPLER_UNIFORM) {
            vec2 azimuth = sin_cos_pi(2.0 * u.y);
            incident_local = vec3(sqrt(u.x * (2.0 - u.x)) * azimuth.yx, 1.0 - u.x);
            result.pdf = 0.5 / PI;
        } else if (SAMPLER == SAMPLER_COSINE) {
            incident_local = sample_cosine_hemisphere(u);
            result.pdf = incident_local.z / PI;
        } else {
            float lobe = random_1d(
                index.pixel, sequence_index,
                first_dimension + DIMENSION_BRDF_LOBE + (candidate >> 1u), wave.seed);
            incident_local = brdf_sample(material, outgoing_local, vec3(u, lobe));
        }
        result.direction = to_world(frame, incident_local);
        radiance = vec3(-1.0);
    }
    // Below the shading or the geometric horizon there is nothing to see.
    if (incident_local.z <= 0.0 || dot(result.direction, hit.geometric_normal) <= 0.0) {
        return result;
    }
    if (radiance.x < 0.0) {
        radiance = environment_radiance(result.direction);
        environment_density = both ? environment_pdf(result.direction, radiance) : 0.0;
    }
    vec3 value;
    float brdf_density;
    brdf_evaluate_and_pdf(material, outgoing_local, incident_local, value, brdf_density);
    result.integrand = value * radiance * incident_local.z;
    if (both) {
        result.pdf = 0.5 * (brdf_density + environment_density);
    } else if (SAMPLER == SAMPLER_ENV) {
        result.pdf = environment_density;
    } else if (SAMPLER == SAMPLER_BRDF) {
        result.pdf = brdf_density;
    }
    return result;
}

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count) {
        return;
    }
    Hit hit = hits[path];
    if (hit.material == NO_MATERIAL) {
        return;
    }
    PathIndex index = wave_path(path);
    Material material = materials[hit.material];
    Frame frame = frame_from_normal(hit.shading_normal);
    vec3 outgoing_local = to_local(frame, -rays[path].direction);
    uint first_dimension = vertex_dimension();
    uvec2 block = uvec2(index.pixel % parameters.film_width, index.pixel / parameters.film_width)
        / FILM_BLOCK;
    uint coin =
        hash_4d(uvec4(block, first_dimension + DIMENSION_TECHNIQUE, wave.seed)).x & 1u;

    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        // Rays are numbered through all samples, since they share one sequence.
        uint ray = index.sample_index * wave.total_shadow_rays + wave.first_shadow_ray + i;
        Candidate chosen = Candidate(vec3(0.0), vec3(0.0), 1.0);
        float weight_sum = 0.0;
        float chosen_target = 0.0;
        float u_choice = SAMPLER == SAMPLER_RIS
            ? random_1d(index.pixel, ray, first_dimension + DIMENSION_RESAMPLING, wave.seed)
            : 0.0;
        for (uint c = 0u; c < CANDIDATES; ++c) {
            Candidate candidate =
                draw_candidate(index, ray, c, coin, hit, frame, material, outgoing_local);
            if (SAMPLER != SAMPLER_RIS) {
                chosen = candidate;
                break;
            }
            // Weighted reservoir of one; u_choice is stretched to be used again.
            float target = luminance(candidate.integrand);
            float weight = candidate.pdf > 0.0 ? target / candidate.pdf : 0.0;
            weight_sum += weight;
            if (weight > 0.0) {
                float probability = weight / weight_sum;
                if (u_choice < probability) {
                    u_choice /= probability;
                    chosen = candidate;
                    chosen_target = target;
                } else {
                    u_choice = (u_choice - probability) / (1.0 - probability);
                }
            }
        }
        vec3 contribution = vec3(0.0);
        if (SAMPLER == SAMPLER_RIS) {
            // Talbot et al. 2005, Eq. 6: f/target * mean weight.
            if (chosen_target > 0.0) {
                contribution =
                    chosen.integrand * (weight_sum / (float(CANDIDATES) * chosen_target));
            }
        } else if (chosen.pdf > 0.0) {
            contribution = chosen.integrand / chosen.pdf;
        }
        shadow_rays[i * path_count + path] = ShadowRay(chosen.direction, contribution);
    }
}
