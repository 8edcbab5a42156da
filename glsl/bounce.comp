// Continues every path of the wave by sampling the BRDF: the next ray and the throughput.
#version 460

#define NEEDS_PARAMETERS
#define NEEDS_WAVE
#define NEEDS_RAYS
#define WRITES_RAYS
#define NEEDS_HITS
#define NEEDS_PATHS
#define WRITES_PATHS
#define NEEDS_MATERIAL_TEXELS
#define NEEDS_GEOMETRY
#include "layout.glsl"
#include "frame.glsl"
#include "random.glsl"
#include "wave.glsl"
#include "brdf.glsl"
#include "bvh.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

// First vertex at which a path may be ended by russian roulette.
layout(constant_id = CONSTANT_ROULETTE_VERTEX) const uint ROULETTE_VERTEX = 8u;

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
    PathState state = paths[path];
    Material material = load_material(hit.material);
    Frame frame = frame_from_normal(hit.shading_normal);
    vec3 outgoing_local = to_local(frame, -rays[path].direction);
    uint first_dimension = vertex_dimension();
    vec2 u =
        random_2d(index.pixel, index.sample_index, first_dimension + DIMENSION_BOUNCE, wave.seed);
    float lobe = random_1d(
        index.pixel, index.sample_index, first_dimension + DIMENSION_BOUNCE_LOBE, wave.seed);
    vec3 incident_local = brdf_sample(material, outgoing_local, vec3(u, lobe));
    vec3 direction = to_world(frame, incident_local);

    vec3 throughput = vec3(0.0);
    if (incident_local.z > 0.0 && dot(direction, hit.geometric_normal) > 0.0) {
        vec3 value;
        float pdf;
        brdf_evaluate_and_pdf(material, outgoing_local, incident_local, value, pdf);
        throughput =
            pdf > 0.0 ? state.throughput * value * (incident_local.z / pdf) : vec3(0.0);
    }
    float strongest = max(throughput.r, max(throughput.g, throughput.b));
    if (wave.vertex + 1u >= ROULETTE_VERTEX && strongest > 0.0) {
        float survival = min(1.0, strongest);
        float u_roulette = random_1d(
            index.pixel, index.sample_index, first_dimension + DIMENSION_ROULETTE, wave.seed);
        throughput = u_roulette < survival ? throughput / survival : vec3(0.0);
        strongest = u_roulette < survival ? strongest : 0.0;
    }
    bool alive = strongest > 0.0;
    state.throughput = throughput;
    state.rays_traced += alive ? 1u : 0u;
    paths[path] = state;
    rays[path] = Ray(
        offset_ray_origin(hit.position, hit.geometric_normal, direction), alive ? 1u : 0u,
        direction, 0u);
}
