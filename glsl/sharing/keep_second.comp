// Keeps the second vertices that the pixels of a cohort share: those with a diffuse base, whose light
// does not depend on the direction from which it is seen. Their paths go on as if they had begun there,
// and what they have gathered before waits in the vertex. All other paths stay as they are.
#version 460

#include "base.glsl"
#include "first_vertex.glsl"
#include "frame.glsl"
#include "load.glsl"
#include "wave.glsl"

UPDATES(paths)
WRITES(second_vertices)

void keep_second(uint path) {
    second_vertices[path].scale = 0.0;
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL || !has_base(load_material(hit.material))) {
        return;
    }
    FirstVertex first = load_first_vertex(path);
    PathState state = paths[path];
    float strongest = max(state.throughput.r, max(state.throughput.g, state.throughput.b));
    if (first.material == NO_MATERIAL || strongest <= 0.0) {
        return;
    }
    vec3 direction = load_ray(path).direction;
    vec3 expected;
    float pdf;
    Frame frame = frame_from_normal(first.shading_normal);
    evaluate_first(first, first_reflector(first, frame), frame, direction, expected, pdf);
    float most = max(expected.r, max(expected.g, expected.b));
    if (most <= 0.0) {
        return;
    }
    // The path has weighed its throughput by 1 / density: the ratio of the two densities.
    second_vertices[path] = SecondVertex(
        hit.position, hit.geometric_normal, hit.shading_normal, -direction, state.throughput,
        state.radiance, vec3(0.0), vec3(0.0), vec3(0.0), hit.material, strongest,
        pdf * (strongest / most));
    // As strong as before, so that roulette ends the path as often.
    state.throughput = vec3(strongest);
    state.radiance = vec3(0.0);
    paths[path] = state;
}

RUN_PATHS(keep_second)
