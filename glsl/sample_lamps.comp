// Chooses one point on the lamps at every hit of the wave and writes a shadow ray to it, with its
// unoccluded contribution. Draws candidates from the list of the place and keeps one in proportion to what
// it brings and how visible its lamps are there: resampled importance sampling [Talbot et al. 2005]. The
// candidates of all rays of a hit draw from strata of the lamps; their mean density is that of one free
// candidate, by which each is divided. Where a bounce ray may find the lamp too, the balance heuristic weighs
// both by the density of one candidate and of the BRDF.
#version 460

#include "lamps.glsl"
#include "path_list.glsl"
#include "reservoir.glsl"
#include "vertex.glsl"

WRITES(lamp_groups)
WRITES(lamp_lists)

layout(constant_id = CONSTANT_LAMP_CANDIDATES) const uint LAMP_CANDIDATES = 4u;

// First dimension of lamps: each ray has two for each candidate, and one for the choice; at most 2048
// rays a vertex.
const uint DIMENSION_LAMP = 0x4000000u;
const uint DIMENSIONS_PER_LAMP_RAY = 2u * LAMP_CANDIDATES + 1u;
const uint DIMENSIONS_PER_LAMP_VERTEX = 2048u * DIMENSIONS_PER_LAMP_RAY;

void sample_vertex(uint path, Vertex vertex) {
    Hit hit = vertex.hit;
    uint dimension = DIMENSION_LAMP + wave.vertex * DIMENSIONS_PER_LAMP_VERTEX
        + wave.first_shadow_ray * DIMENSIONS_PER_LAMP_RAY;
    uint strata = LAMP_CANDIDATES * wave.total_shadow_rays;
    uint list = 0u;
    if (HAS_LAMP_CELLS) {
        list = lamp_list(hit.position, hit.geometric_normal);
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
        bits.x = stratified(bits.x, c * wave.total_shadow_rays + wave.first_shadow_ray, strata);
        LampSample lamp = sample_lamp(
            list, hit.position, bits, random_2d(vertex.index.pixel, number, own + 1u, wave.seed));
        vec3 incident_local = to_local(vertex.frame, lamp.direction);
        vec3 value;
        float brdf_pdf;
        brdf_evaluate_and_pdf(vertex.reflector, incident_local, value, brdf_pdf);
        bool is_above =
            incident_local.z > 0.0 && dot(lamp.direction, hit.geometric_normal) > 0.0;
        float weight = lamp.pdf > 0.0 ? lamp.pdf / (lamp.pdf + brdf_pdf) : 1.0;
        vec3 contribution = is_above
            ? value * lamp.radiance_over_pdf * (incident_local.z * weight)
            : vec3(0.0);
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
        lamp_groups[path] = light_group(chosen_source);
    }
}

WALK_VERTICES(sample_vertex)
