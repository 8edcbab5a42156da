// Chooses directions at every hit of the wave and writes one shadow ray for each, with what it
// brings if nothing is in the way: BRDF * radiance * cosine / pdf. Densities per steradian.
#version 460

#define NEEDS_PARAMETERS
#define NEEDS_WAVE
#define NEEDS_RAY_TEXELS
#define NEEDS_HIT_TEXELS
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

// What does not change from ray to ray at one hit.
struct Vertex {
    Hit hit;
    Frame frame;
    Material material;
    vec3 outgoing_local;
    uint pixel;
    // First dimension of the random numbers.
    uint dimension;
};

// A direction considered at a hit.
struct Candidate {
    vec3 direction;
    // BRDF * radiance * cosine, radiance as if unoccluded.
    vec3 integrand;
    // Density of the whole technique or mixture it was drawn from; 0 where nothing was drawn.
    float pdf;
};

// Completes a candidate. `pdf` is the density of a technique that is neither the BRDF's own nor the
// environment's, which `SAMPLER` says.
Candidate evaluate(
    Vertex vertex, vec3 direction, vec3 incident_local, vec3 radiance, float environment_density,
    float pdf) {
    Candidate candidate = Candidate(direction, vec3(0.0), pdf);
    vec3 value;
    float brdf_density;
    brdf_evaluate_and_pdf(
        vertex.material, vertex.outgoing_local, incident_local, value, brdf_density);
    if (SAMPLER == SAMPLER_MIS || SAMPLER == SAMPLER_RIS) {
        candidate.pdf = 0.5 * (brdf_density + environment_density);
    } else if (SAMPLER == SAMPLER_ENV) {
        candidate.pdf = environment_density;
    } else if (SAMPLER == SAMPLER_BRDF) {
        candidate.pdf = brdf_density;
    }
    // Below the shading or the geometric horizon there is nothing to see.
    if (incident_local.z > 0.0 && dot(direction, vertex.hit.geometric_normal) > 0.0) {
        candidate.integrand = value * radiance * incident_local.z;
    }
    return candidate;
}

// A direction proportional to the environment's luminance.
Candidate draw_from_environment(Vertex vertex, uint sequence_index, uint candidate) {
    vec2 u = random_2d(
        vertex.pixel, sequence_index,
        vertex.dimension + DIMENSION_ENVIRONMENT_DIRECTION + candidate, wave.seed);
    EnvironmentSample light = environment_sample(u);
    vec3 incident_local = to_local(vertex.frame, light.direction);
    return evaluate(vertex, light.direction, incident_local, light.radiance, light.pdf, 0.0);
}

// A direction from the BRDF, or from a fixed density over the hemisphere.
Candidate draw_from_surface(Vertex vertex, uint sequence_index, uint candidate) {
    vec2 u = random_2d(
        vertex.pixel, sequence_index, vertex.dimension + DIMENSION_BRDF_DIRECTION + candidate,
        wave.seed);
    vec3 incident_local;
    float pdf = 0.0;
    if (SAMPLER == SAMPLER_UNIFORM) {
        vec2 azimuth = sin_cos_pi(2.0 * u.y);
        incident_local = vec3(sqrt(u.x * (2.0 - u.x)) * azimuth.yx, 1.0 - u.x);
        pdf = 0.5 / PI;
    } else if (SAMPLER == SAMPLER_COSINE) {
        incident_local = sample_cosine_hemisphere(u);
        pdf = incident_local.z / PI;
    } else {
        float lobe = random_1d(
            vertex.pixel, sequence_index, vertex.dimension + DIMENSION_BRDF_LOBE + candidate,
            wave.seed);
        incident_local = brdf_sample(vertex.material, vertex.outgoing_local, vec3(u, lobe));
    }
    vec3 direction = to_world(vertex.frame, incident_local);
    vec3 radiance = environment_radiance(direction);
    float environment_density = SAMPLER == SAMPLER_MIS || SAMPLER == SAMPLER_RIS
        ? environment_pdf(direction, radiance)
        : 0.0;
    return evaluate(vertex, direction, incident_local, radiance, environment_density, pdf);
}

void write_ray(uint index, vec3 direction, vec3 contribution) {
    shadow_rays[index] = ShadowRay(direction, contribution);
}

void write_candidate(uint index, Candidate candidate) {
    write_ray(
        index, candidate.direction,
        candidate.pdf > 0.0 ? candidate.integrand / candidate.pdf : vec3(0.0));
}

// One of the candidates seen so far, chosen in proportion to target / pdf.
struct Reservoir {
    Candidate chosen;
    float chosen_target;
    float weight_sum;
    // Stretched after each choice to be used again.
    float u;
};

void consider(inout Reservoir reservoir, Candidate candidate) {
    float target = luminance(candidate.integrand);
    float weight = candidate.pdf > 0.0 ? target / candidate.pdf : 0.0;
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

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count) {
        return;
    }
    Vertex vertex;
    vertex.hit = load_hit(path);
    if (vertex.hit.material == NO_MATERIAL) {
        return;
    }
    PathIndex index = wave_path(path);
    vertex.frame = frame_from_normal(vertex.hit.shading_normal);
    vertex.material = materials[vertex.hit.material];
    vertex.outgoing_local = to_local(vertex.frame, -load_ray(path).direction);
    vertex.pixel = index.pixel;
    vertex.dimension = vertex_dimension();
    // Rays are numbered through all samples, since they share one sequence.
    uint first_ray = index.sample_index * wave.total_shadow_rays + wave.first_shadow_ray;

    if (SAMPLER == SAMPLER_RIS) {
        for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
            Reservoir reservoir;
            reservoir.chosen = Candidate(vec3(0.0), vec3(0.0), 0.0);
            reservoir.chosen_target = 0.0;
            reservoir.weight_sum = 0.0;
            reservoir.u = random_1d(
                vertex.pixel, first_ray + i, vertex.dimension + DIMENSION_RESAMPLING, wave.seed);
            for (uint c = 0u; c < CANDIDATES / 2u; ++c) {
                consider(reservoir, draw_from_environment(vertex, first_ray + i, c));
                consider(reservoir, draw_from_surface(vertex, first_ray + i, c));
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
        // The two techniques take turns from a random start, so that each ray's technique is a fair
        // coin. The coin is shared by a block of 8x8 pixels, and each technique has its own loop:
        // devices that run both sides of a branch then run one technique per ray.
        uvec2 block =
            uvec2(index.pixel % parameters.film_width, index.pixel / parameters.film_width)
            / FILM_BLOCK;
        uint coin =
            hash_4d(uvec4(block, vertex.dimension + DIMENSION_TECHNIQUE, wave.seed)).x & 1u;
        uint turn = (first_ray + coin) & 1u;
        for (uint i = turn; i < wave.shadow_ray_count; i += 2u) {
            write_candidate(
                i * path_count + path,
                draw_from_environment(vertex, (first_ray + i + coin) >> 1u, 0u));
        }
        for (uint i = 1u - turn; i < wave.shadow_ray_count; i += 2u) {
            write_candidate(
                i * path_count + path,
                draw_from_surface(vertex, (first_ray + i + coin) >> 1u, 0u));
        }
    } else {
        for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
            Candidate candidate;
            if (SAMPLER == SAMPLER_ENV) {
                candidate = draw_from_environment(vertex, first_ray + i, 0u);
            } else {
                candidate = draw_from_surface(vertex, first_ray + i, 0u);
            }
            write_candidate(i * path_count + path, candidate);
        }
    }
}
