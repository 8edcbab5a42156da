// Samples the BRDF to continue every path of the wave: next ray and throughput.
#version 460

#include "bounce.glsl"
#include "path_list.glsl"

layout(constant_id = CONSTANT_ONLY_SPECULAR) const bool ONLY_SPECULAR = false;

void bounce_path(uint path) {
    Hit hit = load_hit(path);
    Material material;
    bool samples_light = hit.material != NO_MATERIAL;
    if ((ONLY_SPECULAR && samples_light) || !goes_on_from(path, hit, material)) {
        rays[path].is_active = 0u;
        return;
    }
    PathIndex index = wave_path(path);
    Frame frame = frame_from_normal(hit.shading_normal);
    vec3 outgoing_local = to_local(frame, -load_ray(path).direction);
    vec3 u = bounce_numbers(index, index.sample_index, wave.seed);
    vec3 direction;
    vec3 factor;
    float pdf = 0.0;
    if (samples_light) {
        Reflector reflector = reflector_from(material, outgoing_local);
        vec3 incident_local = brdf_sample(reflector, u);
        direction = to_world(frame, incident_local);
        factor = bounce_factor(hit, reflector, incident_local, direction, pdf);
    } else {
        factor = specular_factor(path, hit, material, frame, outgoing_local, u, direction, pdf);
    }
    follow_bounce(path, index, hit, direction, pdf, factor, index.sample_index, wave.seed);
}

WALK_PATHS(bounce_path)
