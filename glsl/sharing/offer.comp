// Sums up what every path offers to the pixels of its cohort: the light that the base of its second
// vertex reflects. Paths that found no light have nothing to offer, and nothing is traced to them.
#version 460

#include "base.glsl"
#include "load.glsl"
#include "wave.glsl"

READS(paths)
READS(second_vertices)
WRITES(offers)

void offer_path(uint path) {
    SecondVertex second = second_vertices[path];
    vec3 radiance = second.base + second.bounce_share * paths[path].radiance;
    if (second.scale == 0.0 || radiance == vec3(0.0)) {
        offers[path].material = NO_MATERIAL;
        return;
    }
    Material material = load_material(second.material);
    vec3 view = base_view(material, dot(second.shading_normal, second.outgoing));
    // A channel that the base does not reflect has no light of it either.
    vec3 emitted = mix(
        vec3(0.0), radiance / (second.scale * view), greaterThan(view, vec3(0.0)));
    offers[path] = Offer(
        second.position, second.material, second.geometric_normal, second.density_ratio,
        second.shading_normal, 0.0, emitted, 0.0);
}

RUN_PATHS(offer_path)
