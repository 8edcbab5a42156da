// Keeps the second vertices that the pixels of a tile share: diffuse ones, whose light does not depend
// on the direction from which it is seen. Their paths go on as if they had begun there, and what they
// have gathered before waits in the vertex. All other paths stay as they are.
#version 460

#include "brdf.glsl"
#include "first_vertex.glsl"
#include "frame.glsl"
#include "load.glsl"
#include "wave.glsl"

UPDATES(paths)
WRITES(second_vertices)

layout(local_size_x = WORKGROUP_SIZE) in;

void main() {
    uint path = gl_GlobalInvocationID.x;
    if (path >= wave_path_count()) {
        return;
    }
    second_vertices[path].scale = 0.0;
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL || !is_kind(load_material(hit.material), MATERIAL_DIFFUSE)) {
        return;
    }
    FirstVertex first = load_first_vertex(path);
    PathState state = paths[path];
    float strongest = max(state.throughput.r, max(state.throughput.g, state.throughput.b));
    if (first.material == NO_MATERIAL || strongest <= 0.0) {
        return;
    }
    vec3 expected;
    float pdf;
    evaluate_first(first, load_ray(path).direction, expected, pdf);
    float most = max(expected.r, max(expected.g, expected.b));
    if (most <= 0.0) {
        return;
    }
    // The path has weighed its throughput by 1 / density: the ratio of the two densities.
    second_vertices[path] = SecondVertex(
        hit.position, hit.geometric_normal, hit.shading_normal, state.throughput, state.radiance,
        strongest, pdf * (strongest / most));
    // Of one strength with the old one, so that roulette ends the path as often.
    state.throughput = vec3(strongest);
    state.radiance = vec3(0.0);
    paths[path] = state;
}
