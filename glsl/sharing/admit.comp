// Notes which connections of every path meet nothing. Light through panes and surfaces that are not
// opaque, which dim the ray, is left to the path itself.
#version 460

#include "load.glsl"
#include "wave.glsl"

WRITES(paths)
UPDATES(seen)

void admit_path(uint path) {
    uint path_count = wave_path_count();
    if (load_hit(path).material == NO_MATERIAL) {
        return;
    }
    uint traced = 0u;
    uint visible = 0u;
    uint bits = 0u;
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint ray = i * path_count + path;
        vec3 contribution = load_shadow_ray(ray).contribution;
        traced += contribution != vec3(0.0) ? 1u : 0u;
        if (contribution == vec3(1.0) && reaches_light(ray)) {
            visible += 1u;
            bits |= 1u << i;
        }
    }
    uint first = wave.first_shadow_ray;
    seen[path] |= first < 32u ? uvec2(bits << first, 0u) : uvec2(0u, bits << (first - 32u));
    PathState state = load_path_state(path);
    paths[path].shadow_rays_traced = state.shadow_rays_traced + traced;
    paths[path].shadow_rays_visible = state.shadow_rays_visible + visible;
}

RUN_PATHS(admit_path)
