// Chooses one point on the lamps at every hit of the wave and writes a shadow ray to it, with its
// unoccluded contribution. Draws candidates from the list of the place and keeps one in proportion to what
// it brings and how visible its lamps are there: resampled importance sampling [Talbot et al. 2005]. The
// candidates of all rays of a hit draw from strata of the lamps; their mean density is that of one free
// candidate, by which each is divided. Where a bounce ray may find the lamp too, the balance heuristic weighs
// both by the density of one candidate and of the BRDF. At rough glass, where no sampler draws rays, half of
// the candidates are from the environment.
#version 460

#include "hit_instance.glsl"
#include "lamps.glsl"
#include "path_list.glsl"
#include "reservoir.glsl"
#include "specular.glsl"
#include "vertex.glsl"

WRITES(lamp_groups)
WRITES(lamp_lists)

layout(constant_id = CONSTANT_LAMP_CANDIDATES) const uint LAMP_CANDIDATES = 4u;

// Stands for a lamp in LampSample.
const uint ENVIRONMENT_SOURCE = 0xffffffffu;

// First dimension of lamps: each ray has two for each candidate, and one for the choice; at most 2048
// rays a vertex.
const uint DIMENSION_LAMP = 0x4000000u;
const uint DIMENSIONS_PER_LAMP_RAY = 2u * LAMP_CANDIDATES + 1u;
const uint DIMENSIONS_PER_LAMP_VERTEX = 2048u * DIMENSIONS_PER_LAMP_RAY;

// Value * |cosine| toward an incident direction, and its density at a bounce.
vec3 scattered(Vertex vertex, vec3 incident_local, vec3 direction, bool is_back, out float pdf) {
    Reflector reflector = vertex.reflector;
    bool is_above = dot(direction, vertex.hit.geometric_normal) > 0.0;
    if (HAS_ROUGH_GLASS && is_interface(reflector.material)) {
        Scatter found =
            dielectric_toward(reflector.material, reflector.outgoing_local, is_back, incident_local);
        pdf = found.pdf;
        return is_above != found.is_transmitted
            ? found.weight * found.pdf
                * inside_transmittance(reflector.material, is_back, vertex.hit.distance)
            : vec3(0.0);
    }
    vec3 value;
    brdf_evaluate_and_pdf(reflector, incident_local, value, pdf);
    return incident_local.z > 0.0 && is_above ? value * incident_local.z : vec3(0.0);
}

// Light from a direction of the environment as that of a lamp beyond any scene.
LampSample sample_environment(vec2 u) {
    EnvironmentSample light = environment_sample(u);
    vec3 radiance_over_pdf = light.pdf > 0.0 ? light.radiance / light.pdf : vec3(0.0);
    return LampSample(
        1.0e18 * light.direction, light.direction, radiance_over_pdf, light.pdf, 1.0,
        ENVIRONMENT_SOURCE);
}

void sample_vertex(uint path, Vertex vertex) {
    Hit hit = vertex.hit;
    bool is_glass = HAS_ROUGH_GLASS && is_interface(vertex.reflector.material);
    // The lamps of glass are outside.
    bool is_inside = is_glass
        && is_back(hit.triangle, load_hit_instance(path), load_ray(path).direction);
    bool has_both = is_glass && parameters.lamp_count > 0u;
    uint dimension = DIMENSION_LAMP + wave.vertex * DIMENSIONS_PER_LAMP_VERTEX
        + wave.first_shadow_ray * DIMENSIONS_PER_LAMP_RAY;
    uint strata = LAMP_CANDIDATES * wave.total_shadow_rays;
    uint width = stratum_width(strata);
    uint list = 0u;
    if (HAS_LAMP_CELLS) {
        list = lamp_list(hit.position, is_inside ? -hit.geometric_normal : hit.geometric_normal);
        lamp_lists[path] = list;
    }
    uint number = vertex.index.sample_index;
    Reservoir reservoir =
        reservoir_start(random_1d(vertex.index.pixel, number, dimension, wave.seed));
    vec3 chosen_to_lamp = vec3(0.0);
    vec3 chosen_contribution = vec3(0.0);
    uint chosen_source = 0u;
    for (uint c = 0u; c < LAMP_CANDIDATES; ++c) {
        uint own = dimension + 1u + 2u * c;
        uvec2 bits = random_bits_2d(vertex.index.pixel, number, own, wave.seed);
        uint stratum = c * wave.total_shadow_rays + wave.first_shadow_ray;
        bits.x = stratified(bits.x, stratum, strata, width);
        vec2 u = random_2d(vertex.index.pixel, number, own + 1u, wave.seed);
        bool is_far = is_glass && (!has_both || bits.x >= 0x80000000u);
        bits.x <<= has_both ? 1u : 0u;
        LampSample lamp;
        if (is_far) {
            lamp = sample_environment(u);
        } else {
            lamp = sample_lamp(list, hit.position, bits, u);
        }
        float brdf_pdf;
        vec3 value = scattered(
            vertex, to_local(vertex.frame, lamp.direction), lamp.direction, is_inside, brdf_pdf);
        float weight = lamp.pdf > 0.0 ? lamp.pdf / (lamp.pdf + brdf_pdf) : 1.0;
        vec3 contribution = value * lamp.radiance_over_pdf * (has_both ? 2.0 * weight : weight);
        float target = luminance(contribution) * lamp.visibility;
        if (reservoir_takes(reservoir, target, target)) {
            chosen_to_lamp = lamp.to_lamp;
            chosen_contribution = contribution;
            chosen_source = lamp.source;
        }
    }
    float factor = reservoir_factor(reservoir, LAMP_CANDIDATES);
    write_ray(path, chosen_to_lamp, chosen_contribution * factor);
    if (LIGHT_GROUPS > 0u) {
        lamp_groups[path] = chosen_source == ENVIRONMENT_SOURCE ? 0u : light_group(chosen_source);
    }
}

void sample_path(uint path) {
    Hit hit = load_hit(path);
    if (HAS_ROUGH_GLASS && hit.material == NO_MATERIAL && hit.triangle != NO_TRIANGLE) {
        hit.material = triangle_material(hit.triangle, load_hit_instance(path));
        hit.material = is_interface(load_material(hit.material)) ? hit.material : NO_MATERIAL;
    }
    if (hit.material != NO_MATERIAL) {
        sample_vertex(path, load_vertex(path, hit));
    } else {
        write_ray(path, vec3(0.0), vec3(0.0));
        if (LIGHT_GROUPS > 0u) {
            lamp_groups[path] = 0u;
        }
    }
}

WALK_PATHS(sample_path)
