// Sums up what every path offers to the pixels of its cohort: the light that its second vertex reflects, if
// it is the same from all sides, or else light that arrives there from one direction, chosen among all that
// the path has found. Paths that found no light have nothing to offer, and nothing is traced to them.
#version 460

#include "load.glsl"
#include "sharing/shared_part.glsl"
#include "wave.glsl"

READS(paths)
UPDATES(second_vertices)
WRITES(offers)

void offer_path(uint path) {
    SecondVertex second = second_vertices[path];
    offers[path].material = NO_MATERIAL;
    if (second.scale == 0.0) {
        return;
    }
    vec3 beyond = paths[path].radiance;
    vec3 light;
    if (is_diffuse(load_material(second.material))) {
        second.shared_light = second.direct + beyond;
        light = second.shared_light;
    } else {
        take_light(second, second.bounce_direction, beyond, second.bounce_value);
        light = second.weight > 0.0 ? second.arriving * (second.weight_sum / second.weight)
                                    : vec3(0.0);
    }
    second_vertices[path].shared_light = second.shared_light;
    if (light != vec3(0.0)) {
        offers[path] = Offer(
            second.position, second.material, second.geometric_normal, second.density_ratio,
            second.shading_normal, second.alpha, light / second.scale, second.metallic,
            second.incident, second.reflectance, second.anisotropy);
    }
}

RUN_PATHS(offer_path)
