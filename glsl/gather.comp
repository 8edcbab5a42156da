// Adds visible shadow rays to every path, and the environment where rays escape: all of it where no
// light was sampled, which is seen directly, in a mirror or through glass; else the share of the
// bounce ray among the samples of `mis`, or beside that of sample_lamps.comp at rough glass, or nothing.
#version 460

#include "environment.glsl"
#include "light_groups.glsl"
#include "load.glsl"
#include "mis.glsl"
#include "path_list.glsl"
#include "wave.glsl"

READS(visibility)
READS(lamp_groups)
UPDATES(paths)

void gather_path(uint path) {
    uint path_count = wave_path_count();
    Hit hit = load_hit(path);
    if (!has_shadow_rays(hit)) {
        Ray ray = load_ray(path);
        bool is_first = wave.first_shadow_ray == 0u && wave.to_lamps == 0u;
        uint rays = wave.arriving_shadow_rays;
        if (is_first && ray.is_active != 0u && (ray.brdf_pdf <= 0.0 || rays > 0u)
            && hit.triangle == NO_TRIANGLE) {
            vec4 light = environment_light(ray.direction);
            float weight = 1.0;
            if (ray.brdf_pdf != 0.0) {
                float environment_density = environment_pdf(ray.direction, light);
                float all = ray.brdf_pdf < 0.0
                    ? ray.brdf_pdf - environment_density
                    : float(rays) * mis_pdf(ray.brdf_pdf, environment_density, rays, 1u);
                weight = ray.brdf_pdf / all;
            }
            PathState state = paths[path];
            precise vec3 found = state.throughput * light.xyz * weight;
            paths[path].radiance = state.radiance + found;
            add_to_group(path, ENVIRONMENT_GROUP, found);
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
    precise vec3 found = state.throughput * (sum / float(max(wave.total_shadow_rays, 1u)));
    state.radiance += found;
    state.shadow_rays_traced += traced;
    state.shadow_rays_visible += visible;
    paths[path] = state;
    if (LIGHT_GROUPS > 0u) {
        add_to_group(path, wave.to_lamps != 0u ? lamp_groups[path] : ENVIRONMENT_GROUP, found);
    }
}

WALK_PATHS(gather_path)
