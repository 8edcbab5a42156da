// Sums up what every path offers to the pixels of its cohort: the light that its second vertex reflects, if
// it is the same from all sides, or else light that arrives there from one direction, chosen among all that
// the path has found. Paths that found no light have nothing to offer, and nothing is traced to them.
#version 460

#include "load.glsl"
#include "sharing/shared_part.glsl"
#include "wave.glsl"

LOADS(SecondVertex, load_second_vertex, second_vertex_texels)
LOADS(SecondLight, load_second_light, second_light_texels)
WRITES(offers)

void offer_path(uint path) {
    SecondVertex second = load_second_vertex(path);
    offers[path].material = NO_MATERIAL;
    if (second.scale == 0.0) {
        return;
    }
    SecondLight found = load_second_light(path);
    vec3 beyond = load_path_state(path).radiance;
    vec3 light;
    if (is_diffuse(load_material(second.material))) {
        light = found.direct + beyond;
    } else {
        take_light(found, found.bounce_direction, beyond, found.bounce_value);
        light = found.weight > 0.0 ? found.arriving * (found.weight_sum / found.weight) : vec3(0.0);
    }
    if (light != vec3(0.0)) {
        offers[path] = Offer(
            second.position, second.material, second.geometric_normal, second.density_ratio,
            second.shading_normal, second.alpha, light / second.scale, second.metallic,
            found.incident, second.reflectance, second.anisotropy);
    }
}

RUN_PATHS(offer_path)
