// Parts the light of second vertices in two: direct light, gathered so far, and what their paths still
// find in the direction of the next ray.
#version 460

#include "brdf.glsl"
#include "frame.glsl"
#include "hit_surface.glsl"
#include "load.glsl"
#include "wave.glsl"

UPDATES(paths)
LOADS(SecondVertex, load_second_vertex, second_vertex_texels)
WRITES(second_lights)

void keep_third(uint path) {
    SecondVertex second = load_second_vertex(path);
    if (second.scale == 0.0) {
        return;
    }
    Material material = load_surface(path, second.material);
    Ray ray = load_ray(path);
    vec3 direct = paths[path].radiance;
    if (is_diffuse(material)) {
        second_lights[path].shared_light = direct;
    } else if (ray.is_active != 0u) {
        Frame frame = frame_from_normal(second.shading_normal);
        Reflector reflector = reflector_from(material, to_local(frame, second.outgoing));
        second_lights[path].bounce_direction = ray.direction;
        second_lights[path].bounce_value =
            brdf_evaluate(reflector, to_local(frame, ray.direction));
    }
    second_lights[path].direct = direct;
    paths[path].radiance = vec3(0.0);
}

RUN_PATHS(keep_third)
