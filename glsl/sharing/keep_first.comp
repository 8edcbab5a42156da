// Keeps the first vertices of the wave, before their paths go on, for the connections of their cohorts.
#version 460

#include "hit_surface.glsl"
#include "load.glsl"
#include "wave.glsl"

WRITES(first_vertices)

void keep_first(uint path) {
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        first_vertices[path].material = NO_MATERIAL;
        return;
    }
    Material material = load_surface(path, hit.material);
    first_vertices[path] = FirstVertex(
        hit.position, hit.material, hit.geometric_normal, material.alpha, hit.shading_normal,
        material.ior, -load_ray(path).direction, load_path_state(path).throughput, material.reflectance,
        material.anisotropy, 0.0);
}

RUN_PATHS(keep_first)
