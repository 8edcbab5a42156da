// Adds visible shadow rays to every path, and the environment where no light was sampled: seen
// directly, in a mirror or through glass.
#version 460

#include "environment.glsl"
#include "load.glsl"
#include "wave.glsl"

READS(visibility)
UPDATES(paths)

layout(local_size_x = WORKGROUP_SIZE) in;

void main() {
    uint path = gl_GlobalInvocationID.x;
    uint path_count = wave_path_count();
    if (path >= path_count) {
        return;
    }
    if (load_hit_origin(path).material == NO_MATERIAL) {
        // Other vertices sample the environment: rays that escape from there would count it twice.
        Ray ray = load_ray(path);
        bool is_first = wave.first_shadow_ray == 0u && wave.to_lamps == 0u;
        if (is_first && ray.is_active != 0u && ray.brdf_pdf == 0.0
            && load_hit(path).triangle == NO_TRIANGLE) {
            PathState state = paths[path];
            paths[path].radiance =
                state.radiance + state.throughput * environment_radiance(ray.direction);
        }
        return;
    }
    vec3 sum = vec3(0.0);
    uint traced = 0u;
    uint visible = 0u;
    for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
        uint ray = i * path_count + path;
        vec3 contribution = load_shadow_ray(ray).contribution;
        // Same test as in shadow.comp: rays without a contribution are not traced.
        bool is_traced = any(notEqual(contribution, vec3(0.0)));
        traced += is_traced ? 1u : 0u;
        if (is_traced && visibility[ray] != 0u) {
            visible += 1u;
            sum += contribution;
        }
    }
    PathState state = paths[path];
    state.radiance += state.throughput * (sum / float(max(wave.total_shadow_rays, 1u)));
    state.shadow_rays_traced += traced;
    state.shadow_rays_visible += visible;
    paths[path] = state;
}
