// Adds what the diffuse base of second vertices reflects of their visible shadow rays, where gather.comp
// has added what the whole BRDF reflects.
#version 460

#include "base.glsl"
#include "frame.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "wave.glsl"

READS(visibility)
UPDATES(second_vertices)

void gather_path(uint path) {
    uint path_count = wave_path_count();
    SecondVertex second = second_vertices[path];
    if (second.scale == 0.0) {
        return;
    }
    Material material = load_surface(path, second.material);
    if (is_kind(material, MATERIAL_DIFFUSE)) {
        return;
    }
    Frame frame = frame_from_normal(second.shading_normal);
    Reflector reflector = reflector_from(material, to_local(frame, second.outgoing));
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint index = i * path_count + path;
        ShadowRay ray = load_shadow_ray(index);
        if (ray.contribution != vec3(0.0) && visibility[index] != 0u) {
            vec3 direction = wave.to_lamps != 0u ? normalize(ray.direction) : ray.direction;
            sum += ray.contribution * base_share(reflector, to_local(frame, direction));
        }
    }
    second_vertices[path].base =
        second.base + second.scale * (sum / float(max(wave.total_shadow_rays, 1u)));
}

RUN_PATHS(gather_path)
