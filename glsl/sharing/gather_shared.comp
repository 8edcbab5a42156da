// Chooses among the visible shadow rays of second vertices the light that they offer, and counts what the
// shared part of the BRDF reflects, where gather.comp has added what the whole reflects.
#version 460

#include "frame.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "sharing/shared_part.glsl"
#include "wave.glsl"

LOADS(SecondVertex, load_second_vertex, second_vertex_texels)
LOADS(SecondLight, load_second_light, second_light_texels)
WRITES(second_lights)

void gather_path(uint path) {
    uint path_count = wave_path_count();
    SecondVertex second = load_second_vertex(path);
    if (second.scale == 0.0) {
        return;
    }
    Material material = load_surface(path, second.material);
    if (is_diffuse(material)) {
        return;
    }
    Frame frame = frame_from_normal(second.shading_normal);
    Reflector reflector = reflector_from(material, to_local(frame, second.outgoing));
    SecondLight light = load_second_light(path);
    float per_ray = second.scale / float(max(wave.total_shadow_rays, 1u));
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint index = i * path_count + path;
        ShadowRay ray = load_shadow_ray(index);
        if (ray.contribution != vec3(0.0) && reaches_light(index)) {
            vec3 direction = wave.to_lamps != 0u ? normalize(ray.direction) : ray.direction;
            take_light(
                light, direction, per_ray * ray.contribution,
                brdf_evaluate(reflector, to_local(frame, direction)));
        }
    }
    second_lights[path] = light;
}

RUN_PATHS(gather_path)
