// Samples the BRDF to continue every path of the wave: next ray and throughput.
#version 460

#include "bounce.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

void main() {
    uint path = gl_GlobalInvocationID.x;
    if (path >= wave_path_count()) {
        return;
    }
    Hit hit = hits[path];
    if (hit.material == NO_MATERIAL) {
        rays[path].is_active = 0u;
        return;
    }
    PathIndex index = wave_path(path);
    Material material = load_material(hit.material);
    Frame frame = frame_from_normal(hit.shading_normal);
    vec3 outgoing_local = to_local(frame, -rays[path].direction);
    uint dimension = vertex_dimension();
    vec2 u = random_2d(index.pixel, index.sample_index, dimension + DIMENSION_BOUNCE, wave.seed);
    float lobe =
        random_1d(index.pixel, index.sample_index, dimension + DIMENSION_BOUNCE_LOBE, wave.seed);
    vec3 incident_local = brdf_sample(material, outgoing_local, vec3(u, lobe));
    vec3 direction = to_world(frame, incident_local);
    vec3 factor = bounce_factor(hit, material, outgoing_local, incident_local, direction);
    follow_bounce(path, index, hit, direction, factor, index.sample_index, wave.seed);
}
