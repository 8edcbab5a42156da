// Parts the light of second vertices in two: direct light, gathered so far, and what their paths still
// find, of which the base has its share by the direction of the next ray.
#version 460

#include "base.glsl"
#include "frame.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "wave.glsl"

UPDATES(paths)
UPDATES(second_vertices)

void keep_third(uint path) {
    SecondVertex second = second_vertices[path];
    if (second.scale == 0.0) {
        return;
    }
    Material material = load_surface(path, second.material);
    second.direct = paths[path].radiance;
    second.base = is_kind(material, MATERIAL_DIFFUSE) ? second.direct : second.base;
    Ray ray = load_ray(path);
    if (ray.is_active != 0u) {
        Frame frame = frame_from_normal(second.shading_normal);
        second.bounce_share = base_share(
            reflector_from(material, to_local(frame, second.outgoing)),
            to_local(frame, ray.direction));
    }
    second_vertices[path] = second;
    paths[path].radiance = vec3(0.0);
}

RUN_PATHS(keep_third)
