// Keeps the second vertices that the pixels of a cohort share. Their paths go on as if they had begun there,
// and what they have gathered before waits in the vertex. All other paths stay as they are.
#version 460

#include "first_vertex.glsl"
#include "frame.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "random.glsl"
#include "sharing/cohort.glsl"
#include "wave.glsl"

UPDATES(paths)
WRITES(second_vertices)
WRITES(second_lights)

void keep_second(uint path) {
    second_vertices[path].scale = 0.0;
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        return;
    }
    FirstVertex first = load_first_vertex(path);
    PathState state = load_path_state(path);
    float strongest = largest_of(state.throughput);
    if (first.material == NO_MATERIAL || strongest <= 0.0) {
        return;
    }
    vec3 direction = load_ray(path).direction;
    vec3 expected;
    float pdf;
    Frame frame = frame_from_normal(first.shading_normal);
    evaluate_first(first, first_reflector(first, frame), frame, direction, expected, pdf);
    float most = largest_of(expected);
    if (most <= 0.0) {
        return;
    }
    Material material = load_surface(path, hit.material);
    PathIndex index = wave_path(path);
    float u = random_independent_1d(index.pixel, index.sample_index, DIMENSION_OFFER, wave.seed);
    // The path has weighed its throughput by 1 / density: the ratio of the two densities.
    second_vertices[path] = SecondVertex(
        hit.position, hit.geometric_normal, hit.shading_normal, -direction, state.throughput,
        paths[path].radiance, material.reflectance, material.alpha, material.ior, material.anisotropy,
        hit.material, strongest, pdf * (strongest / most));
    // All else is written before it is read.
    second_lights[path].shared_light = vec3(0.0);
    second_lights[path].bounce_value = vec3(0.0);
    second_lights[path].weight_sum = 0.0;
    second_lights[path].weight = 0.0;
    second_lights[path].random_number = u;
    // As strong as before, so that roulette ends the path as often.
    paths[path].throughput = vec3(strongest);
    paths[path].radiance = vec3(0.0);
}

RUN_PATHS(keep_second)
