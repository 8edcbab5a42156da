// Samples the BRDF to continue every path of the wave: next ray and throughput.
#version 460

#include "bounce.glsl"
#include "path_list.glsl"

layout(constant_id = CONSTANT_ONLY_SPECULAR) const bool ONLY_SPECULAR = false;

void bounce_path(uint path) {
    Hit hit = hits[path];
    PathIndex index = wave_path(path);
    if (hit.material == NO_MATERIAL) {
        follow_specular(path, index, hit, index.sample_index, wave.seed);
        return;
    }
    if (ONLY_SPECULAR) {
        rays[path].is_active = 0u;
        return;
    }
    Frame frame = frame_from_normal(hit.shading_normal);
    Reflector reflector = reflector_from(
        load_surface(path, hit.material), to_local(frame, -rays[path].direction));
    vec3 u = bounce_numbers(index, index.sample_index, wave.seed);
    vec3 incident_local = brdf_sample(reflector, u);
    vec3 direction = to_world(frame, incident_local);
    float pdf;
    vec3 factor = bounce_factor(hit, reflector, incident_local, direction, pdf);
    follow_bounce(path, index, hit, direction, pdf, factor, index.sample_index, wave.seed);
}

WALK_PATHS(bounce_path)
