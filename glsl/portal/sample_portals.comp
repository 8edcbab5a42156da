// Chooses directions at every hit of the wave from the BRDF, from the portals of the scene and from the
// environment, and writes one shadow ray for each by the density of all three: the balance heuristic of
// `mis`. Densities are in solid angle measure.
#version 460

#include "mis_rays.glsl"
#include "path_list.glsl"
#include "portal/portals.glsl"

// Light at a vertex as the techniques beside the BRDF draw it.
struct Light {
    // Share of the portals; where none is seen, the environment takes it.
    float portal_share;
    float portal_total;
};

// Replaces the density of the environment by that of portals and environment.
DirectionSample with_portals(Vertex vertex, Light light, DirectionSample sampled) {
    sampled.environment_pdf *= 1.0 - light.portal_share;
    if (light.portal_share > 0.0) {
        sampled.environment_pdf += light.portal_share
            * portal_pdf(vertex, light.portal_total, sampled.direction);
    }
    return sampled;
}

DirectionSample draw_light(Vertex vertex, Light light, uint index) {
    vec2 u = vertex_numbers(vertex, index, DIMENSION_ENVIRONMENT_DIRECTION);
    float choice = vertex_number(vertex, index, DIMENSION_RESAMPLING);
    DirectionSample sampled;
    if (choice < light.portal_share) {
        vec3 direction =
            portal_sample(vertex, light.portal_total, choice / light.portal_share, u);
        sampled = evaluate_world(vertex, direction);
    } else {
        sampled = draw_from_environment(vertex, u);
    }
    return with_portals(vertex, light, sampled);
}

void sample_vertex(uint path, Vertex vertex) {
    float total = portal_total(vertex);
    Light light = Light(total > 0.0 ? PORTAL_SHARE : 0.0, total);
    WRITE_MIS_RAYS(
        path, vertex, mis_share(wave.total_shadow_rays, wave.bounce_rays),
        draw_light(vertex, light, index),
        with_portals(vertex, light, draw_brdf_ray(vertex, index, 0u)))
}

WALK_VERTICES(sample_vertex)
